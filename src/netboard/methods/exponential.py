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
from netboard.physics.vectors import State

_EVEN, _KICKED, _FIXED = 1, 2, 4
"""What is known of a product: heave is apart; the vector is a rest N; balls do not roll."""


def _columns(row: int, length: int, known: int) -> list[int]:
    """Return which columns of a table can have something other than 0 to add to a row."""
    if known & _FIXED and row >= 4:
        return [] if known & _KICKED else [row]
    columns = range(length)
    if known & _EVEN:
        columns = range(2) if row < 2 else range(2, length)
    return [j for j in columns if not known & _KICKED or (j % 2 == 1 and not (known & _FIXED and j > 4))]


def _times(tables: Any, k: int, x: State, known: int) -> State:
    """Return the product of table k and a state, each sum from the left."""
    table = tables[0][tables[1], k]
    results = []
    for i in range(len(x)):
        first, *others = _columns(i, len(x), known)
        result = table[i, first] * x[first]
        for j in others:
            result = result + table[i, j] * x[j]
        results.append(float(result))
    return tuple(results)


def _pushed(base: State, tables: Any, k: int, rest: State, known: int) -> State:
    """Return a state and the product of table k and a rest N, added from the left."""
    table = tables[0][tables[1], k]
    results = []
    for i in range(len(base)):
        result = base[i]
        for j in _columns(i, len(base), known | _KICKED):
            result = result + table[i, j] * rest[j]
        results.append(float(result))
    return tuple(results)


def _sum(row: int, length: int, known: int, vector: str) -> str:
    """Write one row of a product."""
    return " + ".join(
        f"tables[0][tables[1], k, {row}, {j}] * {vector}[{j}]" for j in _columns(row, length, known)
    )


@specialised(_times)
def _write_times(tables: Any, k: Any, x: Any, known: Any) -> Any:
    rows = [_sum(i, x.count, known.literal_value, "x") for i in range(x.count)]
    return eval(f"lambda tables, k, x, known: ({', '.join(rows)})")


@specialised(_pushed)
def _write_pushed(base: Any, tables: Any, k: Any, rest: Any, known: Any) -> Any:
    sums = [_sum(i, base.count, known.literal_value | _KICKED, "rest") for i in range(base.count)]
    rows = [f"base[{i}]" + (f" + {row}" if row else "") for i, row in enumerate(sums)]
    return eval(f"lambda base, tables, k, rest, known: ({', '.join(rows)})")
