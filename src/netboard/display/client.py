"""The display of a station: views in, frames out.

The newest view wins. It is painted as soon as it comes, but not more often than the screen refreshes; a view that
changes nothing on the screen is not painted at all. Without views for the configured time the window goes blank and
says so, and it recovers by itself when they are back. About twice a second the server is told which view was painted
when.

ZeroMQ's file descriptor signals changes only, so every signal drains the socket; a slow round looks after what must be
done by the clock, and drains too. Everything runs in Qt's thread.
"""

import logging
from collections.abc import Callable
from importlib.metadata import version
from pathlib import Path

from PySide6.QtCore import QObject, QSocketNotifier, Qt, QTimer

from netboard import keys, sockets
from netboard.clock import now_ns
from netboard.config import Config, Side, parse
from netboard.display.frames import FrameTally
from netboard.display.scene import Picture, blank, compose
from netboard.display.widget import screenshot
from netboard.display.window import BoardWindow, application, screen_of
from netboard.errors import ConfigError, NetboardError, WireError
from netboard.process import NAME, Seldom
from netboard.wire.codec import decode, encode
from netboard.wire.messages import PROTOCOL_VERSION, Goodbye, Hello, Message, Ping, Pong, Refusal, View, Welcome

log = logging.getLogger(__name__)

ROUND_MS = 50
HELLO_NS = 500_000_000
REPORT_NS = 500_000_000
DEFAULT_REFRESH_HZ = 60.0
SOON = 0.15
"""A frame due within this share of a refresh is painted at once [1]."""


