"""Counterfactual replay: recorded hand movements with another board, model or force condition.

The loop is open: the hands move as recorded, whatever the board does. The replay therefore shows the effect of a change
on board, ball, forces and outcome without human reaction. It does not predict what people would have done. The trial
state machine decides anew.

The ball is an unstable system (a saddle): a tiny difference grows exponentially within a fraction of a second, and a
block computed in one run would be noise after its first seconds. So each attempt starts from the recorded state at its
release, and any difference in it is due to the change. Between attempts, from the end of one to the release of the
next, the stage runs but its results are not used. Without a change, every tick is bit-identical to the recorded one.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from netboard.base.tick import TICK_SECONDS
from netboard.recording.format.summary import Attempt, find_attempts
from netboard.recording.integrity.verification import as_words, runs, state_of
from netboard.stage.stage import Stage

Rows = NDArray[Any]


class Quantity(NamedTuple):
    """A compared quantity."""

    name: str
    text: str
    unit: str
    scale: float


QUANTITIES = (
    Quantity("theta", "tilt", "deg", float(np.degrees(1.0))),
    Quantity("p", "ball", "mm", 1e3),
    Quantity("left_force", "left force", "N", 1.0),
    Quantity("right_force", "right force", "N", 1.0),
)
"""Compared quantities: tilt of the board, position of the ball, and commanded forces."""


class Difference(NamedTuple):
    """Difference of a quantity in an attempt.

    Attributes
    ----------
    rms : float
        Root mean square [SI].
    largest : float
        Largest magnitude [SI].
    """

    rms: float
    largest: float


@dataclass(frozen=True, slots=True)
class Comparison:
    """One attempt, recorded and recomputed.

    Attributes
    ----------
    now : Attempt
        The recomputed attempt; ``unfinished`` if it outlasts the recorded one, because later hand movements belong to
        another attempt.
    common : int
        Compared ticks: from the release while both attempts run [1].
    """

    then: Attempt
    now: Attempt
    common: int
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
    """A recording and its counterfactual replay.

    Attributes
    ----------
    recorded, computed : ndarray of TICK, shape (n,)
        Recorded ticks, and those of the changed stage with the same inputs.
    """

    recorded: Rows
    computed: Rows
    comparisons: tuple[Comparison, ...]

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


def _compare(recorded: Rows, computed: Rows, then: Attempt) -> Comparison:
    """Compare a recorded attempt with the recomputed one."""
    start, stop = np.searchsorted(recorded["tick"], [then.tick, then.stop])
    # Include the row after the last one, which tells how a command ended the attempt.
    now = find_attempts(computed[start : stop + 1])[0]
    common = min(now.stop, then.stop) - then.tick
    differences = {}
    for quantity in QUANTITIES:
        apart = difference(recorded, computed, quantity, slice(start, start + common))
        differences[quantity.name] = Difference(float(np.sqrt(np.mean(apart**2))), float(np.max(np.abs(apart))))
    return Comparison(then, now, common, differences)


def difference(recorded: Rows, computed: Rows, quantity: Quantity, where: slice) -> NDArray[np.float64]:
    """Return computed minus recorded values of a quantity."""
    return np.asarray(computed[quantity.name][where] - recorded[quantity.name][where], np.float64)


def attempts_of(found: WhatIf) -> Rows:
    """Return the recomputed ticks of the attempts only, each up to the end of the comparison.

    Returns
    -------
    ndarray of TICK, shape (m,)
        Rows of the changed stage. There are gaps between attempts, so that each can be verified by itself.
    """
    kept = np.zeros(len(found.computed), bool)
    for comparison in found.comparisons:
        start = int(np.searchsorted(found.computed["tick"], comparison.then.tick))
        kept[start : start + comparison.common] = True
    return found.computed[kept]


def most_telling(comparisons: Sequence[Comparison]) -> Comparison:
    """Choose the attempt to show: the longest with another outcome, else the one with the largest ball difference."""
    otherwise = [one for one in comparisons if one.then.outcome != one.now.outcome]
    if otherwise:
        return max(otherwise, key=lambda one: one.common)
    return max(comparisons, key=lambda one: one.differences["p"].rms)


def seconds_since_release(count: int) -> NDArray[np.float64]:
    """Return the tick times of an attempt [s]."""
    return np.arange(count, dtype=np.float64) * TICK_SECONDS
