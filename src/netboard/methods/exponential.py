"""One-step exponential methods: what is linear about the level board is solved exactly, the rest by a Runge-Kutta rule.

However stiff the couplings, they are bounded at every length of step. With ``x' = A x + N(x, t)``, A of
`netboard.physics.linear`, a method's tables are A and products of h and the functions phi_k (`netboard.methods.phi`).
N has accelerations only, so that only those columns of a table meet it; and on a board whose couplings are alike heave
does not meet the rest of A. `exact` is for boards that cannot tilt: there N depends on the hands alone.

Every step has the arguments of those of `netboard.methods.one_step`; the rules of `netboard.physics.models` hold here.
"""

from typing import Any

import numpy as np
from numba import types
from numpy.typing import NDArray

from netboard.compiled import inlined, specialised
from netboard.methods.lanes import gathered, lane, lanes_at
from netboard.methods.phi import phi
from netboard.physics.hold import drives
from netboard.physics.linear import scene_matrix
from netboard.physics.models import rates
from netboard.physics.scene import Parts
from netboard.physics.vectors import State, joined, places, plus, speeds

_EVEN, _FIXED, _PAPER = 1, 2, 4
"""What is known of a scene: heave moves apart from the rest; the balls are fixed; they weigh on the board, and no more."""


def _blocks(length: int, known: int) -> list[tuple[range, list[int]]]:
    """Return which rows of a table belong together, and which columns have something other than 0 for them."""
    rows = 4 if known & _FIXED else length
    columns = [j for j in range(length) if j < 4 or j % 2 == 0 or not known & _FIXED]
    if known & _EVEN:
        return [(range(2), columns[:2]), (range(2, rows), columns[2:])]
    return [(range(rows), columns)]


def _kicks(columns: list[int]) -> list[int]:
    """Return which columns meet a rest N: it changes rates alone."""
    return [j for j in columns if j % 2 == 1]


def _pulled(row: int, length: int, known: int) -> list[int]:
    """Return which columns of A have something other than 0 for an acceleration."""
    for rows, columns in _blocks(length, known):
        if row in rows:
            return [2] if known & _PAPER and row > 4 else [j for j in columns if j < 4 or j % 2 == 0]
    return []


def _times(tables: Any, k: int, x: State, known: int) -> State:
    """Return the product of table k and a state; each sum goes from the left to the right."""
    table = tables[0][tables[1], k]
    result = list(x)
    for rows, columns in _blocks(len(x), known):
        for i in rows:
            result[i] = float(table[columns[0], i]) * x[columns[0]]
            for j in columns[1:]:
                result[i] += float(table[j, i]) * x[j]
    return tuple(result)


def _pushed(base: State, tables: Any, k: int, rest: State, known: int) -> State:
    """Return a state and what table k makes of a rest N, added from the left to the right."""
    table = tables[0][tables[1], k]
    result = list(base)
    for rows, columns in _blocks(len(base), known):
        for i in rows:
            for j in _kicks(columns):
                result[i] += float(table[j, i]) * rest[j]
    return tuple(result)


def _left_over(rate: State, tables: Any, x: State, known: int) -> State:
    """Return N: the accelerations less what A, table 0, makes of the state; 0 in place of the rest of a rate."""
    a = tables[0][tables[1], 0]
    result = [0.0] * len(x)
    for i in range(1, len(x), 2):
        columns = _pulled(i, len(x), known)
        if columns:
            linear = float(a[columns[0], i]) * x[columns[0]]
            for j in columns[1:]:
                linear += float(a[j, i]) * x[j]
            result[i] = rate[i] - linear
    return tuple(result)


def _written(arguments: str, lines: list[str], results: list[str]) -> Any:
    """Make a function of its text."""
    text = [f"def written({arguments}):", *lines, f"return ({', '.join(results)},)"]
    known: dict[str, Any] = {"lanes_at": lanes_at, "lane": lane, "gathered": gathered}
    exec("\n    ".join(text), known)
    return known["written"]


def _sum(rows: range, columns: list[int], k: object, length: int, x: str, base: str = "") -> tuple[list[str], list[str]]:
    """Write the sums of some rows: lines, and where in them the results are. Three rows or more are done at once."""
    if len(rows) < 3:
        starts = [[base.replace("#", str(i))] if base else [] for i in rows]
        return [], [
            " + ".join(start + [f"tables[0][tables[1], {k}, {j}, {i}] * {x}[{j}]" for j in columns])
            for i, start in zip(rows, starts, strict=True)
        ]
    place = f"(tables[1] * tables[0].shape[1] + {k}) * {length * length} + {rows.start}"
    terms = [f"lanes_at(tables[0], {place} + {j * length}, {len(rows)}) * {x}[{j}]" for j in columns]
    if base:
        terms.insert(0, "gathered((" + ", ".join(base.replace("#", str(i)) for i in rows) + f"), {len(rows)})")
    return ["block = " + " + ".join(terms)], [f"lane(block, {i})" for i in range(len(rows))]


