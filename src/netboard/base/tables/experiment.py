"""Configuration tables of the experiment: session, block, design, quality rules, task.

Defaults are the paper's. `netboard.base.config` reads the tables and gives the common rules.
"""

from dataclasses import dataclass, field
from typing import Annotated, Literal, get_args

from pydantic import StrictBool, StrictInt

from netboard.base.settings import FORBID_UNKNOWN_KEYS, LABEL, Number, about
from netboard.base.tables.forces import Force

MAX_TRIALS = 10_000
"""Largest number of trials in a block [1]."""

PERSON, STILL = "person", "still"
"""Movers of a hand besides robot partners: a person, and none, who receives no force."""

Flag = Literal[
    "late_ticks",
    "lost_samples",
    "missing_ticks",
    "clipped",
    "saturated",
    "start_tilt",
    "stuck_left",
    "stuck_right",
    "too_short",
    "too_long",
    "frozen_display",
]
"""A quality flag of an attempt, as `netboard.task.trials.quality` sets it."""

TECHNICAL: tuple[Flag, ...] = tuple(flag for flag in get_args(Flag) if flag != "too_long")
"""Flags of technical faults, which participants did not cause. A long duration is a result, not a fault."""


@dataclass(frozen=True, slots=True)
class Session:
    """Who takes part, and how the session is labelled."""

    __pydantic_config__ = FORBID_UNKNOWN_KEYS
    name: Annotated[str, about("label of the session, part of the recording's name", form=LABEL)] = "S01"
    dyad: Annotated[str, about("pseudonymous id of the dyad", form=LABEL)] = "D01"
    pilot: Annotated[StrictBool, about("true: a pilot run, marked as such in the data")] = False
    study: Annotated[str, about("name of the study; empty: none, a single block")] = ""
    participant_a: Annotated[str, about("pseudonymous id of participant A", form=LABEL)] = "A"
    participant_b: Annotated[str, about("pseudonymous id of participant B", form=LABEL)] = "B"
    hand_a: Annotated[Literal["right", "left"], about("dominant hand of participant A")] = "right"
    hand_b: Annotated[Literal["right", "left"], about("dominant hand of participant B")] = "right"
    seat_a: Annotated[Literal["left", "right"], about("where participant A sits; B sits at the other side")] = "left"
    consent: Annotated[StrictBool, about("true: both participants have given their consent")] = False

    @property
    def ready(self) -> bool:
        """Whether a block of a study may begin: with consent, or as a pilot run."""
        return self.consent or self.pilot

    @property
    def real(self) -> bool:
        """Whether its data count: both participants have consented, and it is no pilot run."""
        return self.consent and not self.pilot


@dataclass(frozen=True, slots=True)
class Block:
    """One block: trials under one condition; a plan has many."""

    __pydantic_config__ = FORBID_UNKNOWN_KEYS
    number: Annotated[int, about("number of the block in its plan", "1", ge=1, le=1000)] = 1
    blocks: Annotated[int, about("how many blocks the plan has", "1", ge=1, le=1000)] = 1
    label: Annotated[str, about("label of the block, as shown; empty: its condition")] = ""
    configuration: Annotated[
        Literal["dyadic", "bimanual"], about("two participants with one hand each, or one participant with both hands")
    ] = "dyadic"
    performer: Annotated[Literal["A", "B"], about("the participant who performs a bimanual block")] = "A"
    station: Annotated[Literal["left", "right"], about("the station whose display shows a bimanual block")] = "left"
    force: Annotated[Force, about("force condition: which forces the haptic feedback contains")] = "full"
    force_scale: Annotated[float, about("factor of the commanded force", "1", ge=0, le=2)] = 1.0
    force_delay_ms: Annotated[int, about("added delay of the commanded force", "ms", ge=0, le=500)] = 0
    catch: Annotated[
        tuple[StrictInt, ...],
        about("numbers of the catch trials, which have no haptic feedback", max_length=1000, strict=False),
    ] = ()
    trial_scales: Annotated[
        tuple[Number, ...], about("force_scale of each trial, in place of force_scale; the list repeats", strict=False)
    ] = ()
    unrelated: Annotated[str, about('recording whose forces are rendered with force = "unrelated"')] = ""
    left: Annotated[
        str,
        about(
            'mover of the left hand: "person", "still" (held at height 0), or a robot partner, of those that '
            "`netboard plan check` knows",
            form=LABEL,
        ),
    ] = PERSON
    right: Annotated[str, about("mover of the right hand, likewise", form=LABEL)] = PERSON
    blinded: Annotated[
        StrictBool, about("true: operators do not see whether a person or which robot partner moves a hand")
    ] = False
    trials: Annotated[int, about("successful trials in the block", "1", ge=1, le=MAX_TRIALS)] = 60
    duration: Annotated[float, about("no trial begins after this time; 0: no time limit", "s", ge=0, le=36_000)] = 0.0
    first_target: Annotated[Literal["left", "right", "random"], about("side of the first target")] = "random"
    rest: Annotated[float, about("rest before the block", "s", ge=0, le=3600)] = 0.0
    instructions: Annotated[
        str, about("instructions for the participants before the block; empty: the standard text")
    ] = ""
    questionnaires: Annotated[str, about("questionnaire after the block, for the operator; empty: none")] = ""
    seed: Annotated[int, about("seed of everything random in the session", "1", ge=0, lt=2**31)] = 1

    @property
    def haptics(self) -> bool:
        """Whether there is haptic feedback."""
        return self.force != "none"


