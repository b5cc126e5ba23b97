"""Integration by Taylor series, with output at any time for the price of a polynomial.

Order and step follow from a tolerance (Jorba and Zou 2005, see `netboard.physics.scene.series`). The drives of the
hands are polynomials within an interval. There a series ends at the first order at which two successive terms are below
the tolerance at the end of the interval. If this needs too many orders, the last two coefficients give the length of
the step. So a step never crosses a joint of the hands, whichever derivative jumps there, and short intervals take few
orders. Rows of output between the ends of steps are values of the series.

Two events end a step, too, because the equations change there: a ball touches a stop, or the board stands upright,
where the normal force of a ball on the board changes its sign. They are located by steps that cannot miss a touch,
however slight: a bound of the second derivative limits each of them.
"""

import math
from collections.abc import Callable
from functools import cache

import numpy as np
from numpy.typing import NDArray

from netboard.base.compiled import Records, borrowed, inlined, kernel
from netboard.physics.arithmetic.trig import sincos
from netboard.physics.arithmetic.vectors import State, calm
from netboard.physics.arithmetic.written import listed, written
from netboard.physics.hands.extrapolation import later
from netboard.physics.scene.models import stopped
from netboard.physics.scene.parameters import Parts, SceneNumbers, numbers_of
from netboard.physics.scene.series import (
    COSINE,
    LEFT,
    MAX_ORDER,
    NEXT,
    RIGHT,
    STATE,
    Table,
    begin_series,
    extend_series,
)

DEGREE = 3
"""Degree of the drives of the hands between two joints [1]."""

LOWEST_ORDER = DEGREE + 2
"""Lowest order of a step: the second at which the highest coefficient of a drive has an effect [1]."""

WRITTEN_ORDERS, COARSE = 8, 1e-9
"""Orders that `make_series` writes out, and the tolerance down to which they suffice [1]."""

SLOWEST = 0.01
"""A tolerance is relative to the largest speed at the start of a step, or to this speed if that is lower [m/s]."""

SAFETY = 0.9
"""Step over that at which the last two terms are equal to the tolerance, or up to 6.2 % longer (`_root`) [1]."""

SHORTEST = 1e-9
"""A step shorter than this makes the state NaN: the series has no radius of convergence left [s]."""

SHORTEST_FLIGHT = 1e-4
"""A ball that would leave its stop for less than about this time rests on it: it is put back after the time [s]."""

BEYOND, TOUCH = 1.0 + 1e-12, 1e-13
"""A ball touches its stop this far out, with this error, over the place of the stop: it is beyond it, then, whatever
the rounding [1]."""

SOONEST = 1e-12
"""An event ends a step after this time, at least, so that time goes on [s]."""

UPRIGHT = 1e-9
"""Below this cosine of the tilt its rate gives the side of a board that passes the vertical [1]."""

_LOCATING = 100
"""Most iterations for one event [1]."""


def order_for(tolerance: float) -> int:
    """Return the highest order of a series for a tolerance: by Jorba and Zou -ln(tolerance) / 2 + 1 [1].

    Coarse tolerances take no order above `WRITTEN_ORDERS`: the coupling limits their steps, and such orders cost more.
    """
    highest = WRITTEN_ORDERS if tolerance >= COARSE else MAX_ORDER
    return min(max(math.ceil(-0.5 * math.log(tolerance) + 1.0), LOWEST_ORDER), highest)


_evaluated = written(
    "x, table, k, t", lambda n, *_: listed([f"x[{i}] * t + table[{STATE + i * NEXT} + k]" for i in range(n)])
)
"""One step of Horner's scheme for all components of a state."""

put_state = written("out, i, x", lambda _, __, n: "\n".join([*(f"out[i, {k}] = x[{k}]" for k in range(n)), "None"]))
"""Write a state into a row of an array."""

_taken = written("like, table, k", lambda n, *_: listed([f"table[{STATE + i * NEXT} + k]" for i in range(n)]))
"""The coefficients of one order."""


@inlined
def state_at(like: State, table: Table, order: int, t: float) -> State:
    """Return the state at a time since the start of the step.

    Parameters
    ----------
    like : tuple of float
        Any state of this length [SI].
    t : float
        Time since the start of the step, within the step [s].
    """
    x: State = _taken(like, table, order)
    for k in range(order - 1, -1, -1):
        x = _evaluated(x, table, k, t)
    return x


@inlined
def expand_drives(hands: NDArray[np.float64], i: int, t: float, order: int, table: Table) -> None:
    """Write the coefficients of both drives from a time in interval i on.

    Parameters
    ----------
    hands : ndarray of float64, shape (n, 8)
        Polynomials of both drives from the start of each interval [N].
    t : float
        The time since its start [s].
    """
    u = later(
        (hands[i, 0], hands[i, 1], hands[i, 2], hands[i, 3], hands[i, 4], hands[i, 5], hands[i, 6], hands[i, 7]), t
    )
    for k in range(4):
        table[LEFT + k], table[RIGHT + k] = u[k], u[4 + k]


