"""Settings of an analysis: every reading of the paper, summary and exclusion rule, as a checked value.

The paper leaves choices open. Each has a default here, and alternatives with the names that the functions in
`netboard.analysis.measures` use; docs/reference/measures.md gives the reasons. `Summaries` decides how trials are
summarised, `Exclusions` which of them count; all other tables decide what is measured in a trial. Every result is
stored with all of its settings.
"""

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from typing import Annotated, Literal

from pydantic import StrictStr, TypeAdapter

from netboard.analysis.measures.braking import Braking
from netboard.analysis.measures.cooperation import Amount, Opposite, Search, Threshold, Velocity
from netboard.analysis.measures.ellipses import Extent, Scaling
from netboard.analysis.measures.motion import Inside, SpeedOrder, Window
from netboard.analysis.measures.movements import AtLimit, Average
from netboard.analysis.measures.peaks import Extrema, Plateau
from netboard.analysis.measures.performance import Level, TrialTime
from netboard.analysis.measures.segments import Angle, Turning
from netboard.analysis.measures.signals import CutoffOf, OrderOf, Padding
from netboard.base.settings import NO_EXTRAS, about, read, write, write_template
from netboard.base.tables.experiment import Role
from netboard.task.trials.quality import WORDS

Flag = Literal[
    "late_ticks",
    "lost_samples",
    "clipped",
    "saturated",
    "start_tilt",
    "stuck_left",
    "stuck_right",
    "too_short",
    "too_long",
    "frozen_display",
]
"""A word of `netboard.task.trials.quality.WORDS`."""

TECHNICAL = tuple(word for word in WORDS if word != "too_long")
"""Flags of technical faults, which participants did not cause. A long duration is a result, not a fault."""


@dataclass(frozen=True, slots=True)
class Filters:
    """Filters and velocities."""

    __pydantic_config__ = NO_EXTRAS
    fast: Annotated[float, about("cutoff for all force and kinematic data", "Hz", gt=0, le=400)] = 20.0
    slow: Annotated[
        float, about("cutoff for the board's angular velocity and the ball's speed", "Hz", gt=0, le=400)
    ] = 5.0
    order: Annotated[int, about("order of the filter", "1", ge=1, le=20)] = 10
    order_of: Annotated[OrderOf, about("what has that order: both passes together, or each")] = "both_passes"
    cutoff_of: Annotated[CutoffOf, about("what is at the cutoff: each pass as designed, or -3 dB of both")] = "design"
    padding: Annotated[Padding, about("what is taken to lie beyond the ends")] = "odd"
    pad: Annotated[float, about("for how long", "s", ge=0, le=60)] = 1.0
    bridge: Annotated[float, about("longest hole of lost ticks that a straight line fills", "s", ge=0, le=1)] = 0.02
    unit: Annotated[Literal["recording", "trial"], about("what is filtered at once")] = "recording"
    velocity: Annotated[
        Literal["derivative", "device"],
        about("velocity of a stylus: of its filtered height, or its device's, filtered"),
    ] = "derivative"
    speed: Annotated[
        SpeedOrder, about("whether the ball's absolute velocity is filtered, or taken of the filtered")
    ] = "absolute_first"


@dataclass(frozen=True, slots=True)
class Completion:
    """When a trial is done."""

    __pydantic_config__ = NO_EXTRAS
    inside: Annotated[Inside, about("what must be in the target: the ball's centre, or all of it")] = "centre"


@dataclass(frozen=True, slots=True)
class Movements:
    """Classes of movement."""

    __pydantic_config__ = NO_EXTRAS
    window: Annotated[Window, about("of which time the shares are: to the completion, or with the hold")] = (
        "to_completion"
    )
    still_below: Annotated[float, about("a stylus that is slower does not move", "m/s", gt=0, le=1)] = 0.003
    at_limit: Annotated[AtLimit, about("what a stylus does that is exactly so fast")] = "moving"


@dataclass(frozen=True, slots=True)
class Segments:
    """Movements of the board."""

    __pydantic_config__ = NO_EXTRAS
    turning: Annotated[Turning, about("whether a turn ends a movement, or only slowness")] = "one_way"
    angle: Annotated[Angle, about("how far a movement goes: net, range, or integral of the slow angular velocity")] = (
        "net"
    )
    ends: Annotated[
        Literal["recording", "trial"], about("where movements end at the latest: with the recording, or with the trial")
    ] = "recording"
    least_rate_deg: Annotated[float, about("the board turns when it is faster", "deg/s", gt=0, le=90)] = 1.0
    shortest: Annotated[float, about("least duration of a movement", "s", gt=0, le=10)] = 0.1
    least_angle_deg: Annotated[float, about("least angle of a movement", "deg", ge=0, le=90)] = 1.0


@dataclass(frozen=True, slots=True)
class Delays:
    """Cooperative movements, and the delay between their sides."""

    __pydantic_config__ = NO_EXTRAS
    opposite: Annotated[Opposite, about("what must be opposite: displacements, or most samples")] = "net"
    amount: Annotated[Amount, about("what is compared with nine times the other's: displacement, or path")] = "net"
    largest_ratio: Annotated[float, about("the nine", "1", ge=1, le=1000)] = 9.0
    threshold: Annotated[Threshold, about("of which peak the portions are")] = "slower_side"
    search: Annotated[Search, about("where a side that is above a threshold at once has reached it")] = "back"
    velocity: Annotated[Velocity, about("what must reach the threshold")] = "own_direction"


