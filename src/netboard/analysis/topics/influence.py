"""Directed influence between partners: Granger causality, compared with surrogate dyads.

The signals are the velocities of the two styluses at 50 Hz, from release to completion. Trials with the target on the
left are mirrored, including the ball position, so that all trials have the same demands and a side remains the same
participant. The model conditions on the target's own past and the ball's. True dyads are compared with surrogate dyads:
partners from two dyads with the same task (`netboard.analysis.measures.information`). The zero-phase filter leaks a
little of the future into the past, which is another reason for this comparison.

Computing time grows with the square of the number of dyads, times the trials of each. At most `MOST` trials of pairs
are evaluated, but at least `LEAST` of each dyad; trials are then sampled with a fixed seed.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Literal

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from netboard.analysis.extraction.conditions import STAND_INS
from netboard.analysis.extraction.study import StudyData
from netboard.analysis.measures.information import Past, SurrogateComparison, chance_level, granger
from netboard.analysis.statistics.estimates import mean
from netboard.analysis.topics.figure import Drawn, fit_beside, look_of, new_mosaic, pictured
from netboard.analysis.topics.groups import Condition, conditions
from netboard.analysis.topics.paths import joined
from netboard.analysis.topics.result import Result, TopicResults, cached, plain
from netboard.base.looks import GREY, PRINT_SMALL
from netboard.base.plural import plural

if TYPE_CHECKING:
    from matplotlib.axes import Axes

Direction = Literal["left to right", "right to left"]

PAST = Past(step=1, own=3, other=3, delay=1)
"""Past of 20, 40 and 60 ms, in samples of a path."""

MOST, LEAST = 1000, 10
"""Largest number of trials over pairs of dyads, per condition and direction; minimum per dyad [1]."""

SHORTEST = 8
"""Minimum number of samples of a trial [1]."""

SEED = 20_000_731
"""Seed of the choice of trials, and of pairings of many dyads."""

Trials = list[NDArray[np.float64]]


@dataclass(frozen=True, slots=True, eq=False)
class Influence:
    """Influence of one side on the other in a condition: the Granger strength in each true dyad [nat].

    `chance` compares their mean with that of surrogate dyads, None for a single dyad; `available` is the smallest
    number of trials of any dyad, from which these were sampled [1].
    """

    condition: Condition
    direction: Direction
    dyads: tuple[str, ...]
    values: NDArray[np.float64]
    chance: SurrogateComparison | None
    trials: int
    available: int


def _results(one: Influence) -> list[Result]:
    """Return strength in true dyads, chance level, excess, and p value."""
    n, chance = len(one.dyads), one.chance
    group = f"{one.condition.label}, {one.direction}"
    note = f"{one.trials} of {one.available} trials of each dyad; given the ball"
    if chance is None:
        few = "one dyad" if n == 1 else "no dyad has both signals"
        numbers = [("Granger strength", mean(one.values), "nat", f"{note}; {few}: no surrogates")]
    else:
        numbers = [
            ("Granger strength", chance.value, "nat", note),
            ("Granger strength of surrogate dyads", chance.level, "nat", f"{len(chance.surrogates)} pairings"),
            ("Granger strength beyond surrogates", chance.excess, "nat", note),
            (
                "Granger strength: p by surrogates",
                chance.p,
                "1",
                f"smallest possible p {chance.least_p:.3g} with these exchanges",
            ),
        ]
    return [plain("influence", name, group, x, unit, n, "dyad", why) for name, x, unit, why in numbers]


@cached
def influences(study: StudyData) -> TopicResults[Influence]:
    """Return the influence of each partner on the other, in all conditions with two people."""
    found: list[Influence] = []
    for condition in conditions(study):
        trials = study.counted[study.counted["condition"] == condition.name]
        movers = study.blocks.loc[study.blocks["recording"].isin(trials["recording"]), ["left_by", "right_by"]]
        if (movers["left_by"] != movers["right_by"]).all() and not movers.isin(STAND_INS).any(axis=None):
            found += _in_condition(condition, trials, study.paths)
    return TopicResults.of(found, _results)


def _in_condition(condition: Condition, trials: pd.DataFrame, paths: Mapping[str, pd.DataFrame]) -> list[Influence]:
    there = _signals(trials, paths)
    if not there:
        return []
    dyads, available = tuple(there), min(map(len, there.values()))
    count = min(available, max(LEAST, MOST // len(dyads) ** 2))
    rng = np.random.default_rng(SEED)
    drawn = np.sort(rng.choice(available, count, replace=False))
    left, right = ([[there[dyad][k][:, [side, 2]] for k in drawn] for dyad in dyads] for side in (0, 1))
    return [
        _influence(condition, "left to right", dyads, left, right, available, rng),
        _influence(condition, "right to left", dyads, right, left, available, rng),
    ]


def _signals(trials: pd.DataFrame, paths: Mapping[str, pd.DataFrame]) -> dict[str, Trials]:
    """Return each dyad's trials in order, each with rows of both velocities and the ball position [m/s, m]."""
    found: dict[str, Trials] = {dyad: [] for dyad in sorted(trials["dyad"].unique())}
    for whole in joined(trials, paths):
        table = whole[whole["time"] <= whole["completion"]]
        signals = table[["left_vz", "right_vz", "p"]].to_numpy() * table[["target"]].to_numpy()
        bounds = np.flatnonzero(np.diff(table["number"])) + 1
        for signal in np.split(signals, bounds):
            if len(signal) >= SHORTEST and np.isfinite(signal).all():
                found[whole["dyad"].iat[0]].append(signal)
    return {dyad: own for dyad, own in found.items() if own}


