"""``netboard bench fuzz``: malformed frames by the million, for the codec and for every socket of every process.

First the codec alone. Then a real server with two agents, a display and a logger in a trial: peers that it has welcomed
and peers that it has not send malformed messages to all its sockets, and others bytes that are not ZeroMQ's. Last real
agents, a display and a logger, connected to a server that talks nonsense. What must hold: nothing ends, hangs or grows,
what is refused is counted, the trial goes on, and no force is any other than it was.
"""

import gc
import time
from collections.abc import Iterator
from dataclasses import dataclass, field
from itertools import islice
from pathlib import Path

from netboard.base.errors import WireError
from netboard.benchmarks.faults.fuzz_peers import peer_parts
from netboard.benchmarks.faults.fuzz_server import server_parts
from netboard.benchmarks.faults.mutants import Mutants, true_frames
from netboard.benchmarks.faults.watching import GROWN, resident
from netboard.benchmarks.harness.results import Folder, Part, Value, Verdict, new_folder
from netboard.benchmarks.harness.running import Tell, run
from netboard.network.protocol.codec import decode, encode

FRAMES = 1_000_000
QUICK_FRAMES = 20_000
"""Frames for the codec and for each socket in the short form [1]."""

SLOWEST_MS = 50.0
"""Longest time that the codec may take for a frame [ms]."""

TOLD_FRAMES = 10_000


def main(output: Path | None, *, quick: bool, force: bool, frames: int | None) -> int:
    """Send malformed frames, and see that nothing comes of it.

    - `frames`: how many for the codec, and for each socket; None for the usual number [1].
    """
    folder = Folder(output or new_folder("fuzz"), force=force)
    count = frames or (QUICK_FRAMES if quick else FRAMES)
    verdicts = run(folder, {"study": "fuzz", "frames": count}, lambda tell: study(folder.path, count, tell))
    return 0 if all(verdict.holds for verdict in verdicts) else 1


def study(folder: Path, count: int, tell: Tell) -> Iterator[Part]:
    """Run the parts."""
    yield codec_part(count, tell)
    yield from server_parts(folder / "server", count, tell)
    yield from peer_parts(folder / "peers", count, tell)


# --- the codec -----------------------------------------------------------------------------------------------------


@dataclass
class Sieve:
    """Feeds frames to the codec and counts the results.

    - `slowest`: longest time that one took [s].
    """

    accepted: int = 0
    refused: int = 0
    size: int = 0
    slowest: float = 0.0
    worst: bytes = b""
    wrong: list[str] = field(default_factory=list)

    def take(self, frame: bytes) -> None:
        """Decode a frame and count the result."""
        message = None
        began = time.thread_time()
        try:
            message = decode(frame)
            self.accepted += 1
        except WireError:
            self.refused += 1
        except Exception as error:  # noqa: BLE001 - which is what is looked for
            self.wrong.append(f"{type(error).__name__} for {frame[:64].hex()}")
        took = time.thread_time() - began
        if took > self.slowest:
            self.slowest, self.worst = took, frame
        self.size += len(frame)
        if message is not None and repr(decode(encode(message))) != repr(message):
            self.wrong.append(f"not the same again: {frame[:64].hex()}")


def codec_part(count: int, tell: Tell) -> Part:
    """Give malformed frames to the codec, with nothing collected meanwhile, as in the loops that use it."""
    sieve = Sieve()
    before = resident()
    gc.disable()
    try:
        for number, frame in enumerate(islice(Mutants(true_frames(1), 1), count)):
            if number % TOLD_FRAMES == 0:
                tell("the codec", number / count)
            if number == count // 4:
                before = resident()
            sieve.take(frame)
    finally:
        gc.enable()
    grown = resident() - before
    columns = ("frames [1]", "messages [1]", "refused [1]", "mean size [bytes]", "slowest [ms]", "grown [MB]")
    slowest = sieve.slowest * 1e3
    row: tuple[Value, ...] = (count, sieve.accepted, sieve.refused, sieve.size / count, slowest, grown * 1e-6)
    return Part(
        "codec",
        "Malformed frames for the codec",
        columns,
        [row],
        [
            Verdict(
                "every frame is a message or refused",
                not sieve.wrong,
                "; ".join(sieve.wrong[:3]) or f"{sieve.accepted} and {sieve.refused}",
            ),
            Verdict(
                f"none takes longer than {SLOWEST_MS:g} ms",
                slowest < SLOWEST_MS,
                f"{slowest:.1f} ms for {len(sieve.worst)} bytes",
            ),
            Verdict("memory stays flat", grown < GROWN, f"{grown * 1e-6:.1f} MB more after the first quarter"),
        ],
    )
