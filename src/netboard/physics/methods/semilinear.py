"""A scene split into what is linear about the level board and the rest: ``x' = A x + N(x, t)``, and products with both.

A is that of `netboard.physics.scene.linear`. N has accelerations only, so that only some columns of a matrix meet it;
and on a board whose couplings are alike heave does not meet the rest of A. What is known to be 0 is left out of every
product. A table is a matrix by its columns, so that the processor does three sums or more at once: tables are an array
of shape (kinds, k, n, n) and the number of the kind. Table 0 is A.

The rules of `netboard.physics.scene.models` hold here.
"""

from collections.abc import Callable
from typing import Any

from netboard.base.compiled import inlined
from netboard.physics.arithmetic.simd import listed, written
from netboard.physics.arithmetic.vectors import State, alike, joined, places, plus, speeds, total
from netboard.physics.scene.models import friction, rates, turned
from netboard.physics.scene.parameters import Parts

EVEN, FIXED, PAPER = 1, 2, 4
"""What is known of a scene: heave moves apart from the rest; balls are fixed; the paper's equations, no friction."""

_EVEN_FIXED = EVEN | FIXED


def known_of(parts: Parts) -> int:
    """Return what is known of a scene.

    Parameters
    ----------
    parts : Parts
        Structure of the scene.

    Returns
    -------
    int
        Sum of `EVEN`, `FIXED` and `PAPER`, each if it is so [1].
    """
    return (
        EVEN * parts.even
        + FIXED * (parts.loaded and not parts.free)
        + PAPER * (not parts.lagrangian and not parts.resisted)
    )


def _blocks(length: int, known: int) -> list[tuple[range, list[int]]]:
    """Return which rows of a matrix belong together, and which columns have something other than 0 for them."""
    rows = range(4 if known & FIXED else length)
    columns = [j for j in range(length) if j < 4 or j % 2 == 0 or not known & FIXED]
    if known & EVEN:
        return [(rows[:2], columns[:2]), (rows[2:], columns[2:])]
    return [(rows, columns)]


def _kicks(columns: list[int]) -> list[int]:
    """Return which columns meet N: it changes rates. That of the tilt's rate is known last, and comes last."""
    return sorted((j for j in columns if j % 2 == 1), key=lambda j: (j == 3, j))


def columns_of(row: int, length: int, known: int) -> list[int]:
    """Return which columns of a matrix have something other than 0 for a row.

    Parameters
    ----------
    row : int
        The row [1].
    length : int
        Length of a state [1].
    known : int
        What is known of the scene (`known_of`) [1].

    Returns
    -------
    list of int
        The columns; none for a ball that is fixed [1].
    """
    return [j for rows, columns in _blocks(length, known) if row in rows for j in columns]


def kicked_rows(length: int, known: int) -> list[int]:
    """Return in which rows N can be something other than 0.

    Parameters
    ----------
    length : int
        Length of a state [1].
    known : int
        What is known of the scene (`known_of`) [1].

    Returns
    -------
    list of int
        The rows, the tilt's last [1].
    """
    return _kicks([j for _, columns in _blocks(length, known) for j in columns])


def needed_rows(length: int, known: int) -> list[int]:
    """Return on which rows of a state N depends.

    By the paper, not on how fast balls roll, nor, on an even board, on its heave. Balls that are fixed do not count.

    Parameters
    ----------
    length : int
        Length of a state [1].
    known : int
        What is known of the scene (`known_of`) [1].

    Returns
    -------
    list of int
        The rows, rising [1].
    """
    rows = [i for block, _ in _blocks(length, known) for i in block]
    if known & PAPER:
        rows = [i for i in rows if i < 4 or i % 2 == 0]
        if known & EVEN:
            rows = [i for i in rows if i > 1]
    return rows


def _write_sums(length: int, known: int, vector: str, kicks: bool, start: str) -> str:
    """Write a state: of each row the sum of its products, from the left, after a start if there is one.

    Three rows or more are done at once; rows of balls that are fixed stay as they are.
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
    """Write accelerations less what A makes of the state; speeds of balls have no part in that."""
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
def times(x: State, tables: Any, k: int, parts: Parts) -> State:
    """Return the product of a table and a state.

    Parameters
    ----------
    x : tuple of float
        The state [SI].
    tables : tuple of ndarray of float64, shape (kinds, k, n, n), and int
        Tables, and which kind of them.
    k : int
        Number of the table [1].
    parts : Parts
        Structure of the scene; a compile-time constant.

    Returns
    -------
    tuple of float
        As long as the state [SI].
    """
    if parts.loaded and not parts.free:
        return _times(x, tables, k, _EVEN_FIXED) if parts.even else _times(x, tables, k, FIXED)
    return _times(x, tables, k, EVEN) if parts.even else _times(x, tables, k, 0)


@inlined
def pushed(x: State, tables: Any, k: int, rest: State, parts: Parts) -> State:
    """Return a state and the product of a table and N.

    Parameters
    ----------
    x : tuple of float
        The state [SI].
    tables : tuple of ndarray of float64, shape (kinds, k, n, n), and int
        Tables, and which kind of them.
    k : int
        Number of the table [1].
    rest : tuple of float
        N, or a sum of such [SI].
    parts : Parts
        Structure of the scene; a compile-time constant.

    Returns
    -------
    tuple of float
        As long as the state [SI].
    """
    if parts.loaded and not parts.free:
        return _pushed(x, tables, k, rest, _EVEN_FIXED) if parts.even else _pushed(x, tables, k, rest, FIXED)
    return _pushed(x, tables, k, rest, EVEN) if parts.even else _pushed(x, tables, k, rest, 0)


@inlined
def _paper_remainder(x: State, left: float, right: float, tables: Any, parts: Parts, scene: Any) -> State:
    """Return N of the paper's equations, with A for their coefficients: little is left to do after sine and cosine."""
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
        # As in the equations, springs, dampers and weights turn the board by their share of the cosine; in A, by all.
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
            ap = plus(ap, -scene["ease"] * (1.0 / scene["m"]), drag)
        return joined(0.0, az, 0.0, ao, alike(0.0, p), ap)
    return joined(0.0, az, 0.0, ao, alike(0.0, p), alike(0.0, p))


@inlined
def remainder(x: State, left: float, right: float, tables: Any, parts: Parts, scene: Any) -> State:
    """Return N, the accelerations less what A makes of the state.

    Parameters
    ----------
    x : tuple of float
        The state [SI].
    left, right : float
        Drives of the hands [N].
    tables : tuple of ndarray of float64, shape (kinds, k, n, n), and int
        Tables, of which the first is A, and which kind of them.
    parts : Parts
        Structure of the scene; a compile-time constant.
    scene : SCENE record
        The scene.

    Returns
    -------
    tuple of float
        As long as the state; 0 but in the rows of accelerations [SI].
    """
    if not parts.lagrangian:
        return _paper_remainder(x, left, right, tables, parts, scene)
    rate = rates(x, left, right, parts, scene)
    if parts.loaded and not parts.free:
        return _left_over(rate, x, tables, _EVEN_FIXED) if parts.even else _left_over(rate, x, tables, FIXED)
    return _left_over(rate, x, tables, EVEN) if parts.even else _left_over(rate, x, tables, 0)
