"""How trials go: the mean paths of ball and hands from the release on, and how far trials spread around them.

Trials with the target at the left are mirrored, so that the target is at the right and the hands are that at the
target's side and the other one. A path goes on through the hold to the end of its trial; all are shown as far as nine
of ten trials go, so that hardly any trial drops out on the way.
"""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from netboard.analysis.extraction.details import STEP
from netboard.analysis.extraction.study import Study
from netboard.analysis.extraction.trials import RATE
from netboard.analysis.results.groups import Condition, conditions, estimated
from netboard.analysis.results.result import Result, kept
from netboard.analysis.statistics.estimates import t_interval

PERIOD = STEP / RATE
"""From one sample of a path to the next [s]."""

GOING_ON = 0.1
"""Paths are shown as long as no more than this share of all trials has ended [1]."""

BAND = (0.1, 0.9)
"""Quantiles of the trials at each time [1]."""

REPORTED = 0.5
"""From one time whose place is reported to the next [s]."""

QUANTITIES = {"ball": "ball along the board", "near": "hand at the target's side", "far": "the other hand"}
"""What has a path, by its short name."""

KEYS = ["recording", "trial", "attempt"]


@dataclass(frozen=True, slots=True, eq=False)
class Course:
    """The course of a quantity in a condition.

    Attributes
    ----------
    quantity : {"ball", "near", "far"}
        Place of the ball, + = towards the target; height of the hand at the target's side; height of the other one.
    time : ndarray of float64, shape (m,)
        From the release on [s].
    each : ndarray of float64, shape (n, m)
        The mean of each dyad's trials [m].
    mean : ndarray of float64, shape (m,)
        The mean of those [m].
    low, high : ndarray of float64, shape (m,)
        Quantiles of all trials [m].
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


@dataclass(frozen=True, slots=True)
class Courses:
    """All of them."""

    courses: tuple[Course, ...]

    @property
    def results(self) -> tuple[Result, ...]:
        """Where ball and hands were at some times."""
        return tuple(row for one in self.courses for row in _rows(one))


def _rows(one: Course) -> Iterator[Result]:
    for k in range(0, len(one.time), round(REPORTED / PERIOD)):
        note = f"of {one.trials} trials, + = {'towards the target' if one.quantity == 'ball' else 'up'}"
        group = f"{one.condition.label}, {one.time[k]:.1f} s"
        yield estimated("paths", QUANTITIES[one.quantity], group, t_interval(one.each[:, k]), "m", note)


@kept
def courses(study: Study) -> Courses:
    """Average the paths of all conditions."""
    if not len(study.counted):
        return Courses(())
    samples = int(study.counted["duration"].quantile(GOING_ON) / PERIOD)
    return Courses(tuple(course for condition in conditions(study) for course in _courses(condition, study, samples)))


def joined(trials: pd.DataFrame, paths: Mapping[str, pd.DataFrame]) -> Iterator[pd.DataFrame]:
    """Bring paths and their trials together, one recording after the other.

    Yields
    ------
    DataFrame
        The paths of those trials in a recording, with their ``condition``, ``dyad``, ``target`` and ``completion``;
        ``number`` counts the recording's trials from 0, and ``sample`` their samples. None where there are no paths.
    """
    for recording, own in trials.groupby("recording", sort=False):
        told = own[[*KEYS, "condition", "dyad", "target", "completion"]]
        table = paths[str(recording)].merge(told, on=KEYS, validate="many_to_one")
        if len(table):
            samples = (table["time"] / PERIOD).round().astype("int64")
            yield table.assign(number=table.groupby(KEYS, sort=False).ngroup(), sample=samples)


def _courses(condition: Condition, study: Study, samples: int) -> list[Course]:
    """Average the paths of a condition."""
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
        found.append(Course(condition, name, time, tuple(each.index), each.to_numpy(), mean, low, high, len(wide)))
    return found


def _places(table: pd.DataFrame) -> dict[str, pd.DataFrame]:
    """Return where ball and hands were in the trials of a recording, by quantity: a row each, a column a sample [m]."""
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
