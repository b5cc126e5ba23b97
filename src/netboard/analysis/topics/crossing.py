"""Compared conditions of a declared contrast, the values of the dyads in them, and the dyads' scores for each effect.

An effect is a main effect of a declared factor, averaged over the levels of the other, or their interaction. Other
factors of the study are averaged over the levels that occur in all compared conditions. A dyad counts if it has a value
in all of these conditions that its levels of factors between dyads allow.

Real studies (`netboard.analysis.topics.declared`) and virtual ones (`netboard.analysis.cohort.decisions`) have the same
scores.
"""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import combinations, product
from math import prod

import numpy as np
import pandas as pd

from netboard.analysis.extraction.conditions import StudyFactor
from netboard.analysis.topics.groups import paired_levels
from netboard.task.studies.declaration import compared_levels, contrast_of
from netboard.task.studies.factors import level_text

Levels = tuple[str, ...]
"""A level of each declared factor."""


@dataclass(frozen=True, slots=True)
class DeclaredFactor:
    """A factor of the declared contrast, with the two compared levels, first minus second."""

    of: StudyFactor
    levels: tuple[str, str]

    @property
    def name(self) -> str:
        """Name, for texts."""
        return "kind of block" if self.of.name == "kind" else self.of.name

    @property
    def text(self) -> str:
        """The factor with its levels, such as ``haptics: on vs off``."""
        return f"{self.of.name}: {' vs '.join(level_text(self.of.of, level) for level in self.levels)}"

    @property
    def between(self) -> bool:
        """Whether a dyad has only one of the levels."""
        return self.of.scope == "dyad"


@dataclass(frozen=True, slots=True)
class Crossing:
    """The compared conditions: the names of those in each combination of levels, in the same order of other levels."""

    factors: tuple[DeclaredFactor, ...]
    cells: Mapping[Levels, tuple[str, ...]]
    left_out: tuple[str, ...]

    @property
    def names(self) -> list[str]:
        """Names of all compared conditions."""
        return [name for names in self.cells.values() for name in names]

    def label(self, levels: Levels) -> str:
        """Return the label of a combination of levels, such as ``haptics on, kind dyadic``."""
        return ", ".join(
            f"{one.of.name} {level_text(one.of.of, level)}" for one, level in zip(self.factors, levels, strict=True)
        )


class NotEstimable(ValueError):
    """The recordings do not allow the declared analysis; the message gives the reason."""


# --- conditions ------------------------------------------------------------------------------------------------------


def crossing_of(contrast: str, every: Sequence[StudyFactor], trials: pd.DataFrame) -> Crossing:
    """Return the compared conditions of a contrast; `trials` are rows of trials, or of conditions."""
    known = {one.name: one for one in reversed(every)}
    factors = []
    for part in contrast_of(contrast):
        if part.factor not in known:
            raise NotEstimable(f"no recording has the factor {part.factor}")
        factors.append(DeclaredFactor(known[part.factor], compared_levels(part, known[part.factor].of.levels)))
    columns = [one.of.column for one in factors]
    rows = tested_rows(trials).drop_duplicates("condition")
    for one in factors:
        rows = rows[rows[one.of.column].isin(one.levels)]
    others = other_columns(every, rows, columns)
    found = {
        levels: {tuple(row[others]): row["condition"] for _, row in _where(rows, columns, levels).iterrows()}
        for levels in product(*(one.levels for one in factors))
    }
    return _crossed(tuple(factors), found)


def _crossed(factors: tuple[DeclaredFactor, ...], found: Mapping[Levels, Mapping[Levels, str]]) -> Crossing:
    """Return the conditions whose other levels occur in every combination of compared levels."""
    shared = [others for others in next(iter(found.values())) if all(others in own for own in found.values())]
    left_out = [name for own in found.values() for others, name in own.items() if others not in shared]
    crossing = Crossing(
        factors, {levels: tuple(own[one] for one in shared) for levels, own in found.items()}, tuple(left_out)
    )
    for levels, own in found.items():
        if not own:
            raise NotEstimable(f"there are no test trials with {crossing.label(levels)}")
    if not shared:
        raise NotEstimable("no two of the compared conditions have the same levels of the other factors")
    return crossing


