"""A fake server for the console, on a real socket: it answers from a scripted state and obeys commands.

Run by itself it stays in one state, for screenshots:
``PYTHONPATH=tests python tests/windows/console_server.py running --port 5550``, and then
``netboard console --set network.port=5550 --offscreen --screenshot running.png --after 11``.
"""

import argparse
import json
import math
import time
from dataclasses import replace
from functools import partial
from importlib.metadata import version

from fakes import STATUS
from netboard.base.safeguards import Safeguard
from netboard.base.tables.rig import Network
from netboard.network.protocol.codec import decode, encode
from netboard.network.protocol.control import (
    FORM_AWAITED,
    Command,
    DeviceStatus,
    DisplayStatus,
    LinkStatus,
    LoopStatus,
    Outcomes,
    OutcomesRequest,
    RecordingStatus,
    Reply,
    StandInStatus,
    StationStatus,
    Status,
    StatusRequest,
    Trace,
    TracePoint,
    TraceRequest,
)
from netboard.network.protocol.joining import HELLO_FIRST, Goodbye, Hello, Refusal, Welcome
from netboard.network.protocol.messages import PROTOCOL_VERSION, Message
from netboard.network.transport import channels, sockets
from netboard.network.transport.ports import free_port
from netboard.nodes.ports.emergency import AWAITING_RELEASE, RELEASE, STOP
from netboard.nodes.server.stand_ins import AWAITING_WORDS
from netboard.task.journal.outcome import AttemptOutcome

ARMED = int(Safeguard.ARMED)
MINE = version("netboard")


def link(side: str) -> LinkStatus:
    return LinkStatus(f"agent.{side}", f"lab-{side}:812", MINE, 0.0008, 0.00021, 0.00011, 2.5, 1000.0, 0)


RUNNING = replace(
    STATUS,
    session="5c1d",
    tick=754_321,
    phase="running",
    trial=12,
    successes=11,
    failures=3,
    completions=(3.2, 2.9),
    late_ticks=3,
    peers=("agent.left", "agent.right", "display.left", "display.right", "logger", "console"),
    links=(link("left"), link("right"), LinkStatus("logger", "lab0:900", MINE, 0.1, 0.0003, 0.0002, 0.1, 50.0, 0)),
    loops=(LoopStatus("agent.left", 0.0019, 0.0085), LoopStatus("agent.right", 0.0021, 0.0085)),
    name="S03",
    dyad="D03",
    study="paper",
    consent=True,
    block=3,
    blocks=18,
    condition="dyadic, full force",
    recordings=(RecordingStatus("S03-block03.mcap", 0.12, 184_200_000, 38_400_000_000),),
    stations=(StationStatus("left", 0.0009, ARMED, 0.31, 0, 0), StationStatus("right", 0.0011, ARMED, -0.12, 0, 0)),
    devices=(
        DeviceStatus("left", "haptic", "Touch", "4711", "haptic device: Touch, serial 4711"),
        DeviceStatus("right", "haptic", "Touch", "4712", "haptic device: Touch, serial 4712 (mass not identified)"),
    ),
    displays=(DisplayStatus("left", "xcb"), DisplayStatus("right", "wayland")),
)
"""No fault."""

IDLE = replace(
    RUNNING, phase="idle", trial=1, successes=0, failures=0, armed=False, block=1, condition="dyadic, no force",
    stations=(StationStatus("left", 0.0009, 0, 0.0, 0, 0), StationStatus("right", 0.0011, 0, 0.0, 0, 0)),
)  # fmt: skip
"""The session is open and ready for F1 and F2."""

PAUSED = replace(
    RUNNING,
    phase="paused",
    notice="paused: the right device is lost",
    stations=tuple(station._replace(rendered=0.0) for station in RUNNING.stations),
)
"""The device is back, and no force acts."""

UNARMED_LINK = LinkStatus("agent.right", "lab-right:77", "0.0.9", 0.004, 0.0012, 0.0006, math.nan, 712.0, 41)

STAND_INS = (StandInStatus("right device simulated", False), StandInStatus("right display off screen", False))
VIRTUAL = "simulated, no device: virtual Touch, serial virtual-right"

