"""The launcher at work: its processes are scripts, its window is off screen, and keys alone drive it."""

import os
import time
from collections.abc import Callable, Iterator
from concurrent.futures import wait
from errno import ESTALE
from pathlib import Path
from threading import current_thread

import pytest

import waiting
from netboard.base.config import Config
from netboard.base.errors import ConfigError, NetboardError
from netboard.base.tables.experiment import Block
from netboard.network.transport.ports import free_port
from netboard.services.loading import load, load_study
from netboard.windows.launcher.control import FileReaders, LauncherControl, LauncherMemory, SessionChoice
from netboard.windows.launcher.model import LaunchStage, badge, rows
from netboard.windows.launcher.session_files import FILE_LOOK_S, FileLooks
from script_launcher import SLOW_STOP, ScriptLauncher

DONE = "print('on'); print('keys/server.key: is missing; created')"


class Scripts(ScriptLauncher):
    """Runs a script of its name in place of each command."""

    scripts: dict[str, str]

    def start(self, name: str, *arguments: str) -> None:
        super().start(name, self.scripts.get(name, SLOW_STOP))


@pytest.fixture
def control(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[LauncherControl]:
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(Scripts, "scripts", {"preparation": DONE}, raising=False)
    Path("rig.toml").write_text(f"[network]\nport = {free_port()}\n")
    made = LauncherControl(SessionChoice("rig.toml"), FileReaders(load, load_study), launcher=Scripts)
    yield made
    made.close()


def until(control: LauncherControl, condition: Callable[[], object]) -> None:
    waiting.until(condition, control.poll, lambda: (control.stage, control.processes))


def said(control: LauncherControl) -> str:
    return "\n".join(notice.words for notice in control.notices.visible(time.monotonic()))


@pytest.mark.slow
def test_session_starts_by_itself_when_it_is_prepared_and_stops_in_order(control: LauncherControl) -> None:
    control.start()
    assert control.stage is LaunchStage.PREPARING
    until(control, lambda: control.stage is LaunchStage.RUNNING)
    assert set(control.places) <= set(control.processes)
    assert "keys/server.key: is missing; created" in control.log_of("preparation")
    control.start()
    control.choose(SessionChoice("rig.toml", dyad=9))
    assert control.choice.dyad == 1
    assert "A session is running already; stop it first (F4).\nA session is running, and keeps its choice" in said(
        control
    )
    control.end("console")
    until(control, lambda: control.processes["console"].phase == "stopped")
    assert control.stage is LaunchStage.RUNNING
    assert control.run("console")
    control.stop()
    until(control, lambda: control.stage is LaunchStage.IDLE)
    assert {status.phase for name, status in control.processes.items() if name in control.places} == {"stopped"}
    assert "Everything has ended." in said(control)


def test_failed_preparation_is_named_and_starts_nothing(
    control: LauncherControl, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setitem(Scripts.scripts, "preparation", "print('on'); print('no space left'); raise SystemExit(1)")
    control.start()
    until(control, lambda: control.stage is LaunchStage.IDLE)
    assert set(control.processes) == {"preparation"}
    assert "The preparation failed: no space left" in said(control)


def test_failed_agent_is_shown_with_its_log_and_can_be_started_again(
    control: LauncherControl, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("netboard.nodes.launching.session.MAX_FAILURES", 0)
    monkeypatch.setitem(Scripts.scripts, "left agent", "print('on'); print('no device'); raise SystemExit(1)")
    control.start()
    until(control, lambda: badge(control.facts()).words == "FAILED: left agent")
    assert "The left agent ended with exit code 1; it is not started again" in said(control)
    assert "no device" in said(control)
    monkeypatch.setitem(Scripts.scripts, "left agent", SLOW_STOP)
    assert control.run("left agent")
    until(control, lambda: badge(control.facts()).words == "STARTING")
    control.end_all()


def test_study_that_is_edited_while_it_runs_is_explained(
    control: LauncherControl, monkeypatch: pytest.MonkeyPatch
) -> None:
    from netboard.task.studies import library

    monkeypatch.setattr("netboard.windows.launcher.session_files.LOOK_S", 0.0)
    Path("study.toml").write_text(library.text_of("pilot"))
    control.choose(SessionChoice("rig.toml", "study.toml"))
    control.start()
    until(control, lambda: control.stage is LaunchStage.RUNNING)
    until(control, control._files._first.done)
    Path("study.toml").write_text(library.text_of("pilot") + "\n# more\n")
    until(control, lambda: "study.toml was changed. The running session keeps the study" in said(control))
    control.end_all()


def test_study_on_a_failing_disk_keeps_no_emergency_stop_from_being_repeated(
    control: LauncherControl, monkeypatch: pytest.MonkeyPatch
) -> None:
    from netboard.task.studies import library

    reading: set[str] = set()
    read_text = Path.read_text

    def failing(path: Path, *settings: str, **options: str) -> str:
        if path.name == "study.toml" and control.stage in (LaunchStage.PREPARING, LaunchStage.RUNNING):
            reading.add(current_thread().name)
            raise OSError(ESTALE, os.strerror(ESTALE))
        return read_text(path, *settings, **options)

    Path("study.toml").write_text(library.text_of("pilot"))
    monkeypatch.setattr("netboard.windows.launcher.session_files.LOOK_S", 0.0)
    monkeypatch.setattr(Path, "read_text", failing)
    control.choose(SessionChoice("rig.toml", "study.toml"))
    control.start()
    until(control, lambda: control.stage is LaunchStage.RUNNING)
    until(control, lambda: reading)
    control.emergency_stop()
    until(control, lambda: "The server has not confirmed the emergency stop" in said(control))
    assert "MainThread" not in reading
    assert "was changed" not in said(control)
    control.end_all()


def test_recordings_of_the_session_are_looked_up_beside_the_window(
    control: LauncherControl, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The window's thread has the emergency stop to handle, and a folder may have thousands of recordings."""
    looking: set[str] = set()
    glob = Path.glob

    def noted(folder: Path, pattern: str) -> Iterator[Path]:
        looking.add(current_thread().name)
        return glob(folder, pattern)

    Path("recordings").mkdir()
    Path("recordings/before.mcap").write_bytes(b"12345")
    monkeypatch.setattr("netboard.windows.launcher.session_files.LOOK_S", 0.0)
    monkeypatch.setattr(Path, "glob", noted)
    control.start()
    until(control, lambda: control.stage is LaunchStage.RUNNING)
    until(control, control._files._before.done)
    Path("recordings/session.mcap.part").write_bytes(b"123")
    until(control, lambda: control.facts().on_disk)
    assert control.facts().on_disk == 3
    assert looking
    assert "MainThread" not in looking
    control.end_all()


@pytest.mark.parametrize(("first", "size"), [(0, 0), (1, 3)])
def test_disk_error_keeps_the_launcher_neither_from_starting_nor_from_stopping(
    control: LauncherControl, monkeypatch: pytest.MonkeyPatch, first: int, size: int
) -> None:
    looks: list[Path] = []
    listed: list[Path] = []

    def failing(folder: Path) -> list[Path]:
        looks.append(folder)
        if first < len(looks) <= first + 2:
            raise OSError(ESTALE, os.strerror(ESTALE))
        return listed

    monkeypatch.setattr("netboard.windows.launcher.session_files._recordings", failing)
    monkeypatch.setattr("netboard.windows.launcher.session_files.LOOK_S", 0.0)
    control.start()
    until(control, lambda: control.stage is LaunchStage.RUNNING)
    begun = control._files._due
    until(control, lambda: looks)
    Path("session.mcap.part").write_bytes(b"123")
    listed.append(Path("session.mcap.part"))
    control.emergency_stop()
    until(control, lambda: control.facts().on_disk == size and control._files._due > begun)
    assert control._stop_ns
    control.end_all()


def test_window_thread_reads_nothing_of_a_running_session(
    control: LauncherControl, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The folder of the logs and the study may be on a slow disk, and this thread has the emergency stop to handle."""
    from netboard.task.studies import library

    Path("study.toml").write_text(library.text_of("pilot"))
    control.choose(SessionChoice("rig.toml", "study.toml"))
    control.start()
    until(control, lambda: control.stage is LaunchStage.RUNNING)
    readers: dict[str, set[str]] = {}
    stat = Path.stat

    def noted(path: Path, **how: bool) -> os.stat_result:
        readers.setdefault(path.name, set()).add(current_thread().name)
        return stat(path, **how)

    for name in ("LOOK_S", "FILE_LOOK_S"):
        monkeypatch.setattr(f"netboard.windows.launcher.session_files.{name}", 0.0)
    monkeypatch.setattr(Path, "stat", noted)
    until(control, lambda: "on" in control.shown_log_of("server"))
    until(control, lambda: control.facts() and {"study.toml", "server.log", "left-agent.log"} <= readers.keys())
    monkeypatch.setattr(Path, "stat", stat)
    assert [name for name, threads in readers.items() if "MainThread" in threads] == []
    assert control.processes["server"].log_bytes == len("on\n")
    control.end_all()


def test_look_at_files_keeps_what_was_found_before_a_disk_error() -> None:
    found: list[int] = []

    def read() -> int:
        found.append(len(found) + 1)
        if found[-1] == 2:
            raise OSError(ESTALE, os.strerror(ESTALE))
        return found[-1]

    now = [0.0]
    looks = FileLooks(lambda: now[0])

    def look() -> int:
        shown = looks.newest("a", read, 0)
        wait(looks._coming.values())
        return shown

    assert (look(), look(), look()) == (0, 1, 1)
    assert found == [1], "not before the time"
    now[0] += FILE_LOOK_S
    assert (look(), look()) == (1, 1)
    now[0] += FILE_LOOK_S
    assert (look(), look()) == (1, 3)
    looks.close()


@pytest.mark.parametrize(
    ("choice", "problem"),
    [
        (SessionChoice("none.toml"), "none.toml: no such file"),
        (SessionChoice("rig.toml", "papre"), "no such study or file"),
        (SessionChoice("rig.toml", "paper", session=4), "--session: found 4, expected 1 to"),
    ],
)
def test_choice_that_cannot_be_started_says_why(control: LauncherControl, choice: SessionChoice, problem: str) -> None:
    control.choose(choice)
    assert problem in control.problem
    assert badge(control.facts()).words == "NOT READY"
    control.start()
    assert control.stage is LaunchStage.IDLE
    assert problem in said(control)


def test_another_choice_ends_no_task_and_changes_the_commands(control: LauncherControl) -> None:
    assert control.run("check")
    control.choose(SessionChoice("rig.toml", dyad=5))
    assert control.processes["check"].phase == "running"
    assert "--dyad 5" in control.command_line("server")
    control.end("check")
    until(control, lambda: control.processes["check"].phase == "stopped")


def test_start_reads_the_files_again(control: LauncherControl) -> None:
    """The processes do so, too: an emergency stop must reach their server."""
    port = free_port()
    Path("rig.toml").write_text(f'[network]\nport = {port}\n[triggers]\nkind = "simulated"\n')
    control.start()
    assert control.config.network.port == port
    assert "trigger" in control.places
    until(control, lambda: control.stage is LaunchStage.RUNNING)
    control.emergency_stop()
    control.end_all()
    assert control._stop_ns == 0  # it is not sent to the server of the next session
    Path("rig.toml").write_text("[network]\nport = 80\n")
    control.start()
    assert control.stage is LaunchStage.IDLE
    assert "[network] port: found 80" in said(control)


def test_stopping_reaches_a_task_whose_side_another_choice_has_moved(control: LauncherControl) -> None:
    assert control.run("left device test")
    Path("far.toml").write_text(Path("rig.toml").read_text() + '[stations]\nleft = "127.0.0.1"\n')
    control.choose(SessionChoice("far.toml"))
    control.stop()
    until(control, lambda: control.processes["left device test"].phase == "stopped")


def test_each_analysis_has_a_folder_of_its_own(control: LauncherControl) -> None:
    assert control.command_line("analysis") == "netboard analyse recordings -o recordings/results_1"
    Path("recordings/results_1").mkdir(parents=True)
    assert control.command_line("analysis") == "netboard analyse recordings -o recordings/results_2"


def test_last_report_is_that_of_the_newest_analysis(control: LauncherControl) -> None:
    assert control.last_report is None
    for seconds, number in enumerate((1, 2, 9, 10)):
        report = Path(f"recordings/results_{number}/report.html")
        report.parent.mkdir(parents=True)
        report.touch()
        os.utime(report, (seconds, seconds))
        assert control.last_report == report


def test_each_row_has_the_command_that_does_the_same(control: LauncherControl) -> None:
    commands = {row.name: control.command_line(row.name) for row in rows(control.facts())}
    assert commands["server"] == "netboard server --study paper --dyad 1 --session 1 --seed 1 -c rig.toml"
    assert commands["preparation"] == ("netboard up --prepare --study paper --dyad 1 --session 1 --seed 1 -c rig.toml")
    assert commands["left device test"] == "netboard devices test --side left --yes -c rig.toml"
    assert commands["check"] == "netboard check recordings --verify"


def test_station_on_another_machine_is_asked_not_run_here(control: LauncherControl) -> None:
    text = Path("rig.toml").read_text()
    Path("rig.toml").write_text(text + '[stations]\nleft = "127.0.0.1"\n')
    control.choose(control.choice)
    found = {row.name: row.machine for row in rows(control.facts())}
    assert found["left agent"] == found["left doctor"] == "left station"
    assert found["right agent"] == "this machine"
    assert "left agent" not in control.commands()
    assert control.command_line("left agent") == "done by the service at the left station"
    assert not control.run("left doctor")
    assert "make it with: netboard keys init" in said(control)
    assert "the left station cannot be used without its key" in said(control)


# --- the window --------------------------------------------------------------------------------------------------


@pytest.fixture
def window(app, control):
    from netboard.windows.launcher.window import LauncherWindow

    remembered: list[SessionChoice] = []
    made = LauncherWindow(control, lambda: {"load": "0.1"}, remembered.append)
    made.remembered = remembered
    made.show()
    yield made
    made._timer.stop()
    made.hide()


def press(window, key: str) -> None:
    from PySide6.QtGui import QKeySequence, QShortcut

    (shortcut,) = (one for one in window.findChildren(QShortcut) if one.key() == QKeySequence(key))
    shortcut.activated.emit()


@pytest.mark.slow
def test_keys_start_and_stop_and_halting_is_never_disabled(window, app, control: LauncherControl) -> None:
    def check() -> None:
        app.processEvents()
        window.poll()
        assert window.halt.isEnabled()
        assert window.stop.isEnabled()

    press(window, "F2")
    until(control, lambda: check() or control.stage is LaunchStage.RUNNING)
    assert window.badge.text() == "STARTING"
    press(window, "Esc")
    press(window, "F4")
    until(control, lambda: check() or control.stage is LaunchStage.IDLE)
    assert "Everything has ended." in said(control)


def test_emergency_stop_without_a_server_says_so_until_it_is_read(window, control: LauncherControl) -> None:
    press(window, "Esc")
    assert "No server runs here, so no force is commanded." in said(control)
    press(window, "Ctrl+D")
    assert said(control) == ""


def test_rig_is_written_by_its_form_and_chosen(window, control: LauncherControl) -> None:
    press(window, "Ctrl+2")
    names = [table.name for table in window.rig._tables]
    window.rig.tables.setCurrentIndex(names.index("safety"))
    fields = window.rig.form.inputs
    fields["max_force"].setText("99")
    fields["max_force"].setModified(True)
    fields["max_force"].editingFinished.emit()
    assert "[safety] max_force: found 99, expected a number > 0 and <= 40 [N]" in window.rig.problem.text()
    fields["max_force"].setText("1.5")
    fields["max_force"].setModified(True)
    fields["max_force"].editingFinished.emit()
    before = Path("rig.toml").read_text()
    window.rig.path.setText("other.toml")
    press(window, "Ctrl+S")
    assert load(Path("other.toml")).safety.max_force == 1.5
    assert load(Path("other.toml")).network.port == load(Path("rig.toml")).network.port
    assert Path("rig.toml").read_text() == before
    assert control.choice.rig == "other.toml"
    assert window.remembered[-1] == control.choice


def test_study_is_checked_as_it_is_written_and_saved_only_if_valid(window, control: LauncherControl) -> None:
    press(window, "Ctrl+3")
    assert "18 blocks" in window.study.plan.text()
    window.study.editor.setPlainText('name = "x"\n[orders]\nmain = "2 dyadic"\n')
    assert "[kinds]: found none" in window.study.problem.text()
    press(window, "Ctrl+S")
    assert not Path("study.toml").exists()
    window.study.editor.appendPlainText('[kinds.dyadic]\nperformers = "dyad"\n')
    press(window, "Ctrl+S")
    assert control.choice.study == "study.toml"
    assert control.problem == ""


def test_backups_of_a_rig_are_all_kept(window) -> None:
    original = "# ours\n" + Path("rig.toml").read_text()
    Path("rig.toml").write_text(original)
    window.rig.load("rig.toml")
    press(window, "Ctrl+2")
    press(window, "Ctrl+S")
    assert window.rig.problem.text() == ""
    assert [path.name for path in Path().glob("rig.toml*")] == ["rig.toml"], "nothing was changed"
    enter(window.rig.form.inputs["left"], "127.0.0.1")
    press(window, "Ctrl+S")
    assert window.rig.problem.text() == "rig.toml had comments, which stay only in rig.toml.bak"
    written = Path("rig.toml").read_text()
    enter(window.rig.form.inputs["left"], "")
    press(window, "Ctrl+S")
    assert window.rig.problem.text() == ""
    assert Path("rig.toml.bak").read_text() == original
    assert Path("rig.toml.bak.2").read_text() == written


def enter(field, entry: str) -> None:
    field.setText(entry)
    field.setModified(True)
    field.editingFinished.emit()


def test_study_is_backed_up_before_it_is_replaced(window) -> None:
    from netboard.task.studies import library

    before = library.text_of("pilot")
    Path("own.toml").write_text(before)
    window.study.load("own.toml")
    press(window, "Ctrl+3")
    press(window, "Ctrl+S")
    assert not Path("own.toml.bak").exists(), "nothing was changed"
    for line in ("# one", "# two"):
        window.study.editor.appendPlainText(line)
        press(window, "Ctrl+S")
    assert Path("own.toml").read_text().endswith("# one\n# two")
    assert Path("own.toml.bak").read_text() == before
    assert Path("own.toml.bak.2").read_text().endswith("# one")


def test_file_that_was_edited_elsewhere_is_not_replaced(window) -> None:
    from netboard.task.studies import library

    Path("own.toml").write_text(library.text_of("pilot"))
    window.study.load("own.toml")
    newer = {"own.toml": library.text_of("pilot") + "# theirs\n", "rig.toml": "# theirs\n"}
    for name, text in newer.items():
        Path(name).write_text(text)
    window.study.editor.appendPlainText("# mine")
    for key, page in (("Ctrl+2", window.rig), ("Ctrl+3", window.study)):
        press(window, key)
        press(window, "Ctrl+S")
        assert "was changed elsewhere after it was read here; save under another name" in page.problem.text()
    assert {name: Path(name).read_text() for name in newer} == newer
    window.study.path.setText("mine.toml")
    press(window, "Ctrl+S")
    assert Path("mine.toml").read_text().endswith("# mine")


def test_rig_that_cannot_be_read_is_not_overwritten(window) -> None:
    Path("rig.toml").write_text("[block]\ntrails = 3\n")
    window.rig.load("rig.toml")
    press(window, "Ctrl+2")
    press(window, "Ctrl+S")
    assert Path("rig.toml").read_text() == "[block]\ntrails = 3\n"
    assert "rig.toml: exists already, and is not the file that is shown here" in window.rig.problem.text()


def test_study_is_changed_by_the_forms_of_its_parts_and_stays_a_text(window, control: LauncherControl) -> None:
    page = window.study
    page.editor.setPlainText('name = "x"\n[orders]\nmain = "2 dyadic"\n[kinds.dyadic]\n# both\nperformers = "dyad"\n')
    assert page.shown.currentWidget() is page.editor
    page.part.setCurrentText("kinds.dyadic")
    assert page.shown.currentWidget() is page.form
    page.table.setCurrentText("block")
    trials = page.form.inputs["trials"]
    trials.setText("7")
    trials.setModified(True)
    trials.editingFinished.emit()
    assert page.editor.toPlainText().endswith('# both\nperformers = "dyad"\nblock.trials = 7\n')
    assert page.part.currentText() == "kinds.dyadic"
    trials.setText("-7")
    trials.setModified(True)
    trials.editingFinished.emit()
    assert "[kinds.dyadic.block] trials: found -7" in page.problem.text()
    assert "block.trials = 7" in page.editor.toPlainText()
    page._begin("paper")
    assert page.part.currentText() == "kinds.dyadic", "a part that the next study has, too, stays chosen"
    assert page.form.inputs["trials"].text() == str(Block().trials)
    page.editor.setPlainText('name = "x"\n[orders]\nmain = "2 solo"\n[kinds.solo]\nperformers = "A"\n')
    assert page.part.currentText() == "the whole text"
    assert page.shown.currentWidget() is page.editor
    page.save()
    assert control.choice.study == "study.toml"


def test_parts_of_a_study_are_added_and_removed_with_keys_alone(window) -> None:
    from PySide6.QtCore import Qt
    from PySide6.QtTest import QTest

    page = window.study
    page.load("pilot")
    window.show_page(2)
    before = page.editor.toPlainText()
    page.collection.setFocus()
    QTest.keyClick(page.collection, Qt.Key.Key_End)
    while page.collection.currentText() != "new in kinds":
        QTest.keyClick(page.collection, Qt.Key.Key_Up)
    QTest.keyClick(page.collection, Qt.Key.Key_Tab)
    assert window.focusWidget() is page.new_name
    assert not page.add_button.isEnabled()
    QTest.keyClicks(page.new_name, "dyadic")
    assert page.problem.text() == "kinds: found dyadic already, expected another name"
    QTest.keyClick(page.new_name, Qt.Key.Key_Return)
    assert page.editor.toPlainText() == before
    QTest.keyClicks(page.new_name, "2")
    assert (page.problem.text(), page.add_button.isEnabled()) == ("", True)
    QTest.keyClick(page.new_name, Qt.Key.Key_Return)
    assert (page.part.currentText(), page.new_name.text()) == ("kinds.dyadic2", "")
    assert page.shown.currentWidget() is page.form
    assert page.form.inputs["catch_after"].text() == "3", "as that of the last kind"
    assert "\n[kinds.dyadic2]\n" in page.editor.toPlainText()
    page.table.setFocus()
    QTest.keyClick(page.table, Qt.Key.Key_Tab)
    assert window.focusWidget() is page.remove_button
    QTest.keyClick(page.remove_button, Qt.Key.Key_Space)
    assert page.editor.toPlainText() == before
    assert page.part.currentText() == "the whole text"
    page.editor.undo()
    assert "[kinds.dyadic2]" in page.editor.toPlainText()


def test_part_that_is_needed_or_has_no_form_of_its_own_is_not_removed(window) -> None:
    page = window.study
    page.load("pilot")
    assert not page.add_button.isEnabled(), "there is no name"
    assert not page.remove_button.isEnabled(), "the whole text is shown"
    page.part.setCurrentText("kinds.dyadic")
    page.remove()
    assert '[orders] main: found "dyadic", expected one of practice' in page.problem.text()
    page.part.setCurrentText("orders")
    assert not page.remove_button.isEnabled()
    page.new_name.setText("short")
    assert page.collection.currentText() == "new in orders"
    page.add()
    short = page.form.inputs["short"]
    assert short.text() == "practice"
    short.setText("")
    short.setModified(True)
    short.editingFinished.emit()
    assert list(page.form.inputs) == ["main"]


def test_nothing_is_added_to_a_text_that_is_no_study(window) -> None:
    page = window.study
    page.editor.setPlainText("name = ")
    page.new_name.setText("pairs")
    page.add()
    assert page.editor.toPlainText() == "name = "
    assert "not valid TOML" in page.problem.text()


def test_study_that_is_not_shown_is_not_overwritten(window) -> None:
    from netboard.task.studies import library

    Path("study.toml").write_text("# the only copy\n")
    press(window, "Ctrl+3")
    press(window, "Ctrl+S")
    assert Path("study.toml").read_text() == "# the only copy\n"
    assert "study.toml: exists already" in window.study.problem.text()
    Path("own.toml").write_text(library.text_of("pilot"))
    window.study.load("own.toml")
    window.study.editor.appendPlainText("# mine")
    press(window, "Ctrl+S")
    assert Path("own.toml").read_text().endswith("# mine")
    window.study._begin("paper")
    press(window, "Ctrl+S")
    assert Path("own.toml").read_text().endswith("# mine")


def test_page_follows_the_study_that_is_chosen(window, control: LauncherControl) -> None:
    from netboard.task.studies import library

    page = window.study
    Path("own.toml").write_text(library.text_of("pilot") + "# mine\n")
    window.choose(SessionChoice("rig.toml", "own.toml"))
    assert page.editor.toPlainText().endswith("# mine\n")
    assert page.path.text() == "own.toml"
    window.choose(SessionChoice("rig.toml", "paper"))
    assert page.editor.toPlainText() == library.text_of("paper")
    window.choose(SessionChoice("rig.toml", "none.toml"))
    assert (page.editor.toPlainText(), page.problem.text()) == ("", "none.toml: no such study")
    window.choose(SessionChoice("rig.toml", "own.toml"))
    assert page.editor.toPlainText().endswith("# mine\n")


def test_page_keeps_a_text_that_is_not_saved_when_another_study_is_chosen(window, control: LauncherControl) -> None:
    page = window.study
    page.editor.appendPlainText("# not saved")
    window.choose(SessionChoice("rig.toml", "pilot"))
    assert control.choice.study == "pilot"
    assert page.editor.toPlainText().endswith("# not saved")
    assert "The page Study still shows a text that is not saved, not pilot." in said(control)
    page.path.setText("mine.toml")
    page.save()
    assert control.choice.study == "mine.toml"
    window.choose(SessionChoice("rig.toml", "pilot"))
    assert "# not saved" not in page.editor.toPlainText()


@pytest.mark.parametrize(("height", "least"), [(900, 8.0), (2160, 20.0)])
def test_arrow_of_a_choice_grows_with_the_letters(window, app, height: int, least: float) -> None:
    window.resize(height * 16 // 9, height)
    press(window, "Ctrl+3")
    app.processEvents()
    box = window.study.part
    area = box.arrow_area()
    assert area.width() >= least
    assert box.rect().toRectF().contains(area)
    picture = box.grab().toImage()
    middle = area.center()
    assert picture.pixelColor(middle.toPoint()) == box.palette().buttonText().color()
    assert picture.pixelColor(int(middle.x()), int(area.top()) - 3) != box.palette().buttonText().color()


def test_choice_is_taken_from_the_form(window, control: LauncherControl) -> None:
    window.session.form.inputs["dyad"].setText("0")
    window.session.form.inputs["dyad"].setModified(True)
    window.session.form.inputs["dyad"].editingFinished.emit()
    assert "dyad: found 0" in window.session.problem.text()
    window.session.form.inputs["dyad"].setText("7")
    window.session.form.inputs["dyad"].setModified(True)
    window.session.form.inputs["dyad"].editingFinished.emit()
    assert control.choice.dyad == 7
    press(window, "Ctrl+4")
    window.poll()
    assert "load         0.1" in window.machines.words.toPlainText()


def test_report_that_is_missing_is_explained(window, control: LauncherControl) -> None:
    press(window, "F6")
    assert "There is no report yet: select analysis in the table" in said(control)


# --- memory ------------------------------------------------------------------------------------------------------


def test_second_launcher_says_that_another_one_is_open(tmp_path: Path) -> None:
    pytest.importorskip("PySide6.QtCore", exc_type=ImportError)
    from netboard.windows.launcher.memory import only_launcher

    lock = only_launcher(tmp_path / "netboard" / "launcher.lock")
    with pytest.raises(NetboardError, match="another launcher is open"):
        only_launcher(tmp_path / "netboard" / "launcher.lock")
    lock.unlock()
    only_launcher(tmp_path / "netboard" / "launcher.lock").unlock()


def test_memory_is_kept_and_a_damaged_one_is_named(tmp_path: Path) -> None:
    pytest.importorskip("PySide6.QtCore", exc_type=ImportError)
    from netboard.windows.launcher.memory import remember, remembered

    path = tmp_path / "new" / "launcher.toml"
    assert remembered(path) == (LauncherMemory(), "")
    memory = LauncherMemory(SessionChoice("rig.toml", "pilot", 4))
    remember(path, memory)
    assert remembered(path) == (memory, "")
    path.write_text("[session]\ndyad = 0\n")
    found, problem = remembered(path)
    assert found == LauncherMemory()
    assert problem.startswith(f"nothing is remembered: {path}: [session] dyad: found 0")


def test_reading_is_given_from_outside() -> None:
    def config(path: Path | None) -> Config:
        raise ConfigError("no rig today")

    control = LauncherControl(SessionChoice(), FileReaders(config, load_study))
    assert control.problem == "no rig today"
    control.close()
