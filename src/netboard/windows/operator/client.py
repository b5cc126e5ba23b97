"""The console's control client: it shows the server's status in the window and sends the operator's commands.

It polls the server about fifteen times a second. If the connection cannot continue (another version of the server, or a
restarted server that does not know this console), the client shows the reason and reconnects a second later. An
emergency stop is sent at once, and again at every poll until the server confirms it.
"""

import logging
from collections.abc import Callable
from dataclasses import replace
from importlib.metadata import version
from math import inf
from pathlib import Path

from PySide6.QtCore import QObject, QTimer

from netboard.base.clock import now_ns
from netboard.base.config import Config, parse
from netboard.base.errors import ConfigError, NetboardError
from netboard.base.looks import ThemeName
from netboard.base.process.resources import NAME
from netboard.network.protocol.control import Reply, Status
from netboard.network.transport import sockets
from netboard.nodes.operator.operator import ANSWER_SECONDS, Operator
from netboard.nodes.ports.emergency import AWAITING_RELEASE, RELEASE, STOP
from netboard.task.trials.exclusion import rule_of
from netboard.windows.operator.changes import RecentCounts, StatusHistory
from netboard.windows.operator.commands import COMMANDS, CONFIRMING, RELEASING
from netboard.windows.operator.lamps import ended, limits_of
from netboard.windows.operator.window import SMALLEST, ConsoleWindow, State
from netboard.windows.operator.words import Tone, TonedText
from netboard.windows.participant import window as windows
from netboard.windows.style import choose_theme

POLL_MS = 66
"""Interval between two polls of the server [ms]."""

RENEW_S = 1.0
"""Delay before reconnecting after a refusal [s]."""

CONFIRM_S = 0.5
"""Timeout for the confirmation of an emergency stop [s]."""

LABELS = {STOP: "EMERGENCY STOP", **{command.name: command.label for command in (*COMMANDS, RELEASING, CONFIRMING)}}

log = logging.getLogger(__name__)


