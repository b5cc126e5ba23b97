"""The trials of a study and their fixed factors, as a model sees them: what these trials can tell and what not.

A study has any number of factors. A categorical factor is coded by deviations from its first level, each centred: with
two levels -1/2 and +1/2. A numeric factor is centred, one column. So the main effect of a factor is its average over
the other factors, and interactions are products of columns. A column that these trials cannot tell from the others is
left out, and a note says so. Performers are told apart within their dyad only: "A" of one dyad is not "A" of another.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import combinations
from math import exp

import numpy as np
from numpy.typing import ArrayLike, NDArray

Array = NDArray[np.float64]

INTERCEPT, PRACTICE = "intercept", "log trial"
"""The first and the last column of every design; the logarithm is the natural one."""

COLUMNS = (INTERCEPT, "haptics", "configuration", "haptics x configuration", PRACTICE)
"""Columns of a design with the two factors of the paper."""

MOST_VALUES = 12
"""A numeric factor with more values than this is not listed value by value [1]."""


@dataclass(frozen=True, slots=True, eq=False)
class Factor:
    """A fixed factor: what varied by plan, and what each trial had of it.

    Attributes
    ----------
    name : str
        Its name.
    values : ndarray, shape (n,)
        The level of each trial: text, true or false, or a number [its own].
    levels : tuple
        All levels; the first one is the reference. Empty: those that occur, sorted.
    numeric : bool
        Its effect is a straight line: one column, per unit. Otherwise each level has its own effect.
    unit : str
        Unit of a numeric factor.
    """

    name: str
    values: NDArray[np.generic]
    levels: tuple[object, ...] = ()
    numeric: bool = False
    unit: str = "1"

    def of(self, kept: NDArray[np.generic]) -> "Factor":
        """Choose trials.

        Parameters
        ----------
        kept : ndarray
            Which of the trials: true or false, or their numbers [1].

        Returns
        -------
        Factor
            The same factor of these trials. Its levels remain those of all.
        """
        return Factor(self.name, self.values[kept], self.levels, self.numeric, self.unit)

    @property
    def present(self) -> tuple[object, ...]:
        """The levels that occur, in order."""
        return tuple(level for level in self.levels if (self.values == level).any())

    def coded(self) -> "dict[str, Array]":
        """Return the columns of its main effect by name, each value centred over the levels that occur."""
        if self.numeric:
            return {self.name: self.at(self.values.astype(float))}
        return {name: (self.values == level) - share for name, level, share in self._differences()}

    def at(self, level: object) -> Array:
        """Code values of a numeric factor.

        Parameters
        ----------
        level : float or ndarray of float64
            Values of the factor [its own].

        Returns
        -------
        ndarray of float64
            Their distances from the mean of all levels [its own].
        """
        return np.asarray(level, dtype=float) - float(np.mean(np.asarray(self.levels, dtype=float)))

    def code_of(self, level: object) -> dict[str, float]:
        """Return what each column has at a level.

        Parameters
        ----------
        level : object
            One of the levels.

        Returns
        -------
        dict of str to float
            Value of each column [1].
        """
        if self.numeric:
            return {self.name: float(self.at(level))}
        return {name: float(level == own) - share for name, own, share in self._differences()}

    def _differences(self) -> Iterator[tuple[str, object, float]]:
        """Yield column, level and centre; where but one level occurs, the columns are constant and are left out."""
        levels = self.present if len(self.present) > 1 else self.levels
        for level in levels[1:]:
            yield (
                self.name if len(self.levels) == 2 else f"{self.name}: {level} less {levels[0]}",
                level,
                1 / len(levels),
            )

    @property
    def deviations(self) -> Array:
        """Columns for chance in its effect; their variance is that of the difference of two levels, or of a slope."""
        if self.numeric:
            return self.coded()[self.name][:, None]
        levels = self.present
        each = np.column_stack([(self.values == level) - 1.0 / len(levels) for level in levels])
        return each[:, 1:] if len(levels) == 2 else each / np.sqrt(2.0)


@dataclass(frozen=True, slots=True)
class Cell:
    """What was observed in one condition.

    Attributes
    ----------
    levels : tuple of (str, object)
        Name and level of each factor.
    trials, dyads : int
        How many there are [1].
    mean : float
        Of all trials, of the response itself; for times the geometric one [its own].
    """

    levels: tuple[tuple[str, object], ...]
    trials: int
    dyads: int
    mean: float

    @property
    def label(self) -> str:
        """The condition in words, such as ``haptics on, configuration dyadic``."""
        return ", ".join(f"{name} {level}" for name, level in self.levels) or "all trials"


@dataclass(frozen=True, slots=True, eq=False)
class Design:
    """The trials that have a value, and what is asked of them.

    Attributes
    ----------
    values : ndarray of float64, shape (n,)
        The response [its own].
    dyads, performers : ndarray of int64, shape (n,)
        Numbers of theirs, from 0; a performer belongs to one dyad [1].
    factors : tuple of Factor
        The fixed factors, of these trials.
    conditions : ndarray of int64, shape (n,)
        Number of the combination of levels, from 0 [1].
    order : ndarray of float64, shape (n,)
        Number of the trial in its condition, from 1 [1].
    asked : tuple of str
        All columns that the model has, estimable or not.
    names : tuple of str
        Those of them that these trials can tell.
    columns : ndarray of float64, shape (n, k)
        The columns of those names [1].
    between : int
        How many of them, beside the intercept, do not vary within any dyad [1].
    lonely : tuple of str
        Those of them that a single dyad tells: without it nobody could.
    left_out : int
        Trials without a value [1].
    notes : tuple of str
        Why columns are missing, or lonely.
    """

    values: Array
    dyads: NDArray[np.int64]
    performers: NDArray[np.int64]
    factors: tuple[Factor, ...]
    conditions: NDArray[np.int64]
    order: Array
    asked: tuple[str, ...]
    names: tuple[str, ...]
    columns: Array
    between: int
    lonely: tuple[str, ...]
    left_out: int
    notes: tuple[str, ...]

    @property
    def n_dyads(self) -> int:
        """How many dyads there are [1]."""
        return len(np.unique(self.dyads))

    @property
    def n_performers(self) -> int:
        """How many performers there are [1]."""
        return len(np.unique(self.performers))

    def varied(self, of: NDArray[np.int64]) -> tuple[Factor, ...]:
        """Return the factors that vary within a grouping.

        Parameters
        ----------
        of : ndarray of int64, shape (n,)
            Group of each trial: dyads or performers [1].

        Returns
        -------
        tuple of Factor
            Those of which some group has more than one level.
        """
        return tuple(one for one in self.factors if _varies(np.unique(one.values, return_inverse=True)[1], of))


def paper_factors(haptics: ArrayLike, dyadic: ArrayLike) -> tuple[Factor, Factor]:
    """Return the two factors of the paper: haptics off and on, one person and two.

    Parameters
    ----------
    haptics, dyadic : array_like of bool, shape (n,)
        Forces are felt; two people perform.

    Returns
    -------
    tuple of Factor
        ``haptics`` and ``configuration``.
    """
    felt, two = (np.asarray(label).astype(bool) for label in (haptics, dyadic))
    return (
        Factor("haptics", np.where(felt, "on", "off"), ("off", "on")),
        Factor("configuration", np.where(two, "dyadic", "bimanual"), ("bimanual", "dyadic")),
    )


def design_of(
    values: ArrayLike,
    dyads: ArrayLike,
    performers: ArrayLike,
    factors: Sequence[Factor],
    order: ArrayLike,
) -> Design:
    """Bring trials and their labels together, and find out what they can tell.

    Parameters
    ----------
    values : array_like, shape (n,)
        The response; trials where it is NaN are left out [its own].
    dyads, performers : array_like, shape (n,)
        Whose trial it is: labels of any kind. The performer is a person, or the two of a dyad together.
    factors : sequence of Factor
        The fixed factors. The model has their main effects and all interactions of two of them.
    order : array_like, shape (n,)
        Number of the trial in its condition, from 1 [1].

    Returns
    -------
    Design
        Without the columns that are constant, or sums of others.

    Raises
    ------
    ValueError
        If there is not one label for each trial, a trial number below 1, two factors of one name, or a level that is
        not among the factor's levels.
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
    number = labels["order"][known].astype(float)
    if not (number >= 1.0).all():
        raise ValueError(f"order: trial numbers from 1 are expected, found {number[~(number >= 1.0)][0]}")
    pair = np.unique(labels["dyads"][known], return_inverse=True)[1].astype(np.int64)
    label = np.unique(labels["performers"][known], return_inverse=True)[1].astype(np.int64)
    person = np.unique(pair * (len(label) + 1) + label, return_inverse=True)[1].astype(np.int64)
    kept = tuple(_checked(one).of(known) for one in factors)
    asked = _asked(kept, np.log(number))
    names = _told_apart(asked)
    lonely = _lonely(asked, names, pair)
    notes = [f"{name}: left out, these trials cannot tell it" for name in asked if name not in names]
    notes += [f"{name}: a single dyad tells it" for name in lonely]
    columns = np.column_stack([asked[name] for name in names]) if names else np.empty((len(number), 0))
    between = sum(name != INTERCEPT and not _varies(asked[name], pair) for name in names)
    return Design(
        y[known],
        pair,
        person,
        kept,
        _combinations(kept, len(number)),
        number,
        tuple(asked),
        names,
        columns,
        between,
        lonely,
        int((~known).sum()),
        tuple(notes),
    )


