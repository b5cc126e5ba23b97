"""A recording proves itself: its inputs, run through the stage of its own configuration, give its ticks again.

Ticks are computed and compared a slice at a time, so that a recording of any length needs the memory of one portion.
"""

from collections.abc import Iterable
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import Any

import numpy as np
from numpy.typing import NDArray

from netboard.base.config import parse
from netboard.base.errors import RecordingError
from netboard.base.tick import OUTPUT, STATE, TICK
from netboard.recording.files.reader import Recording
from netboard.stage.stage import Stage, make_stage

SLICE = 2048
"""Ticks computed at once: with what they are compared to, so many fit into a processor's own memory [1]."""


@dataclass(frozen=True)
class Verdict:
    """Outcome of a verification.

    Attributes
    ----------
    gaps : int
        Places where ticks are missing and the comparison started afresh [1].
    tick : int or None
        First tick that is not identical to the bit; None if all are [1].
    recorded, computed : float
        The two values of that field, in its own unit [SI].
    """

    checked: int
    gaps: int
    tick: int | None = None
    field: str = ""
    recorded: float = 0.0
    computed: float = 0.0

    @property
    def identical(self) -> bool:
        """Whether every tick is identical to the bit."""
        return self.tick is None


_STATE = STATE.names or ()
_RESULTS = [*_STATE, *(OUTPUT.names or ())]
_PLACES = {name: place for place, name in enumerate(TICK.names or ())}


def verify(stage: Stage, ticks: NDArray[Any]) -> Verdict:
    """Run the stage over recorded inputs and compare every tick to the bit.

    Parameters
    ----------
    ticks : ndarray of TICK, shape (n,)
        The recorded ticks, in order. After a gap the recorded state is taken over.
    """
    return verify_portions(stage, (ticks,))


def verify_portions(stage: Stage, portions: Iterable[NDArray[Any]]) -> Verdict:
    """Do the same with ticks that come in portions.

    Parameters
    ----------
    portions : iterable of ndarray of TICK
        The recorded ticks, in order. After a gap, within a portion or between two, the recorded state is taken over.

    Returns
    -------
    Verdict
        Identical, or where and how not; what comes after the first difference is not looked at.
    """
    verifier = Verifier(stage)
    for rows in portions:
        if not verifier.take(rows):
            break
    return verifier.verdict


class Verifier:
    """Computes recorded ticks again as they come."""

    def __init__(self, stage: Stage) -> None:
        self.verdict = Verdict(0, 0)
        self._stage = stage
        self._state = np.zeros(1, STATE)
        self._next: int | None = None
        self._computed = np.zeros(SLICE, TICK)

    def take(self, rows: NDArray[Any]) -> bool:
        """Compute the next ticks; False if there was a difference, now or before."""
        for first, stop in runs(rows["tick"]):
            if self._next != rows["tick"][first]:
                known = self._next is not None
                self.verdict = replace(self.verdict, gaps=self.verdict.gaps + known)
                self._state = state_of(rows[first : first + 1])
            for start in range(first, stop, SLICE):
                if not (self.verdict.identical and self._compare(rows[start : min(start + SLICE, stop)])):
                    return False
            self._next = int(rows["tick"][stop - 1]) + 1
        return True

    def _compare(self, recorded: NDArray[Any]) -> bool:
        """Compute some ticks in a row."""
        computed = self._computed[: len(recorded)]
        words = as_words(recorded)
        as_words(computed)[:] = words  # as plain words: numpy copies structured types field by field
        self._stage.advance(self._state, computed, 0, len(computed))
        checked = self.verdict.checked
        if np.array_equal(words, as_words(computed)):
            self.verdict = replace(self.verdict, checked=checked + len(recorded))
            return True
        i, name = _first_difference(recorded, computed)
        self.verdict = Verdict(
            checked + i + 1,
            self.verdict.gaps,
            int(recorded["tick"][i]),
            name,
            recorded[name][i].item(),
            computed[name][i].item(),
        )
        return False


def state_of(row: NDArray[Any]) -> NDArray[Any]:
    """State found by a tick, from its row."""
    state = np.zeros(1, STATE)
    for name in _STATE:
        state[name] = row[name]
    return state


def runs(numbers: NDArray[np.int64]) -> list[tuple[int, int]]:
    """Split numbers where they do not go up by one.

    Returns
    -------
    list of (int, int)
        First index and the index after the last, of each run [1].
    """
    if len(numbers) == 0:
        return []
    breaks = np.flatnonzero(np.diff(numbers) != 1) + 1
    edges = [0, *breaks.tolist(), len(numbers)]
    return list(pairwise(edges))


def as_words(rows: NDArray[Any]) -> NDArray[np.int64]:
    """Look at rows as words of 64 bits, so that NaN equals NaN and -0 is not 0.

    Returns
    -------
    ndarray of int64, shape (n, words)
        The same memory, if they lie one after the other [1].
    """
    return np.ascontiguousarray(rows).view(np.int64).reshape(len(rows), -1)


def _first_difference(recorded: NDArray[Any], computed: NDArray[Any]) -> tuple[int, str]:
    """Index and field of the first value that is not the same to the bit; results are looked at in their order."""
    differs = as_words(recorded) != as_words(computed)
    i = int(np.argmax(differs.any(axis=1)))
    return i, next(name for name in _RESULTS if differs[i, _PLACES[name]])


def verify_recording(recording: Recording) -> Verdict:
    """Compute every tick of an open recording again and compare it to the bit."""
    stage = make_stage(parse(recording.config_text, f"{recording.path} (its configuration)"))
    verdict = verify_portions(stage, recording.batches(as_sent=True))
    if not verdict.checked:
        raise RecordingError(f"{recording.path}: has no tick to verify")
    return verdict