@specialised(_times)
def _write_times(tables: Any, k: Any, x: Any, known: Any) -> Any:
    n, lines, results = x.count, [], [f"x[{i}]" for i in range(x.count)]
    for rows, columns in _blocks(n, known.literal_value):
        more, results[rows.start : rows.stop] = _sum(rows, columns, "k", n, "x")
        lines += more
    return _written("tables, k, x, known", lines, results)


@specialised(_pushed)
def _write_pushed(base: Any, tables: Any, k: Any, rest: Any, known: Any) -> Any:
    n, lines, results = base.count, [], [f"base[{i}]" for i in range(base.count)]
    for rows, columns in _blocks(n, known.literal_value):
        more, results[rows.start : rows.stop] = _sum(rows, _kicks(columns), "k", n, "rest", "base[#]")
        lines += more
    return _written("base, tables, k, rest, known", lines, results)


@specialised(_left_over)
def _write_left_over(rate: Any, tables: Any, x: Any, known: Any) -> Any:
    n, results = x.count, ["0.0"] * x.count
    for i in range(1, n, 2):
        columns = _pulled(i, n, known.literal_value)
        if columns:
            results[i] = f"rate[{i}] - (" + _sum(range(i, i + 1), columns, 0, n, "x")[1][0] + ")"
    return _written("rate, tables, x, known", [], results)


@inlined
def times(tables: Any, k: int, x: State, parts: Parts) -> State:
    """Return the product of a table and a state."""
    fixed = parts.loaded and not parts.free
    if parts.even:
        return _times(tables, k, x, 3) if fixed else _times(tables, k, x, 1)
    return _times(tables, k, x, 2) if fixed else _times(tables, k, x, 0)


@inlined
def pushed(base: State, tables: Any, k: int, rest: State, parts: Parts) -> State:
    """Return a state and the product of a table and a rest N."""
    fixed = parts.loaded and not parts.free
    if parts.even:
        return _pushed(base, tables, k, rest, 3) if fixed else _pushed(base, tables, k, rest, 1)
    return _pushed(base, tables, k, rest, 2) if fixed else _pushed(base, tables, k, rest, 0)


@inlined
def remainder(x: State, left: float, right: float, tables: Any, parts: Parts, scene: Any) -> State:
    """Return N."""
    rate = rates(x, left, right, parts, scene)
    fixed = parts.loaded and not parts.free
    if fixed:
        return _left_over(rate, tables, x, 3) if parts.even else _left_over(rate, tables, x, 2)
    if parts.lagrangian:
        return _left_over(rate, tables, x, 1) if parts.even else _left_over(rate, tables, x, 0)
    return _left_over(rate, tables, x, 5) if parts.even else _left_over(rate, tables, x, 4)


@inlined
def etd2rk(x: State, h: float, hands: Any, tables: Any, parts: Parts, scene: Any) -> State:
    """Return the state after one step of the exponential Heun method, order 2 (S. M. Cox, P. C. Matthews, 2002)."""
    left, right = drives(hands, 0, 0.0)
    start = remainder(x, left, right, tables, parts, scene)
    end = pushed(times(tables, 1, x, parts), tables, 2, start, parts)
    left, right = drives(hands, 1, h)
    change = plus(remainder(end, left, right, tables, parts, scene), -1.0, start)
    return pushed(end, tables, 3, change, parts)


@inlined
def etdrk4(x: State, h: float, hands: Any, tables: Any, parts: Parts, scene: Any) -> State:
    """Return the state after one step of Krogstad's method, order 4."""
    half = 0.5 * h
    left, right = drives(hands, 0, 0.0)
    n1 = remainder(x, left, right, tables, parts, scene)
    x2 = pushed(times(tables, 1, x, parts), tables, 2, n1, parts)
    left, right = drives(hands, 1, half)
    n2 = remainder(x2, left, right, tables, parts, scene)
    x3 = pushed(x2, tables, 3, plus(n2, -1.0, n1), parts)
    n3 = remainder(x3, left, right, tables, parts, scene)
    base = pushed(times(tables, 4, x, parts), tables, 5, n1, parts)
    x4 = pushed(base, tables, 6, _scaled_difference(n3, n1), parts)
    left, right = drives(hands, 2, h)
    n4 = remainder(x4, left, right, tables, parts, scene)
    middle = plus(n2, 1.0, n3)
    bend = plus(plus(plus(middle, 1.0, middle), -3.0, n1), -1.0, n4)
    twist = plus(plus(n1, -1.0, middle), 1.0, n4)
    return pushed(pushed(base, tables, 6, bend, parts), tables, 7, twist, parts)


@inlined
def _scaled_difference(a: State, b: State) -> State:
    d = plus(a, -1.0, b)
    return plus(d, 1.0, d)


def etd2rk_tables(scene: Any, parts: Parts, length: int, h: float) -> NDArray[np.float64]:
    """Return A and, of the step's length, phi_0, h phi_1, h phi_2."""
    a = scene_matrix(parts, scene, length)
    full = phi(a, h, 2)
    return _by_columns(a, full[0], h * full[1], h * full[2])


