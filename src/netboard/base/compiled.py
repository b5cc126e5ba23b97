"""How kernels are compiled: `kernel` turns a scalar function into strict machine code that is kept between runs.

Strict means IEEE arithmetic as written: no contraction, no reordering, so that the same input gives the same bits on
every machine and with the compiler switched off.

Numba renews a kept kernel when its own file has changed, but not when a kernel it calls has changed in another file: it
would silently go on with the old code. So the kernels of every state of the package's source have a folder of their
own, and the folders of other states are removed after a day: a process that was started before may still need one.
"""

import hashlib
import inspect
import os
import shutil
import time
from collections.abc import Callable, Mapping
from pathlib import Path
from types import CellType, FunctionType
from typing import Any, ParamSpec, TypeVar

import numba
from numba.core import cgutils
from numba.extending import intrinsic, overload

P = ParamSpec("P")
R = TypeVar("R")
A = TypeVar("A")

PREFIX = "kernels-"

UNUSED_S = 24 * 3600.0
"""Kernels of another state of the source that nobody has added to for so long are removed [s]."""


def _choose_folder() -> None:
    """Tell numba where to keep kernels, in this process and those it starts; a folder the user has chosen stays."""
    package = Path(__file__).parents[1]
    state = hashlib.sha256()
    for source in sorted(package.rglob("*.py")):
        state.update(source.read_bytes())
    # A service of systemd has a cache of its own (CacheDirectory=), and may write nothing into the package.
    given = os.environ.get("CACHE_DIRECTORY", "").partition(":")[0]
    folder = Path(given or package / "__pycache__") / f"{PREFIX}{state.hexdigest()[:16]}"
    chosen = os.environ.setdefault("NUMBA_CACHE_DIR", str(folder))
    if chosen == str(folder) and not folder.exists():
        for other in folder.parent.glob(f"{PREFIX}*"):
            if time.time() - other.stat().st_mtime > UNUSED_S:
                shutil.rmtree(other, ignore_errors=True)
    # Numba read the environment when it was imported, which may have been by someone else.
    numba.config.CACHE_DIR = chosen  # type: ignore[attr-defined]


_choose_folder()


def folder() -> Path:
    """Where what is compiled on this machine is kept."""
    return Path(os.environ["NUMBA_CACHE_DIR"])


STRICT: dict[str, Any] = {"error_model": "numpy", "fastmath": False, "forceinline": False}
"""IEEE arithmetic as written; it never raises: x / 0 is infinite.

Numba lets a kernel inherit what it does not say itself from the first caller that it is compiled for, and keeps it so
for every other: each option is said.
"""

INLINED: dict[str, Any] = {**STRICT, "forceinline": True}
"""The same, compiled into every caller."""

FAST: dict[str, Any] = {**STRICT, "fastmath": {"contract"}}
"""A product and a sum may be rounded once, as one (fused multiply-add), which not every machine does. Nothing else is
let go: a sum keeps its order, and what is not finite is still found out."""

LOOSE: dict[str, Any] = {**FAST, "forceinline": True}
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
    """Compile a function into every kernel that calls it, so that what it need not compute there falls away."""
    compiled: Callable[P, R] = numba.njit(cache=True, **INLINED)(function)
    return compiled


def fast(function: Callable[P, R]) -> Callable[P, R]:
    """Compile a function as `kernel` does, with fused multiply-adds: never for what must verify to the bit.

    Parameters
    ----------
    function : callable
        As for `kernel`; what it calls is as strict as it was, but for what `loosened` makes.
    """
    compiled: Callable[P, R] = numba.njit(cache=True, **FAST)(function)
    return compiled


_CHOICES: dict[Any, Callable[..., object]] = {}
"""What `specialised` was given for each function."""


def composed(function: Callable[P, R], **kernels: Callable[..., object]) -> Callable[P, R]:
    """Compile a function as `kernel` does, with kernels made at run time in the place of those that it names.

    Numba keeps it under a name of its own for each of what those were made with: their constants.

    Parameters
    ----------
    **kernels : callable
        Kernels, by the name of what the function's module has in their place.
    """
    texts = {name: getattr(found, "py_func", found) for name, found in kernels.items()}
    made_with = {name: [cell.cell_contents for cell in text.__closure__ or ()] for name, text in texts.items()}
    known = {**function.__globals__, **kernels}
    copy = FunctionType(function.__code__, known, function.__name__)
    copy.__qualname__ = f"{function.__name__}-{hashlib.sha256(repr(made_with).encode()).hexdigest()[:16]}"
    return kernel(copy)


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
        overload(function, jit_options=INLINED, prefer_literal=True)(choose)  # type: ignore[arg-type]
        _CHOICES[function] = choose

    return register


def loosened(function: Callable[P, R], instead: Mapping[Any, Any]) -> Callable[P, R]:
    """Return the text of a strict kernel, and of all that it calls, compiled anew for a `fast` one.

    So the equations are written once. It is compiled into its caller, and kept with that.

    Parameters
    ----------
    instead : mapping of callable to callable
        What to call in place of some of the functions that it calls.
    """
    done = dict(instead)

    def again(found: Any) -> Any:
        text = getattr(found, "py_func", found)
        if not isinstance(text, FunctionType) or not text.__module__.startswith("netboard."):
            return found
        if found not in done:
            done[found] = _copied(text, again)
            if found in _CHOICES:
                _choose_again(done[found], _CHOICES[found], again)
            elif found is not text:
                done[found] = numba.njit(**LOOSE)(done[found])
        return done[found]

    copy: Callable[P, R] = again(function)
    return copy


def _copied(text: Any, again: Callable[[Any], Any]) -> FunctionType:
    """Return the same text with other functions under the names that it uses."""
    known = {name: again(text.__globals__[name]) for name in text.__code__.co_names if name in text.__globals__}
    cells = tuple(CellType(again(cell.cell_contents)) for cell in text.__closure__ or ())
    return FunctionType(text.__code__, {**text.__globals__, **known}, text.__name__, text.__defaults__, cells or None)


def _choose_again(copy: FunctionType, choose: Callable[..., object], again: Callable[[Any], Any]) -> None:
    """Let numba choose for the copy as for the function, and copy what was chosen."""

    def chosen(*arguments: Any) -> Any:
        text = choose(*arguments)
        return text and _copied(text, again)

    names = ", ".join(inspect.signature(choose).parameters)
    alike = eval(f"lambda {names}: chosen({names})", {"chosen": chosen})
    overload(copy, jit_options=LOOSE, prefer_literal=True)(alike)  # type: ignore[arg-type]


def borrowed(array: A) -> A:
    """Return the same array for use in a kernel that does not count who holds it: counting costs more than a step.

    Every tuple made of an array, and every function given that tuple, would count up and down, 5 ns each.

    Parameters
    ----------
    array : ndarray
        An argument of the kernel: its caller holds it for as long as the kernel runs.
    """
    return array


def _uncounted(context: Any, array: Any) -> Any:
    """Write the array's structure without its owner."""

    def write(target: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        made = cgutils.create_struct_proxy(array)(target, builder, arguments[0])
        made.meminfo = cgutils.get_null_value(made.meminfo.type)
        made.parent = cgutils.get_null_value(made.parent.type)
        return made._getvalue()

    return array(array), write


_borrow: Any = intrinsic(_uncounted)


@specialised(borrowed)
def _borrowed(array: Any) -> Any:
    return lambda array: _borrow(array)
