"""The display of a station: views in, frames out.

The newest view wins; `netboard.windows.participant.showing` turns it into frames. If no view arrives within
`link_timeout_ms`, the window goes blank with a message; it recovers by itself when views arrive again. About twice a
second the client reports to the server which view was painted when. The server sends the configuration of board and
block, and sends it again with each block. Only `[display]` is taken from the local configuration, because it describes
this screen and this participant's language.

ZeroMQ's file descriptor is edge-triggered, so every signal drains the socket. A slow timer handles timeouts, greetings,
reports and answers, and drains the sockets too. Everything runs in Qt's thread.
"""

import logging
from collections.abc import Callable
from dataclasses import replace
from importlib.metadata import version
from pathlib import Path
from typing import TypeAlias

from PySide6.QtCore import QObject, QSocketNotifier, QTimer

from netboard.base.clock import now_ns
from netboard.base.config import Config, Side, parse
from netboard.base.errors import ConfigError, WireError
from netboard.base.process.resources import NAME
from netboard.base.tables.questionnaires import questions_of
from netboard.base.terminal.logs import RateLimitedLog
from netboard.base.tick import NEVER_NS
from netboard.network import keys
from netboard.network.protocol.codec import decode, encode
from netboard.network.protocol.joining import HELLO_INTERVAL_NS, Goodbye, Hello, Ping, Pong, Refusal, Welcome
from netboard.network.protocol.messages import PROTOCOL_VERSION, Message
from netboard.network.transport import channels, names, sockets
from netboard.stage.curtain import make_curtain
from netboard.stage.view import View
from netboard.windows.participant import window as windows
from netboard.windows.participant.block_form import BlockForm
from netboard.windows.participant.language import load_words
from netboard.windows.participant.markers import open_markers
from netboard.windows.participant.scene import DisplayPicture, extent
from netboard.windows.participant.screens import blank
from netboard.windows.participant.showing import PlayerInput, Showing
from netboard.windows.participant.window import BoardWindow, application

log = logging.getLogger(__name__)

PERIOD_MS = 50
"""Interval of the periodic work [ms]."""

REPORT_NS = 500_000_000
"""Interval between two reports of frames [ns]."""

Play: TypeAlias = Callable[[Side, Config, sockets.Context, BoardWindow], PlayerInput]
"""A function that makes the player of a side."""


