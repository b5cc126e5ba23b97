"""The loop of a trigger box: it sleeps until a trigger arrives, a pulse begins or ends, or the input has something.

A trigger is written as soon as it is received; reports and reconnections come after. A box that is lost is opened again
once a second, and the session goes on meanwhile: each trigger without a pulse is reported with the reason.
"""

import logging
from collections.abc import Callable

from netboard.base.clock import now_ns
from netboard.base.errors import DeviceError
from netboard.base.process.realtime import steady_loop
from netboard.base.process.resources import NAME
from netboard.base.tables.rig import Network
from netboard.devices.triggers.box import NO_FILE, TriggerBox
from netboard.devices.triggers.pulses import Pulses
from netboard.network import keys
from netboard.network.protocol.joining import Goodbye, Welcome
from netboard.network.protocol.messages import Message
from netboard.network.protocol.triggers import BoxState, InputPulse, PulseReport, Trigger
from netboard.network.transport import channels, poller, sockets
from netboard.nodes.logger.log_link import Connection, LogEndpoint

log = logging.getLogger(__name__)

RETRY_NS = 1_000_000_000
"""Interval at which a box that is not there is looked for [ns]."""

MAX_INPUT_PER_SECOND = 20
"""Input pulses reported in a second; a line that floats gives thousands, and must not crowd out other reports [1]."""

SECOND_NS = 1_000_000_000


class TriggerLink:
    """The control channel over a ZeroMQ socket, which the input of a box and the next pulse wake, too."""

    def __init__(self, network: Network, context: sockets.Context) -> None:
        endpoint = keys.reach(network, "trigger").reach(channels.CONTROL)
        self._socket = sockets.control_client(context, endpoint, f"trigger@{NAME}")
        self._waiter = poller.Waiter((self._socket,))
        self.input = NO_FILE
        self.wake_ns: int | None = None  # when the next pulse begins or ends

    def wait(self, seconds: float) -> bool:
        """Wait until a frame or an input can be read, a pulse is due, or the timeout [s]."""
        if self.wake_ns is not None:
            seconds = min(seconds, max(self.wake_ns - now_ns(), 0) * 1e-9)
        self._waiter.others = () if self.input == NO_FILE else (self.input,)
        return self._waiter.wait(seconds)

    def receive(self) -> bytes | None:
        """Return the next frame, or None if there is none now."""
        return sockets.receive(self._socket)

    def send(self, frame: bytes) -> bool:
        """Send without waiting; return False if no peer is connected."""
        return sockets.send_or_renew(self._socket, frame)


class TriggerNode:
    """Runs one box. ``clock``: monotonic time [ns]."""

    def __init__(self, box: TriggerBox, link: LogEndpoint, clock: Callable[[], int] = now_ns) -> None:
        self.made = self.failed = 0
        self._box, self._link, self._clock = box, link, clock
        self._server = Connection(link, "trigger", {"box": box.text}, clock)
        self._pulses = Pulses(box.settings)
        self._received: dict[int, int] = {}  # when each trigger that is not reported yet was received [ns]
        self._open = False
        self._trouble = "not opened yet"
        self._retry_ns = self._second_ns = clock()
        self._reported_inputs = 0  # since the beginning of this second

    def run(self, stopping: Callable[[], bool]) -> None:
        """Serve triggers until stopped; the lines are low afterwards, also after an error."""
        steady_loop()
        try:
            self._look_for_box()
            while not stopping():
                self.step()
            self._server.send(Goodbye("the trigger box was stopped"))
        finally:
            self._close_box()

    def step(self) -> None:
        """Wait for what comes next, and handle it."""
        if isinstance(self._link, TriggerLink):
            self._link.input = self._box.file if self._open else NO_FILE
            self._link.wake_ns = self._pulses.wake_ns() if self._open else None
        for message in self._server.messages():
            self._handle(message)
        if self._open:
            self._take_input()
            self._make_pulses()
        self._report()
        if not self._open and self._clock() >= self._retry_ns:
            self._look_for_box()

    def _handle(self, message: Message | None) -> None:
        match message:
            case Trigger():
                received_ns = self._clock()
                self._received[message.number] = received_ns
                self._pulses.want(message.number, message.code, received_ns)
                if self._open:
                    self._make_pulses()
                else:
                    self._pulses.fail(self._trouble)
            case Welcome():
                self._server.welcomed = True
                self._say_state()
            case Goodbye(reason=reason):
                log.info("the server ended the connection: %s", reason)
                self._server.welcomed = False

    def _make_pulses(self) -> None:
        """Write the codes that are due."""
        while self._open and (code := self._pulses.due(self._clock())) is not None:
            before_ns = self._clock()
            if self._try(lambda code=code: self._box.write(code)):  # type: ignore[misc]
                self._pulses.wrote(before_ns, self._clock())
        self._pulses.expire(self._clock())

    def _take_input(self) -> None:
        """Read the input: the edge of a pulse, or a pulse of another machine."""
        found = bytearray()
        self._try(lambda: found.extend(self._box.read()))
        for code in found:
            time_ns = self._clock()
            if not self._pulses.edge(time_ns):
                self._report_input(InputPulse(code, time_ns))

    def _report_input(self, pulse: InputPulse) -> None:
        """Send a pulse of another machine, or only count it if there were too many in this second."""
        if pulse.time_ns - self._second_ns >= SECOND_NS:
            self._second_ns, self._reported_inputs = pulse.time_ns, 0
        if self._reported_inputs < MAX_INPUT_PER_SECOND:
            self._reported_inputs += 1
            self._server.send(pulse)
        else:
            self._server.problems.log(
                f"an input pulse was not reported, after {MAX_INPUT_PER_SECOND} in a second: does the input line float?"
            )

    def _report(self) -> None:
        done, self._pulses.done = self._pulses.done, []
        for pulse in done:
            self.failed, self.made = self.failed + bool(pulse.fault), self.made + (not pulse.fault)
            received_ns = self._received.pop(pulse.number, pulse.wanted_ns)
            times = received_ns, pulse.began_ns, pulse.ended_ns, pulse.edge_ns, pulse.waited_ns
            self._server.send(PulseReport(pulse.number, *times, pulse.fault))

    # --- the box -------------------------------------------------------------------------------------------------

    def _look_for_box(self) -> None:
        """Try to open the box."""
        self._retry_ns = self._clock() + RETRY_NS
        try:
            self._box.open()
        except DeviceError as error:
            if str(error) != self._trouble:
                log.error("%s; trying again every second", error)
                self._trouble = str(error)
                self._say_state()
            return
        self._open, self._trouble = True, ""
        log.info("%s: ready", self._box.text)
        self._say_state()

    def _try(self, action: Callable[[], object]) -> bool:
        """Use the box; if that fails, it is lost. Return whether it succeeded."""
        try:
            action()
        except DeviceError as error:
            self._lose(str(error))
            return False
        return True

    def _lose(self, reason: str) -> None:
        log.error("%s; trying again every second", reason)
        self._close_box()
        self._trouble = reason
        self._pulses.fail(reason)
        self._retry_ns = self._clock() + RETRY_NS
        self._say_state()

    def _close_box(self) -> None:
        """Close the box if it is open, with its lines low as far as it takes that."""
        try:
            if self._open:
                self._box.lower()
        finally:
            self._open = False
            self._box.close()

    def _say_state(self) -> None:
        self._server.send(BoxState(self._open, self._box.text, self._box.simulated, self._trouble))