@dataclass(frozen=True, slots=True)
class Peaks:
    """Peaks of the ball's speed."""

    __pydantic_config__ = NO_EXTRAS
    window: Annotated[Window, about("where peaks are counted: to the completion, or with the hold")] = "to_completion"
    extrema: Annotated[Extrema, about("maxima only, or minima too")] = "maxima"
    plateau: Annotated[Plateau, about("where a peak of equal samples is")] = "first_sample"
    least_prominence: Annotated[float, about("how far a peak stands out at least; 0: any", "m/s", ge=0, le=1)] = 0.0001
    least_share: Annotated[
        float, about("the same as a share of the attempt's largest speed, for the filter's ringing", "1", ge=0, le=1)
    ] = 0.006


@dataclass(frozen=True, slots=True)
class Strategy:
    """The first braking movement."""

    __pydantic_config__ = NO_EXTRAS
    braking: Annotated[Braking, about("what brakes: tilting against the ball, or turning the board back at all")] = (
        "tilt"
    )
    distance: Annotated[
        Literal["signed", "absolute"], about("distance to the target's midpoint: negative behind it, or not")
    ] = "signed"


@dataclass(frozen=True, slots=True)
class Summaries:
    """What is made of the trials."""

    __pydantic_config__ = NO_EXTRAS
    shares: Annotated[Average, about("what counts the same in a person's shares: every trial, or every second")] = (
        "trials"
    )
    delay: Annotated[Literal["absolute", "signed"], about("which delay is averaged")] = "absolute"
    intervals: Annotated[
        Literal["dyads", "people", "movements"],
        about("of what a delay's interval is: dyads (people, alone), or single movements, as in the paper's words"),
    ] = "dyads"
    variance: Annotated[
        Literal["each", "generalised"], about("spread of the strategy: variance of each quantity, or of both at once")
    ] = "each"
    numbering: Annotated[
        Literal["condition", "configuration"],
        about("what first and last trials are of: each haptic condition, or both in the order in which they were done"),
    ] = "condition"
    spread: Annotated[Literal["trials", "people"], about("what a standard deviation is of")] = "trials"
    level: Annotated[
        Level, about("how well somebody does: mean or median of all trials, or the mean of the last 60")
    ] = "mean"
    time: Annotated[TrialTime, about("a trial's time: that of the attempt that succeeded, or of all")] = (
        "successful_attempt"
    )
    extent: Annotated[Extent, about("how far an ellipse reaches")] = "middle_90"
    scaling: Annotated[Scaling, about("units of an ellipse's components")] = "si"
    ends: Annotated[
        int,
        about(
            "how many trials the first and the last ones are; 0: 30, or half of a short condition", "1", ge=0, le=1000
        ),
    ] = 0
    group: Annotated[
        int, about("trials in a group whose strategies are compared, 3 or more; 0: 30, or fewer", "1", ge=0, le=1000)
    ] = 0


@dataclass(frozen=True, slots=True)
class Exclusions:
    """Which trials do not count. Say so before you look at results."""

    __pydantic_config__ = NO_EXTRAS
    flags: Annotated[
        tuple[Flag, ...],
        about("marks of quality that exclude an attempt; a simulated hand may be still for long", strict=False),
    ] = TECHNICAL  # type: ignore[assignment]
    catch: Annotated[bool, about("exclude catch trials; false: they are conditions of their own")] = True
    roles: Annotated[
        tuple[Role, ...],
        about("roles of blocks that are excluded; others but test are conditions of their own", strict=False),
    ] = ("practice", "familiarisation", "baseline")
    pilots: Annotated[
        Literal["unless_all", "always", "never"], about("exclude pilot recordings: unless all are, always, or never")
    ] = "unless_all"
    warm_up: Annotated[int, about("number of trials to exclude at the start of each block", "1", ge=0, le=1000)] = 0
    trials: Annotated[
        tuple[StrictStr, ...],
        about("trials that an experimenter has excluded: RECORDING/TRIAL: why", strict=False),
    ] = ()


@dataclass(frozen=True, slots=True)
class Readings:
    """All settings of an analysis."""

    __pydantic_config__ = NO_EXTRAS
    filters: Filters = field(default_factory=Filters)
    completion: Completion = field(default_factory=Completion)
    movements: Movements = field(default_factory=Movements)
    segments: Segments = field(default_factory=Segments)
    delays: Delays = field(default_factory=Delays)
    peaks: Peaks = field(default_factory=Peaks)
    strategy: Strategy = field(default_factory=Strategy)
    summaries: Summaries = field(default_factory=Summaries)
    exclusions: Exclusions = field(default_factory=Exclusions)


_ADAPTER: TypeAdapter[Readings] = TypeAdapter(Readings)


def parse(text: str, source: str = "analysis.toml", overrides: Sequence[str] = ()) -> Readings:
    """Parse and check a TOML text.

    Raises
    ------
    ConfigError
        If the text is not TOML, a key is unknown, of the wrong type or out of range.
    """
    return read(_ADAPTER, Readings, text, source, overrides)


def template() -> str:
    """Return the commented template with every key and its default, as TOML text."""
    return write_template(Readings)


def resolve(readings: Readings) -> str:
    """Return all settings, as TOML text."""
    return write(readings)


def measured_with(readings: Readings) -> str:
    """Return the settings that determine the tables of a recording, as TOML text."""
    return write(replace(readings, summaries=Summaries(), exclusions=Exclusions()))
