"""The curtain: what a participant may see of a tick. `shown_of` has all its rules.

The server sends each station what `netboard.network.protocol.view_frame.write_view` makes of `shown_of`, and nothing
else; `view_of` makes the same `View` of it for a replay. In a dyadic block a participant sees the board, the ball, the
target and their own stylus. In a bimanual block the one participant sees both styluses; the other, who has nothing to
do, sees neither board nor ball nor the result. The partner's hand is never in a view. (The board itself follows both
hands within some ten milliseconds, so a participant can infer the partner's end from the board: that is the task.)
"""

from collections.abc import Mapping
from dataclasses import dataclass
from enum import IntEnum
from math import isnan
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from netboard.base.compiled import Numbers, Records, Words, inlined, kernel
from netboard.base.config import SIDES, Config, Side
from netboard.base.tables.experiment import PERSON, STILL, Block
from netboard.base.tick import TICK_WORDS
from netboard.stage.view import View
from netboard.task.trials.state_machine import Phase, ticks

AGAIN = "again"
"""The notice before another attempt at the same trial; a display has a line for it in its language."""


class Pause(IntEnum):
    """What participants read during a pause, or after a block that may go on."""

    NONE = 0
    OPERATOR = 1  # the operator has paused
    FAULT = 2  # something is missing, or does not work
    STOP = 3  # an emergency stop
    REPEATS = 4  # the block was over: some of its trials are repeated
    DECISION = 5  # the block is over, and the operator decides whether trials are repeated


PAUSE_NOTICES = ("", *(f"pause_{pause.name.lower()}" for pause in Pause if pause))
"""The notice of each `Pause`; a display has a line for it in its language."""

AWAY = "away"
"""The phase of a view for somebody who has nothing to do in the block."""

PHASE_NAMES = {int(phase): phase.name.lower() for phase in Phase}


CURTAIN = np.dtype(
    [
        ("station", "<i8"),  # place of the station in `SIDES`
        ("away", "<i8"),  # 1: this station has nothing to do
        ("last", "<i8"),  # 1: no block follows
        ("ball", "<i8"),  # 1: there is a ball
        ("left", "<i8"),  # 1: the left hand is shown
        ("right", "<i8"),
        ("target_distance", "<f8"),  # target centre to board centre [m]
        ("trials", "<i8"),  # successful trials the block asks for [1]
        ("block", "<i8"),  # number of the block in its plan, from 1 [1]
        ("blocks", "<i8"),  # number of blocks in the plan [1]
        ("levelling", "<i8"),  # ticks for which the board must be level, 0 for none [1]
        ("holding", "<i8"),  # ticks for which the ball must be in the target, 0 for none [1]
    ]
)
"""What the participants of a block may see at one station, for the kernels."""


@dataclass(frozen=True, slots=True)
class Curtain:
    """What the participants of a block may see: the parts of the scene, and whose hand.

    Attributes
    ----------
    ball : bool
        Whether there is a ball.
    block : int
        Number of the block in its plan, from 1 [1].
    away : tuple of str
        Stations whose participant has nothing to do.
    stations : dict of ndarray of CURTAIN, shape (1,)
        What each station may see.
    partners : dict of ndarray of CURTAIN, shape (1,)
        What the robot partner at each side may see: as much as a person there. Empty without one.
    """

    ball: bool
    block: int
    away: tuple[Side, ...]
    stations: Mapping[Side, NDArray[Any]]
    partners: Mapping[Side, NDArray[Any]]


def make_curtain(config: Config) -> Curtain:
    """Take from the configuration what the curtain needs."""
    block, ball = config.block, config.physics.balls > 0
    away = tuple(side for side in SIDES if _is_away(block, side))
    stations = {side: _pack(config, side, away=side in away) for side in SIDES}
    robots = [side for side in SIDES if getattr(block, side) not in (PERSON, STILL)]
    partners = {side: _pack(config, side, away=False) for side in robots}
    return Curtain(ball, block.number, away, stations, partners)


def _is_away(block: Block, station: Side) -> bool:
    """Whether nobody at a station takes part in a block."""
    if block.configuration == "bimanual":
        return station != block.station
    return (block.left if station == "left" else block.right) != PERSON


def _pack(config: Config, station: Side, *, away: bool) -> NDArray[Any]:
    """Pack what one station may see."""
    block, packed = config.block, np.zeros(1, CURTAIN)
    packed["station"], packed["away"], packed["ball"] = SIDES.index(station), away, config.physics.balls > 0
    for side in SIDES:
        packed[side] = block.configuration != "dyadic" or station == side
    packed["target_distance"], packed["trials"] = config.geometry.target_distance, block.trials
    packed["block"], packed["blocks"], packed["last"] = block.number, block.blocks, block.number >= block.blocks
    packed["levelling"], packed["holding"] = ticks(config.task.level_time), ticks(config.task.hold_time)
    return packed