def _checked(factor: Factor) -> Factor:
    """Fill in the levels of a factor, and make sure that each trial has one."""
    values = np.asarray(factor.values)
    if factor.numeric:
        values = values.astype(float)
        if not np.isfinite(values).all():
            raise ValueError(
                f"{factor.name}: a number for each trial is expected, found {values[~np.isfinite(values)][0]}"
            )
    levels = factor.levels or tuple(np.unique(values).tolist())
    strange = set(values.tolist()) - set(levels)
    if strange:
        one_of = ", ".join(map(str, levels))
        raise ValueError(f"{factor.name}: one of {one_of} is expected, found {', '.join(sorted(map(str, strange)))}")
    return Factor(factor.name, values, levels, factor.numeric, factor.unit)


def _asked(factors: Sequence[Factor], practice: Array) -> dict[str, Array]:
    """Return every column that the model has, by name."""
    coded = {factor.name: factor.coded() for factor in factors}
    columns = {INTERCEPT: np.ones(len(practice))}
    for own in coded.values():
        columns |= own
    for one, other in combinations(coded.values(), 2):
        columns |= {interaction(a, b): one[a] * other[b] for a in one for b in other}
    return columns | {PRACTICE: practice}


def interaction(one: str, other: str) -> str:
    """Name the product of two columns.

    Parameters
    ----------
    one, other : str
        Names of the columns.

    Returns
    -------
    str
        Name of the product.
    """
    return f"{one} x {other}"