_BITS_OF_ONE = 1023 << 52
"""The number 1 as an integer of 64 bits: above it those of a number are a piecewise linear logarithm [1]."""


@inlined
def _root(value: float, n: int) -> float:
    """Return the n-th root of a positive number, or up to 6.2 % more, from a piecewise linear logarithm."""
    power = (np.float64(value).view(np.int64) - _BITS_OF_ONE) / n
    return float(np.int64(power + _BITS_OF_ONE).view(np.float64))


@inlined
def _step_of(last: float, before: float, order: int, bound: float) -> float:
    """Return the length of a step from the sizes of the coefficients of its last two orders; NaN if one is NaN."""
    if not (last < math.inf and before < math.inf):
        return math.nan
    tiny = 1e-290
    one = _root(bound / max(last, tiny), order)
    return SAFETY * min(one, _root(bound / max(before, tiny), order - 1))


@inlined
def speed_of(x: State, arm: float) -> float:
    """Return the largest of the speeds of heave, of the control points and of the balls [m/s].

    Parameters
    ----------
    arm : float
        Distance of the control points from the board's centre [m].
    """
    size = max(SLOWEST, abs(x[1]), arm * abs(x[3]))
    for i in range(5, len(x), 2):
        size = max(size, abs(x[i]))
    return size


@inlined
def _ended(before: float, size: float, power: float, limit: float, bound: float) -> bool:
    """Return whether the last two terms are below the tolerance at the end of the interval."""
    return before * power <= bound and size * (power * limit) <= bound


@inlined
def _longer(
    n: int,
    tail: tuple[int, float, float, float],
    order: int,
    limit: float,
    bound: float,
    x: State,
    mass: tuple[float, float, float],
    side: float,
    parts: Parts,
    numbers: SceneNumbers,
    table: Table,
) -> tuple[int, float, float, float]:
    """Extend a series of order n, unless it ends there or has ended: as a loop does, but written out for n."""
    last, before, size, power = tail
    if last < n or n == order or _ended(before, size, power, limit, bound):
        return tail
    return n + 1, size, extend_series(n, x, mass, side, parts, numbers, table), power * limit


@inlined
def make_series(
    x: State,
    side: float,
    limit: float,
    tolerance: float,
    order: int,
    parts: Parts,
    scene: np.void,
    numbers: SceneNumbers,
    table: Table,
) -> tuple[int, float]:
    """Write a series; return its order, and the length of the step for the tolerance, at most `limit` [1, s].

    Parameters
    ----------
    limit : float
        Time to the end of the interval [s].
    """
    bound = tolerance * speed_of(x, numbers.l)
    mass = begin_series(x, side, parts, scene, table)
    # With a constant order the compiler unrolls all sums. This makes the low orders up to twice as fast.
    extend_series(0, x, mass, side, parts, numbers, table)
    extend_series(1, x, mass, side, parts, numbers, table)
    extend_series(2, x, mass, side, parts, numbers, table)
    before = extend_series(3, x, mass, side, parts, numbers, table)
    size = extend_series(4, x, mass, side, parts, numbers, table)
    tail = LOWEST_ORDER, before, size, limit * limit * limit * limit
    tail = _longer(5, tail, order, limit, bound, x, mass, side, parts, numbers, table)
    tail = _longer(6, tail, order, limit, bound, x, mass, side, parts, numbers, table)
    tail = _longer(7, tail, order, limit, bound, x, mass, side, parts, numbers, table)
    n, before, size, power = tail
    while n < order and not _ended(before, size, power, limit, bound):
        before, size = size, extend_series(n, x, mass, side, parts, numbers, table)
        n, power = n + 1, power * limit
    if _ended(before, size, power, limit, bound):
        return n, limit
    h = _step_of(size, before, order, bound)
    if h < SHORTEST:
        return order, math.nan
    return order, h if h < limit else limit


# --- events --------------------------------------------------------------------------------------------------------


@inlined
def _value_at(table: Table, row: int, order: int, t: float) -> tuple[float, float]:
    """Return value and rate of a series at a time."""
    value, rate = table[row + order], 0.0
    for k in range(order - 1, -1, -1):
        rate = rate * t + value
        value = value * t + table[row + k]
    return value, rate


