"""Semilinear form of the scene, ``x' = A x + N(x, t)``, and products of matrices with states and with N.

A is the linearisation about the level board (`netboard.physics.scene.linear`). N has accelerations only, so products
with it use few columns; with equal couplings, heave is decoupled in A. Products skip elements that are known to be 0. A
table is a matrix stored by columns, for vector instructions: tables are an array of shape (kinds, k, n, n) and the
index of the kind. Table 0 is A.

The rules of `netboard.physics.scene.models` hold here.
"""

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from netboard.base.compiled import inlined
from netboard.physics.arithmetic.vectors import State, alike, joined, places, plus, speeds, total
from netboard.physics.arithmetic.written import listed, written
from netboard.physics.scene.models import friction, rates, turned
from netboard.physics.scene.parameters import Parts

StepTables = tuple[NDArray[np.float64], int]
"""Tables of a method for each step size, and the index of the current one."""

EVEN, FIXED, PAPER = 1, 2, 4
"""Flags of the structure: heave is decoupled; balls are fixed; the paper's equations without friction."""

_EVEN_FIXED = EVEN | FIXED


def known_of(parts: Parts) -> int:
    """Return the structure flags of a scene: the sum of `EVEN`, `FIXED` and `PAPER` where they apply [1]."""
    return (
        EVEN * parts.even
        + FIXED * (parts.loaded and not parts.free)
        + PAPER * (not parts.lagrangian and not parts.resisted)
    )


def _blocks(length: int, known: int) -> list[tuple[range, list[int]]]:
    """Return the diagonal blocks of a matrix: their rows, and their columns that are not 0."""
    rows = range(4 if known & FIXED else length)
    columns = [j for j in range(length) if j < 4 or j % 2 == 0 or not known & FIXED]
    if known & EVEN:
        return [(rows[:2], columns[:2]), (rows[2:], columns[2:])]
    return [(rows, columns)]


def _kicks(columns: list[int]) -> list[int]:
    """Return the columns that multiply N, those of rates; the tilt's is computed last, and comes last."""
    return sorted((j for j in columns if j % 2 == 1), key=lambda j: (j == 3, j))


def columns_of(row: int, length: int, known: int) -> list[int]:
    """Return the columns of a matrix that are not 0 in a row; none for a fixed ball [1]."""
    return [j for rows, columns in _blocks(length, known) if row in rows for j in columns]


def kicked_rows(length: int, known: int) -> list[int]:
    """Return the rows in which N is not 0, the tilt's last [1]."""
    return _kicks([j for _, columns in _blocks(length, known) for j in columns])


def needed_rows(length: int, known: int) -> list[int]:
    """Return the rows of a state on which N depends, ascending [1].

    In the paper's model without friction, N is independent of the speeds of balls, and with equal couplings of the
    heave. Fixed balls have no rows.
    """
    rows = [i for block, _ in _blocks(length, known) for i in block]
    if known & PAPER:
        rows = [i for i in rows if i < 4 or i % 2 == 0]
        if known & EVEN:
            rows = [i for i in rows if i > 1]
    return rows


def _write_sums(length: int, known: int, vector: str, kicks: bool, start: str) -> str:
    """Write the code of a matrix product: for each row the sum of its products, from the left, after an optional start.

    Blocks of three or more rows are vectorised; rows of fixed balls are unchanged.
    """
    lines, results = [], [f"{start or vector}[{i}]" for i in range(length)]
    for number, (rows, every) in enumerate(_blocks(length, known)):
        columns = _kicks(every) if kicks else every
        if len(rows) < 3:
            for i in rows:
                terms = [f"tables[0][tables[1], k, {j}, {i}] * {vector}[{j}]" for j in columns]
                results[i] = " + ".join([results[i], *terms] if start else terms)
            continue
        first = f"(tables[1] * tables[0].shape[1] + k) * {length * length} + {rows[0]}"
        terms = [f"lanes_at(tables[0], {first} + {j * length}, {len(rows)}) * {vector}[{j}]" for j in columns]
        if start:
            terms.insert(0, f"gathered({listed([results[i] for i in rows])}, {len(rows)})")
        lines.append(f"block{number} = " + " + ".join(terms))
        results[rows.start : rows.stop] = [f"lane(block{number}, {i})" for i in range(len(rows))]
    return "\n".join([*lines, listed(results)])