def simple_effects(design: Design) -> dict[str, dict[str, float]]:
    """Return the effects of a factor at each level of another one, for all interactions of two factors.

    Parameters
    ----------
    design : Design
        The trials.

    Returns
    -------
    dict of str to dict of str to float
        By name, such as ``haptics, dyadic``: how much of each column it has. Of a numeric second factor, the lowest and
        the highest value; a level whose name says too little has the factor's name with it [1].
    """
    taken = [str(level) for factor in design.factors for level in factor.levels]
    found = {}
    for one, other in combinations(design.factors, 2):
        ends = (min(other.present), max(other.present)) if other.numeric and other.present else other.levels  # type: ignore[type-var]
        for column in one.coded():
            for level in dict.fromkeys(ends):
                word = str(level)
                short = not other.numeric and taken.count(word) == 1 and not word[:1].isdigit()
                shares = {interaction(column, name): code for name, code in other.code_of(level).items()}
                found[f"{column}, {word if short else f'{other.name} {word}'}"] = {column: 1.0} | shares
    return found


def _told_apart(asked: dict[str, Array], kept: NDArray[np.bool_] | None = None) -> tuple[str, ...]:
    """Name the columns that are no sums of those before them, in all trials or in those that are kept."""
    rows = slice(None) if kept is None else kept
    names: list[str] = []
    columns = np.empty((len(asked[INTERCEPT][rows]), 0))
    for name, column in asked.items():
        size = float(np.abs(column).max(initial=0.0)) or 1.0
        wider = np.column_stack([columns, column[rows] / size])
        if len(wider) and np.linalg.matrix_rank(wider) == wider.shape[1]:
            names, columns = [*names, name], wider
    return tuple(names)


def _lonely(asked: dict[str, Array], names: tuple[str, ...], dyads: NDArray[np.int64]) -> tuple[str, ...]:
    """Find what could not be told any more if one of the dyads were not there."""
    groups = np.unique(dyads)
    if len(groups) < 2:
        return ()
    others = [_told_apart(asked, dyads != group) for group in groups]
    return tuple(name for name in names if any(name not in other for other in others))


def _varies(column: NDArray[np.generic], groups: NDArray[np.int64]) -> bool:
    """Say whether a column has more than one value within any group."""
    return len(np.unique(np.column_stack([groups, np.unique(column, return_inverse=True)[1]]), axis=0)) > len(
        np.unique(groups)
    )


def _combinations(factors: Sequence[Factor], n: int) -> NDArray[np.int64]:
    """Number the combinations of levels that occur, in the order of the levels, the last factor first."""
    places = [[list(one.levels).index(value) for value in one.values.tolist()] for one in reversed(factors)]
    if not n or not factors:
        return np.zeros(n, dtype=np.int64)
    return np.unique(np.column_stack(places), axis=0, return_inverse=True)[1].ravel().astype(np.int64)


def cells_of(design: Design, factors: Sequence[Factor] | None = None, *, geometric: bool = False) -> tuple[Cell, ...]:
    """Describe what was observed in each condition.

    Parameters
    ----------
    design : Design
        The trials.
    factors : sequence of Factor or None
        Conditions are told apart by these; None for all of the design.
    geometric : bool
        Values are logarithms; the mean is that of what they are logarithms of.

    Returns
    -------
    tuple of Cell
        Conditions that have trials. A numeric factor of more than `MOST_VALUES` values is not told apart.
    """
    factors = design.factors if factors is None else factors
    listed = [one for one in factors if not one.numeric or len(one.present) <= MOST_VALUES]
    numbers = _combinations(listed, len(design.values))
    cells = []
    for number in np.unique(numbers):
        own = np.flatnonzero(numbers == number)
        mean = float(design.values[own].mean())
        levels = tuple((one.name, one.values[own[0]].item()) for one in listed)
        dyads = len(np.unique(design.dyads[own]))
        cells.append(Cell(levels, len(own), dyads, exp(mean) if geometric else mean))
    return tuple(cells)
