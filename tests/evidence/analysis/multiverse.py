"""Multiverse analysis: the reported numbers on random paths through all open questions.

A path answers every question, each likely answer with equal probability. There are far too many paths to measure all,
so some are drawn from a seed: sets of filters, for each of these settings of the measures, for each of those summaries.
See Steegen et al., Perspect. Psychol. Sci. 11:702, 2016.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from evidence.analysis.open_questions import QUESTIONS, readings_of
from evidence.analysis.reported_numbers import STATEMENTS
from netboard.analysis.extraction.settings import Readings

SEED = 1
"""Seed of the paths [1]."""

EXCLUDED = ("B5",)
"""Questions that are not varied: a trial ends by the rule of the experiment, which no analysis can change."""

HEADLINES = (
    ("completion time, dyadic, last", "completion time,\ndyadic, last [s]", 1.0),
    ("peaks, dyadic, last", "velocity peaks,\ndyadic, last [1]", 1.0),
    ("cooperative share, dyadic, haptics off", "cooperative share,\ndyadic, off [%]", 100.0),
    ("delay at 10 %, dyadic, haptics off", "delay at 10 %,\ndyadic, off [ms]", 1e3),
    ("delay at 40 %, dyadic, haptics off", "delay at 40 %,\ndyadic, off [ms]", 1e3),
    ("braking distance, dyadic, haptics off", "braking distance,\ndyadic, off [mm]", 1e3),
    ("ellipse's area, dyadic, last group", "ellipse's area,\ndyadic, last [mm m/s]", 1e3),
    ("variance of distance, last group over first, dyadic", "variance of distance,\nlast over first, dyadic [1]", 1.0),
)
"""Headline numbers: name, axis label, and factor to the unit of the label."""


@dataclass(frozen=True, slots=True)
class Paths:
    """Random paths.

    - `measured`: settings of the measures.
    - `summaries`: for each of these, the same settings with each set of summaries.
    - `count`: number of all possible paths [1].
    """

    measured: tuple[Readings, ...]
    summaries: tuple[tuple[Readings, ...], ...]
    count: int


def _questions() -> dict[str, list[list[tuple[str, ...]]]]:
    """Return the likely answers to each question about filters, other measures and summaries."""
    questions: dict[str, list[list[tuple[str, ...]]]] = {"filters": [], "measures": [], "summaries": []}
    for one in QUESTIONS:
        answers = [(), *(other.settings for other in one.alternatives if other.likely)]
        if one.name not in EXCLUDED and len(answers) > 1:
            table = one.alternatives[0].settings[0].partition(".")[0]
            questions[table if table in questions else "measures"].append(answers)
    return questions


def random_paths(base: tuple[str, ...], filters: int, measures: int, summaries: int, seed: int = SEED) -> Paths:
    """Draw random paths.

    - `filters`: number of sets of filters [1].
    - `measures`: number of settings of other measures for each of these [1].
    - `summaries`: number of summaries for each of those [1].
    """
    generator, questions = np.random.default_rng(seed), _questions()

    def drawn(part: str) -> tuple[str, ...]:
        return tuple(word for answers in questions[part] for word in answers[int(generator.integers(len(answers)))])

    measured: list[Readings] = []
    summarised: list[tuple[Readings, ...]] = []
    for _ in range(filters):
        first = drawn("filters")
        for _ in range(measures):
            found = readings_of((*first, *drawn("measures")), base)
            measured.append(found)
            others = [readings_of(drawn("summaries"), base).summaries for _ in range(summaries)]
            summarised.append(tuple(replace(found, summaries=other) for other in others))
    count = int(np.prod([float(len(answers)) for part in questions.values() for answers in part]))
    return Paths(tuple(measured), tuple(summarised), count)


def count_holding(paths: Sequence[dict[str, float]]) -> list[tuple[int, int]]:
    """Return, for each of `STATEMENTS`, the number of paths where it holds and of those where it is defined [1]."""
    found = []
    for statement in STATEMENTS:
        gaps = np.array([statement.gap(one) for one in paths])
        found.append((int(np.count_nonzero(gaps > 0)), int(np.count_nonzero(np.isfinite(gaps)))))
    return found


def plot_paths(
    default: dict[str, float], paths: Sequence[dict[str, float]], singles: Sequence[dict[str, float]]
) -> Any:
    """Draw histograms of the headline numbers over the paths."""
    from netboard.analysis.topics.figure import new_figure
    from netboard.base.looks import BLUE, SKY, VERMILION

    figure, axes = new_figure(3.9, columns=4, rows=2)
    for axis, (name, label, factor) in zip(axes, HEADLINES, strict=True):
        values = factor * np.array([one[name] for one in paths])
        axis.hist(values[np.isfinite(values)], bins=24, color=SKY, edgecolor="white", linewidth=0.3)
        moved = [factor * one[name] for one in singles if not np.isclose(one[name], default[name], rtol=1e-3)]
        axis.plot(moved, np.zeros(len(moved)), "|", color=BLUE, markersize=9, clip_on=False, zorder=3)
        axis.axvline(factor * default[name], color=VERMILION, linewidth=1.4)
        axis.set_xlabel(label)
        axis.ticklabel_format(axis="x", useOffset=False)
        axis.set_yticks([])
        axis.spines["left"].set_visible(False)
    return figure
