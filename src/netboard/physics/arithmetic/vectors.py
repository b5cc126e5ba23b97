"""Arithmetic on state vectors: tuples of floats, for which compiled loops are unrolled.

A state is ``(z, vz, theta, omega)`` followed by ``(p, vp)`` of each ball. Every function is plain Python; beside it is
the unrolled code that Numba compiles instead. Both do the same operations in the same order, to the bit.
"""

from collections.abc import Callable
from typing import Any

import numpy as np
from numba import types
from numpy.typing import NDArray

from netboard.base.compiled import specialised

State = tuple[float, ...]
"""A state, its rate of change, or any other tuple of floats."""


def _unrolled(function: Callable[..., Any], names: str, write: Callable[..., str]) -> None:
    """Register the expression that `write` makes from the types of the arguments as the compiled code of a function."""

    def compose(*arguments: types.Type) -> Any:
        return eval(f"lambda {names}: {write(*arguments)}")

    specialised(function)(eval(f"lambda {names}: compose({names})", {"compose": compose}))


def _listed(count: int, term: str) -> str:
    """Write a tuple whose i-th element is the term with # replaced by i."""
    return "(" + "".join(term.replace("#", str(i)) + ", " for i in range(count)) + ")"


def plus(x: State, h: float, k: State) -> State:
    """Return ``x + h k``.

    Parameters
    ----------
    h : float
        Factor; a time where k is a rate [s].
    k : tuple of float
        As long as x [SI].
    """
    return tuple([a + h * b for a, b in zip(x, k, strict=True)])


_unrolled(plus, "x, h, k", lambda x, h, k: _listed(x.count, "x[#] + h * k[#]"))


def blend(x: State, h: float, weights: State, ks: tuple[State, ...]) -> State:
    """Return ``x + h (w0 k0 + w1 k1 + ...)``.

    Parameters
    ----------
    weights : tuple of float
        A weight for each rate; compile-time constants [1].
    ks : tuple of tuple of float
        Rates, as many as weights, each as long as x [SI].
    """
    return tuple([a + h * _weighted(weights, [k[i] for k in ks]) for i, a in enumerate(x)])


def _weighted(weights: State, values: list[float]) -> float:
    """Return the weighted sum, from the first to the last."""
    total = weights[0] * values[0]
    for weight, value in zip(weights[1:], values[1:], strict=True):
        total += weight * value
    return total


_unrolled(
    blend,
    "x, h, weights, ks",
    lambda x, h, weights, ks: _listed(
        x.count, "x[#] + h * (" + " + ".join(f"weights[{j}] * ks[{j}][#]" for j in range(ks.count)) + ")"
    ),
)


def row(table: NDArray[np.float64], i: int, like: State) -> State:
    """Return a row of a table as a tuple.

    Parameters
    ----------
    table : ndarray of float64, shape (n, length)
        Numbers in any unit [SI].
    i : int
        Index of the row, from 0 [1].
    like : tuple of float
        Any tuple as long as the row [SI].
    """
    return tuple(table[i, : len(like)].tolist())


_unrolled(row, "table, i, like", lambda table, i, like: _listed(like.count, "table[i, #]"))


def places(x: State) -> State:
    """Return the positions of the balls along the board, + = right [m]."""
    return x[4::2]


_unrolled(places, "x", lambda x: "(" + "".join(f"x[{i}], " for i in range(4, x.count, 2)) + ")")


def speeds(x: State) -> State:
    """Return the velocities of the balls along the board, + = right [m/s]."""
    return x[5::2]


_unrolled(speeds, "x", lambda x: "(" + "".join(f"x[{i}], " for i in range(5, x.count, 2)) + ")")


def total(a: State) -> float:
    """Return the sum, from the first to the last; 0 of none [SI].

    Parameters
    ----------
    a : tuple of float
        Numbers to add [SI].
    """
    result = a[0] if a else 0.0
    for value in a[1:]:
        result += value
    return result


_unrolled(total, "a", lambda a: " + ".join(f"a[{i}]" for i in range(a.count)) or "0.0")


def dot(a: State, b: State) -> float:
    """Return the sum of products, from the first to the last; 0 of none [SI].

    Parameters
    ----------
    a, b : tuple of float
        Of equal length [SI].
    """
    result = a[0] * b[0] if a else 0.0
    for one, other in zip(a[1:], b[1:], strict=True):
        result += one * other
    return result


_unrolled(dot, "a, b", lambda a, b: " + ".join(f"a[{i}] * b[{i}]" for i in range(a.count)) or "0.0")


def alike(value: float, a: State) -> State:
    """Return a tuple as long as another, with the same value in each place.

    Parameters
    ----------
    value : float
        Number in any unit [SI].
    a : tuple of float
        One number for each ball [SI].
    """
    return (value,) * len(a)


_unrolled(alike, "value, a", lambda value, a: _listed(a.count, "value"))


def affine(constant: float, factor: float, a: State) -> State:
    """Return ``constant + factor a`` for each element.

    Parameters
    ----------
    constant, factor : float
        Numbers that all elements share [SI].
    a : tuple of float
        One number for each ball [SI].
    """
    return tuple([constant + factor * value for value in a])


_unrolled(affine, "constant, factor, a", lambda constant, factor, a: _listed(a.count, "constant + factor * a[#]"))


def joined(vz: float, az: float, omega: float, ao: float, vp: State, ap: State) -> State:
    """Return the rate of a state from those of its parts.

    Parameters
    ----------
    vz, az : float
        Rates of the height and of its rate [m/s, m/s2].
    omega, ao : float
        Rates of the tilt and of its rate [rad/s, rad/s2].
    vp, ap : tuple of float
        Rates of the position of each ball and of its rate [m/s, m/s2].
    """
    return (vz, az, omega, ao, *(value for pair in zip(vp, ap, strict=True) for value in pair))


_unrolled(
    joined,
    "vz, az, omega, ao, vp, ap",
    lambda vz, az, omega, ao, vp, ap: (
        "(vz, az, omega, ao, " + "".join(f"vp[{i}], ap[{i}], " for i in range(vp.count)) + ")"
    ),
)


TINY = 1e-200
"""Smaller magnitudes are set to 0. Their products would be denormal numbers, which are many times slower to compute; a
board between resting hands would reach them [SI]."""


def calm(x: State) -> State:
    """Return the state with negligible numbers set to 0."""
    return tuple([0.0 if abs(a) < TINY else a for a in x])


_unrolled(calm, "x", lambda x: _listed(x.count, f"0.0 if abs(x[#]) < {TINY} else x[#]"))


def replaced(x: State, i: int, value: float) -> State:
    """Return the state with one element replaced.

    Parameters
    ----------
    i : int
        Index of the element [1].
    value : float
        New value of this element, in its unit [SI].
    """
    return (*x[:i], value, *x[i + 1 :])


_unrolled(replaced, "x, i, value", lambda x, i, value: _listed(x.count, "value if i == # else x[#]"))
