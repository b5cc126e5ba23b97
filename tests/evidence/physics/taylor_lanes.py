"""A batch of offline simulations by the Taylor method, in the lanes of vector registers: for studies.

The sources of `netboard.physics.scene.series` and of the expansion of drives are compiled a second time, with fused
multiply-adds, for lanes in place of numbers. All simulations of a group share scene and sampling times; their hands and
first states differ. A step ends where it does for the slowest of them. Scenes with stops or friction are not taken:
their events end steps at times of their own.
"""

import operator
from collections.abc import Callable
from functools import cache
from statistics import median
from time import process_time
from typing import Any

import numpy as np
from numba import types
from numba.core import cgutils
from numba.extending import intrinsic, make_attribute_wrapper, models, register_model

from netboard.base.compiled import borrowed, fast, relaxed, specialised
from netboard.base.tables.scene import Physics
from netboard.benchmarks.harness.results import ResultPart
from netboard.benchmarks.harness.running import in_turns
from netboard.benchmarks.physics.problem import MODELS, Array, hermite_drives, multiples, styluses_at
from netboard.physics.arithmetic.simd import lanes_at, larger, put, within
from netboard.physics.methods.taylor import (
    LOWEST_ORDER,
    SHORTEST,
    SLOWEST,
    expand_drives,
    make_taylor,
    order_for,
    state_at,
)
from netboard.physics.scene.parameters import Parts, numbers_of, pack_scene, parts_of
from netboard.physics.scene.series import begin_series, extend_series, larger_of, table_of
from netboard.physics.simulation import TOLERANCE

LANES = 8
"""Simulations of a group: one register of the widest kind [1]."""

DURATION, MANY = 2.0, 64
"""Simulations under comparison: their duration, and their number [s, 1]."""

CLAIM = 1e-11
"""Largest difference of a simulation in lanes from one alone, over the range of its signal [1]."""

SHRINK = 0.75
"""Factor by which a step is shortened until its last two terms are below the tolerance in all lanes [1]."""

DRIVES = 8
"""Coefficients of both drives in an interval [1]."""


class LaneTable(types.Type):
    """A table of Taylor coefficients, or of drives, whose elements are lanes: a tuple could have no constant places."""

    def __init__(self, values: Any) -> None:
        """Set the type of the array with its values."""
        self.values = values
        super().__init__(name=f"lane_table({values})")


_Struct: Any = models.StructModel
_proxy: Any = cgutils.create_struct_proxy


def _make_model(manager: Any, table: LaneTable) -> Any:
    return _Struct(manager, table, [("values", table.values)])


register_model(LaneTable)(_make_model)
make_attribute_wrapper(LaneTable, "values", "values")


