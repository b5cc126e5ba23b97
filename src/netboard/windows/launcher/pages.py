"""Pages of the launcher: the session, the rig's settings, the study as text and in forms, the machines."""

from collections.abc import Callable, Mapping
from dataclasses import replace
from pathlib import Path

from PySide6.QtCore import QSignalBlocker, Signal
from PySide6.QtGui import QTextCursor
from PySide6.QtWidgets import (
    QComboBox,
    QHBoxLayout,
    QLabel,
    QLineEdit,
    QPlainTextEdit,
    QPushButton,
    QStackedWidget,
    QVBoxLayout,
    QWidget,
)

from netboard.base.config import parse
from netboard.base.errors import ConfigError, NetboardError
from netboard.base.files.text import read_text
from netboard.task.plans.plan import plan_of
from netboard.task.studies import library
from netboard.task.studies.study import Study, parse_study
from netboard.windows.launcher.control import LauncherMemory, SessionChoice
from netboard.windows.launcher.saving import EditedFile
from netboard.windows.launcher.settings_form import (
    FormField,
    changed_text,
    checked,
    fields_of,
    form_tables,
    keeps_all,
    text_of,
)
from netboard.windows.launcher.study_form import (
    ORDERS,
    OWN,
    Collection,
    StudyPart,
    changed_study,
    collections_of,
    parts_of,
    with_part,
    without_part,
)
from netboard.windows.launcher.widgets import ChoiceBox, DeclaredForm
from netboard.windows.operator.words import Tone

WHOLE_TEXT = "the whole text"
"""Name of the text among the parts of a study."""


class SessionPage(QWidget):
    """What is run; `chosen` carries a new `SessionChoice`."""

    chosen = Signal(object)

    def __init__(self, choice: SessionChoice) -> None:
        super().__init__()
        self.choice = choice
        self.form = DeclaredForm()
        self.problem = _problem()
        _column(self, self.form, self.problem)
        self.form.entered.connect(self._enter)
        self.show_choice(choice)

    def show_choice(self, choice: SessionChoice) -> None:
        """Show a choice."""
        self.choice = choice
        memory = LauncherMemory(choice)
        (table,) = form_tables(LauncherMemory)
        self.form.show_fields(fields_of(memory, table))

    def _enter(self, field: FormField, entry: str) -> None:
        override = f"session.{field.key.name}={entry}"
        try:
            chosen = checked(LauncherMemory, text_of(LauncherMemory(self.choice)), "the form", (override,)).session
        except ConfigError as error:
            self.problem.setText(str(error))
            return
        self.problem.setText("")
        self.choice = chosen
        self.chosen.emit(chosen)


class RigPage(QWidget):
    """The rig's settings, table by table; `saved` carries the path of a file that was written."""

    saved = Signal(str)

    def __init__(self) -> None:
        super().__init__()
        self.text = ""
        self._file = EditedFile()
        self.path = QLineEdit()
        self.path.setPlaceholderText("file of the rig, such as rig.toml")
        self.tables = ChoiceBox()
        self._tables = form_tables()
        self.tables.addItems([table.name for table in self._tables])
        self.about = QLabel()
        _small(self.about)
        self.about.setWordWrap(True)
        self.form = DeclaredForm()
        self.problem = _problem()
        self.save_button = QPushButton("Save the rig   Ctrl+S")
        _column(self, self.path, self.tables, self.about, self.form, self.problem, self.save_button)
        self.tables.currentIndexChanged.connect(lambda _: self._show())
        self.form.entered.connect(self._enter)
        self.save_button.clicked.connect(self.save)
        self.tables.setCurrentIndex([table.name for table in self._tables].index("stations"))

    def load(self, path: str) -> None:
        """Show the settings of a file; an empty path has the defaults."""
        self.path.setText(path)
        self._file.show(None)
        try:
            self.text = read_text(Path(path), "no such file yet") if path else ""
            parse(self.text, path or "the defaults")
            self._file.show(Path(path) if path else None, self.text)
            self.problem.setText("")
        except ConfigError as error:
            self.text = ""
            self.problem.setText(str(error))
        self._show()

    def save(self) -> None:
        """Write the file, and keep the old one as a backup."""
        path = Path(self.path.text().strip() or "rig.toml")
        old = self._file.text
        try:
            backup = self._file.save(path, self.text)
            lost = keeps_all(old, str(path), backup) if backup else ""
        except NetboardError as error:
            self.problem.setText(str(error))
            return
        self.problem.setText(lost)
        self.path.setText(str(path))
        self.saved.emit(str(path))

    def _show(self) -> None:
        table = self._tables[max(0, self.tables.currentIndex())]
        self.about.setText(table.text.splitlines()[0] if table.text else "")
        self.form.show_fields(fields_of(parse(self.text, "the form"), table))

    def _enter(self, field: FormField, entry: str) -> None:
        try:
            self.text = changed_text(self.text, field, entry)
        except ConfigError as error:
            self.problem.setText(str(error))
            return
        self.problem.setText("not saved yet")


