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
from netboard.methods.phi import phi
from netboard.physics.hold import drives
from netboard.physics.linear import scene_matrix
from netboard.physics.models import rates
from netboard.physics.scene import Parts
from netboard.physics.vectors import State, joined, places, plus, speeds

_EVEN, _FIXED, _PAPER = 1, 2, 4
"""What is known of a scene, for the products: heave is apart; balls do not roll; they do not touch each other's motion."""


def _columns(row: int, length: int, known: int) -> list[int]:
    """Return which columns of a table can have something other than 0 to add to a row."""
    if known & _FIXED and row >= 4:
        return [row]
    if known & _EVEN:
        return list(range(2)) if row < 2 else list(range(2, length))
    return list(range(length))


def _kicked(row: int, length: int, known: int) -> list[int]:
    """Return which of them meet a rest N: those of rates that it changes."""
    if known & _FIXED:
        return [j for j in _columns(row, length, known) if j in (1, 3)]
    return [j for j in _columns(row, length, known) if j % 2 == 1]


def _pulled(row: int, length: int, known: int) -> list[int]:
    """Return which columns of A can have something other than 0 in a row of accelerations."""
    if known & _FIXED and row >= 4:
        return []
    if known & _PAPER and row >= 4:
        return [2]
    return [j for j in _columns(row, length, known) if j < 4 or j % 2 == 0]


def _term(tables: Any, k: int, i: int, j: int, x: State) -> float:
    return float(tables[0][tables[1], k, i, j]) * x[j]


def _times(tables: Any, k: int, x: State, known: int) -> State:
    """Return the product of table k and a state, each sum from the left."""
    results = []
    for i in range(len(x)):
        first, *others = _columns(i, len(x), known)
        result = _term(tables, k, i, first, x)
        for j in others:
            result += _term(tables, k, i, j, x)
        results.append(result)
    return tuple(results)


def _pushed(base: State, tables: Any, k: int, rest: State, known: int) -> State:
    """Return a state and the product of table k and a rest N, added from the left."""
    results = []
    for i, result in enumerate(base):
        for j in _kicked(i, len(base), known):
            result += _term(tables, k, i, j, rest)
        results.append(result)
    return tuple(results)


def _remainder(rate: State, tables: Any, x: State, known: int) -> State:
    """Return N: the accelerations less what A, table 0, makes of the state."""
    results = [0.0] * len(x)
    for i in range(1, len(x), 2):
        linear = 0.0
        for j in _pulled(i, len(x), known):
            linear += _term(tables, 0, i, j, x)
        results[i] = rate[i] - linear
    return tuple(results)


def _sum(k: object, row: int, columns: list[int], vector: str) -> str:
    """Write one row of a product."""
    return " + ".join(f"tables[0][tables[1], {k}, {row}, {j}] * {vector}[{j}]" for j in columns)


@specialised(_times)
def _write_times(tables: Any, k: Any, x: Any, known: Any) -> Any:
    n, flags = x.count, known.literal_value
    rows = [_sum("k", i, _columns(i, n, flags), "x") for i in range(n)]
    return eval(f"lambda tables, k, x, known: ({', '.join(rows)})")


@specialised(_pushed)
def _write_pushed(base: Any, tables: Any, k: Any, rest: Any, known: Any) -> Any:
    n, flags = base.count, known.literal_value
    sums = [_sum("k", i, _kicked(i, n, flags), "rest") for i in range(n)]
    rows = [f"base[{i}]" + (f" + {row}" if row else "") for i, row in enumerate(sums)]
    return eval(f"lambda base, tables, k, rest, known: ({', '.join(rows)})")


@specialised(_remainder)
def _write_remainder(rate: Any, tables: Any, x: Any, known: Any) -> Any:
    n, flags = x.count, known.literal_value
    rows = ["0.0"] * n
    for i in range(1, n, 2):
        columns = _pulled(i, n, flags)
        rows[i] = f"rate[{i}] - (" + (_sum(0, i, columns, "x") if columns else "0.0") + ")"
    return eval(f"lambda rate, tables, x, known: ({', '.join(rows)})")


@inlined
def times(tables: Any, k: int, x: State, parts: Parts) -> State:
    """Return the product of a table and a state."""
    if parts.even:
        if parts.free or not parts.loaded:
            return _times(tables, k, x, 1)
        return _times(tables, k, x, 3)
    if parts.free or not parts.loaded:
        return _times(tables, k, x, 0)
    return _times(tables, k, x, 2)


@inlined
def pushed(base: State, tables: Any, k: int, rest: State, parts: Parts) -> State:
    """Return a state and the product of a table and a rest N."""
    if parts.even:
        if parts.free or not parts.loaded:
            return _pushed(base, tables, k, rest, 1)
        return _pushed(base, tables, k, rest, 3)
    if parts.free or not parts.loaded:
        return _pushed(base, tables, k, rest, 0)
    return _pushed(base, tables, k, rest, 2)


@inlined
def remainder(x: State, left: float, right: float, tables: Any, parts: Parts, scene: Any) -> State:
    """Return N."""
    rate = rates(x, left, right, parts, scene)
    if parts.even:
        if not parts.lagrangian:
            return _remainder(rate, tables, x, 5)
        return _remainder(rate, tables, x, 1)
    return _remainder(rate, tables, x, 0)


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
    return np.stack([a, full[0], h * full[1], h * full[2]])


def etdrk4_tables(scene: Any, parts: Parts, length: int, h: float) -> NDArray[np.float64]:
    a = scene_matrix(parts, scene, length)
    half, full = phi(a, 0.5 * h, 2), phi(a, h, 3)
    return np.stack(
        [a, half[0], 0.5 * h * half[1], h * half[2], full[0], h * full[1], h * full[2], 4.0 * (h * full[3])]
    )


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