def etdrk4_tables(scene: Any, parts: Parts, length: int, h: float) -> NDArray[np.float64]:
    a = scene_matrix(parts, scene, length)
    half, full = phi(a, 0.5 * h, 2), phi(a, h, 3)
    first = (a, half[0], 0.5 * h * half[1], h * half[2])
    return _by_columns(*first, full[0], h * full[1], h * full[2], 4.0 * (h * full[3]))


def _by_columns(*matrices: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return matrices of which a row of the array is a column, so that the processor can take it as it is."""
    return np.ascontiguousarray(np.array(matrices).transpose(0, 2, 1))


@inlined
def exact(x: State, h: float, hands: Any, tables: Any, parts: Parts, scene: Any) -> State:
    """Return the state after one step of a board that cannot tilt, without error for drives that are cubics of time.

    Parameters
    ----------
    x : tuple of float
        The state [SI].
    h : float
        Length of the step [s].
    hands : tuple
        The hands through the step, as `netboard.physics.hold.drives` takes them [N].
    tables : tuple of ndarray of float64, shape (kinds, 1, 2, 11), and int
        Tables by `exact_tables`, and which of them are for this length of step.
    parts : Parts
        What the scene has; a constant at the call.
    scene : SCENE record
        Not used.

    Returns
    -------
    tuple of float
        The state at the end of the step [SI].
    """
    by, s0, s1, s2, s3 = _both(hands)
    z = _row(tables[0], tables[1], 0, by, s0, s1, s2, s3) + _flow(tables[0], tables[1], 0, x[0], x[1])
    vz = _row(tables[0], tables[1], 1, by, s0, s1, s2, s3) + _flow(tables[0], tables[1], 1, x[0], x[1])
    p = plus(places(x), h, speeds(x)) if parts.free else places(x)
    return joined(z, vz, x[2], x[3], p, speeds(x))


@inlined
def _row(table: Any, kind: int, row: int, by: int, s0: float, s1: float, s2: float, s3: float) -> float:
    """Return what weight and hands add to a row."""
    w0, w1 = table[kind, 0, row, by] * s0, table[kind, 0, row, by + 1] * s1
    w2, w3 = table[kind, 0, row, by + 2] * s2, table[kind, 0, row, by + 3] * s3
    return table[kind, 0, row, 2] + (w0 + w1 + w2 + w3)


@inlined
def _flow(table: Any, kind: int, row: int, z: float, vz: float) -> float:
    """Return what the state adds to a row."""
    return table[kind, 0, row, 0] * z + table[kind, 0, row, 1] * vz


def _both(hands: Any) -> tuple[int, float, float, float, float]:
    """Return the first column of what the drives are multiplied with, and both hands' coefficients or values added."""
    if len(hands) == 8:
        return 3, hands[0] + hands[4], hands[1] + hands[5], hands[2] + hands[6], hands[3] + hands[7]
    values = hands[0][hands[1]]
    return 7, *[float(values[node, 0] + values[node, 1]) for node in range(4)]


@specialised(_both)
def _write_both(hands: Any) -> Any:
    if isinstance(hands, types.UniTuple):
        return lambda hands: (3, hands[0] + hands[4], hands[1] + hands[5], hands[2] + hands[6], hands[3] + hands[7])
    sums = ", ".join(f"hands[0][hands[1], {node}, 0] + hands[0][hands[1], {node}, 1]" for node in range(4))
    return eval(f"lambda hands: (7, {sums})")


def exact_tables(scene: Any, parts: Parts, length: int, h: float) -> NDArray[np.float64]:
    """Return what `exact` multiplies its state, 1, the drives' coefficients, and their values at its nodes with."""
    if parts.tilts:
        raise ValueError("a board that tilts is not linear: it has no exact step")
    rest = (0.0,) * length
    weightless = scene.copy()
    weightless["g"] = 0.0
    load = rates(rest, 0.0, 0.0, parts, scene)[1]
    answer = rates(rest, 1.0, 0.0, parts, weightless)[1]
    phis = phi(np.ascontiguousarray(scene_matrix(parts, scene, length)[:2, :2]), h, 4)
    # Integrals of e^((h - t) A) (t / h)^k, by a unit drive; of t^k; and of the four cubics that are 1 at one node each.
    powers = [answer * (h * (factor * phis[k + 1][:, 1])) for k, factor in enumerate((1.0, 1.0, 2.0, 6.0))]
    times = [powers[0], h * powers[1], h * h * powers[2], h * h * h * powers[3]]
    nodes = [
        powers[0] - 5.5 * powers[1] + 9.0 * powers[2] - 4.5 * powers[3],
        9.0 * powers[1] - 22.5 * powers[2] + 13.5 * powers[3],
        -4.5 * powers[1] + 18.0 * powers[2] - 13.5 * powers[3],
        powers[1] - 4.5 * powers[2] + 4.5 * powers[3],
    ]
    columns = [phis[0][:, 0], phis[0][:, 1], load * (h * phis[1][:, 1]), *times, *nodes]
    return np.stack(columns, axis=1)[np.newaxis]
