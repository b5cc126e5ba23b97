"""Verifies a recording: its inputs, run through the stage of its own configuration, must reproduce its ticks.

Ticks are computed and compared slice by slice, so memory does not grow with the recording's length.
"""

from collections.abc import Iterable
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import Any

import numpy as np
from numpy.typing import NDArray

from netboard.base.errors import RecordingError
from netboard.base.tick import OUTPUT, STATE, TICK, TICK_WORDS
from netboard.recording.files.reader import Recording
from netboard.stage.stage import Stage, make_stage

SLICE = 2048
"""Ticks per slice: with the recorded ones, this many fit into the processor cache [1]."""


@dataclass(frozen=True)
class Verification:
    """Result of a verification."""

    checked: int
    gaps: int  # gaps of missing ticks, after each of which the comparison restarted
    tick: int | None = None  # first tick that is not bit-identical; None if all are
    field: str = ""
    # Recorded and computed value of the differing field, in its own unit [SI].
    recorded: float = 0.0
    computed: float = 0.0

    @property
    def identical(self) -> bool:
        """Whether every tick is bit-identical."""
        return self.tick is None


_STATE = STATE.names or ()
_RESULTS = [*_STATE, *(OUTPUT.names or ())]


def verify(stage: Stage, ticks: NDArray[Any]) -> Verification:
    """Run the stage over recorded inputs and compare every tick bit for bit.

    After a gap the stage continues from the recorded state.
    """
    return verify_portions(stage, (ticks,))


def verify_portions(stage: Stage, portions: Iterable[NDArray[Any]]) -> Verification:
    """Verify ticks that arrive in batches.

    ``portions``: in order. After a gap, within or between batches, the stage continues from the recorded state. Ticks
    after the first difference are not compared.
    """
    verifier = Verifier(stage)
    for rows in portions:
        if not verifier.take(rows):
            break
    return verifier.result


class Verifier:
    """Recomputes recorded ticks as they arrive."""

    def __init__(self, stage: Stage) -> None:
        self.result = Verification(0, 0)
        self._stage = stage
        self._state = np.zeros(1, STATE)
        self._next: int | None = None
        self._computed = np.zeros(SLICE, TICK)

    def take(self, rows: NDArray[Any]) -> bool:
        """Recompute the next ticks; return False if any tick so far differs."""
        for first, stop in runs(rows["tick"]):
            if self._next != rows["tick"][first]:
                known = self._next is not None
                self.result = replace(self.result, gaps=self.result.gaps + known)
                self._state = state_of(rows[first : first + 1])
            for start in range(first, stop, SLICE):
                if not (self.result.identical and self._compare(rows[start : min(start + SLICE, stop)])):
                    return False
            self._next = int(rows["tick"][stop - 1]) + 1
        return True

    def _compare(self, recorded: NDArray[Any]) -> bool:
        """Recompute consecutive ticks."""
        computed = self._computed[: len(recorded)]
        words = as_words(recorded)
        as_words(computed)[:] = words  # as integers: numpy copies structured types field by field
        self._stage.advance(self._state, computed, 0, len(computed))
        checked = self.result.checked
        if np.array_equal(words, as_words(computed)):
            self.result = replace(self.result, checked=checked + len(recorded))
            return True
        i, name = _first_difference(recorded, computed)
        self.result = Verification(
            checked + i + 1,
            self.result.gaps,
            int(recorded["tick"][i]),
            name,
            recorded[name][i].item(),
            computed[name][i].item(),
        )
        return False


def state_of(row: NDArray[Any]) -> NDArray[Any]:
    """Return the state at the start of a tick, from its row."""
    state = np.zeros(1, STATE)
    for name in _STATE:
        state[name] = row[name]
    return state


def runs(numbers: NDArray[np.int64]) -> list[tuple[int, int]]:
    """Split numbers into runs of consecutive ones. Returns their first and end indices."""
    if len(numbers) == 0:
        return []
    breaks = np.flatnonzero(np.diff(numbers) != 1) + 1
    edges = [0, *breaks.tolist(), len(numbers)]
    return list(pairwise(edges))


def as_words(rows: NDArray[Any]) -> NDArray[np.int64]:
    """View rows as 64-bit integers, so that NaN equals NaN and -0 differs from 0.

    It is a view of the same memory if the rows are contiguous.
    """
    return np.ascontiguousarray(rows).view(np.int64).reshape(len(rows), -1)


def _first_difference(recorded: NDArray[Any], computed: NDArray[Any]) -> tuple[int, str]:
    """Return row index and field of the first value that is not bit-identical, in the order of the computation."""
    differs = as_words(recorded) != as_words(computed)
    i = int(np.argmax(differs.any(axis=1)))
    return i, next(name for name in _RESULTS if differs[i, TICK_WORDS[name]])


def why_not_computable(recording: Recording) -> str:
    """Return why the ticks of a recording cannot be computed again; empty if they can."""
    if recording.metadata["format"] == "1":
        return "format 1 lacks the inputs that are needed to compute its ticks again"
    if recording.metadata.get("imported") == "measured":
        return "its ticks were measured by another program, so no stage can compute them again"
    return ""


def verify_recording(recording: Recording) -> Verification:
    """Verify the checksums of an open recording, and every tick."""
    recording.check()
    if why := why_not_computable(recording):
        raise RecordingError(f"{recording.path}: {why}")
    stage = make_stage(recording.config)
    result = verify_portions(stage, recording.batches(as_sent=True))
    if not result.checked:
        raise RecordingError(f"{recording.path}: has no tick to verify")
    return result
