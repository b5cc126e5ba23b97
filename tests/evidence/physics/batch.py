"""A batch of thousands of simulations of one kind of scene, advanced step by step: for studies, never for a recording.

The source of the strict step is compiled a second time with relaxed floating-point rules, and vectorised over the
simulations: each component is contiguous over them, and no step branches. Results agree with the strict step to
rounding, not to the bit.

Sine and cosine have two forms. The short one is valid for tilts up to an eighth of a turn and returns NaN beyond; if it
does so for any simulation of a block, the step of the block is repeated with the long one.
"""

import math
import operator
from collections.abc import Callable
from functools import cache
from typing import Any, NamedTuple

import numpy as np
from numba import types
from numpy.typing import NDArray

from netboard.base.compiled import fast, inlined, relaxed, specialised
from netboard.physics.arithmetic.trig import EIGHTH_TURN, MAX_ANGLE, reduced, sincos, small
from netboard.physics.arithmetic.vectors import calm
from netboard.physics.arithmetic.written import listed, written
from netboard.physics.methods.one_step import rk4
from netboard.physics.scene.models import stopped
from netboard.physics.scene.parameters import SCENE, Parts

Array = NDArray[np.float64]

_small, _reduced, _calm = relaxed(small, {}), relaxed(reduced, {}), relaxed(calm, {})


@inlined
def _short(x: float) -> tuple[float, float]:
    """Return sine and cosine up to an eighth of a turn, NaN beyond."""
    s, c = _small(x, 0.0)
    fine = abs(x) <= EIGHTH_TURN
    return s if fine else math.nan, c if fine else math.nan


@inlined
def anywhere(x: float) -> tuple[float, float]:
    """Return sine and cosine of any angle, without branches."""
    y, tail, n = _reduced(x)
    s, c = _small(y, tail)
    half = np.floor(0.5 * n)
    odd, turned = n - 2.0 * half, half - 2.0 * np.floor(0.5 * half)
    sine, cosine = c if odd > 0.0 else s, s if odd > 0.0 else c
    sine, cosine = -sine if turned > 0.0 else sine, -cosine if odd != turned else cosine
    fine = abs(x) <= MAX_ANGLE
    return sine if fine else math.nan, cosine if fine else math.nan


_short_step, _long_step = relaxed(rk4, {sincos: _short}), relaxed(rk4, {sincos: anywhere})
_stopped = relaxed(stopped, {sincos: anywhere})

LANES = 64
"""Simulations in a block, whose states fit into the first-level cache [1]."""

_NAMES = SCENE.names or ()
_Numbers = NamedTuple("_Numbers", [(name, float) for name in _NAMES])  # type: ignore[misc]
"""The constants of a scene as values, so that a kernel need not read them again after each write to an array."""


def numbers_at(scenes: Array, b: int, j: int) -> Any:
    """Return the constants of a simulation's scene, by name."""
    return dict(zip(_NAMES, scenes[b, :, j].tolist(), strict=True))


@specialised(numbers_at)
def _compiled_numbers(scenes: Any, b: Any, j: Any) -> Any:
    values = ", ".join(f"scenes[b, {k}, j]" for k in range(len(_NAMES)))
    return eval(f"lambda scenes, b, j: _Numbers({values})", {"_Numbers": _Numbers})


@specialised(operator.getitem)
def _number(scene: Any, name: Any) -> Any:
    """Let compiled code read ``scene["M"]`` from a named tuple, too."""
    known = isinstance(scene, types.BaseNamedTuple) and getattr(scene, "instance_class", None) is _Numbers
    if not (known and isinstance(name, types.StringLiteral)):
        return None
    place = _NAMES.index(name.literal_value)
    return lambda scene, name: scene[place]


column_at = written("a, b, j, length", lambda _, __, ___, n: listed([f"a[b, {k}, j]" for k in range(n)]))
"""The state of one simulation in an array, as a tuple of a length that is a compile-time constant."""

_put = written("done, j, x", lambda _, __, n: "\n".join([*(f"done[{k}, j] = x[{k}]" for k in range(n)), "None"]))
"""Put a state into an array."""


@cache
def make_batch(PARTS: Parts, LENGTH: int, SEPARATE: bool) -> Callable[[Array, Array, Array, float], None]:
    """Compile a step of the classical Runge-Kutta method for many simulations of one kind of scene.

    - `SEPARATE`: each simulation has its own scene; otherwise all share one.

    Returns
    -------
    callable
        ``step(x, hands, scenes, h)`` advances the states, shape (blocks, `LENGTH`, `LANES`), with the polynomials of
        both drives during the step, shape (blocks, 8, `LANES`), the result of `scene_blocks`, and the step length [SI].
    """

    @fast
    def step(x: Any, hands: Any, scenes: Any, h: float) -> None:
        done = np.empty((LENGTH, LANES))
        shared = numbers_at(scenes, 0, 0)
        for b in range(len(x)):
            beyond = 0
            for j in range(LANES):
                scene = numbers_at(scenes, b, j) if SEPARATE else shared
                y = _short_step(column_at(x, b, j, LENGTH), h, column_at(hands, b, j, 8), 0, PARTS, scene)
                _put(done, j, _calm(_stopped(y, PARTS, scene)))
                beyond += 0 if y[3] == y[3] else 1
            if beyond > 0:
                for j in range(LANES):
                    scene = numbers_at(scenes, b, j) if SEPARATE else shared
                    y = _long_step(column_at(x, b, j, LENGTH), h, column_at(hands, b, j, 8), 0, PARTS, scene)
                    _put(done, j, _calm(_stopped(y, PARTS, scene)))
            for k in range(LENGTH):  # as one assignment it takes 0.7 ns more for each simulation
                for j in range(LANES):
                    x[b, k, j] = done[k, j]

    return step


def in_blocks(values: Array) -> Array:
    """Return the values of all simulations in blocks, shape (n / LANES, k, LANES), contiguous [SI]."""
    return np.ascontiguousarray(values.reshape(-1, LANES, values.shape[1]).transpose(0, 2, 1))


def out_of_blocks(blocks: Array) -> Array:
    """Return the values of all simulations from blocks: the inverse of `in_blocks`."""
    return np.ascontiguousarray(blocks.transpose(0, 2, 1)).reshape(-1, blocks.shape[1])


def scene_blocks(scenes: NDArray[Any]) -> Array:
    """Return the constants of scenes in blocks.

    - `scenes` (shape (n,)): one for each simulation, or one that all share.
    """
    values = np.ascontiguousarray(scenes).view(np.float64).reshape(len(scenes), -1)
    return in_blocks(values) if len(scenes) > 1 else values.reshape(1, -1, 1)
