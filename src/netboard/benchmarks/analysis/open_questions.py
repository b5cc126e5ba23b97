"""Open questions of the paper's analysis: each with the default, its alternatives, and the numbers that they affect.

An alternative is a list of settings as given to ``--set``. A question without an alternative gives the reason.
"""

from dataclasses import dataclass
from typing import Literal

from netboard.analysis.extraction.settings import Readings, parse

Family = Literal["time", "peaks", "shares", "delay", "strategy"]
"""Families of reported numbers: those of a family derive from the same measure of an attempt."""


@dataclass(frozen=True, slots=True)
class Alternative:
    """Another answer to a question.

    - `likely`: whether it is a plausible interpretation of the paper; an error or another quantity is not.
    """

    name: str
    settings: tuple[str, ...]
    likely: bool = True


@dataclass(frozen=True, slots=True)
class Question:
    """A question that the paper leaves open.

    - `name`: A1 to A32 for the analysis, B5 for the trial, E4 and E5 for the printed equation.
    - `families`: families of numbers that the answer may change.
    """

    name: str
    text: str
    default: str
    families: tuple[Family, ...]
    alternatives: tuple[Alternative, ...] = ()
    reason: str = ""


def readings_of(settings: tuple[str, ...], base: tuple[str, ...] = ()) -> Readings:
    """Parse settings; those in `settings` override those in `base`."""
    return parse("", "the analysis", (*base, *settings))


def _one(name: str, *settings: str) -> tuple[Alternative, ...]:
    return (Alternative(name, settings),)


_MOVING: tuple[Family, ...] = ("peaks", "shares", "delay", "strategy")
_SEGMENTED: tuple[Family, ...] = ("delay", "strategy")

