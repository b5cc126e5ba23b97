"""Counterfactual replay: recorded hand movements with another board, model or force condition.

The loop is open: the hands move as recorded, whatever the board does. The replay therefore shows the effect of a change
on board, ball, forces and outcome without human reaction. It does not predict what people would have done. The trial
state machine decides again.

The ball is an unstable system (a saddle): a tiny difference grows exponentially within a fraction of a second, and a
block computed in one run would be noise after its first seconds. So each attempt starts from the recorded state at its
release, and any difference in it is due to the change. Between attempts, from the end of one to the release of the
next, the stage runs but its results are not used. Without a change, every tick is bit-identical to the recorded one.
"""

import hashlib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from netboard.base.config import Config, resolve
from netboard.base.tick import TICK_SECONDS
from netboard.network.protocol.records import EventRecord, TickRecord
from netboard.recording.files.offline_writer import events_of
from netboard.recording.files.provenance import config_sha256
from netboard.recording.files.writer import RecordingWriter
from netboard.recording.format.summary import Attempt, find_attempts
from netboard.recording.integrity.verification import as_words, runs, state_of
from netboard.stage.stage import Stage

Rows = NDArray[Any]


class ComparedQuantity(NamedTuple):
    """A compared quantity: its field in a tick, its name in figures, the unit shown, and the factor from SI to it."""

    name: str
    text: str
    unit: str
    scale: float


QUANTITIES = (
    ComparedQuantity("theta", "tilt", "deg", float(np.degrees(1.0))),
    ComparedQuantity("p", "ball", "mm", 1e3),
    ComparedQuantity("left_force", "left force", "N", 1.0),
    ComparedQuantity("right_force", "right force", "N", 1.0),
)
"""Compared quantities: tilt of the board, position of the ball, and commanded forces."""


class Difference(NamedTuple):
    """Difference of a quantity in an attempt."""

    rms: float  # root mean square [SI]
    largest: float  # largest magnitude [SI]


@dataclass(frozen=True, slots=True)
class AttemptComparison:
    """One attempt, recorded and recomputed."""

    then: Attempt
    # The recomputed attempt; ``unfinished`` if it outlasts the recorded one, because later hand movements belong to
    # another attempt.
    now: Attempt
    common: int  # compared ticks: from the release while both attempts run
    differences: dict[str, Difference]

    @property
    def changed(self) -> bool:
        """Whether the outcome or the completion time differs."""
        same = (
            self.then.completion == self.now.completion or np.isnan([self.then.completion, self.now.completion]).all()
        )
        return self.then.outcome != self.now.outcome or not same


@dataclass(frozen=True, slots=True)
class WhatIf:
    """Recorded ticks, those of the changed stage with the same inputs, and each attempt in both."""

    recorded: Rows
    computed: Rows
    comparisons: tuple[AttemptComparison, ...]

    @property
    def identical(self) -> bool:
        """Whether every tick is bit-identical to the recorded one: then the change does not affect the stage."""
        return np.array_equal(as_words(self.recorded), as_words(self.computed))


def what_if(recorded: Rows, stage: Stage) -> WhatIf:
    """Run recorded hand movements through a stage, each attempt from its recorded release."""
    attempts = find_attempts(recorded)
    computed = recorded.copy()
    releases = np.searchsorted(recorded["tick"], [attempt.tick for attempt in attempts])
    for first, stop in runs(recorded["tick"]):
        starts = [first, *(int(place) for place in releases if first < place < stop), stop]
        for start, end in pairwise(starts):
            stage.advance(state_of(recorded[start : start + 1]), computed[start:end], 0, end - start)
    return WhatIf(recorded, computed, tuple(_compare(recorded, computed, attempt) for attempt in attempts))


def _compare(recorded: Rows, computed: Rows, then: Attempt) -> AttemptComparison:
    start, stop = np.searchsorted(recorded["tick"], [then.tick, then.stop])
    # Include the next tick, which shows the command that ended the attempt; a later one says nothing of this attempt.
    following = int(stop < len(recorded) and recorded["tick"][stop] == then.stop)
    now = find_attempts(computed[start : stop + following])[0]
    common = int(np.searchsorted(recorded["tick"][start:stop], min(now.stop, then.stop)))  # without missing ticks
    differences = {}
    for quantity in QUANTITIES:
        change = difference(recorded, computed, quantity, slice(start, start + common))
        differences[quantity.name] = Difference(float(np.sqrt(np.mean(change**2))), float(np.max(np.abs(change))))
    return AttemptComparison(then, now, common, differences)


def difference(recorded: Rows, computed: Rows, quantity: ComparedQuantity, where: slice) -> NDArray[np.float64]:
    """Return computed minus recorded values of a quantity."""
    return np.asarray(computed[quantity.name][where] - recorded[quantity.name][where], np.float64)


def ticks_of_attempts(found: WhatIf) -> Rows:
    """Return the recomputed ticks of the attempts only, each up to the end of the comparison.

    There are gaps between attempts, so that each can be verified by itself.
    """
    kept = np.zeros(len(found.computed), bool)
    for comparison in found.comparisons:
        start = int(np.searchsorted(found.computed["tick"], comparison.then.tick))
        kept[start : start + comparison.common] = True
    return found.computed[kept]


def attempt_to_show(comparisons: Sequence[AttemptComparison]) -> AttemptComparison:
    """Choose the attempt to show: the longest with another outcome, else the one with the largest ball difference."""
    otherwise = [one for one in comparisons if one.then.outcome != one.now.outcome]
    if otherwise:
        return max(otherwise, key=lambda one: one.common)
    return max(comparisons, key=lambda one: one.differences["p"].rms)


def seconds_since_release(ticks: NDArray[np.int64]) -> NDArray[np.float64]:
    """Return the times of the ticks of an attempt [s]."""
    return np.asarray((ticks - ticks[0]) * TICK_SECONDS, np.float64)


def save(
    path: Path, found: WhatIf, config: Config, source: Mapping[str, str], name: str, changes: Sequence[str]
) -> int:
    """Save a counterfactual replay as a recording: the attempts only, with the changed configuration, marked as such.

    The session id is derived from the source's id and the changes, so that the account of a session never mixes the
    two. There are gaps between the attempts, so that the file verifies by itself: after a gap, verification continues
    from the recorded state.
    """
    text, changed = resolve(config), "; ".join(changes)
    session = hashlib.sha256(f"{source['session']} {changed}".encode()).hexdigest()[:32]
    metadata = {
        **source,
        "session": session,
        "name": config.session.name,
        "dyad": config.session.dyad,
        "study": config.session.study,
        "block": str(config.block.number),
        "config_sha256": config_sha256(text.encode()),
        "what_if": changed,
        "source": name,
        "source_session": source["session"],
    }
    opened_ns = int(source.get("opened_log_ns", 0))  # a recovered recording may have lost it
    writer = RecordingWriter(path, metadata, text, config.recording, opened_ns, repeatable=True)
    rows = ticks_of_attempts(found)
    number = events = 0
    now_ns = opened_ns
    try:
        for row in rows:
            now_ns = opened_ns + int(row["time_ns"] - rows["time_ns"][0])
            writer.write(TickRecord(row.tobytes()), number, now_ns)
            number += 1
            for event in events_of(row, config):
                writer.write(EventRecord(events, int(row["tick"]), int(row["time_ns"]), *event), number, now_ns)
                number, events = number + 1, events + 1
            if writer.is_due(now_ns):
                writer.flush(now_ns)
        writer.finish(now_ns)
    except BaseException:
        writer.abandon()
        raise
    return len(rows)
