"""A recording proves itself: its inputs, run through the stage of its own configuration, give its ticks again."""

from dataclasses import dataclass
from itertools import pairwise
from typing import Any

import numpy as np
from numpy.typing import NDArray

from netboard.config import parse
from netboard.errors import RecordingError
from netboard.recording.reader import Recording
from netboard.stage import Stage, make_stage
from netboard.tick import OUTPUT, STATE


@dataclass(frozen=True)
class Verdict:
    """Outcome of a verification.

    Attributes
    ----------
    checked : int
        Ticks computed again and compared [1].
    gaps : int
        Places where ticks are missing and the comparison started afresh [1].
    tick : int or None
        First tick that is not identical to the bit; None if all are [1].
    field : str
        Its first field that differs.
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


def verify(stage: Stage, ticks: NDArray[Any]) -> Verdict:
    """Run the stage over recorded inputs and compare every tick to the bit.

    Parameters
    ----------
    stage : Stage
        Made from the recording's own configuration.
    ticks : ndarray of TICK, shape (n,)
        The recorded ticks, in order. After a gap the recorded state is taken over.

    Returns
    -------
    Verdict
        Identical, or where and how not.
    """
    runs = _runs(ticks["tick"])
    for first, stop in runs:
        recorded = ticks[first:stop]
        computed = recorded.copy()
        state = state_of(recorded[:1])
        stage.advance(state, computed, 0, len(computed))
        difference = _first_difference(recorded, computed)
        if difference is not None:
            i, name = difference
            return Verdict(
                first + i + 1,
                len(runs) - 1,
                int(recorded["tick"][i]),
                name,
                recorded[name][i].item(),
                computed[name][i].item(),
            )
    return Verdict(len(ticks), max(len(runs) - 1, 0))


def state_of(row: NDArray[Any]) -> NDArray[Any]:
    """State found by a tick, from its row.

    Parameters
    ----------
    row : ndarray of TICK, shape (1,)
        The row.

    Returns
    -------
    ndarray of STATE, shape (1,)
        The state at that tick.
    """
    state = np.zeros(1, STATE)
    for name in _STATE:
        state[name] = row[name]
    return state


def _runs(numbers: NDArray[np.int64]) -> list[tuple[int, int]]:
    """Split consecutive tick numbers into (first index, index after the last)."""
    if len(numbers) == 0:
        return []
    breaks = np.flatnonzero(np.diff(numbers) != 1) + 1
    edges = [0, *breaks.tolist(), len(numbers)]
    return list(pairwise(edges))


def _bits(values: NDArray[Any]) -> NDArray[np.int64]:
    """The 64-bit patterns of a column, so that NaN equals NaN and -0 is not 0."""
    return np.ascontiguousarray(values).view(np.int64)


def _first_difference(recorded: NDArray[Any], computed: NDArray[Any]) -> tuple[int, str] | None:
    """Index and field of the first value that is not the same to the bit."""
    found: list[tuple[int, str]] = []
    for name in _RESULTS:
        same = _bits(recorded[name]) == _bits(computed[name])
        if not same.all():
            found.append((int(np.argmin(same)), name))
    return min(found, key=lambda place: place[0], default=None)


def verify_recording(recording: Recording) -> Verdict:
    """Compute every tick of an open recording again and compare it to the bit.

    Parameters
    ----------
    recording : Recording
        The recording.

    Returns
    -------
    Verdict
        Identical, or where and how not.

    Raises
    ------
    RecordingError
        If it cannot be read or has no tick: nothing would be proved.
    ConfigError
        If its configuration is not one of this version.
    """
    ticks = recording.ticks()
    if not len(ticks):
        raise RecordingError(f"{recording.path}: has no tick to verify")
    return verify(make_stage(parse(recording.config_text, str(recording.path))), ticks)
