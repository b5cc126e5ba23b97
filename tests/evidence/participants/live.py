"""``make evidence ARGS=live``: a session of each robot partner in real processes, verified and analysed.

`netboard demo` starts server, agents and logger. At the left a simulated participant holds a simulated device, at the
right the robot another one, behind the safety chain of its agent. The table is read from the recordings, which stay in
the folder of the results, with the report of `netboard analyse` over all of them.
"""

import subprocess
import sys
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np

from evidence.participants.partners import PLAYBACK, recorded_hand
from netboard.base.errors import NetboardError
from netboard.benchmarks.harness.results import Folder, ResultPart
from netboard.benchmarks.harness.running import Tell
from netboard.participants.seat.partners import POLICIES
from netboard.recording.files.reader import Recording
from netboard.recording.format.summary import RecordingSummary, summarise
from netboard.recording.integrity.verification import verify_recording
from netboard.recording.timing.stamps import stamps_of

TRIALS, QUICK_TRIALS = 8, 1
"""Successful trials of each session [1]."""

QUICK_PARTNERS = ("leader",)
"""Partners of the quick form."""


class LiveSession(NamedTuple):
    """What a recording says of a session."""

    summary: RecordingSummary
    identical: bool  # whether all ticks are reproduced to the bit
    repeated: float  # share of the ticks of trials that used a sample of the robot's agent again [1]


def netboard(*arguments: str) -> None:
    """Run a command of netboard."""
    command = [sys.executable, "-m", "netboard.services.cli", *arguments]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    if done.returncode:
        raise NetboardError(f"netboard {' '.join(arguments)}: {done.stdout[-2000:]}{done.stderr[-2000:]}")


def play(name: str, trials: int, folder: Path, settings: Sequence[str]) -> LiveSession:
    """Play a session beside a partner, and read its recording."""
    session = (f"block.right={name}", "session.dyad=D01", f"session.name={name}", *settings)
    options = [word for setting in session for word in ("--set", setting)]
    netboard("demo", "--no-displays", "--trials", str(trials), "--directory", str(folder), *options)
    return read(next(folder.glob(f"{name}_*.mcap")))


def read(path: Path) -> LiveSession:
    """Read and verify a recording."""
    with Recording(path) as recording:
        stamps = stamps_of(recording)
        repeated = float(np.mean(~stamps.sides["right"].fresh[stamps.in_trial]))
        summary = summarise(recording.ticks(), recording.events(), remarks=recording.remarks())
        return LiveSession(summary, verify_recording(recording).identical, repeated)


def live_part(sessions: dict[str, LiveSession]) -> ResultPart:
    """Tabulate the sessions."""
    part = ResultPart(
        "live",
        "A session with each robot at the right, in real processes",
        (
            *("partner", "trials [1]", "mean completion time [s]", "failed [1]", "ticks [1]", "identical to the bit"),
            *("deadline misses [%]", "samples used again [%]", "loop 50 % [ms]", "loop 99 % [ms]"),
            *("force limited [ticks]", "largest force [N]"),
        ),
    )
    for name, (summary, identical, repeated) in sessions.items():
        right, times = summary.right, summary.completions
        part.add(
            *(name, len(times), float(np.mean(times)), summary.failures, summary.ticks, "yes" if identical else "no"),
            *(100.0 * summary.late_ticks / summary.ticks, 100.0 * repeated, 1e3 * right.loop.p50, 1e3 * right.loop.p99),
            *(right.limited_ticks, right.largest_force),
        )
    whole = sum(one.identical and not one.summary.missing_ticks for one in sessions.values())
    part.claim("every tick is recorded, and reproduced to the bit", whole == len(sessions), f"{whole} recordings")
    return part


def study(folder: Folder, tell: Tell, *, quick: bool) -> Iterator[ResultPart]:
    """Play a session beside each robot partner, and analyse all of them."""
    recordings = folder.path / "recordings"
    names = QUICK_PARTNERS if quick else sorted(POLICIES)
    hand = [f"partners.right.file={recorded_hand(folder.path)}"] if PLAYBACK in names else []
    sessions = {}
    for step, name in enumerate(names):
        tell(name, step / len(names))
        trials = QUICK_TRIALS if quick else TRIALS
        sessions[name] = play(name, trials, recordings, hand if name == PLAYBACK else ())
    yield live_part(sessions)
    tell("analysing", 1.0)
    netboard("analyse", str(recordings), "--output", str(folder.path / "report"))