class DisplayClient(QObject):
    """One station's connection to the server, and what its window shows.

    Parameters
    ----------
    station : str
        ``left`` or ``right``.
    config : Config
        The local configuration: where the server is and how the window looks. What the board looks like is taken from
        the server's, as soon as it is known.
    context : zmq.Context
        Where the sockets are made.
    window : BoardWindow
        Where it is shown.
    """

    def __init__(self, station: Side, config: Config, context: sockets.Context, window: BoardWindow) -> None:
        super().__init__(window)
        self.station = station
        self.config = config
        self.window = window
        self.session = ""
        self.linked = False
        self._seen = False
        self._over = False
        self._trouble = ""
        self._said = Seldom(log)
        self._pending: tuple[Picture, int, int] | None = None
        self._view_ns = self._hello_ns = self._report_ns = self._shown_ns = -(2**62)
        self._link_timeout_ns = round(config.display.link_timeout_ms * 1e6)
        self._refresh_ns = round(1e9 / DEFAULT_REFRESH_HZ)
        self.tally = FrameTally(station, self._refresh_ns)
        self._address = keys.reach(config.network, f"display.{station}")
        self._views = sockets.view_subscriber(context, self._address.reach(sockets.VIEW[station]))
        self._control = sockets.control_client(
            context, self._address.reach(sockets.CONTROL), f"display.{station}@{NAME}"
        )
        self._notifiers = [self._notify(self._views, self._take_views), self._notify(self._control, self._take_words)]
        self._turn = QTimer(self, singleShot=True, timerType=Qt.TimerType.PreciseTimer)
        self._turn.timeout.connect(self._paint_pending)
        self._round = QTimer(self, interval=ROUND_MS)
        self._round.timeout.connect(self.look_after)
        self._round.start()
        window.board.painted.connect(self._painted)
        self.look_after()

    def _notify(self, socket: sockets.Socket, slot: Callable[[], None]) -> QSocketNotifier:
        """Call `slot` whenever something may have happened on a socket."""
        notifier = QSocketNotifier(socket.fileno(), QSocketNotifier.Type.Read, self)
        notifier.activated.connect(slot)
        return notifier

    def close(self) -> None:
        """Report the last frames, say goodbye, and close the sockets; a second time does nothing."""
        if self._views.closed:
            return
        self._round.stop()
        self._turn.stop()
        for notifier in self._notifiers:
            notifier.setEnabled(False)
        if self.session:
            self._report()
            sockets.send(self._control, encode(Goodbye("the display was closed")))
        self._views.close()
        sockets.close_after_goodbye(self._control)

    # --- views -------------------------------------------------------------------------------------------------

    def _take_views(self) -> None:
        """Show the newest of the views that have come."""
        newest: View | None = None
        while (frame := sockets.receive(self._views)) is not None:
            message = self._decode(frame)
            if isinstance(message, View):
                newest = message
                self.tally.receive(message.tick)
        if newest is None:
            return
        try:
            picture = compose(newest, self.config)
        except WireError as error:
            self._complain(str(error))
            return
        self._view_ns = now_ns()
        if not self.linked:
            log.info("views are coming")
        self.linked = self._seen = True
        self._plan(picture, newest.tick, self._view_ns)

    def _plan(self, picture: Picture, tick: int, received_ns: int) -> None:
        """Paint a picture at once if it is its turn, else when it is; the newest takes the turn."""
        self._pending = None if picture == self.window.board.picture else (picture, tick, received_ns)
        remaining = self._shown_ns + self._refresh_ns - received_ns
        if remaining <= SOON * self._refresh_ns:
            self._paint_pending()
        elif not self._turn.isActive():
            self._turn.start(-(-remaining // 1_000_000))

    def _paint_pending(self) -> None:
        """Hand the pending picture to the window."""
        if self._pending is None:
            return
        picture, tick, received_ns = self._pending
        self._pending = None
        self._turn.stop()
        self._shown_ns = now_ns()
        self.tally.wait(tick, received_ns)
        self.window.board.show_picture(picture)

    def _painted(self) -> None:
        """Count a frame."""
        self.tally.paint(now_ns())

    # --- control -----------------------------------------------------------------------------------------------

    def _take_words(self) -> None:
        """Hear what the server says on the control channel."""
        while (frame := sockets.receive(self._control)) is not None:
            match self._decode(frame):
                case Welcome(session=session, config=text):
                    self._welcome(session, text)
                case Ping(sent_ns=ping_ns):
                    received_ns = now_ns()
                    sockets.send(self._control, encode(Pong(ping_ns, received_ns, now_ns())))
                case Refusal(reason=reason):
                    self.session = ""
                    self._complain(f"the server refuses this display: {reason}")
                case Goodbye(reason=reason):
                    self.session = ""
                    self._over = True
                    log.info("the server says goodbye: %s", reason)

    def _welcome(self, session: str, text: str) -> None:
        """Take over the server's configuration."""
        try:
            self.config = parse(text, "the server's configuration")
        except ConfigError as error:
            self._complain(str(error))
            return
        if session != self.session:
            log.info("welcomed by session %s", session)
        self.session = session
        self._trouble = ""
        self._over = False

    def _decode(self, frame: bytes) -> Message | None:
        """Decode a frame; what breaks the protocol is said and left out."""
        try:
            return decode(frame)
        except WireError as error:
            self._complain(str(error))
            return None

    def _complain(self, trouble: str) -> None:
        """Say a trouble once, and have it shown while there is nothing else to show."""
        if trouble != self._trouble:
            self._said.say(trouble)
            self._trouble = trouble

    def _hello(self) -> None:
        """Ask to be welcomed."""
        details = {"refresh_hz": f"{1e9 / self._refresh_ns:.2f}", "platform": application().platformName()}
        hello = Hello("display", self.station, PROTOCOL_VERSION, NAME, version("netboard"), details)
        sockets.send_or_renew(self._control, encode(hello))
        if not self.linked:
            sockets.renew(self._views)

    def _report(self) -> None:
        """Tell the server which frames were shown."""
        frames = self.tally.report()
        if frames is not None and sockets.send(self._control, encode(frames)):
            self.tally.clear()

    # --- by the clock ------------------------------------------------------------------------------------------

    def look_after(self) -> None:
        """Do what must be done by the clock: greet, report, notice a lost link."""
        self._take_views()
        self._take_words()
        now = now_ns()
        self._pace()
        if now - self._view_ns > self._link_timeout_ns:
            self._blank()
        if (not self.session or not self.linked) and now - self._hello_ns >= HELLO_NS:
            self._hello_ns = now
            self._hello()
        if self.session and now - self._report_ns >= REPORT_NS:
            self._report_ns = now
            self._report()

    def _pace(self) -> None:
        """Follow the refresh rate of the screen the window is on."""
        rate = screen_of(self.window).refreshRate()
        self._refresh_ns = round(1e9 / (rate if rate > 1 else DEFAULT_REFRESH_HZ))
        self.tally.period_ns = max(self._refresh_ns, round(1e9 / self.config.network.view_rate_hz))

    def _blank(self) -> None:
        """Show that there is nothing to show, and why."""
        if self.linked:
            log.warning("no view for %.1f s", self._link_timeout_ns * 1e-9)
        self.linked = False
        self._pending = None
        self.window.board.show_picture(self._words())

    def _words(self) -> Picture:
        """Say why there is no view."""
        if self._over:
            return blank(self.config, "The session is over")
        waiting = self._trouble or f"Waiting for the server at {self._address.host}:{self._address.port}"
        if self._seen:
            return blank(self.config, "Connection lost", waiting, lost=True)
        return blank(self.config, "Waiting for the experiment", waiting)


class _Photographer(QObject):
    """Takes one screenshot of a window once the participant has seen the board for a while."""

    def __init__(self, client: DisplayClient, path: Path, after: float, done: Callable[[], None]) -> None:
        super().__init__(client)
        self._client = client
        self._path = path
        self._done = done
        self.error: NetboardError | None = None
        self.taken = False
        self._delay = QTimer(self, singleShot=True, interval=round(after * 1000))
        self._delay.timeout.connect(self.take)
        client.window.board.painted.connect(self._look)

    def _look(self) -> None:
        """Start the delay at the first painted view."""
        if self._client.tally.painted and not self.taken and not self._delay.isActive():
            self._delay.start()

    def take(self) -> None:
        """Take the screenshot, unless it has been taken or there is nothing to be seen."""
        if self.taken or not self._client.tally.painted:
            return
        self.taken = True
        self._delay.stop()
        try:
            screenshot(self._client.window, self._path)
        except NetboardError as error:
            self.error = error
        self._done()


def run(
    config: Config,
    station: Side,
    stopping: Callable[[], bool],
    picture: Path | None = None,
    after: float | None = None,
) -> None:
    """Run the display of a station until its window is closed or the process is asked to stop.

    Parameters
    ----------
    config : Config
        The local configuration.
    station : str
        ``left`` or ``right``.
    stopping : callable
        Whether the process has been asked to stop; asked some twenty times a second.
    picture : Path, optional
        Where a screenshot goes.
    after : float, optional
        Take it so long after the first painted view, or at the end if that comes before, and go on. Without it, take
        it at the first painted view and stop [s].

    Raises
    ------
    NetboardError
        If the screenshot exists already or cannot be written.
    """
    if picture is not None and picture.exists():
        raise NetboardError(f"{picture} exists; a screenshot never overwrites a file")
    app = application()
    window = BoardWindow(f"netboard: {station} station")
    window.present(config.display)
    with sockets.open_context() as context:
        client = DisplayClient(station, config, context, window)
        photographer = None
        if picture is not None:
            done = (lambda: None) if after is not None else app.quit
            photographer = _Photographer(client, picture, after or 0.0, done)
        watch = QTimer(window, interval=ROUND_MS)
        watch.timeout.connect(lambda: app.quit() if stopping() else None)
        watch.start()
        window.closed.connect(app.quit)
        app.exec()
        watch.stop()
        if photographer is not None:
            photographer.take()
        client.close()
    window.close()
    log.info("%d frames painted, %d dropped", client.tally.painted, client.tally.dropped)
    if photographer is not None and photographer.error is not None:
        raise photographer.error
