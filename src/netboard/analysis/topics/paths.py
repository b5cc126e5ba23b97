"""Mean paths of ball and hands from the release, and their spread over trials.

Trials with the target on the left are mirrored, so that the target is on the right and the hands are the near and the
far one. A path continues through the hold to the end of its trial. Paths are shown for as long as nine of ten trials
last, so that hardly any trial drops out.
"""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Literal

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from netboard.analysis.extraction.details import STEP
from netboard.analysis.extraction.study import StudyData
from netboard.analysis.extraction.tables import ATTEMPT_KEY
from netboard.analysis.extraction.trials import RATE
from netboard.analysis.statistics.estimates import t_interval
from netboard.analysis.topics.figure import Drawn, due_count, look_of, new_mosaic, pictured, titled
from netboard.analysis.topics.groups import Condition, conditions, estimated
from netboard.analysis.topics.result import Result, TopicResults, cached
from netboard.analysis.topics.units import read_in
from netboard.base.looks import BLACK, DARK_GREY, LIGHT_GREY

if TYPE_CHECKING:
    from matplotlib.axes import Axes

PERIOD = STEP / RATE
"""Sampling period of a path [s]."""

GOING_ON = 0.1
"""Largest share of trials that may have ended within the time shown [1]."""

BAND = (0.1, 0.9)
"""Quantiles of the trials at each time [1]."""

REPORTED = 0.5
"""Interval between reported times [s]."""

QUANTITIES = {"ball": "ball along the board", "near": "hand at the target's side", "far": "the other hand"}
"""Quantities with a path, by short name."""


@dataclass(frozen=True, slots=True, eq=False)
class MeanPath:
    """Mean path of a quantity in a condition: of each dyad, over the dyads, and quantiles of all trials [m, s].

    The quantity is the ball position, + = towards the target; or the height of the hand on the target's side (near), or
    of the other hand (far).
    """

    condition: Condition
    quantity: str
    time: NDArray[np.float64]
    dyads: tuple[str, ...]
    each: NDArray[np.float64]
    mean: NDArray[np.float64]
    low: NDArray[np.float64]
    high: NDArray[np.float64]
    trials: int


def _results(one: MeanPath) -> Iterator[Result]:
    """Yield the positions of ball or hand at the reported times."""
    for k in range(0, len(one.time), round(REPORTED / PERIOD)):
        note = f"of {one.trials} trials, + = {'towards the target' if one.quantity == 'ball' else 'up'}"
        group = f"{one.condition.label}, {one.time[k]:.1f} s"
        yield estimated("paths", QUANTITIES[one.quantity], group, t_interval(one.each[:, k]), "m", note)


@cached
def mean_paths(study: StudyData) -> TopicResults[MeanPath]:
    """Return the mean paths of all conditions."""
    if not len(study.counted):
        return TopicResults((), ())
    samples = int(study.counted["duration"].quantile(GOING_ON) / PERIOD)
    found = (path for condition in conditions(study) for path in _mean_paths(condition, study, samples))
    return TopicResults.of(found, _results)


def joined(trials: pd.DataFrame, paths: Mapping[str, pd.DataFrame]) -> Iterator[pd.DataFrame]:
    """Yield the paths of each recording's trials, with their ``condition``, ``dyad``, ``target`` and ``completion``.

    ``number`` counts the recording's trials from 0, and ``sample`` their samples. Recordings without paths are skipped.
    """
    for recording, own in trials.groupby("recording", sort=False):
        columns = own[[*ATTEMPT_KEY, "condition", "dyad", "target", "completion"]]
        table = paths[str(recording)].merge(columns, on=ATTEMPT_KEY, validate="many_to_one")
        if len(table):
            samples = (table["time"] / PERIOD).round().astype("int64")
            yield table.assign(number=table.groupby(ATTEMPT_KEY, sort=False).ngroup(), sample=samples)


def _mean_paths(condition: Condition, study: StudyData, samples: int) -> list[MeanPath]:
    trials = study.counted[study.counted["condition"] == condition.name]
    places: dict[str, list[pd.DataFrame]] = {name: [] for name in QUANTITIES}
    dyads: list[str] = []
    for table in joined(trials, study.paths):
        for name, wide in _places(table[table["sample"] < samples]).items():
            places[name].append(wide)
        dyads += [table["dyad"].iat[0]] * len(wide)
    if not dyads:
        return []
    found = []
    for name, parts in places.items():
        wide = pd.concat(parts, ignore_index=True).sort_index(axis="columns")
        each = wide.groupby(dyads).mean()
        low, high = (wide.quantile(share).to_numpy() for share in BAND)
        time = wide.columns.to_numpy() * PERIOD
        mean = each.mean().to_numpy()
        found.append(MeanPath(condition, name, time, tuple(each.index), each.to_numpy(), mean, low, high, len(wide)))
    return found