def _influence(
    condition: Condition,
    direction: Direction,
    dyads: tuple[str, ...],
    sources: Sequence[Trials],
    targets: Sequence[Trials],
    available: int,
    rng: np.random.Generator,
) -> Influence:
    values = np.array([_strength(source, target) for source, target in zip(sources, targets, strict=True)])
    known = np.flatnonzero(np.isfinite(values)).tolist()
    chance = None
    if len(known) > 1:
        source, target = ([trials[k] for k in known] for trials in (sources, targets))
        chance = chance_level(source, target, _strength, rng, true=values[known])
    names = tuple(dyads[k] for k in known)
    return Influence(condition, direction, names, values[known], chance, len(sources[0]), available)


def _strength(sources: Sequence[NDArray[np.float64]], targets: Sequence[NDArray[np.float64]]) -> float:
    """Return the Granger strength, conditional on the ball of the target's trial."""
    others, own, ball = ([trial[:, k] for trial in trials] for trials, k in ((sources, 0), (targets, 0), (targets, 1)))
    return granger(others, own, past=PAST, given=[ball]).strength


FEW = 6
"""Largest number of columns with horizontal names [1]."""


@pictured("Influence between partners")
def picture(study: StudyData) -> Drawn:
    """Draw the influence between partners."""
    found = [one for one in influences(study).parts if len(one.values)]
    if not found:
        return "No condition has two people and paths of their trials, so their influence cannot be estimated."
    figure, axes = new_mosaic(3.2, [["all"]])
    for place, one in enumerate(found):
        _column(axes["all"], place, one)
    names = [f"{one.condition.haptics_label}\n{one.direction}" for one in found]
    axes["all"].set_xticks(range(len(found)), names, fontsize=PRINT_SMALL)
    if len(found) > FEW or not fit_beside(names):
        for label in axes["all"].get_xticklabels():
            label.set(rotation=35, ha="right", rotation_mode="anchor")
    axes["all"].set_xlim(-0.6, len(found) - 0.4)
    axes["all"].set_ylim(bottom=min(0.0, axes["all"].get_ylim()[0]))
    axes["all"].set_ylabel("Granger strength [nat]")
    figure.legend(*axes["all"].get_legend_handles_labels(), loc="outside lower center", ncols=3)
    return figure, _caption(found)


def _column(axes: "Axes", place: int, one: Influence) -> None:
    """Draw true dyads on the left, means of surrogate dyads on the right, one for each pairing."""
    look = look_of(one.condition)
    name = f"{one.condition.name}, {one.direction}"
    named = place == 0
    axes.plot(
        np.full(len(one.values), place - 0.15),
        one.values,
        linestyle="none",
        marker="o",
        markersize=3.5,
        color=look.colour,
        alpha=0.5,
        markeredgewidth=0.0,
        label="a dyad" if named else f"_{name}, dyads",
    )
    mean = float(np.mean(one.values))
    axes.plot(
        [place - 0.27, place - 0.03],
        [mean, mean],
        color=look.colour,
        linewidth=2.0,
        label="mean of the dyads" if named else f"_{name}, mean",
    )
    if one.chance is not None:
        at = np.full(len(one.chance.surrogates), place + 0.15)
        axes.plot(
            at,
            one.chance.surrogates,
            linestyle="none",
            marker="_",
            markersize=12,
            color=GREY,
            alpha=0.7,
            label="mean of a pairing of surrogate dyads" if named else f"_{name}, surrogates",
        )
        axes.text(
            place,
            1.0,
            f"p = {one.chance.p:.2g}",
            transform=axes.get_xaxis_transform(),
            ha="center",
            fontsize=PRINT_SMALL,
        )


def _caption(found: list[Influence]) -> str:
    n = sorted({len(one.dyads) for one in found})
    tests = [one.chance for one in found if one.chance is not None]
    chance = "With a single dyad there are no surrogates."
    if tests:
        most = max(tests, key=lambda one: one.n)
        drawn = "all" if most.exact else "randomly drawn"
        chance = (
            f"Grey: means of surrogate dyads, {plural(len(most.surrogates), 'pairing')}. p: share of {drawn} exchanges "
            f"of partners that give at least the recorded mean; the smallest possible p is {most.least_p:.2g}. "
            f"Exploratory, without correction: {plural(len(tests), 'test')}."
        )
    return (
        "Gain in the prediction of one side's velocity if 60 ms of the other side's past are added to its own past and "
        f"the ball's. Points: dyads, n = {' or '.join(map(str, n))}, {found[0].trials} of {found[0].available} trials "
        f"of each; bars: their mean. {chance} Mechanical influence through the board is included."
    )
