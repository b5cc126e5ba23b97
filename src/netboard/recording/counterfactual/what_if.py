"""Counterfactual replay: the recorded hands against another board, another model or another force condition.

The loop is open. The hands do what they did, whatever the board would have done to them, so this tells what a change
does to board, ball, forces and outcome while nobody reacts to it, and not what people would have done. The trial
machine decides anew.

The ball is a saddle: a difference of a hair grows e-fold in a fraction of a second, and a block run through in one go
would be noise after its first seconds. So each attempt begins again with the state that was recorded at its release,
and what differs in it is due to the change. Between attempts, from the end of one to the release of the next, the
stage runs on, but nothing is made of it. With nothing changed, every tick is the recorded one to the bit.
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
    """What is compared."""

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
"""What is compared: tilt of the board, ball along it, and the forces to be felt."""


class Difference(NamedTuple):
    """How much a quantity differs in an attempt.

    Attributes
    ----------
    rms : float
        Root of the mean square [SI].
    largest : float
        Largest magnitude [SI].
    """

    rms: float
    largest: float


@dataclass(frozen=True, slots=True)
class Comparison:
    """One attempt, then and now.

    Attributes
    ----------
    now : Attempt
        What becomes of it; ``unfinished`` if it outlasts the recorded one: later, the hands were about another.
    common : int
        Ticks from the release for which both go on: those that are compared [1].
    """

    then: Attempt
    now: Attempt
    common: int
    differences: dict[str, Difference]

    @property
    def changed(self) -> bool:
        """Whether another outcome, or another completion time, came of it."""
        same = (
            self.then.completion == self.now.completion or np.isnan([self.then.completion, self.now.completion]).all()
        )
        return self.then.outcome != self.now.outcome or not same


@dataclass(frozen=True, slots=True)
class WhatIf:
    """A recording, and what becomes of it.

    Attributes
    ----------
    recorded, computed : ndarray of TICK, shape (n,)
        The ticks as recorded, and those of the changed stage with the same inputs.
    """

    recorded: Rows
    computed: Rows
    comparisons: tuple[Comparison, ...]

    @property
    def identical(self) -> bool:
        """Whether every tick is as recorded, to the bit: what was changed does not concern the stage."""
        return np.array_equal(as_words(self.recorded), as_words(self.computed))


def what_if(recorded: Rows, stage: Stage) -> WhatIf:
    """Run recorded hands through a stage, each attempt from its recorded release."""
    attempts = find_attempts(recorded)
    computed = recorded.copy()
    releases = np.searchsorted(recorded["tick"], [attempt.tick for attempt in attempts])
    for first, stop in runs(recorded["tick"]):
        starts = [first, *(int(place) for place in releases if first < place < stop), stop]
        for start, end in pairwise(starts):
            stage.advance(state_of(recorded[start : start + 1]), computed[start:end], 0, end - start)
    return WhatIf(recorded, computed, tuple(_compare(recorded, computed, attempt) for attempt in attempts))


def _compare(recorded: Rows, computed: Rows, then: Attempt) -> Comparison:
    """Compare an attempt with what becomes of it."""
    start, stop = np.searchsorted(recorded["tick"], [then.tick, then.stop])
    # The row after the last one tells how a command has ended it.
    now = find_attempts(computed[start : stop + 1])[0]
    common = min(now.stop, then.stop) - then.tick
    differences = {}
    for quantity in QUANTITIES:
        apart = difference(recorded, computed, quantity, slice(start, start + common))
        differences[quantity.name] = Difference(float(np.sqrt(np.mean(apart**2))), float(np.max(np.abs(apart))))
    return Comparison(then, now, common, differences)


def difference(recorded: Rows, computed: Rows, quantity: Quantity, where: slice) -> NDArray[np.float64]:
    """Return what a quantity is more than it was."""
    return np.asarray(computed[quantity.name][where] - recorded[quantity.name][where], np.float64)


def attempts_of(found: WhatIf) -> Rows:
    """Return the ticks of the attempts alone, each as far as it is comparable: what may be kept of a counterfactual.

    Returns
    -------
    ndarray of TICK, shape (m,)
        Rows of the changed stage. Between two attempts there is a gap, so that each can be verified by itself.
    """
    kept = np.zeros(len(found.computed), bool)
    for comparison in found.comparisons:
        start = int(np.searchsorted(found.computed["tick"], comparison.then.tick))
        kept[start : start + comparison.common] = True
    return found.computed[kept]


def most_telling(comparisons: Sequence[Comparison]) -> Comparison:
    """Choose the attempt to show: the longest of those that end otherwise, else the one whose ball differs most."""
    otherwise = [one for one in comparisons if one.then.outcome != one.now.outcome]
    if otherwise:
        return max(otherwise, key=lambda one: one.common)
    return max(comparisons, key=lambda one: one.differences["p"].rms)


def seconds_since_release(count: int) -> NDArray[np.float64]:
    """Times of the ticks of an attempt."""
    return np.arange(count, dtype=np.float64) * TICK_SECONDS