class StudyPage(QWidget):
    """A study as text and in forms, checked as it is written; `saved` carries the path of a file that was written."""

    saved = Signal(str)

    def __init__(self) -> None:
        super().__init__()
        self._file = EditedFile()
        self.start_from = ChoiceBox()
        self.start_from.addItems(["start from ...", library.TEMPLATE, *library.names()])
        self.path = QLineEdit("study.toml")
        self.editor = QPlainTextEdit()
        self.editor.setTabChangesFocus(True)
        self.part, self.table = ChoiceBox(), QComboBox()
        self.part.addItem(WHOLE_TEXT)
        self._parts: tuple[StudyPart, ...] = ()
        self._collections: tuple[Collection, ...] = ()
        self.collection, self.new_name = ChoiceBox(), QLineEdit()
        self.new_name.setPlaceholderText("name of a new part")
        self.add_button, self.remove_button = QPushButton("Add"), QPushButton("Remove")
        self.add_button.setEnabled(False)
        self.form = DeclaredForm()
        self.shown = QStackedWidget()
        self.shown.addWidget(self.editor)
        self.shown.addWidget(self.form)
        self.problem = _problem()
        self.plan = QLabel()
        _small(self.plan)
        self.plan.setWordWrap(True)
        self.save_button = QPushButton("Save the study   Ctrl+S")
        chosen = _row(self.part, self.table, self.remove_button)
        added = _row(self.collection, self.new_name, self.add_button)
        below = self.shown, self.plan, self.problem, self.save_button
        _column(self, self.start_from, self.path, chosen, added, *below)
        self.part.currentIndexChanged.connect(lambda _: self._show_part())
        self.table.currentIndexChanged.connect(lambda _: self._show_form())
        self.form.entered.connect(self._enter)
        self.collection.currentIndexChanged.connect(lambda _: self._try_name())
        self.new_name.textChanged.connect(lambda _: self._try_name())
        self.new_name.returnPressed.connect(self.add)
        self.add_button.clicked.connect(self.add)
        self.remove_button.clicked.connect(self.remove)
        self._show_part()
        self.start_from.textActivated.connect(self._begin)
        self.editor.textChanged.connect(self._check)
        self.save_button.clicked.connect(self.save)

    def load(self, study: str) -> None:
        """Show a study's text."""
        self._file.show(None)
        try:
            named = study in library.names()
            text = library.text_of(study) if named else read_text(Path(study), "no such study")
            self.editor.setPlainText(text)
            self.path.setText("study.toml" if named else study)
            self._file.show(None if named else Path(study), text)
            self._show_form()
        except ConfigError as error:
            self.editor.setPlainText("")  # that of another study would be taken for this one
            self.problem.setText(str(error))

    def follow(self, study: str) -> bool:
        """Show the study that was chosen, unless it is shown; return False for a text that would be lost."""
        if self._file.shows(study):
            return True
        if self.editor.toPlainText() != self._file.text:
            return False
        self.load(study)
        return True

    def save(self) -> None:
        """Write the file, if the study is valid, and keep the old one as a backup."""
        path = Path(self.path.text().strip() or "study.toml")
        if self._check() is None:
            return
        try:
            self._file.save(path, self.editor.toPlainText())
        except NetboardError as error:
            self.problem.setText(str(error))
            return
        self.saved.emit(str(path))

    def _begin(self, name: str) -> None:
        if name in (library.TEMPLATE, *library.names()):
            self.editor.setPlainText(library.text_of(name))
            self._file.show(None)
            self._show_form()

    def _check(self) -> Study | None:
        """Check the text; show its problems, or the blocks of the first dyad."""
        try:
            study = parse_study(self.editor.toPlainText(), "study")
            plan = plan_of(study, 1, 1)
        except ConfigError as error:
            self.problem.setText(_first_lines(error))
            self.plan.setText("")
            return None
        counts = [f"session {part.number}: {len(part.blocks)} blocks" for part in plan.sessions]
        first = ", ".join(block.label for block in plan.sessions[0].blocks[:4])
        self.plan.setText(f"{study.name}, dyad 1: {'; '.join(counts)}. First blocks: {first}")
        self.problem.setText("")
        self._list_parts(study)
        return study

    def _list_parts(self, study: Study) -> None:
        """List the parts of a study that have forms; the chosen one stays chosen if it is still there."""
        self._parts, self._collections = parts_of(study), collections_of(study)
        _list_names(self.collection, [f"new in {one.name}" for one in self._collections])
        if _list_names(self.part, [WHOLE_TEXT, *(part.name for part in self._parts)]):
            self._show_part()

    def add(self) -> None:
        """Add a part by the name that was entered, and show its form."""
        self._try_name()
        if self.add_button.isEnabled():
            collection, name = self._collections[self.collection.currentIndex()], self.new_name.text().strip()
            self._replace(with_part(self.editor.toPlainText(), collection, name))
            self.new_name.clear()
            self.part.setCurrentText(collection.name if collection.path == (ORDERS,) else f"{collection.name}.{name}")
            self._show_form()

    def remove(self) -> None:
        """Remove the part whose form is shown."""
        if (part := self._chosen) is not None:
            self._change(lambda text: without_part(text, part.path))

    def _try_name(self) -> None:
        """Say why a part of this name cannot be added."""
        self.add_button.setEnabled(False)
        name = self.new_name.text().strip()
        if not (name and self._collections):  # an invalid study has none, and its problem is shown
            self._check()
            return
        try:
            with_part(self.editor.toPlainText(), self._collections[self.collection.currentIndex()], name)
        except ConfigError as error:
            self.problem.setText(_first_lines(error))
            return
        self.problem.setText("")
        self.add_button.setEnabled(True)

    def _change(self, change: Callable[[str], str]) -> None:
        """Change the text, or say why that is refused."""
        try:
            self._replace(change(self.editor.toPlainText()))
        except ConfigError as error:
            self.problem.setText(_first_lines(error))

    def _replace(self, text: str) -> None:
        """Replace the text; Ctrl+Z in the editor brings the one before back."""
        cursor = QTextCursor(self.editor.document())
        cursor.select(QTextCursor.SelectionType.Document)
        cursor.insertText(text)

    @property
    def _chosen(self) -> StudyPart | None:
        """The part whose form is shown; None for the text."""
        return next((part for part in self._parts if part.name == self.part.currentText()), None)

    def _show_part(self) -> None:
        """Show the text, or the forms of the chosen part."""
        part = self._chosen
        self.shown.setCurrentWidget(self.editor if part is None else self.form)
        before = self.table.currentText()
        with QSignalBlocker(self.table):
            self.table.clear()
            self.table.addItems(part.forms if part is not None else ())
            self.table.setCurrentText(before)  # if this part has it, too
        self.table.setEnabled(part is not None and len(part.forms) > 1)
        removable = part is not None and part.path[:-1] in {one.path for one in self._collections}
        self.remove_button.setEnabled(removable)
        self._show_form()

    def _show_form(self) -> None:
        if (part := self._chosen) is not None:
            self.form.show_fields(part.fields(self.table.currentText() or OWN))

    def _enter(self, field: FormField, entry: str) -> None:
        if field.path == (ORDERS,) and not entry.strip():
            self._change(lambda text: without_part(text, (*field.path, field.key.name)))
            self._show_form()
        else:
            self._change(lambda text: changed_study(text, field, entry))


