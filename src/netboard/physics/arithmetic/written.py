"""Functions written as text: expressions for states of any length, in kernels and in plain Python alike.

The length of a tuple is known when a kernel is compiled, so each element has its own expression and no loop is left.
"""

from collections.abc import Callable, Sequence
from functools import cache
from typing import Any

from numba import types

from netboard.base.compiled import specialised
from netboard.physics.arithmetic.simd import applied, gathered, lane, lanes_at, spread, within


def written(names: str, write: Callable[..., str]) -> Callable[..., Any]:
    """Return a function whose text depends on the lengths of its arguments, in kernels and in plain Python alike.

    Parameters
    ----------
    names : str
        Names of the arguments.
    write : callable
        Returns the text: an expression, perhaps after lines that it needs. Its arguments are the lengths of those that
        are tuples, the numbers of those that are constants at the call, and 0 for others.
    """

    @cache
    def compose(*sizes: int) -> Any:
        *lines, result = write(*sizes).split("\n")
        known: dict[str, Any] = {**_OPERATIONS, "__name__": __name__}
        exec("\n    ".join([f"def composed({names}):", *lines, f"return {result}"]), known)
        return known["composed"]

    def run(*arguments: object) -> Any:
        sizes = [len(a) if isinstance(a, tuple) else a if isinstance(a, int) else 0 for a in arguments]
        return compose(*sizes)(*arguments)

    def choose(*arguments: types.Type) -> Any:
        sizes = [len(a) if isinstance(a, types.BaseTuple) else getattr(a, "literal_value", 0) for a in arguments]
        return compose(*sizes)

    plain: Callable[..., Any] = eval(f"lambda {names}: run({names})", {"run": run, "__name__": __name__})
    specialised(plain)(eval(f"lambda {names}: choose({names})", {"choose": choose}))
    return plain


def width_of(length: int) -> int:
    """Return the number of lanes that hold a state: a multiple of those in a vector register [1]."""
    return 4 if length <= 4 else 8 if length <= 8 else 16


def listed(terms: Sequence[str]) -> str:
    """Return the text of a tuple, from the texts of its elements.

    Parameters
    ----------
    terms : sequence of str
        An expression for each element.
    """
    return "(" + "".join(f"{term}, " for term in terms) + ")"


_OPERATIONS = {f.__name__: f for f in (lanes_at, lane, spread, gathered, within, applied)}
"""Names that such a text may use."""
