"""The agent: one loop that owns one device.

Each millisecond it reads the stylus and sends it. As soon as a force comes back, and at the latest before the next
millisecond, the safety chain turns it into what the device may render. The agent trusts nobody: without fresh messages
the force fades, and on every way out the device gets zero force first.

Its milliseconds follow the server's ticks: the server says how long before the tick's deadline a sample came, and the
agent moves its phase, slowly, until that is `LEAD_NS`. So a sample waits for nothing but the other side's.
"""

import logging
from collections.abc import Callable
from importlib.metadata import version
from typing import Any, Protocol

import numpy as np

from netboard import fastpath, keys, sockets
from netboard.clock import Pacer, now_ns
from netboard.compiled import kernel
from netboard.config import Config, Side
from netboard.devices.base import Device, DeviceInfo, Reading
from netboard.devices.fixture import lateral_force
from netboard.devices.safety import Guard, Safety
from netboard.errors import WireError
from netboard.process import NAME, Seldom, steady_loop
from netboard.tick import TICK_NS
from netboard.wire import fixed
from netboard.wire.codec import decode, encode
from netboard.wire.messages import PROTOCOL_VERSION, Beat, Force, Goodbye, Hello, Refusal, Stylus, Welcome

log = logging.getLogger(__name__)

HELLO_NS = 500_000_000
"""Hello is said again after so long without a word from the server [ns]."""

REMEMBERED = 256
"""Samples whose time of reading is remembered [1]."""

LEAD_NS = 300_000
"""A sample shall come so long before its tick's deadline: enough for most of what delays one [ns]."""

SHIFT_SHARE = 0.02
"""Share of the error by which the phase is moved with each message [1]."""

LARGEST_SHIFT_NS = 5_000
"""The phase is moved by at most so much in a tick: the interval of the samples stays 1 ms within 0.5 % [ns]."""

_FORCE, _STYLUS = fixed.packer_of(Force), fixed.packer_of(Stylus)

FORCE_CAME = -4
"""What `hear` returns for a force in its fixed form, beside what `netboard.fastpath.hear` does [1]."""


@kernel
def hear(fast: Any, frame: Any, head: Any, markers: Any, words: Any) -> int:
    """Receive one frame: `FORCE_CAME` for a force in its fixed form, whose numbers are in the words then.

    Parameters
    ----------
    fast : ndarray of netboard.fastpath.FAST_PATH, shape (1,)
        The fast path to the server.
    frame : ndarray of uint8
        Room for the frame.
    head, markers : ndarray of uint8
        The form of a `Force`.
    words : ndarray of int64, shape (5,)
        Room for its numbers.
    """
    size = fastpath.hear(fast, frame)
    return FORCE_CAME if size >= 0 and fixed.read(frame[:size], head, markers, words) else size


@kernel
def say(fast: Any, frame: Any, head: Any, markers: Any, words: Any) -> int:
    """Send a sample, as `netboard.fastpath.say` does.

    Parameters
    ----------
    fast : ndarray of netboard.fastpath.FAST_PATH, shape (1,)
        The fast path to the server.
    frame : ndarray of uint8
        Room for the frame, and no more.
    head, markers : ndarray of uint8
        The form of a `Stylus`.
    words : ndarray of int64
        Its numbers.
    """
    fixed.write(frame, head, markers, words)
    return fastpath.say(fast, frame)


