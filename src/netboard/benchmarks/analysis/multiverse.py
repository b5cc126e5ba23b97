"""All readings at once: what the numbers would have been on other paths through the paper's open questions.

A path answers every question, each likely answer with the same chance. There are far more paths than can be measured,
so they are drawn, from a seed: first filters, then what is measured behind them, then what is made of the trials.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from netboard.analysis.extraction.settings import Readings
from netboard.benchmarks.analysis.numbers import STATEMENTS
from netboard.benchmarks.analysis.readings import AMBIGUITIES, Ambiguity, readings_of

SEED = 1
"""Seed of the paths [1]."""

BEYOND = ("B5",)
"""Questions that no path answers otherwise: a recording ends with the hold that its own rule saw."""

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
"""Numbers that are shown, with what stands at their axis and the factor to its unit."""


@dataclass(frozen=True, slots=True)
class Paths:
    """Paths that were drawn."""

    measured: tuple[Readings, ...]
    summed_up: tuple[tuple[Readings, ...], ...]
    count: int


def _part(one: Ambiguity) -> str:
    """Which table the answers are in."""
    return one.alternatives[0].settings[0].partition(".")[0]


def _questions() -> dict[str, list[list[tuple[str, ...]]]]:
    """Answers to each question: those of filters, of other measures, of summaries."""
    questions: dict[str, list[list[tuple[str, ...]]]] = {"filters": [], "measures": [], "summaries": []}
    for one in AMBIGUITIES:
        answers = [(), *(other.settings for other in one.alternatives if other.likely)]
        if one.name not in BEYOND and len(answers) > 1:
            part = _part(one)
            questions[part if part in questions else "measures"].append(answers)
    return questions


def draw(base: tuple[str, ...], filters: int, measures: int, summaries: int, seed: int = SEED) -> Paths:
    """Draw paths.

    - `filters`, `measures`, `summaries`: how many sets of filters; of other measures for each of these; of summaries
      for each of those [1].
    """
    generator, questions = np.random.default_rng(seed), _questions()

    def drawn(part: str) -> tuple[str, ...]:
        return tuple(word for answers in questions[part] for word in answers[int(generator.integers(len(answers)))])

    measured: list[Readings] = []
    summed_up: list[tuple[Readings, ...]] = []
    for _ in range(filters):
        first = drawn("filters")
        for _ in range(measures):
            found = readings_of((*first, *drawn("measures")), base)
            measured.append(found)
            others = [readings_of(drawn("summaries"), base).summaries for _ in range(summaries)]
            summed_up.append(tuple(replace(found, summaries=other) for other in others))
    count = int(np.prod([float(len(answers)) for part in questions.values() for answers in part]))
    return Paths(tuple(measured), tuple(summed_up), count)


def held(paths: Sequence[dict[str, float]]) -> list[tuple[int, int]]:
    """Return on how many paths each of `STATEMENTS` holds, and of how many that tell [1]."""
    found = []
    for statement in STATEMENTS:
        gaps = np.array([statement.gap(one) for one in paths])
        found.append((int(np.count_nonzero(gaps > 0)), int(np.count_nonzero(np.isfinite(gaps)))))
    return found


def draw_paths(
    default: dict[str, float], paths: Sequence[dict[str, float]], singles: Sequence[dict[str, float]]
) -> Any:
    """Draw how the headline numbers are spread over the paths."""
    from netboard.analysis.topics.figure import BLUE, SKY, VERMILION, new_figure

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
