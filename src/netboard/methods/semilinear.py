"""A scene split into what is linear about the level board and the rest: ``x' = A x + N(x, t)``, and products with both.

A is that of `netboard.physics.linear`. N has accelerations only, so that only some columns of a matrix meet it; and on a
board whose couplings are alike heave does not meet the rest of A. What is known to be 0 is left out of every product.
A matrix here is a table: an array of shape (kinds, k, n, n) whose rows are the matrix's columns, so that the processor
takes three or more sums at once, and the number of the kind. Table 0 of every method is A.

The rules of `netboard.physics.models` hold here.
"""

from typing import Any

from netboard.compiled import inlined, specialised
from netboard.methods.lanes import gathered, lane, lanes_at
from netboard.physics.models import rates, turned
from netboard.physics.scene import Parts
from netboard.physics.vectors import State, alike, joined, places, total

EVEN, FIXED, PAPER = 1, 2, 4
"""What is known of a scene: heave moves apart from the rest; the balls are fixed; they weigh on the board, and no more."""


def blocks(length: int, known: int) -> list[tuple[range, list[int]]]:
    """Return which rows of a table belong together, and which columns have something other than 0 for them."""
    rows = 4 if known & FIXED else length
    columns = [j for j in range(length) if j < 4 or j % 2 == 0 or not known & FIXED]
    if known & EVEN:
        return [(range(2), columns[:2]), (range(2, rows), columns[2:])]
    return [(range(rows), columns)]


def kicks(columns: list[int]) -> list[int]:
    """Return which columns meet a rest N: it changes rates alone. That of the tilt's is known last, and comes last."""
    return [j for j in columns if j % 2 == 1 and j > 4] + [j for j in columns if j in (1, 3)]


def _pulled(row: int, length: int, known: int) -> list[int]:
    """Return which columns of A have something other than 0 for an acceleration."""
    for rows, columns in blocks(length, known):
        if row in rows:
            return [2] if known & PAPER and row > 4 else [j for j in columns if j < 4 or j % 2 == 0]
    return []


def known_of(parts: Parts) -> int:
    """Return what is known of a scene."""
    return EVEN * parts.even + FIXED * (parts.loaded and not parts.free) + PAPER * (not parts.lagrangian)


def columns_of(row: int, length: int, known: int) -> list[int]:
    """Return which columns have something other than 0 for a row; none for a ball that is fixed."""
    return [j for rows, columns in blocks(length, known) for j in columns if row in rows]


def kicked_rows(length: int, known: int) -> list[int]:
    """Return in which rows N can be something other than 0."""
    return sorted(j for _, columns in blocks(length, known) for j in kicks(columns))


def needed_rows(length: int, known: int) -> list[int]:
    """Return on which rows of a state N depends.

    By the paper, not on how fast balls roll, nor, on an even board, on its heave. Balls that are fixed do not count.
    """
    rows = [i for block, _ in blocks(length, known) for i in block]
    if known & PAPER:
        rows = [i for i in rows if i < 4 or i % 2 == 0]
        if known & EVEN:
            rows = [i for i in rows if i > 1]
    return rows


def _times(tables: Any, k: int, x: State, known: int) -> State:
    """Return the product of table k and a state; each sum goes from the left to the right."""
    table = tables[0][tables[1], k]
    result = list(x)
    for rows, columns in blocks(len(x), known):
        for i in rows:
            result[i] = float(table[columns[0], i]) * x[columns[0]]
            for j in columns[1:]:
                result[i] += float(table[j, i]) * x[j]
    return tuple(result)


def _pushed(base: State, tables: Any, k: int, rest: State, known: int) -> State:
    """Return a state and what table k makes of a rest N, added from the left to the right."""
    table = tables[0][tables[1], k]
    result = list(base)
    for rows, columns in blocks(len(base), known):
        for i in rows:
            for j in kicks(columns):
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
    for rows, columns in blocks(n, known.literal_value):
        more, results[rows.start : rows.stop] = _sum(rows, columns, "k", n, "x")
        lines += more
    return _written("tables, k, x, known", lines, results)


@specialised(_pushed)
def _write_pushed(base: Any, tables: Any, k: Any, rest: Any, known: Any) -> Any:
    n, lines, results = base.count, [], [f"base[{i}]" for i in range(base.count)]
    for rows, columns in blocks(n, known.literal_value):
        more, results[rows.start : rows.stop] = _sum(rows, kicks(columns), "k", n, "rest", "base[#]")
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
def _paper_remainder(x: State, left: float, right: float, tables: Any, parts: Parts, scene: Any) -> State:
    """Return N of the paper's equations, with as little to do as can be once sine and cosine are known."""
    a, kind, p = tables[0], tables[1], places(x)
    s, c = turned(x[2], parts)
    az, ao = 0.0, 0.0
    if parts.heaves:
        az = ((left + right) - scene["M"] * scene["g"]) * (1.0 / scene["M"])
        if parts.loaded:
            weight = scene["m"] * scene["g"]
            if not parts.free:
                weight *= scene["fixed_load"]
            az -= (len(p) * weight * (1.0 / scene["M"])) * (c * c)
        if parts.tilts and not parts.even:
            az += a[kind, 0, 2, 1] * (s - x[2]) + a[kind, 0, 3, 1] * (x[3] * c - x[3])
    if parts.tilts:
        turn = scene["l"] * (1.0 / scene["I"]) * (right - left)
        held = 0.0
        if parts.loaded:
            held = a[kind, 0, 4, 3] * total(p)
        if not parts.even:
            held += a[kind, 0, 0, 3] * x[0] + a[kind, 0, 1, 3] * x[1]
        spin = a[kind, 0, 3, 3]
        if parts.damped:
            spin += scene["b_theta"] * (1.0 / scene["I"])
        spin *= x[3]
        linear = held + (a[kind, 0, 2, 3] * x[2] + spin)
        ao = ((turn + held) + a[kind, 0, 2, 3] * s + spin * c) * c - linear
    if parts.free:
        return joined(0.0, az, 0.0, ao, alike(0.0, p), alike(scene["ball_gravity"] * (s - x[2]), p))
    return joined(0.0, az, 0.0, ao, alike(0.0, p), alike(0.0, p))


@inlined
def remainder(x: State, left: float, right: float, tables: Any, parts: Parts, scene: Any) -> State:
    """Return N."""
    if not parts.lagrangian:
        return _paper_remainder(x, left, right, tables, parts, scene)
    rate = rates(x, left, right, parts, scene)
    fixed = parts.loaded and not parts.free
    if fixed:
        return _left_over(rate, tables, x, 3) if parts.even else _left_over(rate, tables, x, 2)
    return _left_over(rate, tables, x, 1) if parts.even else _left_over(rate, tables, x, 0)


