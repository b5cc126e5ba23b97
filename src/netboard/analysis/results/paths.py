"""Mean paths of ball and hands from the release, and their spread over trials.

Trials with the target on the left are mirrored, so that the target is on the right and the hands are the near and the
far one. A path continues through the hold to the end of its trial. Paths are shown for as long as nine of ten trials
last, so that hardly any trial drops out.
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
"""Sampling period of a path [s]."""

GOING_ON = 0.1
"""Largest share of trials that may have ended within the time shown [1]."""

BAND = (0.1, 0.9)
"""Quantiles of the trials at each time [1]."""

REPORTED = 0.5
"""Interval between reported times [s]."""

QUANTITIES = {"ball": "ball along the board", "near": "hand at the target's side", "far": "the other hand"}
"""Quantities with a path, by short name."""

KEYS = ["recording", "trial", "attempt"]


@dataclass(frozen=True, slots=True, eq=False)
class Course:
    """Mean path of a quantity in a condition.

    Attributes
    ----------
    quantity : {"ball", "near", "far"}
        Ball position, + = towards the target; height of the hand on the target's side; height of the other hand.
    time : ndarray of float64, shape (m,)
        Time after the release [s].
    each : ndarray of float64, shape (n, m)
        Mean of each dyad's trials [m].
    mean : ndarray of float64, shape (m,)
        Mean over the dyads [m].
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
    """All mean paths."""

    courses: tuple[Course, ...]

    @property
    def results(self) -> tuple[Result, ...]:
        """Return the positions of ball and hands at the reported times."""
        return tuple(row for one in self.courses for row in _rows(one))


def _rows(one: Course) -> Iterator[Result]:
    for k in range(0, len(one.time), round(REPORTED / PERIOD)):
        note = f"of {one.trials} trials, + = {'towards the target' if one.quantity == 'ball' else 'up'}"
        group = f"{one.condition.label}, {one.time[k]:.1f} s"
        yield estimated("paths", QUANTITIES[one.quantity], group, t_interval(one.each[:, k]), "m", note)


@kept
def courses(study: Study) -> Courses:
    """Return the mean paths of all conditions."""
    if not len(study.counted):
        return Courses(())
    samples = int(study.counted["duration"].quantile(GOING_ON) / PERIOD)
    return Courses(tuple(course for condition in conditions(study) for course in _courses(condition, study, samples)))


def joined(trials: pd.DataFrame, paths: Mapping[str, pd.DataFrame]) -> Iterator[pd.DataFrame]:
    """Join paths and their trials, one recording after the other.

    Yields
    ------
    DataFrame
        Paths of the trials of a recording, with their ``condition``, ``dyad``, ``target`` and ``completion``;
        ``number`` counts the recording's trials from 0, and ``sample`` their samples. Recordings without paths are
        skipped.
    """
    for recording, own in trials.groupby("recording", sort=False):
        told = own[[*KEYS, "condition", "dyad", "target", "completion"]]
        table = paths[str(recording)].merge(told, on=KEYS, validate="many_to_one")
        if len(table):
            samples = (table["time"] / PERIOD).round().astype("int64")
            yield table.assign(number=table.groupby(KEYS, sort=False).ngroup(), sample=samples)


def _courses(condition: Condition, study: Study, samples: int) -> list[Course]:
    """Return the mean paths of a condition."""
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
