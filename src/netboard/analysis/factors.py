"""The trials of a study and their factors, as a model sees them: what can be told from them, and what cannot.

A study has two factors, forces felt or not (haptics) and two people or one (configuration), each coded as -1/2 and
+1/2, and the trial number. With that coding a factor's effect is its average over the other factor. What data cannot
tell is left out and said. Performers are told apart within their dyad only: "A" of one dyad is not "A" of another.
"""

from dataclasses import dataclass
from math import exp

import numpy as np
from numpy.typing import ArrayLike, NDArray

COLUMNS = ("intercept", "haptics", "configuration", "haptics x configuration", "log trial")
"""Columns of a design; the logarithm is the natural one."""


@dataclass(frozen=True, slots=True)
class Cell:
    """What was observed in one condition.

    Attributes
    ----------
    haptics, dyadic : bool
        The condition.
    trials, dyads : int
        How many there are [1].
    mean : float
        Of all trials, of the response itself; for times the geometric one [its own].
    """

    haptics: bool
    dyadic: bool
    trials: int
    dyads: int
    mean: float


@dataclass(frozen=True, slots=True, eq=False)
class Design:
    """The trials that have a value, and what is asked of them.

    Attributes
    ----------
    values : ndarray of float64, shape (n,)
        The response [its own].
    dyads, performers : ndarray of int64, shape (n,)
        Numbers of theirs, from 0; a performer belongs to one dyad [1].
    haptics, dyadic : ndarray of bool, shape (n,)
        The condition [1].
    order : ndarray of float64, shape (n,)
        Number of the trial in its condition, from 1 [1].
    names : tuple of str
        Those of `COLUMNS` that these trials can tell.
    columns : ndarray of float64, shape (n, k)
        The columns of those names [1].
    lonely : tuple of str
        Those of them that a single dyad tells: without it nobody could.
    left_out : int
        Trials without a value [1].
    notes : tuple of str
        Why columns are missing, or lonely.
    """

    values: NDArray[np.float64]
    dyads: NDArray[np.int64]
    performers: NDArray[np.int64]
    haptics: NDArray[np.bool_]
    dyadic: NDArray[np.bool_]
    order: NDArray[np.float64]
    names: tuple[str, ...]
    columns: NDArray[np.float64]
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


def design_of(
    values: ArrayLike,
    dyads: ArrayLike,
    performers: ArrayLike,
    haptics: ArrayLike,
    dyadic: ArrayLike,
    order: ArrayLike,
) -> Design:
    """Bring trials and their labels together, and find out what they can tell.

    Parameters
    ----------
    values : array_like, shape (n,)
        The response; trials where it is NaN are left out [its own].
    dyads, performers : array_like, shape (n,)
        Whose trial it is: labels of any kind. The performer is a person, or the two of a dyad together.
    haptics, dyadic : array_like of bool, shape (n,)
        Forces are felt; two people perform.
    order : array_like, shape (n,)
        Number of the trial in its condition, from 1 [1].

    Returns
    -------
    Design
        Without the columns that are constant, or sums of others.

    Raises
    ------
    ValueError
        If there is not one label for each trial, or a trial number below 1.
    """
    y = np.asarray(values, dtype=float)
    given = {"dyads": dyads, "performers": performers, "haptics": haptics, "dyadic": dyadic, "order": order}
    labels = {name: np.asarray(label) for name, label in given.items()}
    for name, label in labels.items():
        if y.ndim != 1 or label.shape != y.shape:
            raise ValueError(f"{name}: one for each of {y.shape} values is expected, found shape {label.shape}")
    known = np.isfinite(y)
    number = labels["order"][known].astype(float)
    if not (number >= 1.0).all():
        raise ValueError(f"order: trial numbers from 1 are expected, found {number[~(number >= 1.0)][0]}")
    felt, both = (labels[name][known].astype(bool) for name in ("haptics", "dyadic"))
    pair = np.unique(labels["dyads"][known], return_inverse=True)[1].astype(np.int64)
    label = np.unique(labels["performers"][known], return_inverse=True)[1].astype(np.int64)
    person = np.unique(pair * (len(label) + 1) + label, return_inverse=True)[1].astype(np.int64)
    names, columns = _told_apart(felt, both, number)
    lonely = _lonely(names, pair, felt, both, number)
    notes = [f"{name}: left out, these trials cannot tell it" for name in COLUMNS if name not in names]
    notes += [f"{name}: a single dyad tells it" for name in lonely]
    left_out = int((~known).sum())
    return Design(y[known], pair, person, felt, both, number, names, columns, lonely, left_out, tuple(notes))


def _told_apart(
    haptics: NDArray[np.bool_], dyadic: NDArray[np.bool_], order: NDArray[np.float64]
) -> tuple[tuple[str, ...], NDArray[np.float64]]:
    """Keep the columns that are no sums of those before them."""
    h, c = haptics - 0.5, dyadic - 0.5
    kept: list[str] = []
    columns = np.empty((len(h), 0))
    for name, column in zip(COLUMNS, (np.ones(len(h)), h, c, h * c, np.log(order)), strict=True):
        wider = np.column_stack([columns, column])
        if len(h) and np.linalg.matrix_rank(wider) == wider.shape[1]:
            kept, columns = [*kept, name], wider
    return tuple(kept), columns


def _lonely(
    names: tuple[str, ...],
    dyads: NDArray[np.int64],
    haptics: NDArray[np.bool_],
    dyadic: NDArray[np.bool_],
    order: NDArray[np.float64],
) -> tuple[str, ...]:
    """Find what could not be told any more if one of the dyads were not there."""
    groups = np.unique(dyads)
    if len(groups) < 2:
        return ()
    others = [_told_apart(*(x[dyads != group] for x in (haptics, dyadic, order)))[0] for group in groups]
    return tuple(name for name in names if any(name not in other for other in others))


def cells_of(design: Design, *, geometric: bool = False) -> tuple[Cell, ...]:
    """Describe what was observed in each condition.

    Parameters
    ----------
    design : Design
        The trials.
    geometric : bool
        Values are logarithms; the mean is that of what they are logarithms of.

    Returns
    -------
    tuple of Cell
        Conditions that have trials.
    """
    cells = []
    for dyadic in (False, True):
        for haptics in (False, True):
            own = (design.haptics == haptics) & (design.dyadic == dyadic)
            if own.any():
                mean = float(design.values[own].mean())
                dyads = len(np.unique(design.dyads[own]))
                cells.append(Cell(haptics, dyadic, int(own.sum()), dyads, exp(mean) if geometric else mean))
    return tuple(cells)