def _make_table(context: Any, values: Any) -> Any:
    """Make a table of a borrowed array."""
    table = LaneTable(values)

    def write(target: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        made = _proxy(table)(target, builder)
        made.values = arguments[0]
        return made._getvalue()

    return table(values), write


lane_table: Any = intrinsic(_make_table)


@specialised(operator.getitem)
def _coefficient(table: Any, place: Any) -> Any:
    """Let compiled code read a place as lanes; that of drives has a row and a column."""
    if not isinstance(table, LaneTable):
        return None
    if isinstance(place, types.BaseTuple):
        return lambda table, place: lanes_at(table.values, (place[0] * DRIVES + place[1]) * LANES, LANES)
    return lambda table, place: lanes_at(table.values, place * LANES, LANES)


@specialised(operator.setitem)
def _set_coefficient(table: Any, place: Any, value: Any) -> Any:
    """Let compiled code write a place."""
    if not isinstance(table, LaneTable):
        return None
    if isinstance(value, types.Float | types.Integer):
        return lambda table, place, value: _fill(table.values, place * LANES, float(value))
    return lambda table, place, value: put(table.values, place * LANES, value)


@fast
def _fill(values: Any, first: int, value: float) -> None:
    for j in range(LANES):
        values[first + j] = value


_begin: Any = relaxed(begin_series, {})
_extend: Any = relaxed(extend_series, {larger_of: larger})
_state_at: Any = relaxed(state_at, {})
_expand: Any = relaxed(expand_drives, {})


@cache
def make_taylor_lanes(PARTS: Parts) -> Callable[[Array, Array, Array, float, int, Any, Array, Array], int]:
    """Compile the march of one group of simulations.

    Returns
    -------
    callable
        ``march(x, hands, lengths, tolerance, order, scene, table, out)`` writes the states at the ends of all
        intervals, shape (n, 6, `LANES`), and returns the number of steps; it ends with NaN where no step is short
        enough. ``x`` has the first states, shape (6, `LANES`), ``hands`` the polynomials of both drives, shape (n, 8,
        `LANES`), and ``table`` room for coefficients [SI].
    """

    @fast
    def march(
        x: Any, hands: Any, lengths: Any, tolerance: float, order: int, scenes: Any, values: Any, out: Any
    ) -> int:
        table, drives, scene = lane_table(borrowed(values)), lane_table(borrowed(hands)), scenes[0]
        y = (
            lanes_at(x, 0, LANES),
            lanes_at(x, LANES, LANES),
            lanes_at(x, 2 * LANES, LANES),
            lanes_at(x, 3 * LANES, LANES),
            lanes_at(x, 4 * LANES, LANES),
            lanes_at(x, 5 * LANES, LANES),
        )
        count, numbers = 0, numbers_of(scene)
        for i in range(len(lengths)):
            t = 0.0
            while t < lengths[i]:
                h = lengths[i] - t
                _expand(drives, i, t, order, table)
                mass = _begin(y, 1.0, PARTS, scene, table)
                speed = larger(larger(abs(y[1]), scene["l"] * abs(y[3])), larger(abs(y[5]), SLOWEST))
                size, before, power, quiet, last = speed, speed, 1.0 / tolerance, 0, order
                for n in range(order):
                    before, size = size, _extend(n, y, mass, 1.0, PARTS, numbers, table)
                    power *= h
                    quiet = quiet + 1 if within(size * power / speed, 1.0) else 0
                    if quiet >= 2 and n + 1 >= LOWEST_ORDER:
                        last = n + 1
                        break
                while quiet < 2:
                    h *= SHRINK
                    power = h ** (order - 1) / tolerance
                    if h < SHORTEST:
                        out[i:] = np.nan
                        return count
                    if within(size * (power * h) / speed, 1.0) and within(before * power / speed, 1.0):
                        quiet = 2
                y = _state_at(y, table, last, h)
                t, count = t + h, count + 1
            for k in range(6):
                put(out, (6 * i + k) * LANES, y[k])
        return count

    return march


def group_runs(physics: Physics, count: int) -> tuple[Callable[[], Array], Callable[[], Array]]:
    """Return a run of all simulations in lanes, and one of each alone; both return states, shape (count, n, 6)."""
    parts, scene, order = parts_of(physics), pack_scene(physics), order_for(TOLERANCE)
    times = multiples(round(DURATION * 1000) + 1, 1e-3)
    hands = np.stack([hermite_drives(physics, times, *styluses_at(times, spread)) for spread in _spreads(count)])
    lengths, ends = np.diff(times), np.arange(1, len(times))
    first = np.zeros((count, 6))
    first[:, 4], first[:, 5] = 0.02, np.linspace(0.15, 0.25, count)
    groups = [slice(g, g + LANES) for g in range(0, count, LANES)]
    lanes = [(np.ascontiguousarray(first[g].T), np.ascontiguousarray(hands[g].transpose(1, 2, 0))) for g in groups]
    march, alone = make_taylor_lanes(parts), make_taylor(parts)
    room, table = np.zeros(table_of(6).size * LANES), table_of(6)

    def together() -> Array:
        outs = np.empty((len(groups), len(lengths), 6, LANES))
        for (x, drives), out in zip(lanes, outs, strict=True):
            march(x, drives, lengths, TOLERANCE, order, scene, room, out)
        return outs.transpose(0, 3, 1, 2).reshape(count, len(lengths), 6)

    def one_by_one() -> Array:
        out = np.empty((count, len(lengths), 6))
        for x, drives, states in zip(first.tolist(), hands, out, strict=True):
            alone(tuple(x), drives, lengths, ends, lengths, TOLERANCE, order, scene, table, states)
        return out

    return together, one_by_one


def _spreads(count: int) -> list[float]:
    return [float(spread) for spread in np.linspace(0.5, 1.0, count)]


def lanes_part(repeats: int, count: int = MANY) -> ResultPart:
    """Compare simulations in lanes with the same simulations one by one, in turns."""
    part = ResultPart(
        "lanes",
        f"{count} simulations of hands sampled at 1 kHz by the Taylor method, states kept at each sample, on one core: "
        "a step of one of them, in lanes and one by one; ratio: median of the turns, and its quartiles",
        "model | one by one [ns] | in lanes [ns] | ratio | quartiles | largest difference over the range [1]",
    )
    worst = 0.0
    for model in MODELS:
        runs = group_runs(Physics(model=model), count)
        found, exact = (run() for run in runs)
        apart = float((np.abs(found - exact).max(axis=(0, 1)) / np.ptp(exact, axis=(0, 1))).max())
        turns = np.array([[median(taken) for taken in in_turns(runs, 1, 1.0, process_time)] for _ in range(repeats)])
        low, middle, high = np.quantile(turns[:, 1] / turns[:, 0], (0.25, 0.5, 0.75)).tolist()
        each = np.median(turns, axis=0) / (count * DURATION * 1000) * 1e9
        part.add(model, float(each[1]), float(each[0]), middle, f"{low:.2f} to {high:.2f}", apart)
        worst = float(np.maximum(worst, apart))
    part.claim(f"simulations in lanes agree within {CLAIM:.0e}", worst < CLAIM, f"{worst:.2g}")
    return part