class ConsoleClient(QObject):
    """Connect a console window to a server."""

    def __init__(self, config: Config, context: sockets.Context, window: ConsoleWindow) -> None:
        super().__init__(window)
        self._config, self._context, self._window = config, context, window
        self._operator: Operator | None = Operator(config.network, context)
        self._history, self._recent = StatusHistory(), RecentCounts()
        self.status: Status | None = None
        self._server_config: tuple[str, Config | None] = ("", None)
        self._last_message_ns = self._renew_ns = 0
        self._stop_ns: int | None = None
        self._asked: dict[int, tuple[str, str, int]] = {}
        window.commanded.connect(self.do)
        self._timer = QTimer(self, interval=POLL_MS)
        self._timer.timeout.connect(self.poll)
        self._timer.start()

    def do(self, name: str, argument: str = "") -> None:
        """Send a command to the server."""
        if name == STOP and self._stop_ns is None:
            self._stop_ns = now_ns()
        elif name == RELEASE:
            self._stop_ns = None
        if self._operator is None:
            self._fail(name, argument, ": no connection to the server")
            return
        self._asked[self._operator.command(name, argument)] = (name, argument, now_ns())
        log.info("%s %s", name, argument)
        self._window.say(TonedText(f"{LABELS[name]}: sent", Tone.QUIET))

    def poll(self) -> None:
        """Poll the server, and show the state."""
        if self._operator is None and now_ns() - self._renew_ns > RENEW_S * 1e9:
            self._operator = Operator(self._config.network, self._context)
        if self._operator is not None:
            try:
                self._update(self._operator)
            except NetboardError as error:
                self._lose(str(error))
        self._window.show_state(self._state())

    def leave(self) -> None:
        """Take leave of the server and close the connection."""
        self._timer.stop()
        if self._operator is not None:
            self._operator.leave()
            self._operator = None

    @property
    def silence(self) -> float:
        """Time since the last status; infinite before the first [s]."""
        return (now_ns() - self._last_message_ns) * 1e-9 if self._last_message_ns else inf

    def _state(self) -> State:
        late = self._stop_ns is not None and now_ns() - self._stop_ns > CONFIRM_S * 1e9
        operator, status = self._operator, self.status
        if status is not None:
            status = ended(status, self.silence, operator is not None and operator.over)
        attempts = [] if operator is None else operator.attempts
        points = [] if operator is None else operator.points
        config = self._configured("" if operator is None else operator.config)
        shown = State(status, self.silence, self._recent, late, attempts, points)
        if config is None:
            return shown
        return replace(shown, session=config.session, block=config.block, rule=rule_of(config))

    def _configured(self, text: str) -> Config | None:
        """Return the server's configuration of the block; None if this version cannot read it."""
        if text and text != self._server_config[0]:
            self._server_config = text, _read(text)
        return self._server_config[1]

    def _update(self, operator: Operator) -> None:
        status = operator.poll()
        if status is not None:
            self.status, self._last_message_ns = status, now_ns()
            self._recent = self._history.add(now_ns() * 1e-9, status)
            if AWAITING_RELEASE in status.waiting_for:
                self._stop_ns = None
        for number, (name, argument, asked_ns) in list(self._asked.items()):
            reply = operator.reply(number)
            if reply is not None:
                del self._asked[number]
                self._answered(name, argument, reply)
            elif now_ns() - asked_ns > ANSWER_SECONDS * 1e9:
                del self._asked[number]
                self._fail(name, argument, ": no reply from the server")
        if self._stop_ns is not None:
            operator.command(STOP)

    def _fail(self, name: str, argument: str, why: str) -> None:
        """Show why a command has failed; a note goes back into its field."""
        self._window.say(TonedText(f"{LABELS[name]}{why}", Tone.BAD))
        if name == "note":
            self._window.note.put_back(argument)

    def _answered(self, name: str, argument: str, reply: Reply) -> None:
        """Show the server's reply; a refused form shows the reason itself."""
        reason = f": {reply.reason}" if reply.reason else ""
        if reply.accepted:
            self._window.say(TonedText(f"{LABELS[name]}{reason or ': done'}", Tone.GOOD))
        else:
            self._fail(name, argument, f" was refused{reason}")
        if name == STOP and not reply.accepted:  # as by a replay: it must not stop the next session
            self._stop_ns = None
        if name == "open":
            if reply.accepted:
                self._window.show_form(False)
            else:
                self._window.form.show_problem(f"The server refused the form{reason}")

    def _lose(self, trouble: str) -> None:
        """Close a connection that cannot continue, and show why."""
        log.warning("%s", trouble)
        self._window.say(TonedText(trouble, Tone.BAD))
        if self._operator is not None:
            self._operator.leave()
            self._operator = None
        for name, argument, _ in self._asked.values():
            if name == "note":
                self._window.note.put_back(argument)
        self._asked.clear()
        self._renew_ns = now_ns()


def _read(text: str) -> Config | None:
    """Read the server's configuration; return None if this version cannot read it."""
    try:
        return parse(text, "the server's configuration")
    except ConfigError as error:
        log.warning("the console shows its own settings: %s", error)
        return None


def run(
    config: Config,
    stopping: Callable[[], bool],
    picture: Path | None = None,
    after: float | None = None,
    theme: ThemeName = "system",
) -> None:
    """Run the console until its window is closed or the process is asked to stop.

    A screenshot is taken `after` seconds after the first status, and the console goes on; without a delay, it is taken
    at the first status and the console ends.
    """
    windows.require_new(picture)
    windows.scale_to_screen(*SMALLEST)
    windows.application()
    choose_theme(theme)
    window = ConsoleWindow(config, limits_of(config, version("netboard")), NAME)
    window.resize(window.size().boundedTo(windows.largest_size(windows.screen_of(window))))
    window.show()
    with sockets.open_context() as context:
        client = ConsoleClient(config, context, window)
        screenshot_timer = windows.ScreenshotTimer(window, picture, after, lambda: client.status, config.network)
        windows.run(window, stopping, screenshot_timer.poll)
        screenshot_timer.take()
        client.leave()
    window.hide()  # closing it during a block would have to be confirmed
    screenshot_timer.finish()
