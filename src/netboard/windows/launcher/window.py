"""The launcher's window: one badge, notices, pages on the left; processes, the command and the log on the right.

It is a single window without dialogs and menus. Stopping and the emergency stop are never disabled, and every action
has a key.
"""

import time
from collections.abc import Callable
from functools import partial

from PySide6.QtCore import Qt, QTimer, QUrl
from PySide6.QtGui import QDesktopServices, QKeySequence, QShortcut
from PySide6.QtWidgets import (
    QHBoxLayout,
    QPlainTextEdit,
    QPushButton,
    QSizePolicy,
    QStackedWidget,
    QVBoxLayout,
    QWidget,
)

from netboard.windows.launcher.control import LauncherControl, SessionChoice
from netboard.windows.launcher.model import LaunchStage, advice, badge, rows, session_line
from netboard.windows.launcher.pages import MachinesPage, RigPage, SessionPage, StudyPage, with_rig, with_study
from netboard.windows.launcher.widgets import NoticeList, ProcessTable
from netboard.windows.operator.lamp_widget import label, say
from netboard.windows.operator.words import Tone
from netboard.windows.style import StyledWindow

POLL_MS = 100
"""Interval between two looks at the processes [ms]."""

SMALLEST = 1280, 700
"""Size of the window that shows everything [pixels]; on a smaller screen, everything is drawn smaller."""

PAGES = ("Session", "Rig", "Study", "Machines")


