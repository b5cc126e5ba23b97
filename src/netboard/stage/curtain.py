"""The curtain: what a participant may see of a tick. The only place that makes a `View`.

The server shows each station the result of `view_of` and nothing else; the replay shows the same. In a dyadic block a
participant sees the board, the ball, the target and their own stylus. In a bimanual block the one participant sees both
styluses; the other, who has nothing to do, sees neither board nor ball nor the result. The partner's hand is never in
a view. (The board itself follows both hands within some ten milliseconds, so a participant can infer the partner's end
from the board: that is the task.)
"""

from dataclasses import dataclass
from operator import itemgetter
from typing import Any

import numpy as np
from numpy.typing import NDArray

from netboard.base.compiled import kernel
from netboard.base.config import SIDES, Config, Side
from netboard.base.tables.experiment import Block
from netboard.base.tick import TICK_WORDS
from netboard.stage.view import View
from netboard.task.trials.state_machine import Phase, ticks

AGAIN = "again"
"""The notice before another attempt at the same trial; a display has a line for it in its language."""

AWAY = "away"
"""The phase of a view for somebody who has nothing to do in the block."""

PHASE_NAMES = {int(phase): phase.name.lower() for phase in Phase}


@dataclass(frozen=True, slots=True)
class Curtain:
    """What the participants of a block may see: the parts of the scene, and whose hand.

    Attributes
    ----------
    dyadic : bool
        Two participants, each seeing only their own stylus.
    ball : bool
        Whether there is a ball.
    target_distance : float
        Target centre to board centre [m].
    trials : int
        Successful trials the block asks for [1].
    block, blocks : int
        Number of the block in its plan, from 1, and how many there are [1].
    away : tuple of str
        Stations whose participant has nothing to do.
    durations : dict of int
        Ticks for which a phase must last, by phase [1].
    """

    dyadic: bool
    ball: bool
    target_distance: float
    trials: int
    block: int
    blocks: int
    away: tuple[Side, ...]
    durations: dict[int, int]

    @property
    def last(self) -> bool:
        """Whether no block follows."""
        return self.block >= self.blocks


def make_curtain(config: Config) -> Curtain:
    """Take from the configuration what the curtain needs."""
    block, task = config.block, config.task
    return Curtain(
        dyadic=block.configuration == "dyadic",
        ball=config.physics.balls > 0,
        target_distance=config.geometry.target_distance,
        trials=block.trials,
        block=block.number,
        blocks=block.blocks,
        away=tuple(side for side in SIDES if _is_away(block, side)),
        durations={
            int(Phase.LEVELLING): ticks(task.level_time),
            int(Phase.HOLDING): ticks(task.hold_time),
        },
    )


def _is_away(block: Block, station: Side) -> bool:
    """Whether nobody at a station takes part in a block."""
    if block.configuration == "bimanual":
        return station != block.station
    return (block.left if station == "left" else block.right) != "person"


_SHOWN = (
    *("phase", "attempt", "target", "tick", "z", "theta", "p", "left_used_z", "right_used_z"),
    *("trial", "failures", "completion", "counted", "extra"),
)
_shown = itemgetter(*(TICK_WORDS[name] for name in _SHOWN))
"""Takes what views are made of from the values of a row."""


def view_of(
    curtain: Curtain,
    row: NDArray[Any] | np.void | tuple[Any, ...],
    station: Side,
    best: float | None,
    sent_ns: int,
    seq: int = 0,
    rest: float | None = None,
) -> View:
    """What one station may see of one tick.

    Parameters
    ----------
    row : netboard.base.tick.TICK record, or tuple
        The tick, or its values (`numpy.ndarray.item`).
    best : float or None
        Best completion time of the block so far [s].
    sent_ns : int
        Server time at which the view is sent [ns].
    seq : int
        Number of the view at its station: one more than that of the view sent before [1].
    rest : float or None
        Remaining rest before the block; None without one [s].
    """
    phase, attempt, target, tick, z, theta, p, left, right, trial, failures, completion, counted, extra = _shown(
        row if isinstance(row, tuple) else row.item()
    )
    away = station in curtain.away
    over = phase == Phase.FINISHED and curtain.last  # for both participants
    duration = curtain.durations.get(phase, 0)
    return View(
        station=station,
        tick=tick,
        sent_ns=sent_ns,
        phase=AWAY if away and not over else PHASE_NAMES[phase],
        z=0.0 if away else z,
        theta=0.0 if away else theta,
        p=p if curtain.ball and not away else None,
        target=0.0 if away else target * curtain.target_distance,
        left=None if away or (curtain.dyadic and station != "left") else left,
        right=None if away or (curtain.dyadic and station != "right") else right,
        trial=trial,
        trials=curtain.trials + extra,
        failures=0 if away else failures,
        completion=completion if completion > 0 and not away else None,
        best=None if away else best,
        notice=AGAIN if phase == Phase.LEVELLING and attempt > 1 and not away else "",
        seq=seq,
        share=min(max(counted / duration, 0.0), 1.0) if duration and not away else 0.0,
        block=curtain.block,
        blocks=curtain.blocks,
        rest=rest,
    )


CURTAIN = np.dtype(
    [
        ("away", "<i8"),  # 1: this station has nothing to do
        ("last", "<i8"),  # 1: no block follows
        ("ball", "<i8"),  # 1: there is a ball
        ("left", "<i8"),  # 1: the left hand is shown
        ("right", "<i8"),
        ("target_distance", "<f8"),  # [m]
    ]
)
"""What one station may see, for the kernels."""

_PHASE, _TARGET, _Z, _THETA, _P, _LEFT, _RIGHT = (
    TICK_WORDS[name] for name in ("phase", "target", "z", "theta", "p", "left_used_z", "right_used_z")
)


_FINISHED = int(Phase.FINISHED)


def pack_curtain(curtain: Curtain, station: Side) -> NDArray[Any]:
    """Pack for the kernels what one station may see.

    Returns
    -------
    ndarray of CURTAIN, shape (1,)
        The packed record.
    """
    packed = np.zeros(1, CURTAIN)
    packed["away"], packed["last"], packed["ball"] = station in curtain.away, curtain.last, curtain.ball
    for side in SIDES:
        packed[side] = not curtain.dyadic or station == side
    packed["target_distance"] = curtain.target_distance
    return packed


@kernel
def glimpse(curtain: Any, words: Any, numbers: Any, when: float, shown: Any) -> None:
    """Write what one station sees of a tick, as in its `view_of`, for a simulated participant.

    Parameters
    ----------
    words : ndarray of int64, shape (n,)
        The row of the tick as words.
    numbers : ndarray of float64, shape (n,)
        The same memory as numbers.
    when : float
        Time at which the station displays the tick [s].
    shown : record of netboard.participants.senses.SEEN
        What is seen, written; NaN for what is hidden, phase -1 for a participant who is away (as in `view_of`).
    """
    away = curtain["away"]
    hidden = away and not (curtain["last"] and words[_PHASE] == _FINISHED)
    shown["time"], shown["phase"] = when, -1 if hidden else words[_PHASE]
    shown["z"], shown["theta"] = 0.0 if away else numbers[_Z], 0.0 if away else numbers[_THETA]
    shown["p"] = numbers[_P] if curtain["ball"] and not away else np.nan
    shown["target"] = 0.0 if away else words[_TARGET] * curtain["target_distance"]
    shown["left"] = numbers[_LEFT] if curtain["left"] and not away else np.nan
    shown["right"] = numbers[_RIGHT] if curtain["right"] and not away else np.nan