def _write_left_over(n: int, _: int, __: int, known: int) -> str:
    """Write the code of the accelerations less A x; A has zero columns for the speeds of balls."""
    results = ["0.0"] * n
    for i in kicked_rows(n, known):
        columns = [j for j in columns_of(i, n, known) if j < 4 or j % 2 == 0]
        terms = [f"tables[0][tables[1], 0, {j}, {i}] * x[{j}]" for j in columns]
        results[i] = f"rate[{i}] - ({' + '.join(terms)})"
    return listed(results)


_times: Callable[..., State] = written(
    "x, tables, k, known", lambda n, _, __, known: _write_sums(n, known, "x", False, "")
)
_pushed: Callable[..., State] = written(
    "x, tables, k, rest, known", lambda n, _, __, ___, known: _write_sums(n, known, "rest", True, "x")
)
_left_over: Callable[..., State] = written("rate, x, tables, known", _write_left_over)


@inlined
def times(x: State, tables: StepTables, k: int, parts: Parts) -> State:
    """Return the product of table k and a state."""
    if parts.loaded and not parts.free:
        return _times(x, tables, k, _EVEN_FIXED) if parts.even else _times(x, tables, k, FIXED)
    return _times(x, tables, k, EVEN) if parts.even else _times(x, tables, k, 0)


@inlined
def pushed(x: State, tables: StepTables, k: int, rest: State, parts: Parts) -> State:
    """Return the sum of a state and the product of table k and N.

    Parameters
    ----------
    rest : tuple of float
        N, or a sum of values of N [SI].
    """
    if parts.loaded and not parts.free:
        return _pushed(x, tables, k, rest, _EVEN_FIXED) if parts.even else _pushed(x, tables, k, rest, FIXED)
    return _pushed(x, tables, k, rest, EVEN) if parts.even else _pushed(x, tables, k, rest, 0)


@inlined
def _paper_remainder(x: State, left: float, right: float, tables: StepTables, parts: Parts, scene: np.void) -> State:
    """Return N of the paper's equations; coefficients from A leave few operations after sine and cosine."""
    a, kind, p = tables[0], tables[1], places(x)
    s, c = turned(x[2], parts)
    az, ao = 0.0, 0.0
    if parts.heaves:
        az = ((left + right) - scene["M"] * scene["g"]) * (1.0 / scene["M"])
        if parts.loaded:
            weight = scene["m"] * scene["g"]
            if not parts.free:
                weight *= scene["fixed_load"]
            az -= len(p) * weight * (1.0 / scene["M"]) * (c * c)
        if parts.tilts and not parts.even:
            az += a[kind, 0, 2, 1] * (s - x[2]) + a[kind, 0, 3, 1] * (x[3] * c - x[3])
    if parts.tilts:
        # In the equations, torques of springs, dampers and weights have the factor cosine; in A they have none.
        held = 0.0
        if parts.loaded:
            held = a[kind, 0, 4, 3] * total(p)
        if not parts.even:
            held += a[kind, 0, 0, 3] * x[0] + a[kind, 0, 1, 3] * x[1]
        damper = a[kind, 0, 3, 3]
        if parts.damped:
            damper += scene["b_theta"] * (1.0 / scene["I"])
        brake = damper * x[3]
        turn = scene["l"] * (1.0 / scene["I"]) * (right - left) + held
        ao = (turn + a[kind, 0, 2, 3] * s + brake * c) * c - (held + (a[kind, 0, 2, 3] * x[2] + brake))
    if parts.free:
        ap = alike(scene["ball_gravity"] * (s - x[2]), p)
        if parts.resisted:
            drag = friction(speeds(x), scene["m"] * scene["g"] * abs(c), parts, scene)
            ap = plus(ap, -scene["mass_ratio"] * (1.0 / scene["m"]), drag)
        return joined(0.0, az, 0.0, ao, alike(0.0, p), ap)
    return joined(0.0, az, 0.0, ao, alike(0.0, p), alike(0.0, p))


@inlined
def remainder(x: State, left: float, right: float, tables: StepTables, parts: Parts, scene: np.void) -> State:
    """Return N, the accelerations less A x; 0 except in rows of accelerations."""
    if not parts.lagrangian:
        return _paper_remainder(x, left, right, tables, parts, scene)
    rate = rates(x, left, right, parts, scene)
    if parts.loaded and not parts.free:
        return _left_over(rate, x, tables, _EVEN_FIXED) if parts.even else _left_over(rate, x, tables, FIXED)
    return _left_over(rate, x, tables, EVEN) if parts.even else _left_over(rate, x, tables, 0)
