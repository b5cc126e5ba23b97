"""Compiled integration of a scene along a grid of steps, for offline runs and studies."""

from collections.abc import Callable
from dataclasses import dataclass
from functools import cache
from typing import Any

import numpy as np
from numba import types
from numpy.typing import NDArray

from netboard.base.compiled import Records, borrowed, kernel, specialised
from netboard.physics.arithmetic.vectors import State, calm
from netboard.physics.hands.extrapolation import later
from netboard.physics.methods.catalogue import METHODS, NUMBER, advance
from netboard.physics.scene.models import coupling, stopped
from netboard.physics.scene.parameters import Parts


@dataclass(frozen=True)
class TimeGrid:
    """Intervals of a run, each divided into equal steps.

    Attributes
    ----------
    lengths : ndarray of float64, shape (n,)
        Length of each interval [s].
    counts : ndarray of int64, shape (n,)
        Number of equal steps in each interval [1].
    kinds : ndarray of int64, shape (n,)
        Index of the tables of each interval [1].
    tables : ndarray of float64, shape (kinds, ...)
        Tables of the method for each step size [SI].
    """

    lengths: NDArray[np.float64]
    counts: NDArray[np.int64]
    kinds: NDArray[np.int64]
    tables: NDArray[np.float64]


def make_grid(
    method: str, lengths: NDArray[np.float64], counts: NDArray[np.int64], parts: Parts, length: int, scene: NDArray[Any]
) -> TimeGrid:
    """Make the steps of a run, with the tables of its method."""
    steps, kinds = np.unique(lengths / counts, return_inverse=True)
    make = METHODS[NUMBER[method]].tables
    tables = np.stack([make(scene[0], parts, length, float(h)) for h in steps])
    return TimeGrid(lengths, counts, kinds.astype(np.int64), tables)


def hands_at(hands: NDArray[np.float64], i: int) -> Any:
    """Return the drives during interval i, as `netboard.physics.hands.extrapolation.drives` takes them [N].

    Parameters
    ----------
    hands : ndarray of float64, shape (n, 8) or (n, nodes, 2)
        Polynomials of both drives for each interval, or their values at the nodes of the method [N].
    """
    return tuple(hands[i].tolist()) if hands.ndim == 2 else (hands, i)


@specialised(hands_at)
def _hands_at(hands: types.Array, i: types.Type) -> Any:
    if hands.ndim == 2:
        return lambda hands, i: (
            hands[i, 0],
            hands[i, 1],
            hands[i, 2],
            hands[i, 3],
            hands[i, 4],
            hands[i, 5],
            hands[i, 6],
            hands[i, 7],
        )
    return lambda hands, i: (hands, i)


def moved_on(hands: Any, t: float) -> Any:
    """Return the drives relative to a later step of the same interval.

    Parameters
    ----------
    hands : tuple of float, length 8, or tuple of ndarray and int
        Drives during the interval; values at nodes are for intervals of one step and remain unchanged [N].
    t : float
        Shift of the start [s].
    """
    return later(hands, t) if len(hands) == 8 else hands


@specialised(moved_on)
def _moved_on(hands: types.Type, t: types.Type) -> Any:
    if isinstance(hands, types.UniTuple):
        return lambda hands, t: later(hands, t)  # noqa: PLW0108  (numba takes no compiled function here)
    return lambda hands, t: hands


@cache
def make_march(METHOD: int, PARTS: Parts) -> Callable[..., State]:
    """Compile the integration of a kind of scene along a grid.

    Parameters
    ----------
    METHOD : int
        Place of the method in `netboard.physics.methods.catalogue.METHODS` [1].

    Returns
    -------
    callable
        ``march(x, hands, lengths, counts, kinds, tables, scene, out)`` returns the last state; `out`, of shape
        (n + 1, length) or (0, length), gets the first state and that after each interval.
    """

    @kernel
    def march(
        x: State,
        hands: NDArray[np.float64],
        lengths: NDArray[np.float64],
        counts: NDArray[np.int64],
        kinds: NDArray[np.int64],
        tables: NDArray[np.float64],
        scene: Records,
        out: NDArray[np.float64],
    ) -> State:
        keep, one = len(out) > 0, scene[0]
        hands, tables = borrowed(hands), borrowed(tables)
        if keep:
            for j in range(len(x)):
                out[0, j] = x[j]
        for i in range(len(lengths)):
            drive = hands_at(hands, i)
            h = lengths[i] / counts[i]
            for step in range(counts[i]):
                if step > 0:
                    drive = moved_on(drive, h)
                x = stopped(advance(METHOD, x, h, drive, (tables, kinds[i]), PARTS, one), PARTS, one)
            x = calm(x)
            if keep:
                for j in range(len(x)):
                    out[i + 1, j] = x[j]
        return x

    return march


def run(
    method: str, x: State, hands: NDArray[np.float64], grid: TimeGrid, parts: Parts, scene: NDArray[Any]
) -> NDArray[np.float64]:
    """Integrate a scene along a grid; return the first state and that after each interval, shape (n + 1, length) [SI].

    Parameters
    ----------
    x : tuple of float
        State at the start of the first interval [SI].
    hands : ndarray of float64, shape (n, 8) or (n, nodes, 2)
        As for `hands_at` [N].
    grid : Grid
        Intervals and steps.
    """
    out = np.empty((len(grid.lengths) + 1, len(x)))
    march = make_march(NUMBER[method], parts)
    march(tuple(map(float, x)), hands, grid.lengths, grid.counts, grid.kinds, grid.tables, scene, out)
    return out


@cache
def _make_forces(PARTS: Parts) -> Callable[..., None]:
    """Compile the coupling forces along a trajectory."""

    @kernel
    def forces(
        states: NDArray[np.float64], drives: NDArray[np.float64], scene: Records, out: NDArray[np.float64]
    ) -> None:
        for i in range(len(states)):
            x = (states[i, 0], states[i, 1], states[i, 2], states[i, 3])
            out[i, 0], out[i, 1] = coupling(x, drives[i, 0], drives[i, 1], PARTS, scene[0])

    return forces


def forces_along(
    states: NDArray[np.float64], drives: NDArray[np.float64], parts: Parts, scene: NDArray[Any]
) -> NDArray[np.float64]:
    """Return the forces of the left and the right coupling on the board at each state, + = up, shape (n, 2) [N].

    Parameters
    ----------
    drives : ndarray of float64, shape (n, 2)
        Drives of the left and of the right hand at the same times [N].
    """
    out = np.empty((len(states), 2))
    _make_forces(parts)(states, drives, scene, out)
    return out
