"""The console with a fake server on a real socket: keys, refusals, emergency stop, notes, form, lost link."""

import json
from collections.abc import Callable
from dataclasses import replace
from itertools import product

import pytest
from console_server import MINE, RUNNING, STATES, ConsoleServer, attempts, point

from netboard.base.config import Config
from netboard.base.process.resources import NAME
from netboard.network.protocol.codec import encode
from netboard.network.protocol.joining import Goodbye
from netboard.network.transport import sockets
from netboard.nodes.ports.emergency import RELEASE, STOP
from netboard.windows.operator.commands import COMMANDS, RELEASING, refusal
from netboard.windows.operator.lamps import SILENT, LampLevel, limits_of

pytestmark = pytest.mark.slow


TIMEOUT = 60.0
"""Upper limit of a wait; the condition holds long before, even on a busy machine [s]."""


def until(app, true: Callable[[], object], seconds: float = TIMEOUT) -> None:
    """Run the Qt event loop until a condition holds; fail after the timeout."""
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


class ConsoleRig:
    """A console window, its client and the fake server, all driven by the Qt event loop."""

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
        """Put the server into a state, and wait until the window has it."""
        self.server.show(state)
        self.until(lambda: repr(self.window.state.status) == repr(self.server.status))  # repr, because some hold NaN

    def press(self, key: str) -> None:
        """Press a key in the widget that has the focus."""
        from PySide6.QtGui import QKeySequence
        from PySide6.QtTest import QTest

        pressed = QKeySequence(key)[0]
        QTest.keyClick(self.app.focusWidget() or self.window, pressed.key(), pressed.keyboardModifiers())

    def write(self, words: str) -> None:
        from PySide6.QtTest import QTest

        QTest.keyClicks(self.app.focusWidget(), words)

    def wait_for_command(self, name: str, argument: str = "") -> None:
        """Wait until the server has received a command."""
        self.until(lambda: (name, argument) in self.server.commands())

    def wait_for_reply(self, words: str) -> None:
        self.until(lambda: words in self.window.reply.text())


@pytest.fixture
def console(app, server: ConsoleServer):
    with sockets.open_context() as context:
        made = ConsoleRig(app, server, context)
        made.until(lambda: made.window.state.status is not None and app.focusWindow() is not None)
        yield made
        made.turns.stop()
        made.client.leave()
        made.window.hide()


KEYS = [
    (
        command.key,
        command.name,
        next(state for state in STATES if not refusal(command, replace(STATES[state], outcomes=1), NAME)),
    )
    for command in (*COMMANDS, RELEASING)
    if command.name not in ("open", "note")
]


def test_tab_reaches_a_button_which_enter_presses_and_space_never(console: ConsoleRig) -> None:
    console.show("running")
    pause = next(button for button in console.window.bar.buttons if button.command.name == "pause")
    console.window.setFocus()
    while not pause.hasFocus():
        assert console.window.focusNextChild()
    console.press("Return")
    console.wait_for_command("pause")
    console.press("Space")
    console.wait_for_command(STOP)
    assert len(console.server.commands()) - len(console.server.commands("pause")) == 1