Role = Literal["practice", "familiarisation", "baseline", "test"]
"""Purpose of the trials of a block."""

FactorType = Literal["numeric", "categorical", "boolean"]
"""Type of the levels of a factor."""


@dataclass(frozen=True, slots=True)
class Design:
    """What a block is in the design of its study: its role, and the level of each factor."""

    __pydantic_config__ = FORBID_UNKNOWN_KEYS
    kind: Annotated[str, about("kind of block, as in the study; empty: none")] = ""
    role: Annotated[
        Literal["auto", "practice", "familiarisation", "baseline", "test"],
        about("purpose of its trials; auto: from the name of its kind or its label, else test"),
    ] = "auto"
    between: Annotated[
        tuple[str, ...], about("factors of which a dyad has one level in all of its blocks", strict=False)
    ] = ()
    factors: Annotated[dict[str, str], about("level of each factor in the block")] = field(default_factory=dict)
    trials: Annotated[
        dict[str, tuple[str, ...]],
        about("level in each trial, of factors that vary within the block; repeated from the first", strict=False),
    ] = field(default_factory=dict)
    levels: Annotated[dict[str, tuple[str, ...]], about("all levels of each factor, in their order", strict=False)] = (
        field(default_factory=dict)
    )
    types: Annotated[dict[str, FactorType], about("type of each factor: numeric, categorical or boolean")] = field(
        default_factory=dict
    )
    values: Annotated[dict[str, tuple[Number, ...]], about("value of each level of numeric factors", strict=False)] = (
        field(default_factory=dict)
    )
    units: Annotated[dict[str, str], about("unit of these values")] = field(default_factory=dict)


@dataclass(frozen=True, slots=True)
class Quality:
    """Rules by which an attempt is flagged. Declare them before the data are collected."""

    __pydantic_config__ = FORBID_UNKNOWN_KEYS
    late_ticks: Annotated[int, about("largest number of deadline misses in a trial", "1", ge=0, le=1_000_000)] = 20
    lost_share: Annotated[float, about("largest share of a trial without a fresh sample", "1", ge=0, le=1)] = 0.02
    missing_ticks: Annotated[
        int, about("largest number of ticks of a trial that are missing in the recording", "1", ge=0, le=1_000_000)
    ] = 20
    clipped_share: Annotated[float, about("largest share with a force at its limit", "1", ge=0, le=1)] = 0.05
    saturated_share: Annotated[
        float, about("largest share with a stylus at the edge of its range", "1", ge=0, le=1)
    ] = 0.05
    start_tilt_deg: Annotated[float, about("largest tilt at the release", "deg", gt=0, le=90)] = 1.5
    stuck: Annotated[
        float, about("longest time for which the height of a stylus may not change at all", "s", gt=0, le=60)
    ] = 2.0
    shortest: Annotated[
        float, about("completion time below which an attempt is flagged as too short", "s", ge=0, le=60)
    ] = 0.3
    longest: Annotated[
        float, about("completion time above which an attempt is flagged as too long", "s", gt=0, le=3600)
    ] = 60.0
    frozen_ms: Annotated[
        float, about("longest time between two frames of a display while the board moves", "ms", gt=0, le=60_000)
    ] = 250.0
    repeat: Annotated[
        Literal["none", "flagged"], about("flagged: a trial with a flagged attempt is repeated at the end of its block")
    ] = "none"
    exclude: Annotated[
        tuple[Flag, ...], about("flags with which an attempt is excluded from the analysis", strict=False)
    ] = TECHNICAL
    excluded_share: Annotated[
        float, about("share of the trials of a block that may be excluded before a repeat is offered", "1", ge=0, le=1)
    ] = 0.1


@dataclass(frozen=True, slots=True)
class Task:
    """The rules of a trial. The defaults interpret the paper where it leaves them open."""

    __pydantic_config__ = FORBID_UNKNOWN_KEYS
    hold_time: Annotated[float, about("time the ball must stay in the target", "s", gt=0, le=60)] = 1.5
    level_angle_deg: Annotated[float, about("tilt below which the board counts as level", "deg", gt=0, le=45)] = 1.0
    level_rate_deg_s: Annotated[
        float, about("rotation below which the board counts as level", "deg/s", gt=0, le=360)
    ] = 1.0
    level_height: Annotated[
        float, about("height of the board centre within which it counts as level", "m", gt=0, le=1)
    ] = 0.010
    level_time: Annotated[
        float, about("time the board must be level before the ball is released", "s", ge=0, le=60)
    ] = 0.5
    fall_distance: Annotated[float, about("ball centre beyond which it has fallen off", "m", gt=0, le=5)] = 0.350
    time_limit: Annotated[float, about("a trial running longer has failed; 0 for no limit", "s", ge=0, le=3600)] = 0.0
    stylus_range: Annotated[float, about("stylus heights are clipped to +- this", "m", gt=0, le=1)] = 0.075
