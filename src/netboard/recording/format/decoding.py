"""Compiled decoder of batches: joins the byte planes of some columns of a batch, and adds the predictions to them.

The text of the kernel that predicts is made from `PREDICTIONS`, so each expression is written once: there. It computes
what `netboard.recording.format.predictions.predict` computes, to the bit, in one pass over the ticks for each
expression, while all columns of the batch are in a core's cache. Files with other predictions than this version's do
not come here.
"""

import ast
from collections.abc import Callable
from threading import local
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from netboard.base.compiled import Words, kernel, waiting
from netboard.base.tick import TICK
from netboard.recording.format.predictions import CONSTANTS, PREDICTIONS, kinds_of_values

MARGIN = 2
"""Zeros before and after each column: predictions use at most the second next tick [1]."""

MOST = 1024
"""Most ticks of a batch that the compiled decoder takes; by default a batch has 550 at most [1]."""

SLOT = MOST + 2 * MARGIN
"""Words of scratch memory for each column or intermediate value: no power of two, so that they share a cache [1]."""

SLOTS = {name: place for place, name in enumerate(dict.fromkeys((*(TICK.names or ()), *PREDICTIONS)))}
"""Place in the scratch memory of each column, and of each intermediate value of the predictions."""

_NEIGHBOURS = {"before": -1, "after": 1}


class _AtTick(ast.NodeTransformer):
    """Turns an expression of columns into that of their values at tick k, in the scratch memory."""

    def __init__(self, kinds: dict[str, str]) -> None:
        self._kinds, self._shift = kinds, 0

    def visit_Name(self, node: ast.Name) -> ast.expr:
        """Return the value of a column at the tick, or a constant."""
        if node.id in CONSTANTS:
            return node
        word = f"words[{SLOTS[node.id] * SLOT + MARGIN + self._shift} + k]"
        return _parsed(f"np.int64({word}).view(np.float64)" if self._kinds[node.id] == "f" else word)

    def visit_Call(self, node: ast.Call) -> ast.expr:
        """Return a choice of two values, or the value at a neighbouring tick."""
        if isinstance(node.func, ast.Attribute):  # np.where
            test, here, other = map(self.visit, node.args)
            return ast.IfExp(test, here, other)
        step = _NEIGHBOURS[ast.unparse(node.func)]
        if self._shift * step < 0 or abs(self._shift + step) > MARGIN:
            raise ValueError(f"the compiled decoder cannot look both ways, or so far: {ast.unparse(node)}")
        self._shift += step
        found: ast.expr = self.visit(node.args[0])
        self._shift -= step
        return found


def _parsed(text: str) -> ast.expr:
    return ast.parse(text, mode="eval").body


def _text() -> str:
    """Return the text of the kernel that evaluates the wanted predictions in a batch."""
    kinds = kinds_of_values()
    lines = ["def add_predictions(words, wanted, constants, count):"]
    lines += [f"    {name} = constants[{place}]" for place, name in enumerate(CONSTANTS)]
    for place, (name, text) in enumerate(PREDICTIONS.items()):
        value = ast.unparse(_AtTick(kinds).visit(_parsed(text)))
        stored, start = name in (TICK.names or ()), SLOTS[name] * SLOT + MARGIN
        lines += [f"    if wanted[{place}]:", "        for k in range(count):", f"            value = {value}"]
        if kinds[name] == "f":
            lines += ["            value = value if np.isfinite(value) else 0.0"] if stored else []
            lines += ["            value = np.float64(value).view(np.int64)"]
        lines += [f"            words[{start} + k] {'+=' if stored else '='} value"]
    return "\n".join(lines)


def _made() -> Callable[[Words, NDArray[np.bool_], NDArray[np.float64], int], None]:
    """Compile that text. The kernel cache finds it by this file, and by the table in the version of the source."""
    scope = {"np": np, "__name__": __name__}
    exec(compile(_text(), __file__, "exec"), scope)
    return kernel(scope["add_predictions"])  # type: ignore[arg-type]


_add_predictions = _made()


class Wanted(NamedTuple):
    """Columns to decode.

    - `places`, `orders`, `slots`: of each column to read, its place in the file, how often it was differenced, and its
      place among `SLOTS`.
    - `predicted`: whether each of `PREDICTIONS` is needed.
    - `outputs`: the slots that are returned.
    """

    places: NDArray[np.int64]
    orders: NDArray[np.int64]
    slots: NDArray[np.int64]
    predicted: NDArray[np.bool_]
    outputs: NDArray[np.int64]


class _Scratch(local):
    """Memory of each thread for the values of a batch; the margin before each column stays zero."""

    def __init__(self) -> None:
        self.words = np.zeros(len(SLOTS) * SLOT, np.int64)


scratch = _Scratch()


@waiting
def decode_batch(
    planes: NDArray[np.uint8],
    wanted: Wanted,
    constants: NDArray[np.float64],
    words: Words,
    columns: NDArray[np.int64],
    first: int,
) -> None:
    """Decode some columns of a folded batch of at most `MOST` ticks.

    - `planes`: shape (columns of the file, 8, n).
    - `words`: memory of `scratch`.
    - `columns`: where the outputs are written from `first` on, shape (outputs, m).
    """
    count = planes.shape[2]
    for c in range(len(wanted.places)):
        start = wanted.slots[c] * SLOT + MARGIN
        join_planes(planes[wanted.places[c]], words[start : start + count], wanted.orders[c])
    for after in range(MARGIN + count, len(words), SLOT):
        words[after : after + MARGIN] = 0
    _add_predictions(words, wanted.predicted, constants, count)
    for j in range(len(wanted.outputs)):
        start = wanted.outputs[j] * SLOT + MARGIN
        columns[j, first : first + count] = words[start : start + count]


@kernel
def join_planes(p: NDArray[np.uint8], column: NDArray[np.int64], order: int) -> None:
    """Join the byte planes of a column, unfold the signs, and undo the differences."""
    b0, b1, b2, b3, b4, b5, b6, b7 = p[0], p[1], p[2], p[3], p[4], p[5], p[6], p[7]
    count = len(column)
    for k in range(count):
        # Written out, so that the compiler joins several words at a time.
        word = np.uint64(b0[k]) | np.uint64(b1[k]) << np.uint64(8)
        word |= np.uint64(b2[k]) << np.uint64(16) | np.uint64(b3[k]) << np.uint64(24)
        word |= np.uint64(b4[k]) << np.uint64(32) | np.uint64(b5[k]) << np.uint64(40)
        word |= np.uint64(b6[k]) << np.uint64(48) | np.uint64(b7[k]) << np.uint64(56)
        word = (word >> np.uint64(1)) ^ (np.uint64(0) - (word & np.uint64(1)))
        column[k] = np.int64(word)
    for _ in range(order):
        total = column[0]
        for k in range(1, count):
            total += column[k]
            column[k] = total
