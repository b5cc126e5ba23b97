"""The curtain: what a participant may see of a tick. The only place that makes a `View`.

The server shows each station the result of `view_of` and nothing else; the replay shows the same. In a dyadic block a
participant sees the board, the ball, the target and the own stylus; in a bimanual block the one participant sees both
styluses. The partner's hand is never in a view. (The board itself follows both hands within some ten milliseconds, so
whoever sees the board can infer where the partner's end is: that is the task.)
"""

from dataclasses import dataclass
from operator import itemgetter
from typing import Any

import numpy as np
from numpy.typing import NDArray

from netboard.config import Config, Side
from netboard.experiment.machine import Phase
from netboard.tick import TICK
from netboard.wire.messages import View

AGAIN = "Once more: same target"
"""What participants read before another attempt at the same trial."""

PHASE_NAMES = {int(phase): phase.name.lower() for phase in Phase}


@dataclass(frozen=True, slots=True)
class Curtain:
    """What there is to see in a block, and who may see which hand.

    Attributes
    ----------
    dyadic : bool
        Two participants, each seeing only the own stylus.
    ball : bool
        Whether there is a ball.
    target_distance : float
        Target centre to board centre [m].
    trials : int
        Successful trials the block asks for [1].
    """

    dyadic: bool
    ball: bool
    target_distance: float
    trials: int


def make_curtain(config: Config) -> Curtain:
    """Take from the configuration what the curtain needs.

    Parameters
    ----------
    config : Config
        The whole configuration.
    """
    return Curtain(
        dyadic=config.block.configuration == "dyadic",
        ball=config.physics.balls > 0,
        target_distance=config.geometry.target_distance,
        trials=config.block.trials,
    )


_SHOWN = (
    *("phase", "attempt", "target", "tick", "z", "theta", "p", "left_used_z", "right_used_z"),
    *("trial", "failures", "completion"),
)
_shown = itemgetter(*((TICK.names or ()).index(name) for name in _SHOWN))
"""Takes what views are made of from the values of a row."""


def view_of(curtain: Curtain, row: NDArray[Any] | np.void, station: Side, best: float | None, sent_ns: int) -> View:
    """What one station may see of one tick.

    Parameters
    ----------
    curtain : Curtain
        Who may see what.
    row : netboard.tick.TICK record
        The tick.
    station : str
        ``left`` or ``right``.
    best : float or None
        Best completion time of the block so far [s].
    sent_ns : int
        Server time of sending [ns].
    """
    phase, attempt, target, tick, z, theta, p, left, right, trial, failures, completion = _shown(row.item())
    return View(
        station=station,
        tick=tick,
        sent_ns=sent_ns,
        phase=PHASE_NAMES[phase],
        z=z,
        theta=theta,
        p=p if curtain.ball else None,
        target=target * curtain.target_distance,
        left=None if curtain.dyadic and station != "left" else left,
        right=None if curtain.dyadic and station != "right" else right,
        trial=trial,
        trials=curtain.trials,
        failures=failures,
        completion=completion if completion > 0 else None,
        best=best,
        notice=AGAIN if phase == Phase.LEVELLING and attempt > 1 else "",
    )