def _places(table: pd.DataFrame) -> dict[str, pd.DataFrame]:
    """Return the positions of ball and hands by quantity: one row for each trial, one column for each sample [m]."""
    right = table["target"] > 0
    places = {
        "ball": table["p"] * table["target"],
        "near": table["right_z"].where(right, table["left_z"]),
        "far": table["left_z"].where(right, table["right_z"]),
    }
    at = table[["number", "sample"]]
    return {
        name: at.assign(place=place).pivot(index="number", columns="sample", values="place")
        for name, place in places.items()
    }


COLUMNS = 4
"""Conditions in a row [1]."""

_STYLES: dict[str, Literal["-", "--"]] = {"near": "-", "far": "--"}
_HANDS = {"near": BLACK, "far": DARK_GREY}
_LETTERS = "ABCDEFGHIJKLMNOPQRSTUVWXYZ"


@pictured("The course of a trial")
def picture(study: StudyData) -> Drawn:
    """Draw mean paths.

    Trials with the target on the left are mirrored.
    """
    from matplotlib.lines import Line2D

    found = mean_paths(study).parts
    if not found:
        return "No included trial has a path."
    shown = list(dict.fromkeys(one.condition for one in found))
    lines = [shown[k : k + COLUMNS] for k in range(0, len(shown), COLUMNS)]
    figure, axes = new_mosaic(0.4 + 3.9 * len(lines), _layout(lines))
    for place, condition in enumerate(shown):
        ball, hands = (axes[f"{what} {condition.name}"] for what in ("ball", "hands"))
        for one in (one for one in found if one.condition == condition):
            _draw_path(ball if one.quantity == "ball" else hands, one)
        titled(ball, _LETTERS[place], condition.label.replace(", ", ",\n"))
        hands.set_xlabel("time from the release [s]")
        ball.tick_params(labelbottom=False)
    for what, label in (("ball", "ball towards the target [mm]"), ("hands", "height of the hands [mm]")):
        _alike(axes, [[f"{what} {one.name}" for one in line] for line in lines], label)
    handles = [Line2D([], [], color=colour, linestyle=_STYLES[name]) for name, colour in _HANDS.items()]
    figure.legend(handles, [QUANTITIES[name] for name in _HANDS], loc="outside lower center", ncols=2)
    return figure, _caption(found)


def _layout(lines: list[list[Condition]]) -> list[list[str]]:
    """Return a layout with the hands of each condition below its ball."""
    width = len(lines[0])
    rows = [[f"{what} {one.name}" for one in line] for line in lines for what in ("ball", "hands")]
    return [row + ["."] * (width - len(row)) for row in rows]


def _alike(axes: "dict[str, Axes]", lines: list[list[str]], label: str) -> None:
    """Give panels of one quantity the same scale, and label the first panel of each row."""
    names = [name for line in lines for name in line]
    lows, highs = zip(*(axes[name].get_ylim() for name in names), strict=True)
    for name in names:
        axes[name].set_ylim(min(lows), max(highs))
        axes[name].tick_params(labelleft=any(name == line[0] for line in lines))
    for line in lines:
        axes[line[0]].set_ylabel(label)


def _draw_path(axes: "Axes", one: MeanPath) -> None:
    """Draw a quantity: each dyad, their mean, and the band of the trials."""
    look, scale = look_of(one.condition), read_in("m").scale
    name = f"{one.condition.name}, {one.quantity}"
    colour = DARK_GREY if one.quantity == "far" else look.colour
    axes.axhline(0.0, color=LIGHT_GREY, linewidth=0.6, zorder=0)
    axes.fill_between(
        one.time, scale * one.low, scale * one.high, color=colour, alpha=0.16, linewidth=0.0, label=f"_{name}, trials"
    )
    for dyad, own in zip(one.dyads, one.each, strict=True):
        axes.plot(one.time, scale * own, color=colour, linewidth=0.5, alpha=0.5, label=f"_{name}, {dyad}")
    axes.plot(
        one.time,
        scale * one.mean,
        color=colour,
        linewidth=1.5,
        linestyle=_STYLES.get(one.quantity, "-"),
        label=f"_{name}",
    )


def _caption(found: tuple[MeanPath, ...]) -> str:
    low, high = (round(100 * share) for share in BAND)
    own = [one for one in found if one.quantity == "ball"]
    known = due_count(
        [(one.condition.label, len(one.dyads), "dyad") for one in own], [one.trials for one in own], "trial"
    )
    return (
        "Ball and hands after the release, while at least nine of ten trials continue; trials with the target at the "
        f"left are mirrored. Thick: means over dyads; thin: dyads; bands: {low} % to {high} % of the trials. {known}"
    )
