"""Movement classes (the paper's figure 4): shares of time with cooperative, competitive, single or no movement.

Shares are computed for each trial, averaged for each performer and then for each dyad. A setting decides whether every
trial or every second has equal weight within a performer.
"""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from netboard.analysis.extraction.study import Study
from netboard.analysis.measures.movements import Average, mean_shares
from netboard.analysis.results.groups import (
    CLASSES,
    Condition,
    comparisons,
    conditions,
    counted,
    estimate,
    estimated,
    of_dyads,
)
from netboard.analysis.results.result import Result
from netboard.analysis.statistics.estimates import Estimate

TOPIC = "classes"


@dataclass(frozen=True, slots=True)
class Shares:
    """Shares of the classes in a condition.

    Attributes
    ----------
    performers : DataFrame
        Shares of each dyad and performer (rows) and class (columns) [1].
    dyads : DataFrame
        Shares of each dyad (rows) and class (columns) [1].
    """

    condition: Condition
    performers: pd.DataFrame
    dyads: pd.DataFrame
    means: tuple[Estimate, ...]


@dataclass(frozen=True, slots=True)
class Classes:
    """Shares of the classes in all conditions."""

    shares: tuple[Shares, ...]
    results: tuple[Result, ...]


def classes(study: Study) -> Classes:
    """Return the shares of the movement classes in all conditions."""
    trials = counted(study)
    found = tuple(
        _shares(one, trials[trials["condition"] == one.name], study.readings.summaries.shares)
        for one in conditions(study)
    )
    return Classes(found, tuple(_results(found)))


def _shares(condition: Condition, rows: pd.DataFrame, of: Average) -> Shares:
    each = {
        key: mean_shares(own[list(CLASSES)].to_numpy(np.float64), of=of)
        for key, own in rows.groupby(["dyad", "performer"])
    }
    performers = _table(each)
    dyads = of_dyads(performers)
    return Shares(condition, performers, dyads, tuple(estimate(dyads[name]) for name in CLASSES))


def _table(each: dict[tuple[str, str], NDArray[np.float64]]) -> pd.DataFrame:
    """Return shares as a table; performers without shares are left out."""
    known = {key: values for key, values in each.items() if np.isfinite(values).all()}
    index = pd.MultiIndex.from_tuples(list(known), names=["dyad", "performer"]) if known else _NOBODY
    return pd.DataFrame(np.array(list(known.values())).reshape(-1, len(CLASSES)), index, columns=list(CLASSES))


_NOBODY = pd.MultiIndex.from_arrays([[], []], names=["dyad", "performer"])


def _results(found: tuple[Shares, ...]) -> Iterator[Result]:
    for one in found:
        for name, mean in zip(CLASSES, one.means, strict=True):
            yield estimated(TOPIC, f"share of {_words(name)}", one.condition.label, mean, "1")
    every = tuple(one.condition for one in found)
    for name in CLASSES:
        values = {one.condition.name: one.dyads[name] for one in found}
        for group, differences in comparisons(every, values):
            yield estimated(TOPIC, f"share of {_words(name)}", group, estimate(differences), "1", "a difference")


def _words(name: str) -> str:
    """Return the name of a movement class."""
    return "stillness" if name == "still" else f"{name} movement"