SIMULATED = replace(
    IDLE,
    devices=(RUNNING.devices[0], DeviceStatus("right", "simulated", "virtual Touch", "virtual-right", VIRTUAL)),
    displays=(DisplayStatus("left", "xcb"), DisplayStatus("right", "offscreen")),
    waiting_for=(f"{AWAITING_WORDS}: {', '.join(one.words for one in STAND_INS)}",),
    stand_ins=STAND_INS,
)
"""A real session with a simulated device and a display that nobody sees, not confirmed."""

STATES: dict[str, Status] = {
    "simulated": SIMULATED,
    "simulated_unopened": replace(SIMULATED, opened=False, consent=False, waiting_for=("the session's form",)),
    "confirmed": replace(
        SIMULATED, waiting_for=(), armed=True, stand_ins=tuple(one._replace(confirmed=True) for one in STAND_INS)
    ),
    "no_consent": replace(IDLE, consent=False),
    "unopened": replace(IDLE, opened=False, consent=False, waiting_for=("the session's form",)),
    "ready": IDLE,
    "waiting": replace(
        IDLE,
        links=(RUNNING.links[0],),
        peers=("agent.left", "display.left"),
        waiting_for=("agent.right", "the logger"),
        recordings=(),
        stations=(IDLE.stations[0], StationStatus("right", math.nan, 0, 0.0, 0, 0)),
    ),
    "running": RUNNING,
    "holding": replace(RUNNING, phase="holding", pending="pause after this trial"),
    "troubled": replace(
        RUNNING,
        links=(RUNNING.links[0], UNARMED_LINK),
        loops=(LoopStatus("agent.left", 0.0019, 0.0085), LoopStatus("agent.right", 0.0061, 0.0085)),
        late_ticks=9,
        recordings=(RecordingStatus("S03-block03.mcap", 0.4, 184_200_000, 3_100_000_000),),
        stations=(
            StationStatus("left", 0.0009, ARMED | int(Safeguard.CLAMPED), 3.0, 0, 120),
            StationStatus("right", 0.018, int(Safeguard.STALE), 0.0, 37, 0),
        ),
    ),
    "paused": PAUSED,
    "watched": replace(PAUSED, commander="lab2:4711"),
    "stopped": replace(
        RUNNING,
        phase="paused",
        armed=False,
        waiting_for=(AWAITING_RELEASE,),
        stations=(
            StationStatus("left", 0.0009, int(Safeguard.STOPPED), 0.0, 0, 0),
            StationStatus("right", 0.0011, int(Safeguard.STOPPED), 0.0, 0, 0),
        ),
    ),
    "unrecorded": replace(RUNNING, recordings=()),
    "rest": replace(IDLE, block=4, rest=83.0, armed=True),
    "finished": replace(RUNNING, phase="finished", block=18, trial=60, successes=60, armed=False),
    "lost": replace(
        RUNNING,
        phase="finished",
        trial=60,
        successes=60,
        notice="7 of 60 trials will be excluded: deadline misses",
        lost=(3, 8, 9, 21, 30, 44, 59),
        repeats=(12,),
    ),
    "unanswered": replace(
        RUNNING, phase="finished", trial=60, successes=60, notice=f"{FORM_AWAITED}left and right, 57 s at most"
    ),
    "pilot": replace(RUNNING, pilot=True, consent=False, name="P01", dyad="D00"),
}
"""The server states that a test can select."""

FIRST = ("unopened", "ready", "waiting")
"""States before the first trial."""

DONE = 15
"""Attempts so far in the running state: 11 successes, 3 failures, and one aborted [1]."""

FATES = ("success", "success", "fell", "success", "success", "success", "timed_out", "success", "aborted", "success")


def attempts(count: int) -> list[AttemptOutcome]:
    """Synthetic attempts of the third block."""
    made, trial, number = [], 1, 1
    for k in range(count):
        fate = FATES[k % len(FATES)]
        doubts = "late_ticks,lost_samples" if k == 7 else ""
        seconds = 2.5 + math.sin(k) if fate == "success" else math.nan
        made.append(AttemptOutcome(3, trial, number, fate, seconds, doubts, 5 if k == 9 else 0))
        trial, number = (trial + 1, 1) if fate == "success" else (trial, number + 1)
    return made


def point(tick: int) -> TracePoint:
    """One synthetic point of the trace."""
    t = tick * 1e-3
    left, right = 0.02 * math.sin(2.1 * t), 0.018 * math.sin(2.1 * t + 0.7) + 0.004 * math.sin(9 * t)
    ball = 0.15 * math.sin(0.8 * t)
    force = 0.5 + 0.4 * math.sin(2.1 * t + 0.2)
    return TracePoint(tick, left, right, (left + right) / 2, (right - left) / 0.5, ball, force, 0.9 - force)