class MachinesPage(QWidget):
    """How the machines are: this one and those of the stations."""

    def __init__(self, look: Callable[[], object]) -> None:
        super().__init__()
        self.look = QPushButton("Look at the stations   F5")
        self.words = QPlainTextEdit()
        self.words.setReadOnly(True)
        self.words.setTabChangesFocus(True)
        hint = QLabel("Run the doctor and the device tests from the table: select one, press Enter.")
        _small(hint)
        hint.setWordWrap(True)
        _column(self, self.look, self.words, hint)
        self.look.clicked.connect(look)

    def show_states(self, states: Mapping[str, Mapping[str, str]], troubles: Mapping[str, str]) -> None:
        """Show the state of each machine."""
        parts = []
        for machine, state in states.items():
            lines = [machine.upper(), *([f"  {troubles[machine]}"] if troubles.get(machine) else [])]
            parts.append("\n".join([*lines, *(f"  {what:<12} {found}" for what, found in state.items())]))
        text = "\n\n".join(parts)
        if self.words.toPlainText() != text:
            self.words.setPlainText(text)


def with_study(choice: SessionChoice, path: str) -> SessionChoice:
    """Return a choice with another study."""
    return replace(choice, study=path)


def with_rig(choice: SessionChoice, path: str) -> SessionChoice:
    """Return a choice with another rig."""
    return replace(choice, rig=path)


def _problem() -> QLabel:
    made = QLabel()
    made.setProperty("tone", Tone.BAD.value)
    made.setWordWrap(True)
    return made


def _small(line: QLabel) -> None:
    line.setProperty("scale", "fine")
    line.setProperty("tone", Tone.QUIET.value)


def _row(*parts: QWidget) -> QWidget:
    made = QWidget()
    row = QHBoxLayout(made)
    row.setContentsMargins(0, 0, 0, 0)
    for part in parts:
        row.addWidget(part, 0 if isinstance(part, QPushButton) else 1)
    return made


def _list_names(box: QComboBox, names: list[str]) -> bool:
    """List names in a box, in which the chosen one stays chosen; return whether they have changed."""
    before = box.currentText()
    if names == [box.itemText(place) for place in range(box.count())]:
        return False
    with QSignalBlocker(box):
        box.clear()
        box.addItems(names)
        box.setCurrentText(before if before in names else names[0])
    return True


def _first_lines(error: ConfigError) -> str:
    return "\n".join(str(error).splitlines()[:3])


def _column(page: QWidget, *parts: QWidget) -> None:
    rows = QVBoxLayout(page)
    rows.setContentsMargins(0, 0, 0, 0)
    for part in parts:
        rows.addWidget(part)
