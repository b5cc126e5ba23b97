"""Haptic feedback from another session: recorded forces that are unrelated to the present trial (a control condition).

Only successful attempts are used, from the release of the ball to the end of the hold. Trial k plays back the forces of
the k-th of them, and starts again with the first when there are no more. All attempts at a trial get the same forces:
the first one while the ball is fixed, then one per tick, and the last one if the trial takes longer. If the target was
on the other side, the hands are swapped, so that the forces fit a ball that moves in the same direction.
"""

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from netboard.base.errors import ConfigError
from netboard.task.trials.state_machine import BALL_FREE, Cause


@dataclass(frozen=True)
class Unrelated:
    """Forces on the hands in the successful attempts of another session.

    Attributes
    ----------
    trials : tuple of ndarray of float64, shape (ticks, 2)
        Forces on the left and the right hand, + = up, one per tick from the release, for a target on the right [N].
    """

    trials: tuple[NDArray[np.float64], ...]

    def at(self, state: np.void) -> tuple[float, float]:
        """Return the forces for a tick: its `left_other` and `right_other`.

        Parameters
        ----------
        state : netboard.base.tick.STATE record
            The state at the beginning of the tick.

        Returns
        -------
        left, right : float
            Forces on the hands, + = up [N].
        """
        forces = self.trials[(int(state["trial"]) - 1) % len(self.trials)]
        since = int(state["run_ticks"]) if state["phase"] in BALL_FREE else 0
        left, right = forces[min(since, len(forces) - 1)].tolist()
        return (left, right) if state["target"] > 0 else (right, left)


def unrelated_of(ticks: NDArray[Any], source: str) -> Unrelated:
    """Extract the forces from the ticks of a recording.

    Parameters
    ----------
    ticks : ndarray of TICK, shape (n,)
        The ticks, in order. Attempts with missing ticks or without any force are skipped.
    source : str
        Name of the recording, for the error message.

    Returns
    -------
    Unrelated
        The forces of the recording.

    Raises
    ------
    ConfigError
        If no attempt can be used.
    """
    found = []
    for last in np.flatnonzero(ticks["event"] == Cause.HELD).tolist():
        row = ticks[last]
        first = last - int(row["run_ticks"])
        if first < 0 or ticks["run_ticks"][first] != 0 or ticks["tick"][first] != row["tick"] - row["run_ticks"]:
            continue
        sides = ("left", "right") if row["target"] > 0 else ("right", "left")
        forces = np.stack([ticks[f"{side}_force"][first : last + 1] for side in sides], axis=1)
        if np.isfinite(forces).all() and forces.any():
            found.append(forces)
    if not found:
        raise ConfigError(f"[block] unrelated: {source}: found no successful trial with forces, expected at least one")
    return Unrelated(tuple(found))
