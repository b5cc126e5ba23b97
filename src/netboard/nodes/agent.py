"""The agent: one loop that owns one device.

Each millisecond it reads the stylus and sends it. As soon as a force comes back, and at the latest at the next
millisecond, the safety chain turns it into what the device may render. The agent trusts nobody: without fresh messages
the force fades, and on every way out the device gets zero force first.
"""

import logging
from collections.abc import Callable
from importlib.metadata import version
from typing import Protocol

from netboard import sockets
from netboard.clock import Pacer, now_ns
from netboard.config import Config, Side
from netboard.devices.base import Device, DeviceInfo, Reading
from netboard.devices.fixture import lateral_force
from netboard.devices.safety import Guard, Safety
from netboard.errors import WireError
from netboard.process import NAME, steady_loop
from netboard.tick import TICK_NS
from netboard.wire.codec import decode, encode
from netboard.wire.messages import PROTOCOL_VERSION, Beat, Force, Goodbye, Hello, Refusal, Stylus, Welcome

log = logging.getLogger(__name__)

HELLO_NS = 500_000_000
"""Hello is said again after so long without a word from the server [ns]."""

REMEMBERED = 256
"""Samples whose time of reading is remembered [1]."""


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
    """

    def __init__(self, socket: sockets.Socket, hello: Hello) -> None:
        self.newest: Force | Beat | None = None
        self.received_ns: int | None = None
        self.loop_ns = 0
        self._socket = socket
        self._hello = encode(hello)
        self._session = ""
        self._said_hello_ns = -HELLO_NS
        self._stamps = [0] * REMEMBERED
        self._looped = -1
        self._refused = ""

    def send(self, stylus: Stylus) -> None:
        """Send a sample, and a hello first where the server is silent."""
        heard_ns = self.received_ns or 0
        if stylus.sent_ns - max(heard_ns, self._said_hello_ns) >= HELLO_NS:
            self._said_hello_ns = stylus.sent_ns
            sockets.send(self._socket, self._hello)
        self._stamps[stylus.seq % REMEMBERED] = stylus.stamp_ns
        if self._session:
            sockets.send(self._socket, encode(stylus))

    def receive(self) -> bool:
        """Take everything that has come; True if there is a newer force or beat."""
        newer = False
        while (frame := sockets.receive(self._socket)) is not None:
            try:
                message = decode(frame)
            except WireError as error:
                log.warning("the server sent nonsense: %s", error)
                continue
            match message:
                case Force() | Beat():
                    newer |= self._take(message)
                case Welcome(session=session):
                    self._enter(session)
                case Goodbye(reason=reason):
                    log.info("the server says goodbye: %s", reason)
                    self._session = ""
                case Refusal(reason=reason) if reason != self._refused:
                    self._refused = reason
                    log.warning("the server refuses: %s", reason)
        return newer

    def rendered(self, at_ns: int) -> None:
        """Note that the newest force is at the device: the loop is closed for the sample it was computed from."""
        message = self.newest
        if isinstance(message, Force) and message.stylus_seq > self._looped:
            self._looped = message.stylus_seq
            self.loop_ns = at_ns - self._stamps[message.stylus_seq % REMEMBERED]

    def wait(self, seconds: float) -> bool:
        """Wait for the server, at most so long [s]."""
        return sockets.wait_readable(self._socket, seconds)

    def leave(self, reason: str) -> None:
        """Say goodbye and close."""
        sockets.send(self._socket, encode(Goodbye(reason)))
        sockets.close_after_goodbye(self._socket)

    def _take(self, message: Force | Beat) -> bool:
        if not self._session or (self.newest is not None and message.tick <= self.newest.tick):
            return False
        self.newest, self.received_ns = message, now_ns()
        return True

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
        where = sockets.addresses(config.network)
        socket = sockets.motion_agent(context, where.reach(sockets.MOTION), f"agent.{side}@{NAME}")
        self._link = Link(socket, introduction(side, config, device.info))
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
        steady_loop()
        pacer = Pacer(now_ns() + TICK_NS)
        while not stopping():
            pacer.wait()
            self._tick(pacer.due_ns + TICK_NS)
        self._device.write(0.0, 0.0, 0.0)
        self._link.leave("the agent was stopped")

    def _tick(self, until_ns: int) -> None:
        """Read and send the stylus, then render what comes until the next tick is due."""
        reading = self._device.read(now_ns())
        self._send(reading)
        if self._companion is not None:
            self._companion.step(reading.stamp_ns, isinstance(self._link.newest, Force))
        self._link.receive()
        self._arm(reading.ready)
        self._render(reading)
        while (left_ns := until_ns - now_ns()) > 0 and self._link.wait(left_ns * 1e-9):
            if self._link.receive():
                self._render(reading)

    def _arm(self, ready: bool) -> None:
        """Arm the device only while the server says that nothing is to be felt: forces come back with the trial.

        So a device that has lost the server in a trial stays without force until the trial has been paused and resumed.
        """
        if not ready:
            self._safety.disarm()
        elif self._safety.guard is Guard.DISARMED and isinstance(self._link.newest, Beat):
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
        message = self._link.newest
        self._link.send(
            Stylus(
                seq=self._seq,
                stamp_ns=reading.stamp_ns,
                x=reading.x,
                y=reading.y,
                z=reading.z,
                vx=reading.vx,
                vy=reading.vy,
                vz=reading.vz,
                buttons=reading.buttons,
                safeguards=self._safeguards,
                rendered=self._rendered,
                force_tick=-1 if message is None else message.tick,
                force_sent_ns=0 if message is None else message.sent_ns,
                force_received_ns=self._link.received_ns or 0,
                sent_ns=now_ns(),
                loop_ns=self._link.loop_ns,
            )
        )
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
