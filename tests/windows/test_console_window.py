"""The console with a server on a real socket: keys, refusals, emergency stop, notes, form, silence."""

import json
from collections.abc import Callable
from dataclasses import replace

import pytest
from console_server import MINE, RUNNING, STATES, ConsoleServer, attempts, point

from netboard.base.config import Config
from netboard.base.process import NAME
from netboard.network.transport import sockets
from netboard.nodes.ports.emergency import RELEASE, STOP
from netboard.windows.operator.commands import COMMANDS, RELEASING, refusal
from netboard.windows.operator.lamps import Level, limits_of

pytestmark = pytest.mark.slow


TIMEOUT = 60.0
"""What is waited for is there long before, on a busy machine too [s]."""


def until(app, true: Callable[[], object], seconds: float = TIMEOUT) -> None:
    """Let Qt work until something is true."""
    from PySide6.QtCore import QEventLoop, QTimer

    loop, timer, limit = QEventLoop(), QTimer(interval=2), QTimer(singleShot=True)
    met = False

    def look() -> None:
        nonlocal met
        if met := bool(true()):  # it may hold for a moment only: do not ask again
            loop.quit()

    timer.timeout.connect(look)
    limit.timeout.connect(loop.quit)
    timer.start()
    limit.start(round(seconds * 1000))
    loop.exec()
    timer.stop()
    assert met or true()


class Table:
    """A window, its client, and the server, all turned by Qt."""

    def __init__(self, app, server: ConsoleServer, context: sockets.Context) -> None:
        from PySide6.QtCore import QTimer

        from netboard.windows.operator.client import ConsoleClient
        from netboard.windows.operator.window import ConsoleWindow

        self.app, self.server = app, server
        config = replace(Config(), network=server.network)
        self.window = ConsoleWindow(config, limits_of(config, MINE), NAME)
        self.window.show()
        self.window.activateWindow()
        self.turns = QTimer(interval=1)
        self.turns.timeout.connect(server.turn)
        self.turns.start()
        self.client = ConsoleClient(config, context, self.window)

    def until(self, true: Callable[[], object]) -> None:
        until(self.app, true)

    def show(self, state: str) -> None:
        """Have the server in a state, and wait until that is seen."""
        self.server.show(state)
        self.until(lambda: repr(self.window.state.status) == repr(self.server.status))  # NaN is in some

    def press(self, key: str) -> None:
        """Press a key of the window, wherever its focus is."""
        from PySide6.QtGui import QKeySequence
        from PySide6.QtTest import QTest

        pressed = QKeySequence(key)[0]
        QTest.keyClick(self.app.focusWidget() or self.window, pressed.key(), pressed.keyboardModifiers())

    def write(self, words: str) -> None:
        from PySide6.QtTest import QTest

        QTest.keyClicks(self.app.focusWidget(), words)

    def heard(self, name: str, argument: str = "") -> None:
        """Wait until the server has heard a command."""
        self.until(lambda: (name, argument) in self.server.said())

    def replied(self, words: str) -> None:
        self.until(lambda: words in self.window.reply.text())


@pytest.fixture
def table(app, server: ConsoleServer):
    with sockets.open_context() as context:
        made = Table(app, server, context)
        made.until(lambda: made.window.state.status is not None and app.focusWindow() is not None)
        yield made
        made.turns.stop()
        made.client.leave()
        made.window.show_state(replace(made.window.state, status=None))
        made.window.close()


KEYS = [
    (
        command.key,
        command.name,
        next(state for state in STATES if not refusal(command, replace(STATES[state], outcomes=1), NAME)),
    )
    for command in (*COMMANDS, RELEASING)
    if command.name not in ("open", "note")
]