@inlined
def first_touch(table: Table, row: int, order: int, h: float, level: float, sign: float, gap: float) -> float:
    """Return when ``level - sign row(t)`` first falls to 0 within a step; infinite if it does not [s].

    Each step of the search is so short that the bound of the second derivative excludes a zero before its end. Near a
    zero it converges as Newton's method does.

    Parameters
    ----------
    level : float
        Distance of the event from 0 [SI].
    sign : float
        Side of the event, 1 or -1 [1].
    gap : float
        Distance that counts as a touch [SI].
    """
    bend, reach = 0.0, 1.0
    for k in range(2, order + 1):
        bend += k * (k - 1) * abs(table[row + k]) * reach
        reach *= h
    t = 0.0
    for _ in range(_LOCATING):
        value, rate = _value_at(table, row, order, t)
        left, nearing = level - sign * value, sign * rate
        if left <= gap and nearing > 0.0:
            return t
        left = max(left, 0.0)
        root = math.sqrt(nearing * nearing + 2.0 * bend * left)
        if nearing > 0.0:
            t += 2.0 * left / (nearing + root)
        elif bend > 0.0:
            t += max((root - nearing) / bend, SOONEST)
        else:
            return math.inf
        if not t <= h:
            return math.inf
    return t


@inlined
def _event_of(x: State, table: Table, order: int, h: float, side: float, parts: Parts, scene: np.void) -> float:
    """Return the time of the first event in a step; its end without any [s]."""
    end = h
    if parts.stops:
        stop = scene["stop"]
        for i in range(4, len(x), 2):
            for sign in (-1.0, 1.0):
                touch = first_touch(table, STATE + i * NEXT, order, end, BEYOND * stop, sign, TOUCH * stop)
                leaning = sign * x[i + 1] <= 2.0 * abs(table[STATE + i * NEXT + 2]) * SHORTEST_FLIGHT
                end = min(end, max(touch, SHORTEST_FLIGHT if leaning else SOONEST))
    if parts.resisted and parts.tilts:
        end = min(end, max(first_touch(table, COSINE, order, end, 0.0, -side, TOUCH), SOONEST))
    return end


@inlined
def _side_of(x: State, parts: Parts) -> float:
    """Return the sign of the cosine of the tilt from now on [1]."""
    if not (parts.resisted and parts.tilts):
        return 1.0
    s, c = sincos(x[2])
    if abs(c) < UPRIGHT:
        c = -x[3] * s
    return -1.0 if c < 0.0 else 1.0


# --- runs ----------------------------------------------------------------------------------------------------------


@inlined
def march_by_series(
    x: State,
    hands: NDArray[np.float64],
    lengths: NDArray[np.float64],
    ends: NDArray[np.int64],
    moments: NDArray[np.float64],
    tolerance: float,
    order: int,
    parts: Parts,
    scene: np.void,
    table: Table,
    out: NDArray[np.float64],
) -> tuple[State, int, float]:
    """Integrate along intervals; return the last state, the number of steps and the longest of them [SI, 1, s].

    Parameters
    ----------
    hands : ndarray of float64, shape (n, 8)
        As for `expand_drives` [N].
    ends : ndarray of int64, shape (n,)
        Number of the rows up to the end of each interval [1].
    moments : ndarray of float64, shape (rows,)
        Time of each row since the start of its interval, not 0 [s].
    table : ndarray of float64
        From `netboard.physics.scene.series.table_of`.
    out : ndarray of float64, shape (rows, length)
        Gets the states of the rows [SI].
    """
    row, count, longest, numbers = 0, 0, 0.0, numbers_of(scene)
    for i in range(len(lengths)):
        t, length = 0.0, lengths[i]
        while t < length:
            expand_drives(hands, i, t, order, table)
            side, left = _side_of(x, parts), length - t
            last, h = make_series(x, side, left, tolerance, order, parts, scene, numbers, table)
            if parts.stops or parts.resisted:
                h = _event_of(x, table, last, h, side, parts, scene)
            end = t + h if h < left else length
            h = end - t if h <= left else h  # as the clock counts it, so that time does not drift; NaN stays
            while row < ends[i] and moments[row] < end:
                put_state(out, row, state_at(x, table, last, moments[row] - t))
                row += 1
            x = calm(stopped(state_at(x, table, last, h), parts, scene))
            t, count, longest = end, count + 1, max(longest, h)
        while row < ends[i]:
            put_state(out, row, x)
            row += 1
    return x, count, longest


@cache
def make_taylor(PARTS: Parts) -> Callable[..., tuple[State, int, float]]:
    """Compile `march_by_series` for a kind of scene.

    Returns
    -------
    callable
        ``march(x, hands, lengths, ends, moments, tolerance, order, scene, table, out)`` returns the last state, the
        number of steps and the longest of them [SI, 1, s].
    """

    @kernel
    def march(
        x: State,
        hands: NDArray[np.float64],
        lengths: NDArray[np.float64],
        ends: NDArray[np.int64],
        moments: NDArray[np.float64],
        tolerance: float,
        order: int,
        scene: Records,
        table: Table,
        out: NDArray[np.float64],
    ) -> tuple[State, int, float]:
        hands, table = borrowed(hands), borrowed(table)
        return march_by_series(x, hands, lengths, ends, moments, tolerance, order, PARTS, scene[0], table, out)

    return march