QUESTIONS = (
    Question(
        "A1",
        "Which part of the filter has order 10?",
        "both passes together",
        _MOVING,
        _one("each pass", "filters.order_of=each_pass"),
    ),
    Question(
        "A2",
        "Which response is at -3 dB at the cutoff?",
        "the response of each pass",
        _MOVING,
        _one("the response of both passes (Winter)", "filters.cutoff_of=both_passes"),
    ),
    Question(
        "A3",
        "In which numerical form is the filter?",
        "second-order sections",
        _MOVING,
        reason="the transfer-function form is numerically unstable, so it is an error; a separate table shows it",
    ),
    Question(
        "A4",
        "Which signal is filtered as a whole?",
        "the recording, with 1 s of odd padding",
        _MOVING,
        (
            Alternative("each trial", ("filters.unit=trial",)),
            Alternative("each trial, 0.02 s of padding", ("filters.unit=trial", "filters.pad=0.02")),
        ),
    ),
    Question(
        "A5",
        "Which velocity of a stylus is used?",
        "the derivative of the filtered height",
        ("shares", "delay"),
        _one("the device's velocity, filtered", "filters.velocity=device"),
    ),
    Question(
        "A6",
        "In which order are absolute value and filter applied to the ball's velocity?",
        "absolute value, then filter",
        ("peaks",),
        _one("filter, then absolute value", "filters.speed=filter_first"),
    ),
    Question(
        "A7",
        "In which window are peaks counted?",
        "until completion",
        ("peaks",),
        _one("including the hold", "peaks.window=whole"),
    ),
    Question(
        "A8",
        "What is the smallest prominence of a peak?",
        "0.1 mm/s and 0.6 % of the largest speed",
        ("peaks",),
        (
            Alternative("any", ("peaks.least_prominence=0.0", "peaks.least_share=0.0")),
            Alternative("10 mm/s", ("peaks.least_prominence=0.01",)),
        ),
    ),
    Question(
        "A9",
        "In which window are the shares computed?",
        "until completion",
        ("shares",),
        _one("including the hold", "movements.window=whole"),
    ),
    Question(
        "A10",
        "Does a speed of exactly 3 mm/s count as movement?",
        "yes",
        ("shares",),
        _one("no", "movements.at_limit=still"),
    ),
    Question(
        "A11",
        "What are opposite directions of movement?",
        "signs of the styluses' vertical velocities",
        ("shares",),
        reason="the paper states it; the page of the measures says how it classifies two hands that lift together",
    ),
    Question(
        "A12",
        "How are shares averaged?",
        "over trials",
        ("shares",),
        _one("over time", "summaries.shares=time"),
    ),
    Question(
        "A13",
        "Does a reversal end a movement of the board?",
        "yes",
        _SEGMENTED,
        _one("no, only a low velocity does", "segments.turning=either_way"),
    ),
    Question(
        "A14",
        "Which angle must be at least 1 degree?",
        "net angle",
        _SEGMENTED,
        (
            Alternative("range of the angle", ("segments.angle=range",)),
            Alternative("integral of the low-pass filtered velocity", ("segments.angle=integral",)),
        ),
    ),
    Question(
        "A15",
        "When does a movement end at the latest?",
        "at the end of the recording",
        _SEGMENTED,
        _one("at the end of the trial", "segments.ends=trial"),
    ),
    Question(
        "A16",
        "Which quantity has opposite signs in a cooperative movement?",
        "displacement",
        ("delay",),
        _one("velocity, in most samples", "delays.opposite=majority"),
    ),
    Question(
        "A17",
        "Which quantity may differ by a factor of nine?",
        "displacement",
        ("delay",),
        _one("path length", "delays.amount=path"),
    ),
    Question(
        "A18",
        "Of which peak is the threshold a portion?",
        "the slower side's peak, for both sides",
        ("delay",),
        _one("each side's own peak", "delays.threshold=own_peak"),
    ),
    Question(
        "A19",
        "When does a side start that exceeds the threshold at the onset?",
        "where it crossed the threshold before",
        ("delay",),
        _one("at the onset", "delays.search=inside"),
    ),
    Question(
        "A20",
        "Are delays measured on velocity or on speed?",
        "velocity in the side's own direction",
        ("delay",),
        _one("speed", "delays.velocity=magnitude"),
    ),
    Question(
        "A21",
        "Are delays absolute or signed?",
        "absolute",
        ("delay",),
        (Alternative("signed", ("summaries.delay=signed",), likely=False),),
    ),
    Question(
        "A22",
        "Over which units is a delay's confidence interval computed?",
        "dyads",
        ("delay",),
        _one("single movements", "summaries.intervals=movements"),
    ),
    Question(
        "A23",
        "What is a braking movement?",
        "a tilt against the ball",
        ("strategy",),
        _one("a rotation of the board back", "strategy.braking=rotation"),
    ),
    Question(
        "A24",
        "Which movement is the initial one if the first goes the wrong way?",
        "the first one towards the target",
        ("strategy",),
        reason="otherwise the correction of a false start would count as braking; a table below counts these trials",
    ),
    Question(
        "A25",
        "Which sign has a distance behind the midpoint?",
        "negative",
        ("strategy",),
        _one("positive", "strategy.distance=absolute"),
    ),
    Question(
        "A26",
        "What is the 90th percentile of the range?",
        "P95 - P5",
        ("strategy",),
        (
            Alternative("2 P90 of the magnitude", ("summaries.extent=twice_p90",)),
            Alternative("P90 - P10", ("summaries.extent=p10_to_p90",)),
            Alternative("0.9 of the range", ("summaries.extent=nine_tenths",)),
        ),
    ),
    Question(
        "A27",
        "Which units do the components have?",
        "SI",
        ("strategy",),
        _one("standardised", "summaries.scaling=standardised"),
    ),
    Question(
        "A28",
        "Which variance is reported?",
        "of each quantity",
        ("strategy",),
        _one("generalised variance", "summaries.variance=generalised"),
    ),
    Question(
        "A29",
        "Within which trials are the first and last counted?",
        "each haptic condition",
        ("time", "peaks", "strategy"),
        _one("both conditions, in order of time", "summaries.numbering=configuration"),
    ),
    Question(
        "A30",
        "Over what is the standard deviation computed?",
        "trials",
        ("time", "peaks"),
        _one("means of performers", "summaries.spread=people"),
    ),
    Question(
        "A31",
        "How is the level of a performer computed?",
        "mean of all trials",
        ("time", "peaks"),
        (
            Alternative("median", ("summaries.level=median",)),
            Alternative("mean of the last 60", ("summaries.level=last",)),
        ),
    ),
    Question(
        "A32",
        "Does the time of failed attempts count?",
        "no",
        ("time",),
        _one("yes, it is added", "summaries.time=all_attempts"),
    ),
    Question(
        "B5",
        "What must be in the target?",
        "the ball's centre",
        ("time", *_MOVING),
        _one("the whole ball", "completion.inside=whole_ball"),
    ),
    Question(
        "E4",
        "Which stationary points count as peaks?",
        "maxima",
        ("peaks",),
        (Alternative("maxima and minima", ("peaks.extrema=maxima_and_minima",), likely=False),),
    ),
    Question(
        "E5",
        "Where is a peak of equal samples?",
        "at the first sample",
        ("peaks",),
        _one("in the middle of them", "peaks.plateau=midpoint"),
    ),
)
"""All open questions."""

PAIRS = (("A7", "A8"), ("A18", "A19"), ("A19", "A20"), ("A9", "A4"), ("A23", "A14"))
"""Questions that affect the same numbers; the first alternatives of both are combined."""


def question_named(name: str) -> Question:
    """Return the question of this name."""
    return {one.name: one for one in QUESTIONS}[name]
