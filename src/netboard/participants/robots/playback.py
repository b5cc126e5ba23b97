"""Playback: a robot that moves its hand as one was recorded, whatever its partner does.

It is the control for a partner that reacts (Ganesh et al. 2014): the same movements and the same mechanics, without an
answer to anything that happens now. With each release of the ball it plays the next recorded trial in which the target
was at the same side of that hand, and begins anew after the last one. After the end of a trial it stays where it is,
and while the board is levelled it goes back to height 0. Of the board it sees only when trials begin, and where their
target is. `netboard.recording.importing.recorded_hand` reads the recording.

Rule 1: no observation but the times of the trials, the side of the target and the height of its own hand has an effect
on its action.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Annotated, Any, ClassVar, Literal, final

import numpy as np
from numpy.typing import NDArray

from netboard.base.compiled import inlined
from netboard.base.config import Config, Side
from netboard.base.errors import ConfigError
from netboard.base.settings import about
from netboard.base.tick import TICK_SECONDS
from netboard.participants.policy import identity_of
from netboard.participants.robots.robot import HAND, HAND_SOURCES, HandParameters, HandPolicy, move_hand, pack_hand
from netboard.task.trials.state_machine import is_active, is_free

STEP_TICKS = 5
"""Ticks between two heights that are kept of a movement; it is linear between them [1]."""

MOST_HEIGHTS = 1 << 16
"""Heights of all movements together, at most: 328 s of movement [1]."""

MOST_TRIALS = 1024
"""Movements, at most [1]."""


@dataclass(frozen=True, slots=True)
class PlaybackParameters(HandParameters):
    """Parameters of a recorded hand as a partner."""

    file: Annotated[str, about("recording (.mcap) of a block whose hand is played")] = ""
    hand: Annotated[
        Literal["same", "left", "right"], about("recorded hand that is played; same: that of the partner's side")
    ] = "same"
    first: Annotated[int, about("first recorded trial that is played", "1", ge=1)] = 1
    last: Annotated[int, about("last recorded trial that is played; 0: the last of the block", "1", ge=0)] = 0
    cutoff_hz: Annotated[
        float, about("cut-off frequency of the filter that takes the encoder's steps away", "Hz", gt=0, le=100)
    ] = 20.0


_GIVEN = "the study's"
PLAYBACK_SOURCES = HAND_SOURCES | {
    "file": _GIVEN,
    "hand": _GIVEN,
    "first": _GIVEN,
    "last": _GIVEN,
    "cutoff_hz": "assumed: above the bandwidth of voluntary movements of the hand, about 10 Hz",
}
"""Source of the default of each parameter of a recorded hand."""


@dataclass(frozen=True)
class RecordedHand:
    """Movements of a hand in the trials of a block, each from the release of the ball, at intervals of `STEP_TICKS`."""

    towards: tuple[NDArray[np.float64], ...]  # heights, in trials with the target at the side of the hand [m]
    away: tuple[NDArray[np.float64], ...]  # and at the other side [m]
    sha256: str  # of the heights as recorded: those that are played may differ in the last bit on another machine


_CONSTANTS = np.dtype(
    [
        ("hand", HAND),
        ("sign", "<f8"),  # side of its hand: -1 left, 1 right
        ("stale", "<f8"),  # age of a view that is too old [s]
        ("counts", "<i8", (2,)),  # movements away from the side of the hand, and towards it [1]
        ("starts", "<i8", (2, MOST_TRIALS + 1)),  # place of the first height of each, and of the end of all [1]
        ("heights", "<f8", (MOST_HEIGHTS,)),  # [m]
    ]
)
_STATE = np.dtype(
    [
        ("target", "<f8"),  # equilibrium point of the hand [m]
        ("free", "<i8"),  # 1: the ball is free
        ("since", "<f8"),  # time of the release [s]
        ("towards", "<i8"),  # 1: the target is at the side of the hand
        ("movement", "<i8"),  # number of the movement that is played, from 0
        ("played", "<i8", (2,)),  # trials so far, by direction [1]
    ]
)


@inlined
def decide(state: np.void, k: np.void, observation: np.void, actions: NDArray[Any]) -> None:
    """Follow the recorded movement of this trial."""
    seen, now, goal = observation["seen"], observation["time"], state["target"]
    if 0.0 <= now - seen["time"] < k["stale"]:
        free = is_free(seen["phase"])
        if free and not state["free"]:
            _begin(state, k, seen)
        state["free"] = free
        if free:
            goal = _height(state, k, now - state["since"])
        elif is_active(seen["phase"]):
            goal = 0.0
    target = state["target"]
    state["target"] = move_hand(k["hand"], observation, target, (goal - target) / TICK_SECONDS, actions)


@inlined
def _begin(state: np.void, k: np.void, seen: np.void) -> None:
    """Begin the next movement in the direction of the target."""
    towards = 1 if k["sign"] * seen["target"] > 0.0 else 0
    state["towards"], state["since"] = towards, seen["time"]
    state["movement"] = state["played"][towards] % k["counts"][towards]
    state["played"][towards] += 1


@inlined
def _height(state: np.void, k: np.void, when: float) -> float:
    """Return the height of the movement that is played at a time after the release [m]."""
    starts = k["starts"][state["towards"]]
    first, end = starts[state["movement"]], starts[state["movement"] + 1]
    place = when / (STEP_TICKS * TICK_SECONDS)
    if not place < end - 1 - first:
        return float(k["heights"][end - 1])
    before = first + int(place)
    share = place - int(place)
    return float(k["heights"][before] + share * (k["heights"][before + 1] - k["heights"][before]))


@final
class PlaybackPartner(HandPolicy):
    """A robot that plays the movements of a recorded hand."""

    kind = "playback"
    decide = staticmethod(decide)
    Parameters = PlaybackParameters
    State = _STATE
    sources: ClassVar[Mapping[str, str]] = PLAYBACK_SOURCES
    parameters: PlaybackParameters

    def __init__(self, config: Config, side: Side, recorded: RecordedHand) -> None:
        self.recorded = recorded
        super().__init__(config, side)

    def pack(self, config: Config, side: Side) -> NDArray[Any]:
        """Return its constants for the kernel [SI]."""
        packed = np.zeros(1, _CONSTANTS)
        packed["hand"] = pack_hand(config, self.parameters, side)[0]
        packed["sign"], packed["stale"] = (1.0 if side == "right" else -1.0), self.parameters.stale
        movements = self.recorded.away, self.recorded.towards
        used = sum(len(one) for each in movements for one in each)
        if used > MOST_HEIGHTS or max(map(len, movements)) > MOST_TRIALS:
            step = STEP_TICKS * TICK_SECONDS
            raise ConfigError(
                f"[partners.{side}] first, last: these trials last {used * step:.0f} s, expected at most "
                f"{MOST_TRIALS} in each direction, and {MOST_HEIGHTS * step:.0f} s in all"
            )
        place = 0
        for direction, each in enumerate(movements):
            packed["counts"][0, direction], packed["starts"][0, direction, 0] = len(each), place
            for number, one in enumerate(each, start=1):
                packed["heights"][0, place : place + len(one)] = one
                place += len(one)
                packed["starts"][0, direction, number] = place
        return packed

    @property
    def identity(self) -> Mapping[str, str]:
        """What is recorded of it."""
        return identity_of(self.kind, self.parameters, movements_sha256=self.recorded.sha256)