def tested_rows(rows: pd.DataFrame) -> pd.DataFrame:
    """Return the rows of test trials."""
    return rows[rows["role"].isin(["", "test"])]


def _where(rows: pd.DataFrame, columns: Sequence[str], levels: Levels) -> pd.DataFrame:
    """Return the rows with a level in each column."""
    chosen = np.ones(len(rows), bool)
    for column, level in zip(columns, levels, strict=True):
        chosen &= (rows[column] == level).to_numpy()
    return rows[chosen]


def other_columns(factors: Sequence[StudyFactor], rows: pd.DataFrame, columns: Sequence[str]) -> list[str]:
    """Return the columns of other factors that vary where the compared ones, and those before, have one level each."""
    every = dict.fromkeys([*(one.column for one in factors), "configuration", "force", "partner"])
    kept = [*columns]
    for column in [one for one in every if one not in columns]:
        if len(rows) and rows.groupby(kept)[column].nunique().max() > 1:
            kept.append(column)
    return kept[len(columns) :]


# --- values and scores -----------------------------------------------------------------------------------------------


def cell_values(performers: pd.DataFrame, who: Mapping[str, object], crossing: Crossing) -> dict[Levels, pd.Series]:
    """Return the values of complete dyads in each combination of levels.

    A dyad has no value at levels of a factor between dyads that it has not.

    - `performers`: level of each dyad and performer (rows) in each condition (columns).
    - `who`: who performs each condition, as from `performed_by`.
    """
    found: dict[Levels, pd.Series] = {}
    taken: set[str] = set()
    for group in dyad_groups(crossing):
        names = [name for cell in group for name in crossing.cells[cell]]
        own = performers.reindex(columns=names).dropna(how="all")
        complete = paired_levels(own, who, names).dropna()
        if twice := taken & set(complete.index):
            raise NotEstimable(f"dyad {min(twice)} has several levels of a factor that varies between dyads")
        taken |= set(complete.index)
        found |= {cell: complete[list(crossing.cells[cell])].mean(axis=1) for cell in group}
    return found


def dyad_groups(crossing: Crossing) -> list[list[Levels]]:
    """Return the combinations of levels that one dyad can have, for each combination of levels between dyads."""
    found: dict[Levels, list[Levels]] = {}
    for levels in crossing.cells:
        pairs = zip(crossing.factors, levels, strict=True)
        found.setdefault(tuple(level for one, level in pairs if one.between), []).append(levels)
    return list(found.values())


def effects_of(crossing: Crossing) -> Iterator[tuple[DeclaredFactor, ...]]:
    """Yield the factors of each effect: main effects, then the interaction."""
    for size in range(1, len(crossing.factors) + 1):
        yield from combinations(crossing.factors, size)


def effect_name(factors: Sequence[DeclaredFactor]) -> str:
    """Return the name of an effect, such as ``haptics: on vs off x kind: dyadic vs bimanual``."""
    return " x ".join(one.text for one in factors)


def scores_of(
    values: Mapping[Levels, pd.Series], crossing: Crossing, factors: tuple[DeclaredFactor, ...]
) -> tuple[list[pd.Series], list[float]]:
    """Return the dyads' scores in each group of dyads, and the weight of each group's mean."""

    def weight(levels: Levels, *, between: bool) -> float:
        pairs = zip(crossing.factors, levels, strict=True)
        return prod(_sign(one, level, factors) for one, level in pairs if one.between == between)

    groups = dyad_groups(crossing)
    scores = [pd.concat([values[one] * weight(one, between=False) for one in group], axis=1) for group in groups]
    return [one.sum(axis=1) for one in scores], [weight(group[0], between=True) for group in groups]


def _sign(one: DeclaredFactor, level: str, factors: tuple[DeclaredFactor, ...]) -> float:
    """Return the weight of a level: a difference if the effect has the factor, otherwise a mean."""
    if one not in factors:
        return 0.5
    return 1.0 if level == one.levels[0] else -1.0
