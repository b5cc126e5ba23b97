"""Open questions of the paper's analysis: each with the default, its alternatives, and the numbers that they affect.

An alternative is a list of settings as they stand behind ``--set``. Where a question has none, its reason says why, and
where it is measured all the same.
"""

from dataclasses import dataclass
from typing import Literal

from netboard.analysis.extraction.settings import Readings, parse

Family = Literal["time", "peaks", "shares", "delay", "strategy"]
"""Numbers that are made of the same measure of an attempt."""


@dataclass(frozen=True, slots=True)
class Alternative:
    """Another reading.

    - `likely`: whether somebody might have read the paper so. What is another quantity, or an error, is not.
    """

    name: str
    settings: tuple[str, ...]
    likely: bool = True


@dataclass(frozen=True, slots=True)
class Ambiguity:
    """A question that the paper leaves open.

    - `name`: its short name: A1 to A32 for the analysis, B5, E4 and E5 for what the trial and the equations leave to
      it.
    """

    name: str
    question: str
    default: str
    touches: tuple[Family, ...]
    alternatives: tuple[Alternative, ...] = ()
    reason: str = ""


def readings_of(settings: tuple[str, ...], base: tuple[str, ...] = ()) -> Readings:
    """Check settings."""
    return parse("", "the analysis", (*base, *settings))


def _one(name: str, *settings: str) -> tuple[Alternative, ...]:
    return (Alternative(name, settings),)


_MOVING: tuple[Family, ...] = ("peaks", "shares", "delay", "strategy")
_SEGMENTED: tuple[Family, ...] = ("delay", "strategy")

