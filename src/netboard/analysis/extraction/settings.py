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
from netboard.analysis.measures.cooperation import SEARCH, Amount, Opposite, Search, Threshold, Velocity
from netboard.analysis.measures.ellipses import Extent, Scaling
from netboard.analysis.measures.motion import Inside, SpeedOrder, Window
from netboard.analysis.measures.movements import AtLimit, Average
from netboard.analysis.measures.peaks import Extrema, Plateau
from netboard.analysis.measures.performance import Level, TrialTime
from netboard.analysis.measures.segments import Angle, Turning
from netboard.analysis.measures.signals import CutoffOf, OrderOf, Padding
from netboard.base.settings import FORBID_UNKNOWN_KEYS, about, read, write, write_template
from netboard.base.tables.experiment import Flag, Role

ExclusionFlag = Literal["declared", Flag]
"""A flag that excludes an attempt, or ``declared``: those that its recording declares (`[quality] exclude`)."""


@dataclass(frozen=True, slots=True)
class Filters:
    """Filters and velocities."""

    __pydantic_config__ = FORBID_UNKNOWN_KEYS
    fast: Annotated[float, about("cutoff for all force and kinematic data", "Hz", gt=0, le=400)] = 20.0
    slow: Annotated[
        float, about("cutoff for the board's angular velocity and the ball's speed", "Hz", gt=0, le=400)
    ] = 5.0
    order: Annotated[int, about("order of the filter", "1", ge=1, le=20)] = 10
    order_of: Annotated[OrderOf, about("passes to which this order applies: both together, or each")] = "both_passes"
    cutoff_of: Annotated[CutoffOf, about("cutoff: of each pass as designed, or -3 dB of both passes")] = "design"
    padding: Annotated[Padding, about("padding of the signal beyond its ends")] = "odd"
    pad: Annotated[float, about("duration of the padding", "s", ge=0, le=60)] = 1.0
    bridge: Annotated[float, about("longest gap of lost ticks that is interpolated linearly", "s", ge=0, le=1)] = 0.02
    unit: Annotated[Literal["recording", "trial"], about("section that is filtered at once")] = "recording"
    velocity: Annotated[
        Literal["derivative", "device"],
        about("stylus velocity: derivative of the filtered height, or the device's velocity, filtered"),
    ] = "derivative"
    speed: Annotated[SpeedOrder, about("ball speed: absolute value before the filter, or after it")] = "absolute_first"


@dataclass(frozen=True, slots=True)
class CompletionSettings:
    """Criterion of the completion."""

    __pydantic_config__ = FORBID_UNKNOWN_KEYS
    inside: Annotated[Inside, about("part of the ball that must be in the target: its centre, or all of it")] = "centre"


@dataclass(frozen=True, slots=True)
class Movements:
    """Classes of movement."""

    __pydantic_config__ = FORBID_UNKNOWN_KEYS
    window: Annotated[Window, about("time of which shares are computed: to the completion, or with the hold")] = (
        "to_completion"
    )
    still_below: Annotated[float, about("speed below which a stylus counts as still", "m/s", gt=0, le=1)] = 0.003
    at_limit: Annotated[AtLimit, about("class of a stylus at exactly this speed")] = "moving"


@dataclass(frozen=True, slots=True)
class SegmentSettings:
    """Movements of the board."""

    __pydantic_config__ = FORBID_UNKNOWN_KEYS
    turning: Annotated[Turning, about("whether a reversal ends a movement, or only a low rate")] = "one_way"
    angle: Annotated[Angle, about("angle of a movement: net, range, or integral of the slow angular velocity")] = "net"
    ends: Annotated[
        Literal["recording", "trial"], about("latest end of a movement: end of the recording, or of the trial")
    ] = "recording"
    least_rate_deg: Annotated[float, about("angular velocity above which the board moves", "deg/s", gt=0, le=90)] = 1.0
    shortest: Annotated[float, about("least duration of a movement", "s", gt=0, le=10)] = 0.1
    least_angle_deg: Annotated[float, about("least angle of a movement", "deg", ge=0, le=90)] = 1.0


@dataclass(frozen=True, slots=True)
class DelaySettings:
    """Cooperative movements, and the delay between their sides."""

    __pydantic_config__ = FORBID_UNKNOWN_KEYS
    opposite: Annotated[Opposite, about("quantity that must be opposite: net displacements, or most samples")] = "net"
    amount: Annotated[Amount, about("quantity whose ratio between sides is limited: displacement, or path")] = "net"
    largest_ratio: Annotated[float, about("largest such ratio", "1", ge=1, le=1000)] = 9.0
    threshold: Annotated[Threshold, about("peak to which the thresholds refer")] = "slower_side"
    search: Annotated[Search, about("threshold time of a side that starts above the threshold")] = SEARCH
    velocity: Annotated[Velocity, about("velocity that must reach the threshold")] = "own_direction"


@dataclass(frozen=True, slots=True)
class PeakSettings:
    """Peaks of the ball's speed."""

    __pydantic_config__ = FORBID_UNKNOWN_KEYS
    window: Annotated[Window, about("time in which peaks count: to the completion, or with the hold")] = "to_completion"
    extrema: Annotated[Extrema, about("maxima only, or minima too")] = "maxima"
    plateau: Annotated[Plateau, about("time of a peak with several equal samples")] = "first_sample"
    least_prominence: Annotated[float, about("least prominence of a peak; 0: any", "m/s", ge=0, le=1)] = 0.0001
    least_share: Annotated[
        float, about("the same as a share of the attempt's largest speed, for the filter's ringing", "1", ge=0, le=1)
    ] = 0.006