class ConsoleServer:
    """The fake server; call `turn` often: it answers the pending messages."""

    def __init__(self, port: int | None = None, state: str = "running", attempted: int = 0) -> None:
        self.network = replace(Network(), port=port or free_port())
        self.received: list[Command] = []
        self.refuse: dict[str, str] = {}
        self.silent = self.forgetful = False
        self.config = ""
        self.attempts = attempts(attempted)
        self.show(state)
        self._opened = sockets.open_context()
        context = self._opened.__enter__()
        self.router = sockets.control_server(context, channels.addresses(self.network).listen(channels.CONTROL))
        self._peers: dict[bytes, str] = {}

    def show(self, state: str) -> None:
        self.status = replace(STATES[state], outcomes=len(self.attempts))

    def change(self, **changes: object) -> None:
        self.status = replace(self.status, **changes)

    def close(self) -> None:
        self.router.close_after_goodbye()
        self._opened.__exit__(None, None, None)

    def turn(self) -> None:
        """Receive and answer all pending messages."""
        while (received := self.router.receive()) is not None:
            peer, frame = received
            message = decode(frame)
            if isinstance(message, Command) and not self.silent:
                self.received.append(message)
            for answer in () if self.silent else self._answers(peer, message):
                self.router.send(peer, encode(answer))

    def commands(self, *excluded: str) -> list[tuple[str, str]]:
        """Name and argument of the commands received, except those named."""
        return [(command.name, command.argument) for command in self.received if command.name not in excluded]

    def _answers(self, peer: bytes, message: Message) -> list[Message]:
        match message:
            case Hello(name=name):
                self._peers[peer] = name
                return [Welcome(self.status.session, PROTOCOL_VERSION, 0, self.config)]
            case Goodbye():
                self._peers.pop(peer, None)
            case _ if peer not in self._peers:
                return [Refusal(HELLO_FIRST)]
            case StatusRequest():
                return [self.status]
            case OutcomesRequest(first=first):
                return [Outcomes(first, tuple(self.attempts[first : first + 100]))]
            case TraceRequest(after=after):
                newest = self.status.tick - self.status.tick % 5
                return [Trace(tuple(map(point, range(max(after + 5, newest - 1000), newest + 1, 5))))]
            case Command(name=name, argument=argument, number=number):
                return [self._obey(self._peers[peer], name, argument, number)]
        return []

    def _obey(self, who: str, name: str, argument: str, number: int) -> Reply:
        if reason := self.refuse.get(name, ""):
            return Reply(number, False, reason)
        match name:
            case _ if name == STOP:
                self.change(phase="paused", waiting_for=(AWAITING_RELEASE,), armed=False)
                return Reply(number, True, "no device has a force")
            case _ if name == RELEASE:
                self.change(waiting_for=())
            case "take":
                self.change(commander=who)
            case "open":
                form = json.loads(argument)
                self.change(opened=True, name=form["name"], pilot=form["pilot"], consent=form["consent"])
            case "arm" | "disarm":
                self.change(armed=name == "arm")
            case "start":
                self.change(phase="levelling")
        return Reply(number, True, "")


def main() -> None:
    """Serve one state."""
    parser = argparse.ArgumentParser()
    parser.add_argument("state", choices=STATES)
    parser.add_argument("--port", type=int, default=5550)
    parser.add_argument("--silent-after", type=float, default=math.inf)
    parser.add_argument("--seconds", type=float, default=60.0)
    wanted = parser.parse_args()
    server = ConsoleServer(wanted.port, wanted.state, 0 if wanted.state in FIRST else DONE)
    started, first, late = time.monotonic(), server.status, partial(replace, server.status)
    while (passed := time.monotonic() - started) < wanted.seconds:
        file = first.recordings[0] if first.recordings else None
        grown = () if file is None else ((file[0], 0.1 + 0.1 * (passed % 1), file[2] + round(3e5 * passed), file[3]),)
        server.status = late(tick=first.tick + round(passed * 1000), recordings=grown)
        server.silent = passed > wanted.silent_after
        server.turn()
        time.sleep(0.002)
    server.close()


if __name__ == "__main__":
    main()
