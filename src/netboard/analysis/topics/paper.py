"""Numbers reported by the paper (arXiv:2203.01287), and the same numbers of a study beside them.

The paper gives means and standard deviations, counts of dyads, and directions in words. It gives no p values, no effect
sizes, and no numbers for shares, ellipses and delays except "around 100 ms" and "about 40 ms". Line numbers refer to
the paper's source.

The paper does not say over what its standard deviations are. Their size is that of single trials, so they are taken to
be over these, and a difference of one standard deviation is large.
"""

from dataclasses import asdict, dataclass, replace
from math import isfinite, nan
from typing import Any, Literal

import pandas as pd

from netboard.analysis.extraction.study import StudyData
from netboard.analysis.extraction.tables import count, number, words
from netboard.analysis.topics.delay import APART, OVER_ALL, RISE
from netboard.analysis.topics.everything import PAPER, results_in
from netboard.analysis.topics.groups import CONFIGURATIONS, windows_of
from netboard.analysis.topics.result import Result, plain
from netboard.analysis.topics.units import read_in

Kind = Literal["number", "count", "rises", "falls", "unchanged", "words"]


@dataclass(frozen=True, slots=True)
class Reported:
    """A number or direction in the paper, and the corresponding result of a study.

    Attributes
    ----------
    kind : {"number", "count", "rises", "falls", "unchanged", "words"}
        Kind of comparison: a number, a count, the direction of a difference, or words only.
    topic, quantity, group : str
        Key of the result, as in `Result`; ``{ends}`` stands for the number of first and last trials.
    said : str
        Statement, shortened.
    reported : float
        The number; NaN without one [unit of the result].
    reported_sd : float
        Standard deviation, taken to be over single trials; NaN without one [unit of the result].
    reported_of : int
        Total of a count; 0 if it is not a count [1].
    """

    figure: str
    line: int
    kind: Kind
    said: str
    topic: str
    quantity: str
    group: str
    reported: float = nan
    reported_sd: float = nan
    reported_of: int = 0


def _ends(quantity: str, line: int, panels: str, values: tuple[float, ...]) -> tuple[Reported, ...]:
    """Return first and last means and standard deviations of one quantity, bimanual and dyadic."""
    places = [
        (panel, team, end) for panel, team in zip(panels, CONFIGURATIONS, strict=True) for end in ("first", "last")
    ]
    return tuple(
        Reported(
            f"2{panel}", line, "number", f"{end} 30", "learning", quantity, f"{team}, {end} {{ends}}", mean, deviation
        )
        for (panel, team, end), mean, deviation in zip(places, values[::2], values[1::2], strict=True)
    )


def _learned(quantity: str, line: int, panels: str) -> tuple[Reported, ...]:
    return tuple(
        Reported(
            f"2{panel}",
            line,
            "falls",
            "decreased",
            "learning",
            f"change of {quantity}",
            f"{team}, last {{ends}} vs first {{ends}}",
        )
        for panel, team in zip(panels, CONFIGURATIONS, strict=True)
    )


def _better(quantity: str, panel: str, felt: int, unfelt: int) -> tuple[Reported, ...]:
    """Return the counts of dyads that are better than the mean of their participants."""
    name = f"{quantity}: dyads better than the mean of the two"
    return tuple(
        Reported(f"3{panel}", 180, "count", f"{better} of 4 dyads", "dyads", name, group, float(better), reported_of=4)
        for group, better in (("haptics on", felt), ("haptics off", unfelt))
    )


def _share(figure: str, line: int, kind: Kind, statement: str, of: str, group: str) -> Reported:
    return Reported(figure, line, kind, statement, "classes", f"share of {of}", group)


_CONDITIONS = tuple(f"{team}, {haptics}" for team in CONFIGURATIONS for haptics in ("haptics off", "haptics on"))
_EFFECTS = tuple(f"{team}, haptics on vs off" for team in CONFIGURATIONS)
_BETWEEN = "dyadic vs bimanual"

REPORTED: tuple[Reported, ...] = (
    *_ends("completion time", 161, "AB", (5.71, 4.48, 3.61, 3.08, 4.33, 2.92, 3.62, 2.23)),
    *_learned("completion time", 161, "AB"),
    _share("2AB", 161, "falls", "higher in bimanual", "cooperative movement", _BETWEEN),
    _share("2AB", 161, "falls", "higher in bimanual", "stillness", _BETWEEN),
    _share("2AB", 161, "rises", "more in dyadic", "single movement", _BETWEEN),
    _share("2AB", 161, "rises", "more in dyadic", "competitive movement", _BETWEEN),
    *(_share("2A", 161, "words", "almost none", "competitive movement", group) for group in _CONDITIONS[:2]),
    *_ends("number of velocity peaks", 170, "CD", (3.92, 2.42, 3.17, 1.85, 4.27, 2.91, 3.28, 1.95)),
    *_learned("number of velocity peaks", 170, "CD"),
    *_better("completion time", "A", 4, 2),
    *_better("number of velocity peaks", "B", 3, 1),
    *(_share("4", 182, "rises", "increased with haptics", "cooperative movement", group) for group in _EFFECTS),
    *(_share("4", 182, "falls", "decreased with haptics", "single movement", group) for group in _EFFECTS),
    _share("4", 182, "falls", "decreased with haptics", "competitive movement", _EFFECTS[1]),
    *(
        Reported(f"5{panel}", 192, "falls", statement, "strategy", f"change of {what}", "all, last group vs first")
        for panel, statement, what in (
            ("A", "became smaller", "the area of the ellipse"),
            ("B", "decreased", "variance of distance"),
            ("B", "decreased", "variance of velocity"),
        )
    ),
    *(
        Reported("6", 202, "number", statement, "delay", f"delay, {OVER_ALL}", team, value)
        for statement, team, value in (("about 40 ms", "bimanual", 0.04), ("around 100 ms", "dyadic", 0.1))
    ),
    Reported("6", 202, "rises", "higher in dyadic", "delay", f"delay, {OVER_ALL}", _BETWEEN),
    *(Reported("6", 202, "rises", "increases with the threshold", "delay", RISE, group) for group in _CONDITIONS),
    Reported("6", 202, "falls", "decreased with haptics", "delay", f"delay, {OVER_ALL}", _EFFECTS[1]),
    Reported("6", 202, "count", "intervals apart", "delay", APART, _EFFECTS[1], 4.0, reported_of=4),
    Reported("6", 202, "unchanged", "little effect", "delay", f"delay, {OVER_ALL}", _EFFECTS[0]),
)
"""All reported numbers and directions, in the paper's order."""

