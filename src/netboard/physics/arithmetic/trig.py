"""Sine and cosine that give the same bits everywhere.

The C library's own differ between libraries, versions and processors, and a recording must verify to the bit on any
machine. These use nothing but IEEE additions, multiplications and comparisons, in one fixed order, and are good to 1
ulp up to `MAX_ANGLE`. Beyond it an angle has too few digits left to reduce exactly, and the result is NaN, as it is for
infinite and NaN angles; nothing here raises.

The polynomials and the reduction are those of fdlibm (``k_sin.c``, ``k_cos.c``, ``e_rem_pio2.c``, in the order of
FreeBSD's msun, whose chains of operations are shorter):
Copyright (C) 1993 by Sun Microsystems, Inc. All rights reserved. Permission to use, copy, modify, and distribute this
software is freely granted, provided that this notice is preserved.
"""

import math
from collections.abc import Callable
from functools import cache
from typing import Any

import numpy as np
from numba import types
from numpy.typing import NDArray

from netboard.base.compiled import inlined, specialised
from netboard.physics.arithmetic.simd import Lanes, Packed, lanes_at, put, within

MAX_ANGLE = 1.6e6
"""Angles beyond this give NaN: below it a multiple of pi/2 has at most 20 bits, so its products are exact [rad]."""

EIGHTH_TURN = 0.7853981633974483
"""Up to here the polynomials do without reduction: pi/4 [rad]."""

_TWO_OVER_PI = 0.6366197723675814
_NEAREST = 6755399441055744.0  # 1.5 * 2**52: adding and subtracting it rounds to the nearest whole number

# pi/2 = _HALF_PI_1 + _HALF_PI_2 + _HALF_PI_3; the first two have 33 bits each.
_HALF_PI_1 = 1.57079632673412561417e00
_HALF_PI_2 = 6.07710050630396597660e-11
_HALF_PI_3 = 2.02226624879595063154e-21

_S1 = -1.66666666666666324348e-01
_S2 = 8.33333333332248946124e-03
_S3 = -1.98412698298579493134e-04
_S4 = 2.75573137070700676789e-06
_S5 = -2.50507602534068634195e-08
_S6 = 1.58969099521155010221e-10

_C1 = 4.16666666666666019037e-02
_C2 = -1.38888888888741095749e-03
_C3 = 2.48015872894767294178e-05
_C4 = -2.75573143513906633035e-07
_C5 = 2.08757232129817482790e-09
_C6 = -1.13596475577881948265e-11


@inlined
def small(x: Packed, tail: float) -> tuple[Any, Any]:
    """Return sine and cosine of ``x + tail``, up to `EIGHTH_TURN` [1].

    Parameters
    ----------
    x : float or lanes
        Angle, rounded to float64 [rad].
    tail : float
        Its rounding error, less than the last digit of x [rad].
    """
    z = x * x
    w = z * z
    v = z * x
    sine = _S2 + z * (_S3 + z * _S4) + z * w * (_S5 + z * _S6)
    s = x - ((z * (0.5 * tail - v * sine) - tail) - v * _S1)
    cosine = z * (_C1 + z * (_C2 + z * _C3)) + w * w * (_C4 + z * (_C5 + z * _C6))
    half = 0.5 * z
    top = 1.0 - half
    c = top + (((1.0 - top) - half) + (z * cosine - x * tail))
    return s, c


@inlined
def reduced(x: float) -> tuple[float, float, float]:
    """Reduce an angle by the nearest multiple of a quarter turn (Cody and Waite, in three parts).

    Parameters
    ----------
    x : float
        Angle, up to `MAX_ANGLE` [rad].

    Returns
    -------
    y, tail : float
        Remainder, and its rounding error [rad].
    n : float
        Number of quarter turns, a whole number [1].
    """
    n = (x * _TWO_OVER_PI + _NEAREST) - _NEAREST
    first = x - n * _HALF_PI_1
    w = n * _HALF_PI_2
    rest = first - w
    w = n * _HALF_PI_3 - ((first - rest) - w)
    y = rest - w
    return y, (rest - y) - w, n


@inlined
def _of_one(x: float) -> tuple[float, float]:
    """Return sine and cosine of a number."""
    if abs(x) <= EIGHTH_TURN:
        return small(x, 0.0)
    if not abs(x) <= MAX_ANGLE:
        return math.nan, math.nan
    y, tail, n = reduced(x)
    s, c = small(y, tail)
    quarter = int(n) & 3
    if quarter == 0:
        return s, c
    if quarter == 1:
        return c, -s
    if quarter == 2:
        return -s, -c
    return -c, s


def sincos(x: Packed) -> tuple[Any, Any]:
    """Return sine and cosine of an angle, within 1 ulp up to `MAX_ANGLE`, NaN beyond it [1].

    Parameters
    ----------
    x : float or lanes
        Angle, or lanes of angles, each of which gives the bits of the angle alone [rad].
    """
    if isinstance(x, np.ndarray):
        both = np.array([_of_one(float(one)) for one in x])
        return both[:, 0], both[:, 1]
    return _of_one(x)


@cache
def _of_lanes(COUNT: int) -> Callable[[Any], tuple[Any, Any]]:
    """Compile sine and cosine of some lanes."""

    @inlined
    def sincos_of_lanes(x: NDArray[np.float64]) -> tuple[Any, Any]:
        if within(x, EIGHTH_TURN):
            return small(x, 0.0)
        angles = np.empty((3, COUNT))  # one by one: an angle is too large for the polynomials alone
        put(angles, 0, x)
        for i in range(COUNT):
            angles[1, i], angles[2, i] = _of_one(angles[0, i])
        return lanes_at(angles, COUNT, COUNT), lanes_at(angles, 2 * COUNT, COUNT)

    return sincos_of_lanes


@specialised(sincos)
def _sincos(x: types.Type) -> Any:
    """Select the form for numbers or lanes."""
    of = _of_lanes(x.count) if isinstance(x, Lanes) else _of_one
    return lambda x: of(x)  # noqa: PLW0108  (numba takes no compiled function here)