AMBIGUITIES = (
    Ambiguity(
        "A1",
        "what is of the tenth order?",
        "both passes together",
        _MOVING,
        _one("each pass", "filters.order_of=each_pass"),
    ),
    Ambiguity(
        "A2",
        "what is at the cutoff?",
        "each pass as designed",
        _MOVING,
        _one("-3 dB of both (Winter)", "filters.cutoff_of=both_passes"),
    ),
    Ambiguity(
        "A3",
        "in which form is the filter?",
        "second-order sections",
        _MOVING,
        reason="a fraction of two polynomials is an error, not a reading: measured in a table of its own",
    ),
    Ambiguity(
        "A4",
        "what is filtered at once?",
        "the recording, turned about its ends for 1 s",
        _MOVING,
        (
            Alternative("each trial", ("filters.unit=trial",)),
            Alternative("each trial, 0.02 s of padding", ("filters.unit=trial", "filters.pad=0.02")),
        ),
    ),
    Ambiguity(
        "A5",
        "which velocity of a stylus?",
        "derivative of the filtered height",
        ("shares", "delay"),
        _one("the device's, filtered", "filters.velocity=device"),
    ),
    Ambiguity(
        "A6",
        "the ball's absolute velocity",
        "absolute, then filtered",
        ("peaks",),
        _one("filtered, then absolute", "filters.speed=filter_first"),
    ),
    Ambiguity(
        "A7",
        "in which window are peaks counted?",
        "to the completion",
        ("peaks",),
        _one("with the hold", "peaks.window=whole"),
    ),
    Ambiguity(
        "A8",
        "how small may a peak be?",
        "0.1 mm/s and 0.6 % of the largest speed",
        ("peaks",),
        (
            Alternative("any", ("peaks.least_prominence=0.0", "peaks.least_share=0.0")),
            Alternative("10 mm/s prominent", ("peaks.least_prominence=0.01",)),
        ),
    ),
    Ambiguity(
        "A9",
        "of which window are the shares?",
        "to the completion",
        ("shares",),
        _one("with the hold", "movements.window=whole"),
    ),
    Ambiguity(
        "A10",
        "does exactly 3 mm/s move?",
        "yes",
        ("shares",),
        _one("no", "movements.at_limit=still"),
    ),
    Ambiguity(
        "A11",
        "what are opposite directions?",
        "signs of the styluses' vertical velocities",
        ("shares",),
        reason="printed so; what it makes of two hands that lift together is said beside the classes",
    ),
    Ambiguity(
        "A12",
        "how are shares averaged?",
        "over trials",
        ("shares",),
        _one("over time", "summaries.shares=time"),
    ),
    Ambiguity(
        "A13",
        "does a turn end a movement of the board?",
        "yes",
        _SEGMENTED,
        _one("only slowness does", "segments.turning=either_way"),
    ),
    Ambiguity(
        "A14",
        "which angle must be 1 degree?",
        "net",
        _SEGMENTED,
        (
            Alternative("largest less smallest", ("segments.angle=range",)),
            Alternative("integral of the slow velocity", ("segments.angle=integral",)),
        ),
    ),
    Ambiguity(
        "A15",
        "where do movements end at the latest?",
        "with the recording",
        _SEGMENTED,
        _one("with the trial", "segments.ends=trial"),
    ),
    Ambiguity(
        "A16",
        "what moves in opposite directions?",
        "displacements",
        ("delay",),
        _one("most samples", "delays.opposite=majority"),
    ),
    Ambiguity(
        "A17",
        "nine times as much of what?",
        "displacement",
        ("delay",),
        _one("path", "delays.amount=path"),
    ),
    Ambiguity(
        "A18",
        "a portion of which peak?",
        "the slower side's, for both",
        ("delay",),
        _one("each side's own", "delays.threshold=own_peak"),
    ),
    Ambiguity(
        "A19",
        "above the threshold at once?",
        "where it was reached before",
        ("delay",),
        _one("at the beginning", "delays.search=inside"),
    ),
    Ambiguity(
        "A20",
        "velocity or speed?",
        "velocity in the side's own direction",
        ("delay",),
        _one("speed", "delays.velocity=magnitude"),
    ),
    Ambiguity(
        "A21",
        "a delay with its sign?",
        "absolute",
        ("delay",),
        (Alternative("signed", ("summaries.delay=signed",), likely=False),),
    ),
    Ambiguity(
        "A22",
        "of what is a delay's interval?",
        "dyads",
        ("delay",),
        _one("single movements", "summaries.intervals=movements"),
    ),
    Ambiguity(
        "A23",
        "what brakes?",
        "a tilt against the ball",
        ("strategy",),
        _one("turning the board back", "strategy.braking=rotation"),
    ),
    Ambiguity(
        "A24",
        "if the first movement goes the wrong way?",
        "the first towards the target is the initial one",
        ("strategy",),
        reason="else correcting a false start would be braking; how many trials that concerns is counted below",
    ),
    Ambiguity(
        "A25",
        "distance behind the midpoint",
        "negative",
        ("strategy",),
        _one("positive", "strategy.distance=absolute"),
    ),
    Ambiguity(
        "A26",
        "90th percentile of the range",
        "P95 - P5",
        ("strategy",),
        (
            Alternative("2 P90 of the magnitude", ("summaries.extent=twice_p90",)),
            Alternative("P90 - P10", ("summaries.extent=p10_to_p90",)),
            Alternative("0.9 of the range", ("summaries.extent=nine_tenths",)),
        ),
    ),
    Ambiguity(
        "A27",
        "units of the components",
        "SI",
        ("strategy",),
        _one("standardised", "summaries.scaling=standardised"),
    ),
    Ambiguity(
        "A28",
        "variance of which quantity?",
        "of each",
        ("strategy",),
        _one("generalised", "summaries.variance=generalised"),
    ),
    Ambiguity(
        "A29",
        "first and last trials of what?",
        "of each haptic condition",
        ("time", "peaks", "strategy"),
        _one("of both as they came", "summaries.numbering=configuration"),
    ),
    Ambiguity(
        "A30",
        "a standard deviation of what?",
        "of trials",
        ("time", "peaks"),
        _one("of people's means", "summaries.spread=people"),
    ),
    Ambiguity(
        "A31",
        "how well does somebody do?",
        "mean of all trials",
        ("time", "peaks"),
        (
            Alternative("median", ("summaries.level=median",)),
            Alternative("mean of the last 60", ("summaries.level=last",)),
        ),
    ),
    Ambiguity(
        "A32",
        "do failed attempts cost time?",
        "no",
        ("time",),
        _one("theirs is added", "summaries.time=all_attempts"),
    ),
    Ambiguity(
        "B5",
        "what must be in the target?",
        "the ball's centre",
        ("time", *_MOVING),
        _one("all of the ball", "completion.inside=whole_ball"),
    ),
    Ambiguity(
        "E4",
        "which points without slope?",
        "maxima",
        ("peaks",),
        (Alternative("minima too", ("peaks.extrema=maxima_and_minima",), likely=False),),
    ),
    Ambiguity(
        "E5",
        "where is a peak of equal samples?",
        "at the first",
        ("peaks",),
        _one("in the middle", "peaks.plateau=midpoint"),
    ),
)
"""All of them."""

PAIRS = (("A7", "A8"), ("A18", "A19"), ("A19", "A20"), ("A9", "A4"), ("A23", "A14"))
"""Questions whose answers are combined, the first alternative of each, for they touch the same numbers."""


def ambiguity(name: str) -> Ambiguity:
    """Find a question."""
    found = {one.name: one for one in AMBIGUITIES}
    return found[name]
