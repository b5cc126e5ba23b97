"""The forces of another session, trial by trial, for blocks in which the hands feel those.

Only attempts that succeeded count, from the release of the ball to the end of the hold. Our trial k has the forces of
the k-th of them (from the first again, when there are no more), in all its attempts: the first force while the ball is
fixed, then millisecond by millisecond, and the last one if our trial takes longer. Where the target was at the other
side the hands change places, so that what is felt belongs to a ball that goes the same way.
"""

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from netboard.base.errors import ConfigError
from netboard.task.trials.state_machine import BALL_FREE, Cause


@dataclass(frozen=True)
class Unrelated:
    """What hands felt in the successful attempts of another session.

    Attributes
    ----------
    trials : tuple of ndarray of float64, shape (ticks, 2)
        Forces on the left and the right hand, + = up, one a tick since the release, for a target on the right [N].
    """

    trials: tuple[NDArray[np.float64], ...]

    def at(self, state: Any) -> tuple[float, float]:
        """Return the forces for a tick: its `left_other` and `right_other`.

        Parameters
        ----------
        state : netboard.base.tick.STATE record
            The state that the tick finds.

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
    """Take the forces from the ticks of a recording.

    Parameters
    ----------
    ticks : ndarray of TICK, shape (n,)
        The ticks, in order; an attempt with a hole is left out, and one in which nothing was felt.
    source : str
        Name of the recording, for the message.

    Returns
    -------
    Unrelated
        Its forces.

    Raises
    ------
    ConfigError
        If there is no such attempt.
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
        raise ConfigError(
            f"[block] unrelated: {source}: found no successful trial in which anything was felt, expected one or more"
        )
    return Unrelated(tuple(found))
