"""Malformed messages for real agents, a display and a logger, from a server that talks nonsense between its messages.

One agent runs the simulated participant of a dyad, the other one is controlled over the channel moves, so that every
socket of every process is tested. The devices must render exactly the forces that the server commanded, to the bit.
"""

import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import ExitStack
from pathlib import Path
from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

from netboard.base.clock import now_ns
from netboard.base.config import SIDES, Side
from netboard.base.errors import NetboardError
from netboard.benchmarks.faults.devices import read_traces
from netboard.benchmarks.faults.evidence import between
from netboard.benchmarks.faults.hostile import FORCE, Babbler, HostileServer
from netboard.benchmarks.faults.mutants import Mutants, true_frames
from netboard.benchmarks.faults.rigs import PATIENCE, Rig, tampered
from netboard.benchmarks.faults.watching import look, memory, memory_part
from netboard.benchmarks.harness.results import Part, Value, Verdict
from netboard.benchmarks.harness.running import Tell
from netboard.network.transport import sockets
from netboard.recording.files.reader import Recording

PLAIN = ("safety.stale_after_ms=1000", "safety.disarm_after_ms=2000", "safety.arm_time=0.1")
"""Relaxed staleness limits: one loop sends the nonsense and the force, so a constant force may arrive late."""

TURN_SECONDS = 0.001
EACH_TURN = 3
"""Malformed messages per turn and channel [1]."""

LOOK_TURNS = 1000
"""Turns between two checks of the processes [1]."""

BABBLE_SECONDS = 5.0
"""Duration of the first phase, in which the server does not speak ZeroMQ [s]."""

STUCK_SECONDS = 60.0
"""Time without progress after which a socket counts as stuck [s]."""


class Front:
    """A server that talks nonsense, and the processes that are connected to it.

    - `side`: whose agent is among them: with the left one there are a display and a logger.
    """

    def __init__(self, folder: Path, side: Side) -> None:
        folder.mkdir(parents=True)
        settings, environment = tampered(folder.resolve())
        whole = side == "left"
        configuration = "dyadic" if whole else "bimanual"
        self.side = side
        self.rig = Rig(folder, (*PLAIN, *settings, f"block.configuration={configuration}"), environment)
        self.channels = ("motion", "view", "control", "log") if whole else ("motion", "moves")
        self.whole = whole

    def start(self) -> None:
        """Start the processes."""
        self.rig.start_agent(self.side)
        if self.whole:
            self.rig.start("left display", "display", "--station", "left", "--offscreen")
            self.rig.start("logger", "logger", "--once")

    def serve(self, context: sockets.Context) -> HostileServer:
        """Make the server."""
        return HostileServer(self.rig.config, context, Mutants(true_frames(3), 3 + self.whole))

    def well(self, server: HostileServer) -> bool:
        """Return whether every process works: full force, displays painting, logger recording."""
        return bool(server.grown) and (not self.whole or (server.shown > 0 and server.durable > 0))

    def forces(self, start_ns: int, stop_ns: int) -> NDArray[np.float64]:
        """Return the forces handed to the device in a time window [N]."""
        parts = [between(trace, start_ns, stop_ns)["fz"] for trace in read_traces(self.rig.folder, self.side)]
        return np.concatenate([np.empty(0), *parts])


Served: TypeAlias = list[tuple[Front, HostileServer]]


def peer_parts(folder: Path, count: int, tell: Tell) -> Iterator[Part]:
    """Let real peers connect to a server that talks nonsense."""
    tell("peers: starting", 0.0)
    fronts = [Front(folder / side, side) for side in SIDES]
    with ExitStack() as stack:
        for front in fronts:
            stack.enter_context(front.rig)
            front.start()
        babbled = _babble(fronts)
        context = stack.enter_context(sockets.open_context())
        served = [(front, front.serve(context)) for front in fronts]
        _until(served, lambda: all(front.well(server) for front, server in served))
        before, shown, start_ns = _memory(fronts), served[0][1].shown, now_ns()
        _talk_nonsense(served, count, tell)
        stop_ns, after, shown = now_ns(), _memory(fronts), served[0][1].shown - shown
        tell("peers: judging", 1.0)
        ended = _end(served)
    yield _peers_part(served, babbled, ended, shown, (start_ns, stop_ns))
    yield memory_part("peers-memory", "What the peers hold", before, after)


