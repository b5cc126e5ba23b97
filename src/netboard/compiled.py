"""How kernels are compiled: `kernel` turns a scalar function into strict machine code that is kept between runs.

Strict means IEEE arithmetic as written: no contraction, no reordering, so that the same input gives the same bits on
every machine and with the compiler switched off.

Numba renews a kept kernel when its own file has changed, but not when a kernel it calls has changed in another file: it
would silently go on with the old code. So the kernels of every state of the package's source have a folder of their
own, and the folders of other states are removed.
"""

import hashlib
import os
import shutil
from collections.abc import Callable
from pathlib import Path
from typing import ParamSpec, TypeVar

P = ParamSpec("P")
R = TypeVar("R")

PREFIX = "kernels-"


def _choose_folder() -> None:
    """Tell numba, before it is imported, where to keep kernels; a folder the user has chosen stays."""
    package = Path(__file__).parent
    state = hashlib.sha256()
    for source in sorted(package.rglob("*.py")):
        state.update(source.read_bytes())
    folder = package / "__pycache__" / f"{PREFIX}{state.hexdigest()[:16]}"
    if os.environ.setdefault("NUMBA_CACHE_DIR", str(folder)) == str(folder) and not folder.exists():
        for other in folder.parent.glob(f"{PREFIX}*"):
            shutil.rmtree(other, ignore_errors=True)


_choose_folder()

import numba  # noqa: E402  (reads the choice when it is imported)
from numba.extending import overload  # noqa: E402


STRICT = {"error_model": "numpy"}
"""IEEE arithmetic as written; it never raises: x / 0 is infinite."""

INLINED = {**STRICT, "forceinline": True}
"""The same, compiled into every caller."""


def kernel(function: Callable[P, R]) -> Callable[P, R]:
    """Compile a function on its first call, or take it from those kept. It never raises: x / 0 is infinite.

    What a function made within another one finds there (numbers, named tuples of them) are constants to the compiler:
    what they make needless falls away.

    Parameters
    ----------
    function : callable
        Of scalars, arrays and records, in the part of Python that numba knows; it also runs as it stands, with
        NUMBA_DISABLE_JIT=1.
    """
    compiled: Callable[P, R] = numba.njit(cache=True, **STRICT)(function)
    return compiled


def inlined(function: Callable[P, R]) -> Callable[P, R]:
    """Compile a function into every kernel that calls it, so that what it need not compute there falls away.

    Parameters
    ----------
    function : callable
        As for `kernel`.
    """
    compiled: Callable[P, R] = numba.njit(cache=True, **INLINED)(function)
    return compiled


def specialised(function: Callable[..., object]) -> Callable[[Callable[..., object]], None]:
    """Let the decorated function choose, by the types of the arguments, what is compiled in place of a plain one.

    Parameters
    ----------
    function : callable
        Plain Python; what it does, the chosen text must do in the same order.

    Returns
    -------
    callable
        Decorator of a function of the same arguments, which gets numba's types (an `IntegerLiteral` where the compiler
        knows a number) and returns a function of the same arguments.
    """

    def register(choose: Callable[..., object]) -> None:
        choose.__annotations__ = {}  # numba compares them with those of what is returned
        overload(function, jit_options=INLINED, prefer_literal=True)(choose)

    return register