def phase_shift(lead_ns: int) -> int:
    """How much later the next sample shall be, for one that came so long before its deadline [ns]."""
    error = (lead_ns - LEAD_NS + TICK_NS // 2) % TICK_NS - TICK_NS // 2
    return min(max(round(SHIFT_SHARE * error), -LARGEST_SHIFT_NS), LARGEST_SHIFT_NS)


class Companion(Protocol):
    """What lives with the device in the agent's process: the simulated person who holds a virtual stylus."""

    def step(self, now_ns: int, haptics: bool) -> None:
        """Live for a millisecond; `haptics` tells whether the hand is given forces at all."""


class Link:
    """The agent's end of the motion channel: hello until welcomed, the newest force, and when things were sent.

    Parameters
    ----------
    socket : zmq.Socket
        DEALER of the motion channel.
    hello : Hello
        How the agent introduces itself.
    timeout_ns : int
        An answer to an older sample than this is not fresh [ns].

    Attributes
    ----------
    sample : ndarray of int64
        What `send` sends: the words of a `Stylus`.
    newest : Force or Beat or None
        What the server said last.
    heard_ns : int
        When that was received, 0 for never [ns].
    received_ns : int or None
        When the server last said something fresh [ns].
    """

    def __init__(self, socket: sockets.Socket, hello: Hello, timeout_ns: int) -> None:
        self.newest: Force | Beat | None = None
        self.received_ns: int | None = None
        self._timeout_ns = timeout_ns
        self.heard_ns = self._sent = 0
        self.loop_ns = 0
        self._socket = socket
        self._fast = fastpath.FastPath(socket)
        self._heard = np.zeros(sockets.LARGEST_FRAME, np.uint8)
        self._force = np.zeros(len(fixed.FORCE.markers), np.int64)
        self._said = np.zeros(fixed.STYLUS.size, np.uint8)
        self.sample = np.zeros(len(fixed.STYLUS.markers), np.int64)
        self._hello = encode(hello)
        self._session = ""
        self._said_hello_ns = -HELLO_NS
        self._stamps = [0] * REMEMBERED
        self._looped = -1
        self._refused = ""
        self._nonsense = Seldom(log)

    def warm(self) -> None:
        """Compile (or load) what sends and receives, so that the first tick is not late."""
        nowhere = fastpath.FastPath(None).record
        hear(nowhere, self._heard, *fixed.FORCE[:2], self._force)
        say(nowhere, self._said, *fixed.STYLUS[:2], self.sample)

    def send(self, seq: int, stamp_ns: int) -> None:
        """Send the sample, of this number and time, and a hello first where the server is silent."""
        if stamp_ns - max(self.heard_ns, self._said_hello_ns) >= HELLO_NS:
            self._said_hello_ns = stamp_ns
            sockets.send_or_renew(self._socket, self._hello)
        self._stamps[seq % REMEMBERED], self._sent = stamp_ns, seq
        if self._session and say(self._fast.record, self._said, *fixed.STYLUS[:2], self.sample) == fastpath.FAILED:
            self._fast.fail("motion")

    def receive(self) -> bool:
        """Take one message, if one has come; True if it is a newer force or beat."""
        came = hear(self._fast.record, self._heard, *fixed.FORCE[:2], self._force)
        if came == FORCE_CAME:
            return self._take(Force(*_FORCE.unpack(self._force.data)))
        if came == fastpath.FAILED:
            self._fast.fail("motion")
        return came != fastpath.NOTHING and self._understand(self._heard[:came].tobytes())

    def _understand(self, frame: bytes) -> bool:
        """Take what is no force in its fixed form."""
        try:
            message = decode(frame)
        except WireError as error:
            self._nonsense.say(f"the server sent nonsense: {error}")
            return False
        match message:
            case Force() | Beat():
                return self._take(message)
            case Welcome(session=session):
                self._enter(session)
            case Goodbye(reason=reason):
                log.info("the server says goodbye: %s", reason)
                self._session = ""
            case Refusal(reason=reason) if reason != self._refused:
                self._refused = reason
                log.warning("the server refuses: %s", reason)
        return False

    def rendered(self, at_ns: int) -> None:
        """Note that the newest force is at the device: the loop is closed for the sample it was computed from."""
        message = self.newest
        if isinstance(message, Force) and message.stylus_seq > self._looped:
            self._looped = message.stylus_seq
            self.loop_ns = at_ns - self._stamps[message.stylus_seq % REMEMBERED]

    def wait(self, seconds: float) -> bool:
        """Wait for the server, at most so long [s]; whether something may have come."""
        return sockets.wait_signal(self._socket, seconds)

    def leave(self, reason: str) -> None:
        """Say goodbye and close."""
        sockets.send(self._socket, encode(Goodbye(reason)))
        self._fast.close()
        sockets.close_after_goodbye(self._socket)

    def _take(self, message: Force | Beat) -> bool:
        if not self._session or (self.newest is not None and message.tick <= self.newest.tick):
            return False
        self.newest, self.heard_ns = message, now_ns()
        if self._is_fresh(message.stylus_seq):
            self.received_ns = self.heard_ns
        return True

    def _is_fresh(self, seq: int) -> bool:
        """Whether what was just heard answers a recent sample, or says that there is none; not so what had to wait.

        So an agent that stood still does not take for fresh what came meanwhile.
        """
        if seq < 0:
            return True
        return self._sent - seq < REMEMBERED and self.heard_ns - self._stamps[seq % REMEMBERED] < self._timeout_ns

    def _enter(self, session: str) -> None:
        """Belong to a session; in a new one nothing of the old one counts."""
        self._refused = ""
        if session != self._session:
            log.info("in session %s", session[:8])
            self._session, self.newest = session, None


class Agent:
    """One device, its safety chain and its link to the server.

    Parameters
    ----------
    config : Config
        Rig and experiment.
    side : str
        ``left`` or ``right``.
    device : Device
        The open device.
    context : zmq.Context
        Where the socket is made.
    companion : Companion or None
        What lives with the device.
    """

    def __init__(
        self,
        config: Config,
        side: Side,
        device: Device,
        context: sockets.Context,
        companion: Companion | None = None,
    ) -> None:
        where = keys.reach(config.network, f"agent.{side}")
        socket = sockets.motion_agent(context, where.reach(sockets.MOTION), f"agent.{side}@{NAME}")
        timeout_ns = int(config.network.sample_timeout_ms * 1e6)
        self._link = Link(socket, introduction(side, config, device.info), timeout_ns)
        self._device = device
        self._safety = Safety(config.safety, device.info.max_force)
        self._fixture = config.fixture
        self._companion = companion
        self._seq = 0
        self._safeguards = 0
        self._rendered = 0.0

    def run(self, stopping: Callable[[], bool]) -> None:
        """Serve the device until told to stop; its owner closes it.

        Parameters
        ----------
        stopping : callable
            Whether the process has been asked to stop.

        Raises
        ------
        DeviceError
            If the device fails.
        """
        self._link.warm()
        steady_loop()
        pacer = Pacer(now_ns() + TICK_NS)
        while not stopping():
            pacer.wait()
            pacer.shift(self._tick(pacer.due_ns + TICK_NS))
        self._device.write(0.0, 0.0, 0.0)
        self._link.leave("the agent was stopped")

    def _tick(self, until_ns: int) -> int:
        """Read and send the stylus, then render what comes until the next tick is due; how to shift that [ns]."""
        reading = self._device.read(now_ns())
        self._send(reading)
        self._arm(reading.ready)
        shift_ns = 0
        lived = rendered = False
        while (left_ns := until_ns - now_ns()) > 0:
            wait_ns = left_ns if lived else left_ns - TICK_NS // 4
            if wait_ns > 0 and self._link.wait(wait_ns * 1e-9):
                if not self._link.receive():
                    continue
                self._render(reading)
                shift_ns += phase_shift(self._link.newest.lead_ns) if self._link.newest else 0
                rendered = True
            if not lived:
                self._live()
                lived = True
        if not lived:
            self._live()
        if not rendered:
            self._render(reading)
        return shift_ns

    def _live(self) -> None:
        """Let whoever lives with the device live for a millisecond, when that holds up no force."""
        if self._companion is not None:
            self._companion.step(now_ns(), isinstance(self._link.newest, Force))

    def _arm(self, ready: bool) -> None:
        """Arm the device only while the server says that it may be, and that nothing is to be felt.

        So a device that has lost the server in a trial stays without force until the trial has been paused and resumed.
        """
        if not ready:
            self._safety.disarm()
            return
        if self._safety.guard is Guard.DISARMED:
            beat = self._link.newest
            if isinstance(beat, Beat) and beat.arm:
                self._safety.arm()

    def _render(self, reading: Reading) -> None:
        """Hand the device the newest force and the fixture's, through the safety chain."""
        message = self._link.newest
        fz = message.force if isinstance(message, Force) else 0.0
        fx, fy = lateral_force(reading, self._fixture)
        velocity = (reading.vx, reading.vy, reading.vz)
        limited = self._safety.step(now_ns(), (fx, fy, fz), self._link.received_ns, velocity)
        self._device.write(limited.fx, limited.fy, limited.fz)
        self._link.rendered(now_ns())
        self._rendered = limited.fz
        self._safeguards |= int(limited.safeguards)

    def _send(self, reading: Reading) -> None:
        """Send the sample with what has become of the forces since the one before."""
        message, seq = self._link.newest, self._seq
        _STYLUS.pack_into(
            self._link.sample.data,
            0,
            seq,
            reading.stamp_ns,
            reading.x,
            reading.y,
            reading.z,
            reading.vx,
            reading.vy,
            reading.vz,
            reading.buttons,
            self._safeguards,
            self._rendered,
            -1 if message is None else message.tick,
            0 if message is None else message.sent_ns,
            self._link.heard_ns,
            now_ns(),
            self._link.loop_ns,
        )
        self._link.send(seq, reading.stamp_ns)
        self._seq += 1
        self._safeguards = 0


def introduction(side: Side, config: Config, info: DeviceInfo) -> Hello:
    """How an agent introduces itself, with what is worth recording of its device."""
    agent = config.agents.left if side == "left" else config.agents.right
    details = {
        "device": agent.device,
        "model": info.model,
        "serial": info.serial,
        "max_force": f"{info.max_force!r} N",
        "resolution": f"{info.resolution!r} m",
    }
    return Hello("agent", side, PROTOCOL_VERSION, NAME, version("netboard"), details)