def _babble(fronts: Sequence[Front]) -> int:
    """Answer connecting peers with bytes that are not ZeroMQ for a while; return how many connected."""
    babblers = [Babbler(front.rig.config.network, seed) for seed, front in enumerate(fronts)]
    until = time.monotonic() + PATIENCE
    busy = None
    while time.monotonic() < until and (busy is None or time.monotonic() < busy + BABBLE_SECONDS):
        for babbler in babblers:
            babbler.turn()
        if busy is None and all(babbler.heard for babbler in babblers):
            busy = time.monotonic()
        time.sleep(TURN_SECONDS)
    for front, babbler in zip(fronts, babblers, strict=True):
        look(front.rig)
        babbler.close()
    return sum(babbler.heard for babbler in babblers)


def _until(served: Served, what: Callable[[], bool]) -> None:
    """Serve normally until a condition holds."""
    until = time.monotonic() + PATIENCE
    while not what():
        _turn(served, 0)
        if time.monotonic() > until:
            raise NetboardError("the peers of a server do not do what it means")


def _turn(served: Served, count: int) -> None:
    """Advance each server by one turn, and add malformed messages on each channel that needs more."""
    for front, server in served:
        server.turn(*EACH_TURN * [channel for channel in front.channels if server.nonsense[channel] < count])
    time.sleep(TURN_SECONDS)


def _talk_nonsense(served: Served, count: int, tell: Tell) -> None:
    whole = count * sum(len(front.channels) for front, _ in served)
    done, done_at = 0, time.monotonic()
    turns = 0
    while done < whole:
        _turn(served, count)
        turns += 1
        now = sum(min(server.nonsense[channel], count) for front, server in served for channel in front.channels)
        if now > done:
            done, done_at = now, time.monotonic()
        elif time.monotonic() - done_at > STUCK_SECONDS:
            raise NetboardError(f"somebody takes nothing any more: {[server.nonsense for _, server in served]}")
        if turns % LOOK_TURNS == 0:
            tell("peers: nonsense from a server", done / whole)
            for front, _ in served:
                look(front.rig)


def _end(served: Served) -> dict[str, int]:
    """End everything in order; return the processes and their exit codes."""
    (left, server), (right, _) = served
    server.end_log()
    until = time.monotonic() + PATIENCE
    while left.rig.running["logger"].poll() is None and time.monotonic() < until:
        _turn(served, 0)
    codes = {"logger": left.rig.wait("logger")}
    for front in (left, right):
        codes |= {name: front.rig.stop(name) for name in list(front.rig.running)}
    return codes


def _memory(fronts: Sequence[Front]) -> dict[str, float]:
    return {name: held for front in fronts for name, held in memory(front.rig).items()}


def _peers_part(served: Served, babbled: int, ended: dict[str, int], shown: int, window: tuple[int, int]) -> Part:
    (left, server), (right, other) = served
    rows: list[tuple[Value, ...]] = [
        (socket, number)
        for socket, number in (
            ("left agent: motion", server.nonsense["motion"]),
            ("left agent, left display: view", server.nonsense["view"]),
            ("left display: control", server.nonsense["control"]),
            ("logger: log", server.nonsense["log"]),
            ("right agent: motion", other.nonsense["motion"]),
            ("right agent: moves", other.nonsense["moves"]),
            ("all: no ZeroMQ", babbled),
        )
    ]
    verdicts = [
        Verdict("every process goes on, and ends as it should", not any(ended.values()), f"exit codes {ended}"),
        *(_same_force(front, window) for front in (left, right)),
        Verdict("the display goes on", shown > 0, f"{shown} frames shown meanwhile"),
        _recorded(left, server),
    ]
    return Part("peers", "Malformed messages for the sockets of its peers", ("socket", "messages [1]"), rows, verdicts)


def _same_force(front: Front, window: tuple[int, int]) -> Verdict:
    forces = front.forces(*window)
    other = int(np.sum(forces != FORCE))
    claim = f"the {front.side} device is handed no other force than the one that is meant"
    return Verdict(claim, forces.size > 0 and other == 0, f"{forces.size} times {FORCE:g} N, {other} times another")


def _recorded(front: Front, server: HostileServer) -> Verdict:
    claim = "what was meant to be recorded is"
    paths = front.rig.recordings()
    if len(paths) != 1:
        return Verdict(claim, False, f"{len(paths)} recordings")
    with Recording(paths[0]) as recording:
        ticks = recording.ticks()["tick"]
    whole = np.array_equal(ticks, np.arange(server.ticks))
    return Verdict(claim, whole, f"{ticks.size} of {server.ticks} ticks")