COMPARISON = (
    words("figure", "figure of the paper"),
    count("line", "line of the paper's source"),
    words("quantity", "what it is"),
    words("group", "condition or group to which it refers"),
    words("kind", "what can be compared: a number, a count, a direction (rises, falls, unchanged), or words"),
    words("said", "statement of the paper, shortened"),
    number("reported", "the paper's number", "in column unit"),
    number("reported_sd", "its standard deviation, taken to be of single trials", "in column unit"),
    count("reported_of", "total of which a count is a part; 0 if it is not a count"),
    number("value", "the study's number", "in column unit"),
    number("low", "lower end of its interval", "in column unit"),
    number("high", "upper end of its interval", "in column unit"),
    words("unit", "SI unit"),
    words("interval", "kind of the interval"),
    count("n", "n of the study's number"),
    words("of", "of what"),
    number("difference", "the study's number minus the paper's; none for counts of different totals", "in column unit"),
    number("difference_sd", "the same in standard deviations of the paper", "1"),
    words("verdict", "whether both agree"),
    words("note", "note on the interpretation"),
)


LIKELY_SEARCH = (
    'the default search measures the sides; the paper more likely had delays.search = "inside", with which delays are '
    "shorter and grow with the threshold"
)
"""Note on a delay with another search (docs/reference/measures.md has the reasons)."""


def compare(study: StudyData) -> pd.DataFrame:
    """Compare a study's numbers with those of the paper."""
    found = {(one.topic, one.quantity, one.group): one for topic in PAPER for one in results_in(study, topic)}
    ends = windows_of(study).ends
    rows = []
    for one in REPORTED:
        said = replace(one, group=one.group.format(ends=ends))
        key = said.topic, said.quantity, said.group
        result = found.get(key, plain(*key, nan, "", 0, "", "the study has no such result"))
        if said.topic == "delay" and study.readings.delays.search != "inside":
            result = replace(result, note="; ".join(filter(None, (result.note, LIKELY_SEARCH))))
        rows.append(_row(said, result))
    return pd.DataFrame(rows, columns=[field.name for field in COMPARISON])


def _row(said: Reported, found: Result) -> dict[str, Any]:
    difference = nan if _other_total(said, found) else found.value - said.reported
    return {
        **asdict(said),
        **asdict(found),
        "difference": difference,
        "difference_sd": difference / said.reported_sd,
        "verdict": _verdict(said, found),
    }


def _verdict(said: Reported, found: Result) -> str:
    """Return a phrase on the agreement of a study's number with the paper's."""
    if not isfinite(found.value):
        return "not in this study"
    if said.kind == "words":
        return "not reported as a number"
    if said.kind == "number":
        difference = found.value - said.reported
        deviations = difference / said.reported_sd
        if isfinite(deviations):
            return f"{deviations:+.2f} SD"
        unit = read_in(found.unit, found.quantity)
        return f"{difference * unit.scale:+.3g} {unit.symbol}, no SD reported"
    if _other_total(said, found):
        return f"{found.value / found.n:.0%} here, {said.reported / said.reported_of:.0%} in the paper".replace(
            "%", " %"
        )
    if said.kind == "count":
        return "same count" if found.value == said.reported else "other count"
    return _direction(said.kind, found)


def _other_total(said: Reported, found: Result) -> bool:
    """Return whether a count of the study is out of another total than the paper's, such as of 6 and of 4 dyads."""
    return said.kind == "count" and found.n > 0 and found.n != said.reported_of


def _direction(kind: Kind, found: Result) -> str:
    """Return a phrase on whether a difference has the reported direction, and its confidence interval includes 0."""
    sure = "no interval"
    if isfinite(found.low) and isfinite(found.high):
        sure = f"interval {'includes' if found.low <= 0.0 <= found.high else 'excludes'} 0"
    if kind == "unchanged":
        return sure
    agrees = found.value > 0.0 if kind == "rises" else found.value < 0.0
    return f"{'same' if agrees else 'other'} direction, {sure}"