class LauncherWindow(StyledWindow):
    """Shows a `LauncherControl`. ``here``: describes this machine; ``remember``: keeps a choice for the next time."""

    def __init__(
        self,
        control: LauncherControl,
        here: Callable[[], dict[str, str]],
        remember: Callable[[SessionChoice], object],
    ) -> None:
        super().__init__()
        self.setWindowTitle("netboard launch")
        self.control, self._here, self._remember = control, here, remember
        self._here_state: dict[str, str] = {}
        self.badge, self.line, self.advice = label("", "title", bold=True), label(""), label("")
        self.command = label("", "fine", Tone.QUIET)
        for part in (self.badge, self.advice, self.line, self.command):
            part.setWordWrap(True)
            part.setSizePolicy(QSizePolicy.Policy.Ignored, QSizePolicy.Policy.Preferred)  # widens no window
        self.badge.setAlignment(Qt.AlignmentFlag.AlignCenter)
        self.command.setTextInteractionFlags(Qt.TextInteractionFlag.TextSelectableByMouse)
        self.start = _button("Start   F2", "good", control.start)
        self.stop = _button("Stop all   F4", "", control.stop)
        self.halt = _button("EMERGENCY STOP   Esc", "stop", control.emergency_stop)
        self.report = _button("Report   F6", "", self.open_report)
        self.notices = NoticeList()
        self.session = SessionPage(control.choice)
        self.rig, self.study = RigPage(), StudyPage()
        self.machines = MachinesPage(self.look)
        self.rig.load(control.choice.rig)
        self.study.load(control.choice.study or "paper")
        self.pages: tuple[QWidget, ...] = (self.session, self.rig, self.study, self.machines)
        self.stack = QStackedWidget()
        self.tabs = [QPushButton(f"{name}   Ctrl+{number}") for number, name in enumerate(PAGES, 1)]
        self.table, self.log = ProcessTable(), QPlainTextEdit()
        self.log.setReadOnly(True)
        self.log.setTabChangesFocus(True)
        self._lay_out()
        self._connect()
        self._timer = QTimer(self, interval=POLL_MS)
        self._timer.timeout.connect(self.poll)
        self._timer.start()
        self.resize(1600, 900)
        self.show_page(0)
        self.poll()

    # --- display -----------------------------------------------------------------------------------------------

    def poll(self) -> None:
        """Let the control do what is due, and show the state."""
        self.control.poll()
        facts = self.control.facts()
        say(self.badge, badge(facts), "fill")
        self.line.setText(session_line(facts))
        self.advice.setText(advice(facts))
        self.table.show_rows(rows(facts))
        self.notices.show_notices(self.control.notices.visible(time.monotonic()))
        self.start.setEnabled(facts.stage is LaunchStage.IDLE)
        if self.session.choice != self.control.choice:
            self.session.show_choice(self.control.choice)
        states = {"this machine": self._here_state, **self.control.station_states()}
        self.machines.show_states(states, facts.troubles)
        self._show_log()

    def _show_log(self) -> None:
        name = self.table.selected
        self.command.setText(self.control.command_line(name) if name else "")
        text = self.control.shown_log_of(name) if name else ""
        if self.log.toPlainText() != text:
            self.log.setPlainText(text)
            bar = self.log.verticalScrollBar()
            bar.setValue(bar.maximum())

    def show_page(self, number: int) -> None:
        """Show a page, and give it the keyboard."""
        self.stack.setCurrentIndex(number)
        for place, tab in enumerate(self.tabs):
            tab.setChecked(place == number)
        if PAGES[number] == "Machines" and not self._here_state:
            self.look()
        self.pages[number].setFocus()
        self.pages[number].focusNextChild()

    # --- actions -----------------------------------------------------------------------------------------------

    def look(self) -> None:
        """Look at this machine, and connect to the stations."""
        self._here_state = self._here()
        self.control.watch_stations()

    def toggle(self, name: str) -> None:
        """Start a process or task that does not run; stop one that does."""
        if not name:
            return
        status = self.control.processes.get(name)
        if status is not None and status.phase == "running":
            self.control.end(name)
        elif name in self.control.places and self.control.stage is not LaunchStage.RUNNING:
            self.control.say(f"The {name} starts with the session: press F2.", stays=True)
        else:
            self.control.run(name)

    def open_report(self) -> None:
        """Open the report of the last analysis in the browser, or say how to make one."""
        report = self.control.last_report
        if report is None:
            self.control.say("There is no report yet: select analysis in the table and press Enter.", stays=True)
        elif not QDesktopServices.openUrl(QUrl.fromLocalFile(str(report.resolve()))):
            self.control.say(f"No browser opens here; the report is {report.resolve()}", stays=True)

    def choose(self, choice: SessionChoice) -> None:
        """Take a choice, and remember it."""
        before = self.control.choice
        self.control.choose(choice)
        now = self.control.choice
        if now.rig != before.rig:
            self.rig.load(now.rig)
        if now.study not in ("", before.study) and not self.study.follow(now.study):
            self.control.say(f"The page Study still shows a text that is not saved, not {now.study}.", stays=True)
        self._remember(now)

    def ask_again(self) -> bool:
        """Ask for a second close while a session runs: it ends with the window."""
        if self.control.stage is LaunchStage.IDLE:
            return False
        self.control.say("A session is running. Close the window once more to end it.", stays=True)
        return True

    def _save(self) -> None:
        for page in (self.rig, self.study):
            if page.isVisible():
                page.save()

    # --- construction --------------------------------------------------------------------------------------------

    def _lay_out(self) -> None:
        head, words, buttons = QHBoxLayout(), QVBoxLayout(), QHBoxLayout()
        head.addWidget(self.badge, 1)
        words.addWidget(self.advice)
        words.addWidget(self.line)
        head.addLayout(words, 1)
        for button in (self.start, self.stop, self.report, self.halt):
            buttons.addWidget(button)
        head.addLayout(buttons)
        left, right = QWidget(), QWidget()
        columns, tabs = QVBoxLayout(left), QHBoxLayout()
        columns.setContentsMargins(0, 0, 0, 0)
        for number, (tab, page) in enumerate(zip(self.tabs, self.pages, strict=True)):
            tab.setCheckable(True)
            tab.clicked.connect(partial(self.show_page, number))
            tabs.addWidget(tab)
            self.stack.addWidget(page)
        columns.addLayout(tabs)
        columns.addWidget(self.stack, 1)
        lines = QVBoxLayout(right)
        lines.setContentsMargins(0, 0, 0, 0)
        lines.addWidget(self.table, 3)
        lines.addWidget(self.command)
        lines.addWidget(self.log, 2)
        halves = QHBoxLayout()
        for part, share in ((left, 46), (right, 54)):
            part.setSizePolicy(QSizePolicy.Policy.Ignored, QSizePolicy.Policy.Preferred)
            halves.addWidget(part, share)
        all_rows = QVBoxLayout(self)
        all_rows.addLayout(head)
        all_rows.addWidget(self.notices)
        all_rows.addLayout(halves, 1)

    def _connect(self) -> None:
        self.table.toggled.connect(self.toggle)
        self.session.chosen.connect(self.choose)
        self.rig.saved.connect(lambda path: self.choose(with_rig(self.control.choice, path)))
        self.study.saved.connect(lambda path: self.choose(with_study(self.control.choice, path)))
        for key, do in {
            "F2": self.control.start,
            "F4": self.control.stop,
            "F5": self.look,
            "F6": self.open_report,
            "Esc": self.control.emergency_stop,
            "Ctrl+D": self.control.notices.read,
            "Ctrl+S": self._save,
            "Ctrl+T": self.table.setFocus,
        }.items():
            self._key(key, do)
        for number in range(len(PAGES)):
            self._key(f"Ctrl+{number + 1}", partial(self.show_page, number))

    def _key(self, key: str, do: Callable[[], object]) -> None:
        shortcut = QShortcut(QKeySequence(key), self, autoRepeat=False, context=Qt.ShortcutContext.ApplicationShortcut)
        shortcut.activated.connect(do)


def _button(words: str, fill: str, do: Callable[[], object]) -> QPushButton:
    made = QPushButton(words)
    made.setProperty("fill", fill)
    made.clicked.connect(do)
    return made