class DisplayClient(QObject):
    """Connect one station to the server, and show the views in its window.

    Of the local `config`, only the address of the server and `[display]` are used once the server has sent its own.
    """

    def __init__(
        self,
        station: Side,
        config: Config,
        context: sockets.Context,
        window: BoardWindow,
        player: PlayerInput | None = None,
    ) -> None:
        super().__init__(window)
        self._words = load_words(config.display.language)
        markers = open_markers(config.display.markers, station, f"{config.network.host}:{config.network.port}")
        self.display = config.display
        self.station = station
        self.window = window
        self.showing = Showing(station, config, self._words, markers, window, player)
        self.tally = self.showing.tally
        if player is None:  # a player ends the display with one press of Esc
            window.in_trial = lambda: self.linked and self.showing.in_trial
        self.session = ""
        self.linked = False
        self._form = BlockForm(station, window, self._words)
        self._seen = False
        self._seq = 0
        self._over = False
        self._trouble = ""
        self._problems = RateLimitedLog(log)
        self._view_ns = self._hello_ns = self._report_ns = NEVER_NS
        self._link_timeout_ns = round(config.display.link_timeout_ms * 1e6)
        self._address = keys.reach(config.network, f"display.{station}")
        self._views = sockets.view_subscriber(context, self._address.reach(channels.VIEW[station]))
        control = self._address.reach(channels.CONTROL)
        self._control = sockets.control_client(context, control, f"display.{station}@{NAME}")
        handlers = ((self._views, self._take_views), (self._control, self._take_messages))
        self._notifiers = [self._notify(socket, handler) for socket, handler in handlers]
        self._periodic_timer = QTimer(self, interval=PERIOD_MS)
        self._periodic_timer.timeout.connect(self.work_periodically)
        self._periodic_timer.start()
        self.work_periodically()

    @property
    def config(self) -> Config:
        """The server's configuration of board and block; until it arrives, the local one."""
        return self.showing.config

    def _notify(self, socket: sockets.Socket, handler: Callable[[], None]) -> QSocketNotifier:
        """Call a handler whenever a socket may be readable."""
        notifier = QSocketNotifier(socket.fileno(), QSocketNotifier.Type.Read, self)
        notifier.activated.connect(handler)
        return notifier

    def close(self) -> None:
        """Report the last frames, send `Goodbye`, and close the sockets; a second call does nothing."""
        if self._views.closed:
            return
        self.linked = False
        self._periodic_timer.stop()
        for notifier in self._notifiers:
            notifier.setEnabled(False)
        if self.session:
            self._report()
            self._close_form()
            sockets.send(self._control, encode(Goodbye("the display was closed")))
        self._form.drop()
        self.showing.close()
        self._views.close()
        sockets.close_after_goodbye(self._control)

    # --- views -------------------------------------------------------------------------------------------------

    def _take_views(self) -> None:
        """Drain the view socket and show the newest view."""
        newest: View | None = None
        while (frame := sockets.receive(self._views)) is not None:
            message = self._decode(frame)
            if isinstance(message, View):
                newest = message
        if newest is None:
            return
        now = now_ns()
        try:
            self.showing.take(newest, now)
        except WireError as error:
            self._log_once(str(error))
            return
        self._view_ns = now
        if not self.linked:
            log.info("receiving views")
        self.linked = self._seen = True
        if newest.seq < self._seq:  # another server, which numbers its views from 0, and may have another board
            self.session = ""
            self._hello(now)
        if self.session:
            self._form.follow(newest)
        self._seq = newest.seq

    # --- control -----------------------------------------------------------------------------------------------

    def _take_messages(self) -> None:
        """Drain the control socket and handle the server's messages."""
        while (frame := sockets.receive(self._control)) is not None:
            match self._decode(frame):
                case Welcome(session=session, config=text):
                    self._welcome(session, text)
                case Ping(sent_ns=ping_ns):
                    received_ns = now_ns()
                    sockets.send(self._control, encode(Pong(ping_ns, received_ns, now_ns())))
                case Refusal(reason=reason):
                    self.session = ""
                    self._log_once(f"the server has refused this display: {reason}")
                case Goodbye(reason=reason):
                    self._close_form()
                    self.session = ""
                    self._over = True
                    log.info("the server has closed the connection: %s", reason)

    def _welcome(self, session: str, text: str) -> None:
        """Apply the server's configuration."""
        try:
            config = replace(parse(text, "the server's configuration"), display=self.display)
            questions = {} if self.station in make_curtain(config).away else questions_of(config.form)
        except ConfigError as error:
            self._log_once(str(error))
            return
        if session != self.session:
            log.info("connected to session %s", session)
        self.session = session
        self._trouble = ""
        self._over = False
        if config != self.config:
            self.showing.config = config
            self._measure(config)
        self._form.begin_block(session, config.block.number, questions)

    def _measure(self, config: Config) -> None:
        """Warn if the board at its true size is wider than the window."""
        room, wanted = self.window.board.metres_across, extent(config)[0]
        if self.display.mm_per_pixel > 0 and room < wanted:
            log.warning(
                "the window is %.0f mm wide but the board needs %.0f mm: its ends may be outside",
                room * 1e3,
                wanted * 1e3,
            )

    def _decode(self, frame: bytes) -> Message | None:
        """Decode a frame; log one that breaks the protocol and return None."""
        try:
            return decode(frame)
        except WireError as error:
            self._log_once(str(error))
            return None

    def _log_once(self, trouble: str) -> None:
        """Log a problem once, and keep it to be shown while there is no view."""
        if trouble != self._trouble:
            self._problems.log(trouble)
            self._trouble = trouble

    def _hello(self, now: int) -> None:
        self._hello_ns = now
        details = {"refresh_hz": f"{self.showing.refresh_hz:.2f}", "platform": application().platformName()}
        hello = Hello("display", self.station, PROTOCOL_VERSION, NAME, version("netboard"), details)
        sockets.send_or_renew(self._control, encode(hello))
        if not self.linked:
            sockets.renew(self._views)

    def _close_form(self) -> None:
        """Send what was filled in: the session does not go on, or not at this display."""
        self._form.close()
        self._send_answers()

    def _send_answers(self) -> None:
        self._form.send(lambda frame: sockets.send(self._control, frame))

    def _report(self) -> None:
        frames = self.tally.report()
        if frames is not None and sockets.send(self._control, encode(frames)):
            self.tally.clear()

    # --- periodic work -----------------------------------------------------------------------------------------

    def work_periodically(self) -> None:
        """Do the periodic work: drain the sockets, send `Hello`, report frames, detect a lost link."""
        self._take_views()
        self._take_messages()
        now = now_ns()
        self.showing.read_refresh_rate()
        if now - self._view_ns > self._link_timeout_ns:
            self._blank()
        if (not self.session or not self.linked) and now - self._hello_ns >= HELLO_INTERVAL_NS:
            self._hello(now)
        if self.session:
            self._send_answers()
        if self.session and now - self._report_ns >= REPORT_NS:
            self._report_ns = now
            self._report()

    def _blank(self) -> None:
        """Show why there is no view."""
        if self.linked:
            log.warning("no view for %.1f s", self._link_timeout_ns * 1e-9)
        self.linked = False
        self._form.hide()
        self.showing.blank(self._why())

    def _why(self) -> DisplayPicture:
        """Return the picture that says why there is no view."""
        words = self._words
        if self._over:
            return blank(self.config, words, words.over, over=True)
        named = words.server.format(host=self._address.host, port=self._address.port)
        server = names.trouble(self._address.host) or named
        if self._seen:
            return blank(self.config, words, words.lost, self._trouble or server, lost=True)
        return blank(self.config, words, words.waiting, self._trouble or server)


def run(
    config: Config,
    station: Side,
    stopping: Callable[[], bool],
    picture: Path | None = None,
    after: float | None = None,
    play: Play | None = None,
) -> None:
    """Run the display of a station until its window is closed or the process is asked to stop.

    A screenshot is taken `after` seconds after the first painted view, or at the end; without a delay, it is taken at
    the first painted view and the display ends. `play` makes the player, if this display is also the input of its side.
    """
    windows.require_new(picture)
    application()
    window = BoardWindow(f"netboard: {station} station")
    window.present(config.display, alone=config.stations.left != config.stations.right)
    with sockets.open_context() as context:
        player = None if play is None else play(station, config, context, window)
        client = DisplayClient(station, config, context, window, player)
        screenshot_timer = windows.ScreenshotTimer(window, picture, after, lambda: client.tally.painted, config.network)
        windows.run(window, stopping, screenshot_timer.poll)
        screenshot_timer.take()
        client.close()
    window.close()
    log.info("%d frames painted, %d dropped", client.tally.painted, client.tally.dropped)
    screenshot_timer.finish()
