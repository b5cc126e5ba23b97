"""``make evidence ARGS=fuzz``: malformed frames by the million, for the codec and for every socket of every process.

It has three parts: the codec alone; a real server with two agents, a display and a logger in a trial, which receives
malformed messages and other bytes on all its sockets; and real agents, a display and a logger connected to hostile
servers. No process may crash, hang or grow, every refusal must be counted, the trial must go on, and the forces must
not change.
"""

import gc
import time
from collections.abc import Iterator
from dataclasses import dataclass, field
from functools import partial
from itertools import islice

from evidence.faults.fuzz_peers import peer_parts
from evidence.faults.fuzz_server import MAX_GROWTH, server_parts
from evidence.faults.malformed_frames import MalformedFrames, valid_frames
from netboard.base.errors import WireError
from netboard.base.process.resources import resident_memory
from netboard.benchmarks.harness.results import Folder, ResultPart, Value
from netboard.benchmarks.harness.running import Options, Tell, run
from netboard.network.protocol.codec import decode, encode

FRAMES = 1_000_000
QUICK_FRAMES = 5_000
"""Frames for the codec and for each socket in the short form [1]."""

SLOWEST_MS = 50.0
"""Longest CPU time that the codec may take for a frame [ms]."""

PROGRESS_FRAMES = 10_000
"""Frames between two progress reports [1]."""


def main(frames: int | None, options: Options) -> int:
    """Run the fuzz tests, and return 0 if every requirement holds.

    - `frames`: number of frames for the codec, and for each socket; None for the default [1].
    """
    count = frames or (QUICK_FRAMES if options.quick else FRAMES)
    verdicts = run("fuzz", partial(study, count), options, {"frames": count})
    return 0 if all(verdict.holds for verdict in verdicts) else 1


def study(count: int, folder: Folder, tell: Tell, *, quick: bool) -> Iterator[ResultPart]:
    """Run the three parts."""
    yield codec_part(count, tell)
    yield from server_parts(folder.path / "server", count, tell)
    yield from peer_parts(folder.path / "peers", count, tell)


@dataclass
class CodecCounts:
    """Decodes frames and counts the results.

    - `size`: total size of the frames [bytes].
    - `slowest`, `slowest_frame`: longest CPU time for a frame [s], and that frame.
    - `errors`: what the codec did wrong.
    """

    accepted: int = 0
    refused: int = 0
    size: int = 0
    slowest: float = 0.0
    slowest_frame: bytes = b""
    errors: list[str] = field(default_factory=list)

    def add(self, frame: bytes) -> None:
        """Decode a frame and count the result."""
        message = None
        began = time.thread_time()
        try:
            message = decode(frame)
            self.accepted += 1
        except WireError:
            self.refused += 1
        except Exception as error:  # noqa: BLE001 - any other exception is a failure of the codec
            self.errors.append(f"{type(error).__name__} for {frame[:64].hex()}")
        took = time.thread_time() - began
        if took > self.slowest:
            self.slowest, self.slowest_frame = took, frame
        self.size += len(frame)
        if message is not None and repr(decode(encode(message))) != repr(message):
            self.errors.append(f"encoding and decoding changes the message of {frame[:64].hex()}")


def codec_part(count: int, tell: Tell) -> ResultPart:
    """Decode malformed frames with garbage collection off, as in the loops that use the codec."""
    counts = CodecCounts()
    before = resident_memory()
    gc.disable()
    try:
        for number, frame in enumerate(islice(MalformedFrames(valid_frames(1), 1), count)):
            if number % PROGRESS_FRAMES == 0:
                tell("codec", number / count)
            if number == count // 4:
                before = resident_memory()
            counts.add(frame)
    finally:
        gc.enable()
    growth = resident_memory() - before
    slowest = counts.slowest * 1e3
    row: tuple[Value, ...] = (count, counts.accepted, counts.refused, counts.size / count, slowest, growth * 1e-6)
    part = ResultPart(
        "codec",
        "Malformed frames for the codec",
        "frames [1] | messages [1] | refused [1] | mean size [bytes] | slowest [ms] | growth [MB]",
        [row],
    )
    part.claim(
        "every frame is decoded or refused",
        not counts.errors,
        "; ".join(counts.errors[:3]) or f"{counts.accepted} decoded, {counts.refused} refused",
    )
    part.claim(
        f"no frame takes longer than {SLOWEST_MS:g} ms",
        slowest < SLOWEST_MS,
        f"{slowest:.1f} ms for {len(counts.slowest_frame)} bytes",
    )
    part.claim(
        f"memory grows by less than {MAX_GROWTH * 1e-6:g} MB",
        growth < MAX_GROWTH,
        f"{growth * 1e-6:.1f} MB after the first quarter",
    )
    return part
