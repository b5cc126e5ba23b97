"""Design of a statistical model: the trials of a study, their fixed factors, and the estimable columns.

A study has any number of factors. A categorical factor is coded by deviations from its first level, each centred: -1/2
and +1/2 for two levels. A numeric factor is one centred column. The main effect of a factor is therefore its average
over the other factors, and interactions are products of columns. A column that is linearly dependent on the others is
left out, with a note. Performers are distinguished only within their dyad: "A" of one dyad is not "A" of another.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import combinations
from math import exp

import numpy as np
from numpy.typing import ArrayLike, NDArray

Array = NDArray[np.float64]

INTERCEPT, PRACTICE = "intercept", "log trial"
"""The first and the last column of every design; the logarithm is the natural one."""

MAX_VALUES = 12
"""Largest number of values of a numeric factor that are listed one by one [1]."""


@dataclass(frozen=True, slots=True, eq=False)
class FixedFactor:
    """A fixed factor: an independent variable of the study, and its level in each trial.

    Attributes
    ----------
    name : str
        Name in equations and effects, such as ``haptics``.
    values : ndarray, shape (n,)
        Level of each trial: text, a boolean or a number [its own].
    levels : tuple
        All levels; the first is the reference. If empty, the levels that occur, sorted.
    numeric : bool
        Whether its effect is linear: one column, per step. Otherwise each level has its own effect.
    unit : str
        Unit of a numeric factor.
    step : float
        Change of a numeric factor whose effect its column has [its own].
    """

    name: str
    values: NDArray[np.generic]
    levels: tuple[object, ...] = ()
    numeric: bool = False
    unit: str = "1"
    step: float = 1.0

    @property
    def term(self) -> str:
        """Name of the column of a numeric factor, such as ``width per 0.01 m``."""
        size = " ".join(word for word in (f"{self.step:g}", self.unit) if word != "1")
        return f"{self.name} per {size}" if size else self.name

    def text(self, level: object) -> str:
        """Return a level as text, such as ``0.03 m`` or ``dyadic``.

        Parameters
        ----------
        level : object
            One of the levels; for a numeric factor, any value.
        """
        return f"{level:g} {self.unit}".removesuffix(" 1") if self.numeric else str(level)

    def of(self, kept: NDArray[np.generic]) -> "FixedFactor":
        """Return the factor for some of the trials; its levels remain those of all trials.

        Parameters
        ----------
        kept : ndarray
            Mask or indices of these trials [1].
        """
        return replace(self, values=self.values[kept])

    @property
    def present(self) -> tuple[object, ...]:
        """Return the levels that occur, in order."""
        return tuple(level for level in self.levels if (self.values == level).any())

    def coded(self) -> "dict[str, Array]":
        """Return the columns of the main effect by name, each centred over the levels that occur."""
        if self.numeric:
            return {self.term: self.at(self.values.astype(float))}
        return {name: (self.values == level) - share for name, level, share in self._differences()}

    def at(self, level: object) -> Array:
        """Return the codes of values of a numeric factor: deviations from the mean of all levels, in steps [1].

        Parameters
        ----------
        level : float or ndarray of float64
            Values of the factor [its own].
        """
        return (np.asarray(level, dtype=float) - float(np.mean(np.asarray(self.levels, dtype=float)))) / self.step

    def code_of(self, level: object) -> dict[str, float]:
        """Return the code of a level in each column [1].

        Parameters
        ----------
        level : object
            One of the levels; for a numeric factor, any value.
        """
        if self.numeric:
            return {self.term: float(self.at(level))}
        return {name: float(level == own) - share for name, own, share in self._differences()}

    def _differences(self) -> Iterator[tuple[str, object, float]]:
        """Yield column, level and centre; with only one level the columns are constant and are left out."""
        levels = self.present if len(self.present) > 1 else self.levels
        for level in levels[1:]:
            yield (
                self.name if len(self.levels) == 2 else f"{self.name}: {level} vs {levels[0]}",
                level,
                1 / len(levels),
            )

    @property
    def deviations(self) -> Array:
        """Return the columns of the random slope; its variance is that of a difference of two levels, or of a slope."""
        if self.numeric:
            return self.coded()[self.term][:, None]
        levels = self.present
        each = np.column_stack([(self.values == level) - 1.0 / len(levels) for level in levels])
        return each[:, 1:] if len(levels) == 2 else each / np.sqrt(2.0)


@dataclass(frozen=True, slots=True)
class Cell:
    """Observed data of one condition.

    Attributes
    ----------
    levels : tuple of (str, str)
        Name and level of each factor.
    trials, dyads : int
        Numbers of trials and dyads [1].
    mean : float
        Mean response over all trials; geometric mean for times [its own].
    """

    levels: tuple[tuple[str, str], ...]
    trials: int
    dyads: int
    mean: float

    @property
    def label(self) -> str:
        """Label of the condition, such as ``haptics on, configuration dyadic``."""
        return ", ".join(f"{name} {level}" for name, level in self.levels) or "all trials"


@dataclass(frozen=True, slots=True, eq=False)
class ModelDesign:
    """Trials with a value, and the design of the model for them.

    Attributes
    ----------
    values : ndarray of float64, shape (n,)
        Response of each of these trials, in order [its own].
    dyads, performers : ndarray of int64, shape (n,)
        Dyad and performer numbers, from 0; a performer belongs to one dyad [1].
    factors : tuple of Factor
        Fixed factors of these trials.
    conditions : ndarray of int64, shape (n,)
        Number of each trial's combination of levels, from 0 [1].
    order : ndarray of float64, shape (n,)
        Position of each trial in its condition, from 1 [1].
    requested : tuple of str
        All columns of the model, estimable or not.
    names : tuple of str
        Names of the estimable columns.
    columns : ndarray of float64, shape (n, k)
        Design matrix of these columns [1].
    between : int
        Number of these columns, without the intercept, that are constant within every dyad [1].
    single_dyad : tuple of str
        Names of the columns that are estimable only because of one single dyad.
    left_out : int
        Number of trials without a value [1].
    notes : tuple of str
        Reasons for missing columns and for columns that depend on one dyad.
    """

    values: Array
    dyads: NDArray[np.int64]
    performers: NDArray[np.int64]
    factors: tuple[FixedFactor, ...]
    conditions: NDArray[np.int64]
    order: Array
    requested: tuple[str, ...]
    names: tuple[str, ...]
    columns: Array
    between: int
    single_dyad: tuple[str, ...]
    left_out: int
    notes: tuple[str, ...]

    @property
    def n_dyads(self) -> int:
        """Number of dyads [1]."""
        return len(np.unique(self.dyads))

    @property
    def n_performers(self) -> int:
        """Number of performers [1]."""
        return len(np.unique(self.performers))

    def varied(self, of: NDArray[np.int64]) -> tuple[FixedFactor, ...]:
        """Return the factors that have more than one level in some group.

        Parameters
        ----------
        of : ndarray of int64, shape (n,)
            Group of each trial: dyads or performers [1].
        """
        return tuple(one for one in self.factors if _varies(np.unique(one.values, return_inverse=True)[1], of))


def paper_factors(haptics: ArrayLike, dyadic: ArrayLike) -> tuple[FixedFactor, FixedFactor]:
    """Return the paper's ``haptics`` and ``configuration``: haptics off or on, one person or two.

    Parameters
    ----------
    haptics, dyadic : array_like of bool, shape (n,)
        Whether haptic feedback is on; whether two people perform.
    """
    felt, two = (np.asarray(label).astype(bool) for label in (haptics, dyadic))
    return (
        FixedFactor("haptics", np.where(felt, "on", "off"), ("off", "on")),
        FixedFactor("configuration", np.where(two, "dyadic", "bimanual"), ("bimanual", "dyadic")),
    )


def design_of(
    values: ArrayLike,
    dyads: ArrayLike,
    performers: ArrayLike,
    factors: Sequence[FixedFactor],
    order: ArrayLike,
) -> ModelDesign:
    """Build the design from trials and labels, without columns that are constant or linearly dependent.

    Parameters
    ----------
    values : array_like, shape (n,)
        Response; trials with NaN are ignored [its own].
    factors : sequence of Factor
        Fixed factors, each with its own name. The model has their main effects and all two-way interactions.
    """
    y = np.asarray(values, dtype=float)
    given = {"dyads": dyads, "performers": performers, "order": order} | {one.name: one.values for one in factors}
    if len(given) != 3 + len(factors):
        raise ValueError(f"factors: each needs a name of its own, found {', '.join(one.name for one in factors)}")
    labels = {name: np.asarray(label) for name, label in given.items()}
    for name, label in labels.items():
        if y.ndim != 1 or label.shape != y.shape:
            raise ValueError(f"{name}: one for each of {y.shape} values is expected, found shape {label.shape}")
    known = np.isfinite(y)
    trial = labels["order"][known].astype(float)
    if not (trial >= 1.0).all():
        raise ValueError(f"order: trial numbers from 1 are expected, found {trial[~(trial >= 1.0)][0]}")
    dyad = np.unique(labels["dyads"][known], return_inverse=True)[1].astype(np.int64)
    label = np.unique(labels["performers"][known], return_inverse=True)[1].astype(np.int64)
    performer = np.unique(dyad * (len(label) + 1) + label, return_inverse=True)[1].astype(np.int64)
    kept = tuple(_checked(one).of(known) for one in factors)
    requested = _requested(kept, np.log(trial))
    names = _independent(requested)
    single_dyad = _of_single_dyad(requested, names, dyad)
    notes = [f"{name}: left out, because these trials cannot identify it" for name in requested if name not in names]
    notes += [f"{name}: identified by a single dyad" for name in single_dyad]
    columns = np.column_stack([requested[name] for name in names]) if names else np.empty((len(trial), 0))
    between = sum(name != INTERCEPT and not _varies(requested[name], dyad) for name in names)
    return ModelDesign(
        values=y[known],
        dyads=dyad,
        performers=performer,
        factors=kept,
        conditions=_combinations(kept, len(trial)),
        order=trial,
        requested=tuple(requested),
        names=names,
        columns=columns,
        between=between,
        single_dyad=single_dyad,
        left_out=int((~known).sum()),
        notes=tuple(notes),
    )


def _checked(factor: FixedFactor) -> FixedFactor:
    """Fill in the levels of a factor, and check that each trial has one of them."""
    values = np.asarray(factor.values)
    if factor.numeric:
        values = values.astype(float)
        if not np.isfinite(values).all():
            raise ValueError(
                f"{factor.name}: a number for each trial is expected, found {values[~np.isfinite(values)][0]}"
            )
    levels = factor.levels or tuple(np.unique(values).tolist())
    if unknown := set(values.tolist()) - set(levels):
        one_of = ", ".join(map(str, levels))
        raise ValueError(f"{factor.name}: one of {one_of} is expected, found {', '.join(sorted(map(str, unknown)))}")
    return replace(factor, values=values, levels=levels)


def _requested(factors: Sequence[FixedFactor], practice: Array) -> dict[str, Array]:
    """Return all columns of the model, by name."""
    coded = {factor.name: factor.coded() for factor in factors}
    columns = {INTERCEPT: np.ones(len(practice))}
    for main_effect in coded.values():
        columns |= main_effect
    for one, other in combinations(coded.values(), 2):
        columns |= {interaction(a, b): one[a] * other[b] for a in one for b in other}
    return columns | {PRACTICE: practice}


def interaction(one: str, other: str) -> str:
    """Return the name of the product of two columns.

    Parameters
    ----------
    one, other : str
        Names of the multiplied columns, such as ``haptics``.
    """
    return f"{one} x {other}"


def simple_effects(design: ModelDesign) -> dict[str, dict[str, float]]:
    """Return the contrasts of a factor at each level of another, by name such as ``haptics, dyadic`` [1].

    Contrasts are over the columns, for all two-way interactions. For a numeric second factor: at its lowest and highest
    value. An ambiguous level name is preceded by the factor's name.
    """
    taken = [str(level) for factor in design.factors for level in factor.levels]
    found = {}
    for one, other in combinations(design.factors, 2):
        ends = (min(other.present), max(other.present)) if other.numeric and other.present else other.levels  # type: ignore[type-var]
        for column in one.coded():
            for level in dict.fromkeys(ends):
                word = other.text(level)
                short = not other.numeric and taken.count(word) == 1 and not word[:1].isdigit()
                shares = {interaction(column, name): code for name, code in other.code_of(level).items()}
                found[f"{column}, {word if short else f'{other.name} {word}'}"] = {column: 1.0} | shares
    return found


def _independent(columns: dict[str, Array], kept: NDArray[np.bool_] | None = None) -> tuple[str, ...]:
    """Return the columns that are linearly independent of those before them, in all or in the kept trials."""
    rows = slice(None) if kept is None else kept
    names: list[str] = []
    matrix = np.empty((len(columns[INTERCEPT][rows]), 0))
    for name, column in columns.items():
        size = float(np.abs(column).max(initial=0.0)) or 1.0
        wider = np.column_stack([matrix, column[rows] / size])
        if len(wider) and np.linalg.matrix_rank(wider) == wider.shape[1]:
            names, matrix = [*names, name], wider
    return tuple(names)


def _of_single_dyad(columns: dict[str, Array], names: tuple[str, ...], dyads: NDArray[np.int64]) -> tuple[str, ...]:
    """Return the columns that are not estimable without one of the dyads."""
    groups = np.unique(dyads)
    if len(groups) < 2:
        return ()
    others = [_independent(columns, dyads != group) for group in groups]
    return tuple(name for name in names if any(name not in other for other in others))


def _varies(column: NDArray[np.generic], groups: NDArray[np.int64]) -> bool:
    """Return whether a column has more than one value within any group."""
    return len(np.unique(np.column_stack([groups, np.unique(column, return_inverse=True)[1]]), axis=0)) > len(
        np.unique(groups)
    )


def _combinations(factors: Sequence[FixedFactor], n: int) -> NDArray[np.int64]:
    """Number the observed combinations of levels, in the order of the levels, the last factor first."""
    places = [[list(one.levels).index(value) for value in one.values.tolist()] for one in reversed(factors)]
    if not n or not factors:
        return np.zeros(n, dtype=np.int64)
    return np.unique(np.column_stack(places), axis=0, return_inverse=True)[1].ravel().astype(np.int64)


def cells_of(
    design: ModelDesign, factors: Sequence[FixedFactor] | None = None, *, geometric: bool = False
) -> tuple[Cell, ...]:
    """Return each condition with trials; a numeric factor with more than `MAX_VALUES` values is ignored.

    Parameters
    ----------
    factors : sequence of Factor or None
        Factors that define the conditions; None for all factors of the design.
    geometric : bool
        Whether values are logarithms, so that the mean is the geometric mean of the original quantity.
    """
    factors = design.factors if factors is None else factors
    listed = [one for one in factors if not one.numeric or len(one.present) <= MAX_VALUES]
    numbers = _combinations(listed, len(design.values))
    cells = []
    for number in np.unique(numbers):
        own = np.flatnonzero(numbers == number)
        mean = float(design.values[own].mean())
        levels = tuple((one.name, one.text(one.values[own[0]].item())) for one in listed)
        dyads = len(np.unique(design.dyads[own]))
        cells.append(Cell(levels, len(own), dyads, exp(mean) if geometric else mean))
    return tuple(cells)