@pytest.mark.parametrize(("key", "name", "state"), KEYS, ids=[name for _, name, _ in KEYS])
@pytest.mark.sampled(5)
def test_key_sends_its_command(
    console: ConsoleRig, key: str, name: str, state: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("netboard.windows.operator.window.SOON_NS", 0)
    console.server.attempts = attempts(1)
    console.show(state)
    console.window.show_form(False)
    console.press(key)
    if next(command for command in (*COMMANDS, RELEASING) if command.name == name).confirm:
        console.wait_for_reply("once more")
        assert console.server.commands() == []
        console.press(key)
    console.wait_for_command(name)
    console.wait_for_reply("done")


def test_button_sends_the_same_command_as_its_key(console: ConsoleRig) -> None:
    button = next(button for button in console.window.bar.buttons if button.command.name == "pause")
    button.click()
    console.wait_for_command("pause")
    assert console.server.commands() == [("pause", "")]


def test_too_quick_a_second_press_does_not_confirm_a_command(
    console: ConsoleRig, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("netboard.windows.operator.window.SOON_NS", 2**62)  # too quick on a slow machine, too
    end = next(button for button in console.window.bar.buttons if button.command.name == "end")
    end.click()
    end.click()
    console.wait_for_reply("once more")
    assert "again" in end.text()
    console.window._confirm_timer.timeout.emit()
    assert "again" not in end.text()
    assert console.window.reply.text() == ""
    end.click()
    console.press("F5")
    console.wait_for_command("pause")
    assert "again" not in end.text()
    assert console.server.commands() == [("pause", "")]


def test_impossible_command_is_explained_and_not_sent(console: ConsoleRig) -> None:
    console.press("F7")
    assert console.window.reply.text() == "Resume: not possible while the ball is free"
    console.show("watched")
    console.press("F7")
    assert "lab2:4711 is in command: press T" in console.window.reply.text()
    console.press("T")
    console.until(lambda: console.window.commander.text() == "You are in command")
    console.press("F7")
    console.wait_for_command("resume")


def test_refusal_is_shown_with_its_reason(console: ConsoleRig) -> None:
    console.server.refuse["pause"] = "the trial is over already"
    console.press("F5")
    console.wait_for_reply("Pause now was refused: the trial is over already")
    assert console.window.badge.text() == "RUNNING"


@pytest.mark.parametrize("state", STATES)
@pytest.mark.parametrize("key", ["Esc", "Space"])
@pytest.mark.sampled(8)
def test_emergency_stop_works_in_every_state(console: ConsoleRig, state: str, key: str) -> None:
    console.show(state)
    console.window.show_form(False)
    console.press(key)
    console.wait_for_command(STOP)
    console.until(lambda: console.window.badge.text() == "STOPPED")


def test_emergency_stop_works_while_a_note_is_written(console: ConsoleRig) -> None:
    console.press("F4")
    console.until(console.window.note.text.hasFocus)
    console.write("a b T")
    assert console.window.note.text.text() == "a b T"
    assert console.server.commands() == []
    console.press("Esc")
    console.wait_for_command(STOP)


def test_emergency_stop_works_while_the_form_is_filled_in(console: ConsoleRig) -> None:
    console.server.attempts = attempts(1)
    console.show("unopened")
    console.until(lambda: console.window.table.attempts.rowCount() == 1)
    console.press("F3")
    for field in (*console.window.form.texts.values(), console.window.form.consent):
        field.setFocus()
        console.server.received.clear()
        console.server.show("unopened")
        console.press("Esc")
        console.wait_for_command(STOP)
    console.window.form.consent.setFocus()
    console.server.received.clear()
    console.press("Space")
    assert console.window.form.consent.isChecked()
    console.press("Up")
    assert console.window.table.marked is None
    assert console.server.commands() == []
    console.press("F4")
    console.write("a note")
    console.press("Return")
    console.press("Space")
    console.wait_for_command(STOP)


def test_stop_button_acts_on_press_not_on_release(console: ConsoleRig) -> None:
    from PySide6.QtCore import Qt
    from PySide6.QtTest import QTest

    QTest.mousePress(console.window.stop.button, Qt.MouseButton.LeftButton)
    console.wait_for_command(STOP)
    assert console.window.stop.button.isDown()
    QTest.mouseRelease(console.window.stop.button, Qt.MouseButton.LeftButton)


def test_unconfirmed_stop_raises_an_alarm_and_is_sent_again(console: ConsoleRig) -> None:
    console.server.silent = True
    console.press("Esc")
    console.until(lambda: "LET GO" in console.window.alarm.text())
    console.server.silent = False
    console.wait_for_command(STOP)
    console.until(lambda: "LET GO" not in console.window.alarm.text())


def test_refused_stop_is_not_sent_again(console: ConsoleRig) -> None:
    """A replay refuses it; sent again, it would stop the next session at this address."""
    console.server.refuse[STOP] = "this is a replay"
    console.press("Esc")
    console.wait_for_reply("EMERGENCY STOP was refused: this is a replay")
    assert console.client._stop_ns is None


def test_pressing_ctrl_r_twice_releases_the_stop(console: ConsoleRig, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("netboard.windows.operator.window.SOON_NS", 0)
    console.press("Esc")
    console.until(lambda: console.window.badge.text() == "STOPPED")
    console.press("Ctrl+R")
    console.press("Ctrl+R")
    console.wait_for_command(RELEASE)
    console.until(lambda: console.window.badge.text() == "PAUSED")


def test_note_is_stamped_with_the_tick_of_its_first_letter(console: ConsoleRig) -> None:
    console.press("F4")
    console.until(console.window.note.text.hasFocus)
    first = console.window.note.tick
    console.write("w")
    console.server.change(tick=first + 5000)
    console.until(lambda: console.window.note.tick >= first + 5000)
    console.write("as loud")
    console.press("Return")
    console.until(console.server.commands)
    name, argument = console.server.commands()[0]
    assert (name, json.loads(argument)) == ("note", {"text": "was loud", "tick": first})
    assert not console.window.note.text.hasFocus()
    console.press("F4")
    console.write(" ")
    console.press("Return")
    console.write("")
    assert len(console.server.commands()) == 1


def test_note_that_the_server_has_not_received_returns_to_its_field(console: ConsoleRig) -> None:
    note = console.window.note
    console.server.refuse["note"] = "the connection was interrupted, and note may be out of date: send it again"
    console.press("F4")
    first = note.tick
    console.write("was loud")
    console.server.change(tick=first + 5000)
    console.press("Return")
    console.wait_for_reply("was refused")
    assert note.text.text() == "was loud"
    console.server.refuse.clear()
    console.press("F4")
    console.press("Return")
    console.wait_for_command("note", json.dumps({"text": "was loud", "tick": first}))
    console.wait_for_reply("done")
    assert note.text.text() == ""


def test_form_opens_the_session_once_its_answers_are_valid(console: ConsoleRig) -> None:
    form = console.window.form
    console.server.change(opened=False, consent=False, phase="idle", session="another")
    console.until(lambda: console.window.middle.currentWidget() is form)
    assert form.texts["name"].text() == "S03"
    console.press("Return")
    assert "'A' is only the default" in form.trouble.text()
    form.texts["participant_a"].setText("P05")
    form.texts["participant_b"].setText("P06")
    console.press("Return")
    assert "Consent" in form.trouble.text()
    form.texts["participant_a"].setText("Anna Bauer")
    form.consent.setChecked(True)
    console.press("Return")
    assert "Anna Bauer" in form.trouble.text()
    assert console.server.commands() == []
    form.texts["participant_a"].setText("P05")
    form.texts["participant_b"].setText("P06")
    console.server.refuse["open"] = "S03 of dyad D03 is there already: resume it, or take another name"
    console.press("Return")
    console.until(lambda: "there already" in form.trouble.text())
    console.server.refuse.clear()
    form.texts["name"].setText("S04")
    form.kind.buttons["pilot"].click()
    console.press("Return")
    console.until(lambda: console.window.middle.currentWidget() is console.window.live)
    sent = json.loads(console.server.commands()[-1][1])
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
    console.until(lambda: console.window.banner.text().startswith("PILOT"))


def test_real_session_with_stand_ins_needs_words_in_the_form_or_later(console: ConsoleRig) -> None:
    form, words = console.window.form, "right device simulated, right display off screen"
    console.show("simulated_unopened")
    console.window.show_form(True)
    assert "simulated, no device: virtual Touch" in form.rig.text()
    for name, text in (("participant_a", "P05"), ("participant_b", "P06")):
        form.texts[name].setText(text)
    form.consent.setChecked(True)
    console.press("Return")
    assert words in form.trouble.text()
    assert console.server.commands() == []
    form.words.setText(words)
    console.press("Return")
    console.wait_for_command("confirm", words)
    assert "open" in [name for name, _ in console.server.commands()]
    console.show("simulated")
    console.until(lambda: not console.window.confirmation.isHidden())
    console.press("Shift+F3")
    console.window.confirmation.setText(words)
    console.press("Return")
    console.until(lambda: console.server.commands()[-1] == ("confirm", words))
    console.show("confirmed")
    console.until(console.window.confirmation.isHidden)


def test_form_of_another_session_has_its_proposed_seats_and_no_consent(console: ConsoleRig) -> None:
    form = console.window.form
    console.show("unopened")
    form.texts["participant_a"].setText("P05")
    form.consent.setChecked(True)
    assert form.seat_a.answer == "left"
    console.server.config = '[session]\nseat_a = "right"\nhand_b = "left"\nparticipant_a = "P07"\n'
    console.server._peers.clear()  # another server, which does not know this console
    console.server.change(session="d2f0", name="S05")
    console.until(lambda: form.texts["name"].text() == "S05")
    entry = form.entry
    assert (entry.participant_a, entry.hand_b, entry.seat_a, entry.consent) == ("P07", "left", "right", False)


def test_repeat_names_the_selected_trial(console: ConsoleRig) -> None:
    console.server.attempts = attempts(6)
    console.show("running")
    console.until(lambda: console.window.table.attempts.rowCount() == 6)
    for _ in range(3):
        console.press("Up")
    marked = console.window.table.marked
    assert marked == attempts(6)[3]
    console.press("F9")
    console.wait_for_command("repeat", "3")
    for _ in range(3):
        console.press("Down")
    assert console.window.table.marked is None
    console.press("Shift+F9")
    assert console.window.reply.text() == "Cancel repeat: no repeat is waiting"
    console.server.change(repeats=(3,))
    console.until(lambda: console.window.state.status.repeats == (3,))
    console.press("Shift+F9")
    console.wait_for_command("veto")
    console.press("Up")
    console.server.change(block=4)
    console.until(lambda: console.window.state.status.block == 4)
    console.press("F9")
    assert "block 3" in console.window.reply.text()


def test_long_names_do_not_make_the_window_wider(console: ConsoleRig) -> None:
    width = console.window.width()
    console.server.change(name="N" * 64, dyad="D" * 64, study="s" * 64, label="l" * 300, notice="n" * 300)
    console.until(lambda: "N" * 64 in console.window.banner.toolTip())
    assert console.window.banner.text().startswith("REAL   session NNN")
    assert console.window.width() == width


def test_smallest_window_shows_all_columns_of_the_attempts_and_long_advice(console: ConsoleRig) -> None:
    from netboard.windows.operator.window import SMALLEST

    console.server.attempts = attempts(8)
    console.show("running")
    console.window.resize(*SMALLEST)
    table = console.window.table
    console.until(lambda: console.window.width() == SMALLEST[0] and table.attempts.rowCount() == 8)
    assert table.horizontalHeader().length() <= table.viewport().width()
    alarm = console.window.alarm
    console.server.change(notice="the right device is lost; " * 9)
    console.until(lambda: "right device" in alarm.text())
    assert alarm.heightForWidth(alarm.width()) <= alarm.height()


@pytest.mark.parametrize(("state", "said"), [("stopped", "EMERGENCY STOP"), ("unrecorded", "NOT RECORDING")])
def test_smallest_window_shows_an_alarm_whole(console: ConsoleRig, state: str, said: str) -> None:
    from netboard.windows.operator.window import SMALLEST

    alarm = console.window.alarm
    console.window.resize(*SMALLEST)
    console.show(state)
    console.until(lambda: console.window.width() == SMALLEST[0] and said in alarm.text())
    assert alarm.heightForWidth(alarm.width()) <= alarm.height()


def test_problems_of_the_form_do_not_squeeze_its_fields(console: ConsoleRig) -> None:
    from netboard.windows.operator.window import SMALLEST

    form, name = console.window.form, console.window.form.texts["name"]
    console.show("unopened")
    console.window.resize(*SMALLEST)
    console.window.show_form(True)
    console.until(lambda: name.height() >= name.sizeHint().height())
    for text in form.texts.values():
        text.setText("Anna Bauer " * 5)
    form.send()
    console.app.processEvents()
    form.layout().activate()
    assert form.trouble.text().startswith("Session: found 'Anna Bauer")
    assert name.height() >= name.sizeHint().height()


def test_silent_server_turns_the_server_lamp_red_until_it_answers(console: ConsoleRig) -> None:
    lamp = console.window.session.widgets[0]
    console.until(lambda: lamp.lamp.level is LampLevel.GOOD)
    console.server.silent = True
    console.until(lambda: lamp.lamp.level is LampLevel.BAD)
    assert console.window.badge.text() == "LINK LOST"
    assert "NO REPLY" in console.window.alarm.text()
    enabled = {button.command.name for button in console.window.bar.buttons if button.isEnabled()}
    assert enabled == {"pause", "disarm", "note"}, "the others would be refused as late"
    assert {widget.lamp.level for widget in console.window.stations.columns["left"]} == {LampLevel.OFF}
    console.server.silent = False
    console.until(lambda: lamp.lamp.level is LampLevel.GOOD)
    assert console.window.badge.text() == "RUNNING"


def test_session_is_over_after_the_goodbye_until_the_next_server_answers(console: ConsoleRig) -> None:
    console.server.silent = True
    for peer in console.server._peers:
        console.server.router.send(peer, encode(Goodbye("the session is over")))
    console.until(lambda: console.window.badge.text() == "SESSION OVER")
    console.until(lambda: console.client.silence > SILENT)
    assert console.window.badge.text() == "SESSION OVER"
    console.server.silent = False
    console.until(lambda: console.window.badge.text() == "RUNNING")


def test_console_rejoins_a_server_that_has_forgotten_it(console: ConsoleRig) -> None:
    console.server._peers.clear()
    console.server.change(tick=RUNNING.tick + 77)
    console.until(lambda: console.window.state.status.tick == RUNNING.tick + 77)
    assert console.server.commands() == []
    console.press("F5")
    console.wait_for_command("pause")
    assert console.server.commands() == [("pause", "")]


def test_strip_charts_show_the_last_ten_seconds(app) -> None:
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
    assert len(strips._lines[0][0].getData()[0]) == 2, "an older tick restarts the chart: a replay was rewound"


def test_closing_the_window_during_a_block_needs_confirmation(console: ConsoleRig) -> None:
    assert not console.window.close()
    assert "once more" in console.window.reply.text()
    assert console.window.close()


@pytest.mark.parametrize("state", ["ready", "running"])
def test_screenshot_is_taken_at_the_first_status(app, server: ConsoleServer, tmp_path, state: str) -> None:
    from PySide6.QtCore import QTimer

    from netboard.base.errors import NetboardError
    from netboard.windows.operator.client import run

    server.show(state)
    turns = QTimer(interval=1)
    turns.timeout.connect(server.turn)
    turns.start()
    picture = tmp_path / "console.png"
    run(replace(Config(), network=server.network), lambda: False, picture)
    turns.stop()
    assert picture.read_bytes().startswith(b"\x89PNG")
    assert not any(window.isVisible() for window in app.topLevelWidgets()), "a window that is left takes the keys"
    with pytest.raises(NetboardError, match="exists"):
        run(Config(), lambda: True, picture)


def test_completion_times_of_ten_seconds_and_more_fit_into_their_column(console: ConsoleRig) -> None:
    table = console.window.table
    console.server.attempts = [attempts(1)[0]._replace(completion=seconds) for seconds in (9.5, 11.53, 3599.99)]
    console.show("running")
    console.until(lambda: table.attempts.rowCount() == 3)
    for row, column in product(range(3), range(5)):
        text = table.attempts.data(table.attempts.index(row, column))
        assert table.fontMetrics().horizontalAdvance(text) < table.columnWidth(column)