@pytest.mark.parametrize(("key", "name", "state"), KEYS, ids=[name for _, name, _ in KEYS])
@pytest.mark.daily(5)
def test_a_key_sends_its_command(
    table: Table, key: str, name: str, state: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("netboard.windows.operator.window.SOON_NS", 0)
    table.server.attempts = attempts(1)
    table.show(state)
    table.window.show_form(False)
    table.press(key)
    if next(command for command in (*COMMANDS, RELEASING) if command.name == name).twice:
        table.replied("once more")
        assert table.server.said() == []
        table.press(key)
    table.heard(name)
    table.replied("done")


def test_a_button_does_what_its_key_does(table: Table) -> None:
    button = next(button for button in table.window.bar.buttons if button.command.name == "pause")
    button.click()
    table.heard("pause")
    assert table.server.said() == [("pause", "")]


def test_what_was_pressed_twice_too_soon_is_asked_again(table: Table, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("netboard.windows.operator.window.SOON_NS", 2**62)  # however slow this machine is
    end = next(button for button in table.window.bar.buttons if button.command.name == "end")
    end.click()
    end.click()
    table.replied("once more")
    assert "again" in end.text()
    table.press("F5")
    table.heard("pause")
    assert "again" not in end.text()
    assert table.server.said() == [("pause", "")]


def test_what_makes_no_sense_is_not_sent_and_said(table: Table) -> None:
    table.press("F7")
    assert table.window.reply.text() == "Resume: not possible while running"
    table.show("watched")
    table.press("F7")
    assert "lab2:4711 is in command: press T" in table.window.reply.text()
    table.press("T")
    table.until(lambda: table.window.commander.text() == "You are in command")
    table.press("F7")
    table.heard("resume")


def test_a_refusal_is_shown_with_its_reason(table: Table) -> None:
    table.server.refuse["pause"] = "the trial is over already"
    table.press("F5")
    table.replied("Pause now REFUSED: the trial is over already")
    assert table.window.headline.text() == "RUNNING"


@pytest.mark.parametrize("state", STATES)
@pytest.mark.parametrize("key", ["Esc", "Space"])
@pytest.mark.daily(8)
def test_the_emergency_stop_works_in_every_state(table: Table, state: str, key: str) -> None:
    table.show(state)
    table.window.show_form(False)
    table.press(key)
    table.heard(STOP)
    table.until(lambda: table.window.headline.text() == "STOPPED")


def test_it_works_while_a_note_is_written(table: Table) -> None:
    table.press("F4")
    table.until(table.window.note.text.hasFocus)
    table.write("a b T")
    assert table.window.note.text.text() == "a b T"
    assert table.server.said() == []
    table.press("Esc")
    table.heard(STOP)


def test_it_works_while_the_form_is_filled_in(table: Table) -> None:
    table.show("unopened")
    table.press("F3")
    for field in (*table.window.form.texts.values(), table.window.form.consent):
        field.setFocus()
        table.server.heard.clear()
        table.server.show("unopened")
        table.press("Esc")
        table.heard(STOP)
    table.window.form.consent.setFocus()
    table.server.heard.clear()
    table.press("Space")
    assert table.window.form.consent.isChecked()
    assert table.server.said() == []


def test_its_button_stops_when_it_is_pressed_and_before_it_is_let_go(table: Table) -> None:
    from PySide6.QtCore import Qt
    from PySide6.QtTest import QTest

    QTest.mousePress(table.window.stop.button, Qt.MouseButton.LeftButton)
    table.heard(STOP)
    assert table.window.stop.button.isDown()
    QTest.mouseRelease(table.window.stop.button, Qt.MouseButton.LeftButton)


def test_a_stop_that_is_not_confirmed_is_shouted_and_sent_again(table: Table) -> None:
    table.server.silent = True
    table.press("Esc")
    table.until(lambda: "LET GO" in table.window.alarm.text())
    table.server.silent = False
    table.heard(STOP)
    table.until(lambda: "LET GO" not in table.window.alarm.text())


def test_a_stop_is_released_by_who_presses_twice(table: Table, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("netboard.windows.operator.window.SOON_NS", 0)
    table.press("Esc")
    table.until(lambda: table.window.headline.text() == "STOPPED")
    table.press("Ctrl+R")
    table.press("Ctrl+R")
    table.heard(RELEASE)
    table.until(lambda: table.window.headline.text() == "PAUSED")


def test_a_note_has_the_time_of_its_first_letter(table: Table) -> None:
    table.press("F4")
    table.until(table.window.note.text.hasFocus)
    first = table.window.note.tick
    table.write("w")
    table.server.change(tick=first + 5000)
    table.until(lambda: table.window.note.tick >= first + 5000)
    table.write("as loud")
    table.press("Return")
    table.until(table.server.said)
    name, argument = table.server.said()[0]
    assert (name, json.loads(argument)) == ("note", {"text": "was loud", "tick": first})
    assert not table.window.note.text.hasFocus()
    table.press("F4")
    table.write(" ")
    table.press("Return")
    table.write("")
    assert len(table.server.said()) == 1


def test_the_form_opens_the_session(table: Table) -> None:
    form = table.window.form
    table.server.change(opened=False, consent=False, phase="idle", session="another")
    table.until(lambda: table.window.middle.currentWidget() is form)
    assert form.texts["name"].text() == "S03"
    table.press("Return")
    assert "Consent" in form.trouble.text()
    form.texts["participant_a"].setText("Anna Bauer")
    form.consent.setChecked(True)
    table.press("Return")
    assert "Anna Bauer" in form.trouble.text()
    assert table.server.said() == []
    form.texts["participant_a"].setText("P05")
    form.texts["participant_b"].setText("P06")
    table.server.refuse["open"] = "S03 of dyad D03 is there already: resume it, or take another name"
    table.press("Return")
    table.until(lambda: "there already" in form.trouble.text())
    table.server.refuse.clear()
    form.texts["name"].setText("S04")
    form.kind.buttons["pilot"].click()
    table.press("Return")
    table.until(lambda: table.window.middle.currentWidget() is table.window.live)
    sent = json.loads(table.server.said()[-1][1])
    assert sent == {
        "name": "S04",
        "participant_a": "P05",
        "participant_b": "P06",
        "hand_a": "right",
        "hand_b": "right",
        "seat_a": "left",
        "consent": True,
        "pilot": True,
    }
    table.until(lambda: table.window.banner.text().startswith("PILOT"))


def test_a_repeat_names_the_trial_that_is_marked(table: Table) -> None:
    table.server.attempts = attempts(6)
    table.show("running")
    table.until(lambda: table.window.table.attempts.rowCount() == 6)
    for _ in range(3):
        table.press("Up")
    marked = table.window.table.marked
    assert marked == attempts(6)[3]
    table.press("F9")
    table.heard("repeat", "3")
    for _ in range(3):
        table.press("Down")
    assert table.window.table.marked is None
    table.press("Shift+F9")
    table.heard("veto")
    table.press("Up")
    table.server.change(block=4)
    table.until(lambda: table.window.state.status.block == 4)
    table.press("F9")
    assert "block 3" in table.window.reply.text()


def test_a_silent_server_is_red_within_a_second(table: Table) -> None:
    lamp = table.window.session.widgets[0]
    table.until(lambda: lamp.lamp.level is Level.GOOD)
    table.server.silent = True
    table.until(lambda: lamp.lamp.level is Level.BAD)
    assert table.window.headline.text() == "LINK LOST"
    assert "NO REPLY" in table.window.alarm.text()
    assert {widget.lamp.level for widget in table.window.stations.columns["left"]} == {Level.OFF}
    table.server.silent = False
    table.until(lambda: lamp.lamp.level is Level.GOOD)
    assert table.window.headline.text() == "RUNNING"


def test_a_server_that_does_not_know_it_any_more_is_greeted_anew(table: Table) -> None:
    table.server._peers.clear()
    table.server.change(tick=RUNNING.tick + 77)
    table.until(lambda: table.window.state.status.tick == RUNNING.tick + 77)
    assert table.server.said() == []
    table.press("F5")
    table.heard("pause")
    assert table.server.said() == [("pause", "")]


def test_the_strips_show_the_last_ten_seconds(app) -> None:
    import numpy as np

    from netboard.windows.operator.strips import StripCharts

    strips = StripCharts(Config())
    strips.take([point(tick) for tick in range(0, 15_000, 5)])
    strips.redraw()
    times, heights = strips._lines[0][0].getData()
    assert times[-1] == 0.0
    assert times[0] >= -10.0
    assert np.abs(heights).max() == pytest.approx(20.0, rel=0.01)
    strips.take([point(tick) for tick in range(14_000, 16_000, 5)])
    strips.take([point(20_000)])
    strips.redraw()
    times, heights = strips._lines[0][0].getData()
    assert np.isnan(heights).sum() == 1
    assert np.all(np.diff(times) > 0)
    strips.take([point(5)], restart=True)
    strips.redraw()
    assert len(strips._lines[0][0].getData()[0]) == 1
    strips.take([point(5_000)])
    strips.take([point(1_000), point(1_005)])
    strips.redraw()
    assert len(strips._lines[0][0].getData()[0]) == 2, "a replay has gone back"


def test_a_window_is_not_closed_by_accident_while_a_block_is_on(table: Table) -> None:
    assert not table.window.close()
    assert "once more" in table.window.reply.text()
    assert table.window.close()


def test_a_picture_is_taken_at_the_first_word(app, server: ConsoleServer, tmp_path) -> None:
    from PySide6.QtCore import QTimer

    from netboard.base.errors import NetboardError
    from netboard.windows.operator.client import run

    server.show("ready")
    turns = QTimer(interval=1)
    turns.timeout.connect(server.turn)
    turns.start()
    picture = tmp_path / "console.png"
    run(replace(Config(), network=server.network), lambda: False, picture)
    turns.stop()
    assert picture.read_bytes().startswith(b"\x89PNG")
    with pytest.raises(NetboardError, match="exists"):
        run(Config(), lambda: True, picture)