@dataclass(frozen=True, slots=True)
class StrategySettings:
    """The first braking movement."""

    __pydantic_config__ = FORBID_UNKNOWN_KEYS
    braking: Annotated[Braking, about("definition of braking: tilt against the ball, or any reversal of the board")] = (
        "tilt"
    )
    distance: Annotated[
        Literal["signed", "absolute"], about("distance to the target's midpoint: signed (negative behind it), absolute")
    ] = "signed"


@dataclass(frozen=True, slots=True)
class ControlSettings:
    """Controls of the effects of haptic feedback: arms that yield to a force, with the device and without friction."""

    __pydantic_config__ = FORBID_UNKNOWN_KEYS
    attempts: Annotated[
        int, about("attempts of a recording that have controls, evenly spaced; 0: none", "1", ge=0, le=10_000)
    ] = 12
    stiffness: Annotated[
        float, about("stiffness of the usual arm (assumed; published: 100 to 500)", "N/m", gt=0, le=2000)
    ] = 150.0
    softest: Annotated[float, about("stiffness of a softer arm (assumed)", "N/m", gt=0, le=2000)] = 50.0
    stiffest: Annotated[float, about("stiffness of a stiffer arm (assumed)", "N/m", gt=0, le=2000)] = 300.0
    arm_mass: Annotated[
        float, about("effective mass of an arm (assumed; published: 0.5 to 1.5)", "kg", gt=0, le=10)
    ] = 0.5
    arm_damping: Annotated[float, about("damping of an arm (assumed; published: 5 to 30)", "N s/m", ge=0, le=100)] = 8.0

    @property
    def stiffnesses(self) -> tuple[float, ...]:
        """Stiffnesses of all arms, the usual one first [N/m]."""
        return tuple(dict.fromkeys((self.stiffness, self.softest, self.stiffest)))


@dataclass(frozen=True, slots=True)
class Summaries:
    """Summaries of the trials."""

    __pydantic_config__ = FORBID_UNKNOWN_KEYS
    shares: Annotated[Average, about("weights in the shares of a performer: equal trials, or equal seconds")] = "trials"
    delay: Annotated[Literal["absolute", "signed"], about("delay that is averaged: absolute or signed")] = "absolute"
    intervals: Annotated[
        Literal["dyads", "people", "movements"],
        about("unit of a delay's confidence interval: dyads, performers, or movements (likely the paper's)"),
    ] = "dyads"
    variance: Annotated[
        Literal["each", "generalised"], about("spread of the strategy: variance of each quantity, or of both at once")
    ] = "each"
    numbering: Annotated[
        Literal["condition", "configuration"],
        about("numbering of first and last trials: within each haptic condition, or over both in their order"),
    ] = "condition"
    spread: Annotated[Literal["trials", "people"], about("unit of a standard deviation")] = "trials"
    level: Annotated[Level, about("performance level: mean or median of all trials, or the mean of the last 60")] = (
        "mean"
    )
    time: Annotated[TrialTime, about("time of a trial: that of the successful attempt, or of all attempts")] = (
        "successful_attempt"
    )
    extent: Annotated[Extent, about("extent of an ellipse")] = "middle_90"
    scaling: Annotated[Scaling, about("units of an ellipse's components")] = "si"
    ends: Annotated[
        int, about("number of first and of last trials; 0: 30, or half of a short condition", "1", ge=0, le=1000)
    ] = 0
    group: Annotated[
        int, about("trials in a group whose strategies are compared, 3 or more; 0: 30, or fewer", "1", ge=0, le=1000)
    ] = 0


@dataclass(frozen=True, slots=True)
class Exclusions:
    """Trials that are excluded. Declare them before you look at results."""

    __pydantic_config__ = FORBID_UNKNOWN_KEYS
    flags: Annotated[
        tuple[ExclusionFlag, ...],
        about("quality flags that exclude an attempt; declared: [quality] exclude of the recording", strict=False),
    ] = ("declared",)
    catch: Annotated[bool, about("exclude catch trials; false: they form separate conditions")] = True
    perturbed: Annotated[bool, about("exclude perturbation trials; false: they count as all others")] = True
    roles: Annotated[
        tuple[Role, ...],
        about("roles of blocks that are excluded; other roles except test form separate conditions", strict=False),
    ] = ("practice", "familiarisation", "baseline")
    pilots: Annotated[
        Literal["unless_all", "always", "never"], about("exclude pilot recordings: unless all are, always, or never")
    ] = "unless_all"
    warm_up: Annotated[int, about("number of trials to exclude at the start of each block", "1", ge=0, le=1000)] = 0
    trials: Annotated[
        tuple[StrictStr, ...],
        about("trials that an experimenter has excluded, as RECORDING/TRIAL: reason", strict=False),
    ] = ()


@dataclass(frozen=True, slots=True)
class Readings:
    """All settings of an analysis."""

    __pydantic_config__ = FORBID_UNKNOWN_KEYS
    filters: Filters = field(default_factory=Filters)
    completion: CompletionSettings = field(default_factory=CompletionSettings)
    movements: Movements = field(default_factory=Movements)
    segments: SegmentSettings = field(default_factory=SegmentSettings)
    delays: DelaySettings = field(default_factory=DelaySettings)
    peaks: PeakSettings = field(default_factory=PeakSettings)
    strategy: StrategySettings = field(default_factory=StrategySettings)
    controls: ControlSettings = field(default_factory=ControlSettings)
    summaries: Summaries = field(default_factory=Summaries)
    exclusions: Exclusions = field(default_factory=Exclusions)


_ADAPTER: TypeAdapter[Readings] = TypeAdapter(Readings)


def parse(text: str, source: str = "analysis.toml", overrides: Sequence[str] = ()) -> Readings:
    """Parse a TOML text; ConfigError if it is none, or a key is unknown, of the wrong type or out of range."""
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
