"""Open questions of the paper's analysis: each with the default, its alternatives, and the numbers that they affect."""

from dataclasses import dataclass
from typing import Literal

from netboard.analysis.extraction.settings import Readings, parse

Family = Literal["time", "peaks", "shares", "delay", "strategy"]
"""Families of reported numbers: those of a family derive from the same measure of an attempt."""


@dataclass(frozen=True, slots=True)
class Alternative:
    """Another answer to a question.

    - `settings`: as given to ``--set``.
    - `likely`: whether it is a plausible interpretation of the paper; an error or another quantity is not.
    """

    name: str
    settings: tuple[str, ...]
    likely: bool


@dataclass(frozen=True, slots=True)
class Question:
    """A question that the paper leaves open.

    - `name`: A1 to A32 for the analysis, B5 for the trial, E4 and E5 for the printed equation.
    - `families`: families of numbers that the answer may change.
    - `reason`: why there is no alternative.
    """

    name: str
    text: str
    default: str
    families: tuple[str, ...]
    alternatives: tuple[Alternative, ...]
    reason: str


def readings_of(settings: tuple[str, ...], base: tuple[str, ...] = ()) -> Readings:
    """Parse settings; those in `settings` override those in `base`."""
    return parse("", "the analysis", (*base, *settings))


_UNLIKELY = ("A21", "E4")
"""Questions whose alternatives are an error or another quantity."""

_SEVERAL = {"moving": ("peaks", "shares", "delay", "strategy"), "segmented": ("delay", "strategy")}
"""Families that depend on the filtered motion, and on the movements of the board."""

_TABLE = """
A1 | Which part of the filter has order 10? | both passes together | moving | each pass: filters.order_of=each_pass
A2 | Which response is at -3 dB at the cutoff? | the response of each pass | moving
    | the response of both passes (Winter): filters.cutoff_of=both_passes
A3 | In which numerical form is the filter? | second-order sections | moving
    | the transfer-function form is numerically unstable, so it is an error; a separate table shows it
A4 | Which signal is filtered as a whole? | the recording, with 1 s of odd padding | moving
    | each trial: filters.unit=trial | each trial, 0.02 s of padding: filters.unit=trial filters.pad=0.02
A5 | Which velocity of a stylus is used? | the derivative of the filtered height | shares delay
    | the device's velocity, filtered: filters.velocity=device
A6 | In which order are absolute value and filter applied to the ball's velocity? | absolute value, then filter
    | peaks | filter, then absolute value: filters.speed=filter_first
A7 | In which window are peaks counted? | until completion | peaks | including the hold: peaks.window=whole
A8 | What is the smallest prominence of a peak? | 0.1 mm/s and 0.6 % of the largest speed | peaks
    | any: peaks.least_prominence=0.0 peaks.least_share=0.0 | 10 mm/s: peaks.least_prominence=0.01
A9 | In which window are the shares computed? | until completion | shares | including the hold: movements.window=whole
A10 | Does a speed of exactly 3 mm/s count as movement? | yes | shares | no: movements.at_limit=still
A11 | What are opposite directions of movement? | signs of the styluses' vertical velocities | shares
    | the paper states it; the page of the measures says how it classifies two hands that lift together
A12 | How are shares averaged? | over trials | shares | over time: summaries.shares=time
A13 | Does a reversal end a movement of the board? | yes | segmented
    | no, only a low velocity does: segments.turning=either_way
A14 | Which angle must be at least 1 degree? | net angle | segmented | range of the angle: segments.angle=range
    | integral of the low-pass filtered velocity: segments.angle=integral
A15 | When does a movement end at the latest? | at the end of the recording | segmented
    | at the end of the trial: segments.ends=trial
A16 | Which quantity has opposite signs in a cooperative movement? | displacement | delay
    | velocity, in most samples: delays.opposite=majority
A17 | Which quantity may differ by a factor of nine? | displacement | delay | path length: delays.amount=path
A18 | Of which peak is the threshold a portion? | the slower side's peak, for both sides | delay
    | each side's own peak: delays.threshold=own_peak
A19 | When does a side start that exceeds the threshold at the onset? | where it crossed the threshold before | delay
    | at the onset: delays.search=inside
A20 | Are delays measured on velocity or on speed? | velocity in the side's own direction | delay
    | speed: delays.velocity=magnitude
A21 | Are delays absolute or signed? | absolute | delay | signed: summaries.delay=signed
A22 | Over which units is a delay's confidence interval computed? | dyads | delay
    | single movements: summaries.intervals=movements
A23 | What is a braking movement? | a tilt against the ball | strategy
    | a rotation of the board back: strategy.braking=rotation
A24 | Which movement is the initial one if the first goes the wrong way? | the first one towards the target | strategy
    | otherwise the correction of a false start would count as braking; a table below counts these trials
A25 | Which sign has a distance behind the midpoint? | negative | strategy | positive: strategy.distance=absolute
A26 | What is the 90th percentile of the range? | P95 - P5 | strategy
    | 2 P90 of the magnitude: summaries.extent=twice_p90 | P90 - P10: summaries.extent=p10_to_p90
    | 0.9 of the range: summaries.extent=nine_tenths
A27 | Which units do the components have? | SI | strategy | standardised: summaries.scaling=standardised
A28 | Which variance is reported? | of each quantity | strategy | generalised variance: summaries.variance=generalised
A29 | Within which trials are the first and last counted? | each haptic condition | time peaks strategy
    | both conditions, in order of time: summaries.numbering=configuration
A30 | Over what is the standard deviation computed? | trials | time peaks | means of performers: summaries.spread=people
A31 | How is the level of a performer computed? | mean of all trials | time peaks | median: summaries.level=median
    | mean of the last 60: summaries.level=last
A32 | Does the time of failed attempts count? | no | time | yes, it is added: summaries.time=all_attempts
B5 | What must be in the target? | the ball's centre | time moving | the whole ball: completion.inside=whole_ball
E4 | Which stationary points count as peaks? | maxima | peaks | maxima and minima: peaks.extrema=maxima_and_minima
E5 | Where is a peak of equal samples? | at the first sample | peaks | in the middle of them: peaks.plateau=midpoint
"""
"""Name, question, default, families; then each alternative with its settings, or the reason why there is none."""


def _question(line: str) -> Question:
    name, text, default, families, *answers = line.split(" | ")
    each = tuple(family for word in families.split() for family in _SEVERAL.get(word, (word,)))
    if ": " not in answers[0]:
        return Question(name, text, default, each, (), answers[0])
    pairs = (answer.split(": ") for answer in answers)
    others = tuple(Alternative(other, tuple(settings.split()), name not in _UNLIKELY) for other, settings in pairs)
    return Question(name, text, default, each, others, "")


QUESTIONS = tuple(map(_question, _TABLE.strip().replace("\n   ", "").splitlines()))
"""All open questions."""

PAIRS = (("A7", "A8"), ("A18", "A19"), ("A19", "A20"), ("A9", "A4"), ("A23", "A14"))
"""Questions that affect the same numbers; the first alternatives of both are combined."""


def question_named(name: str) -> Question:
    """Return the question of this name."""
    return {one.name: one for one in QUESTIONS}[name]