class Shown(NamedTuple):
    """What one station may see of a tick; NaN for what is hidden or not known yet. See `View`."""

    phase: int  # number of a phase, or `NO_PHASE` for `AWAY`
    z: float
    theta: float
    p: float
    target: float
    left: float
    right: float
    trial: int
    trials: int
    failures: int
    completion: float
    again: bool  # whether the notice is `AGAIN`
    share: float
    best: float
    pause: int  # number of a `Pause`


NO_PHASE = -1
"""Phase for somebody who has nothing to do, as a number."""

_PHASE, _TARGET, _Z, _THETA, _P, _LEFT, _RIGHT = (
    TICK_WORDS[name] for name in ("phase", "target", "z", "theta", "p", "left_used_z", "right_used_z")
)
_TRIAL, _ATTEMPT, _FAILURES, _COMPLETION, _COUNTED, _EXTRA, TICK_NUMBER = (
    TICK_WORDS[name] for name in ("trial", "attempt", "failures", "completion", "counted", "extra", "tick")
)
_LEVELLING, _HOLDING, _FINISHED = int(Phase.LEVELLING), int(Phase.HOLDING), int(Phase.FINISHED)


@inlined
def shown_of(curtain: np.void, words: Words, numbers: Numbers, best: float, pause: int) -> Shown:
    """Return what one station may see of a tick. These are the rules of the curtain.

    Parameters
    ----------
    best : float
        Best completion time of the block so far, NaN for none [s].
    pause : int
        What is said of a pause: a `Pause` [1].
    """
    phase, away = words[_PHASE], curtain["away"] != 0
    hidden = away and not (curtain["last"] and phase == _FINISHED)  # the end of the last block is for everybody
    ticks = curtain["levelling"] if phase == _LEVELLING else curtain["holding"] if phase == _HOLDING else 0
    completion = numbers[_COMPLETION]
    return Shown(
        NO_PHASE if hidden else phase,
        0.0 if away else numbers[_Z],
        0.0 if away else numbers[_THETA],
        numbers[_P] if curtain["ball"] and not away else np.nan,
        0.0 if away else words[_TARGET] * curtain["target_distance"],
        numbers[_LEFT] if curtain["left"] and not away else np.nan,
        numbers[_RIGHT] if curtain["right"] and not away else np.nan,
        words[_TRIAL],
        curtain["trials"] + words[_EXTRA],
        0 if away else words[_FAILURES],
        completion if completion > 0.0 and not away else np.nan,
        phase == _LEVELLING and words[_ATTEMPT] > 1 and not away,
        min(max(words[_COUNTED] / ticks, 0.0), 1.0) if ticks and not away else 0.0,
        np.nan if away else best,
        0 if hidden else pause,
    )


@kernel
def _shown(curtain: Records, words: Words, best: float, pause: int) -> Shown:
    """Return `shown_of` for an array of one record."""
    return shown_of(curtain[0], words, words.view(np.float64), best, pause)


def view_of(
    curtain: Curtain,
    row: np.void,
    station: Side,
    best: float | None,
    sent_ns: int,
    seq: int = 0,
    rest: float | None = None,
    pause: Pause = Pause.NONE,
) -> View:
    """What one station may see of one tick.

    Parameters
    ----------
    row : netboard.base.tick.TICK record
        The tick to show, which stays as it is.
    best : float or None
        Best completion time of the block so far [s].
    sent_ns : int
        Server time at which the view is sent [ns].
    seq : int
        Number of the view at its station: one more than that of the view sent before [1].
    rest : float or None
        Remaining rest before the block; None without one [s].
    pause : Pause
        What is said of a pause.
    """
    packed, words = curtain.stations[station], np.frombuffer(row.data, np.int64)
    shown = _shown(packed, words, np.nan if best is None else best, int(pause))
    return View(
        station=station,
        tick=int(words[TICK_NUMBER]),
        sent_ns=sent_ns,
        phase=AWAY if shown.phase == NO_PHASE else PHASE_NAMES[shown.phase],
        z=shown.z,
        theta=shown.theta,
        p=_known(shown.p),
        target=shown.target,
        left=_known(shown.left),
        right=_known(shown.right),
        trial=shown.trial,
        trials=shown.trials,
        failures=shown.failures,
        completion=_known(shown.completion),
        best=_known(shown.best),
        notice=AGAIN if shown.again else PAUSE_NOTICES[shown.pause],
        seq=seq,
        share=shown.share,
        block=curtain.block,
        blocks=int(packed["blocks"][0]),
        rest=rest,
    )


def _known(value: float) -> float | None:
    return None if isnan(value) else value


@kernel
def glimpse(curtain: np.void, words: Words, numbers: Numbers, when: float, seen: np.void) -> None:
    """Write what one station sees of a tick, for a simulated participant.

    Parameters
    ----------
    when : float
        Time at which the station displays the tick [s].
    seen : record of netboard.participants.policy.SEEN
        What is seen, written; NaN for what is hidden.
    """
    shown = shown_of(curtain, words, numbers, np.nan, 0)
    seen["time"], seen["phase"] = when, shown.phase
    seen["z"], seen["theta"], seen["p"], seen["target"] = shown.z, shown.theta, shown.p, shown.target
    seen["left"], seen["right"] = shown.left, shown.right
