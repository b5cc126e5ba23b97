"""Compilation of kernels: `kernel` compiles a scalar function to strict machine code and caches it between runs.

Strict means IEEE arithmetic as written: no contraction, no reordering, so that the same input gives the same bits on
every machine and with the compiler switched off. That holds for kernels of + - * /, square roots and the functions of
`netboard.physics.arithmetic`; `exp` and `log1p`, which simulated participants use, come from the machine's C library.

`netboard.base.kernel_cache` keeps compiled kernels, in a folder for each version of the source.
"""

import dis
import hashlib
import inspect
import re
from collections.abc import Callable, Mapping, Sequence
from types import CellType, FunctionType
from typing import Any, ParamSpec, TypeVar, cast

import numba
import numpy as np
from llvmlite import ir
from numba.core import cgutils, types
from numba.core.base import BaseContext
from numba.core.compiler_lock import global_compiler_lock
from numba.core.errors import NumbaError
from numba.core.typing.templates import Signature
from numba.extending import intrinsic, overload
from numpy.typing import NDArray

from netboard.base.compilation import compilation
from netboard.base.kernel_cache import MADE_WITH, KernelCache, identity, locked

P = ParamSpec("P")
R = TypeVar("R")
A = TypeVar("A")

Records = NDArray[np.void]
"""An array of records, whose fields its dtype declares; a record of it is a `numpy.void`."""

Words = NDArray[np.int64]
"""Memory of a record or a message as words of 64 bits, whatever they mean."""

Numbers = NDArray[np.float64]
"""The same memory as numbers."""

Bytes = NDArray[np.uint8]
"""A frame of a message as bytes."""

STRICT: dict[str, Any] = {"error_model": "numpy", "fastmath": False, "forceinline": False, "no_cfunc_wrapper": True}
"""IEEE arithmetic as written; it never raises: x / 0 is infinite. No entry for C code, which none has: it is an eighth
of the time that compilation takes.

A kernel inherits unset options from the first caller that it is compiled for, and Numba keeps that version for all
callers. Therefore each option is set.
"""

INLINED: dict[str, Any] = {**STRICT, "forceinline": True}
"""The same, compiled into every caller."""

FAST: dict[str, Any] = {**STRICT, "fastmath": {"contract"}}
"""Permits fused multiply-add, which not every machine has, and nothing else: sums keep their order, and non-finite
values are still detected."""

LOOSE: dict[str, Any] = {**FAST, "forceinline": True}
"""The same, compiled into every caller."""


def kernel(function: Callable[P, R]) -> Callable[P, R]:
    """Compile a function on its first call, or load it from the cache. Arithmetic never raises: x / 0 is infinite.

    Numbers and named tuples in the closure of a function are compile-time constants, and dead code is removed.

    Parameters
    ----------
    function : callable
        Of scalars, arrays and records, in numba's subset of Python; it also runs as it stands, with
        NUMBA_DISABLE_JIT=1.
    """
    return _compiled(function, **STRICT)


def waiting(function: Callable[P, R]) -> Callable[P, R]:
    """Compile a function that may sleep: as `kernel` does, and other threads of Python run meanwhile."""
    return _compiled(function, nogil=True, **STRICT)


def _compiled(function: Callable[P, R], **options: Any) -> Callable[P, R]:
    dispatcher = numba.njit(**options)(_named_by_parts(function))
    compiled: Callable[P, R] = _cached(_once_for_all_integers(dispatcher))
    return compiled


def _cached(compiled: Any) -> Any:
    """Let one process compile a kernel while others wait, which then find it in the cache."""
    if not hasattr(compiled, "overloads"):  # the compiler is switched off
        return compiled
    compiled._cache = KernelCache(compiled.py_func)
    compile_now, name = compiled.compile, f"{compiled.py_func.__module__}.{compiled.py_func.__qualname__}"

    def compile_once(signature: tuple[types.Type, ...]) -> Any:
        if signature in compiled.overloads:
            return compile_now(signature)
        # Take Numba's lock first, so that no thread that holds it can wait for this thread's file lock.
        with global_compiler_lock, locked(name), compilation.kernel():
            return compile_now(signature)

    compiled.compile = compile_once
    return compiled


def _once_for_all_integers(compiled: Any) -> Any:
    """Compile a kernel once for all integers: Numba would do so for each constant with which another calls it."""
    if hasattr(compiled, "get_call_template"):  # not if the compiler is switched off
        template = compiled.get_call_template
        compiled.get_call_template = lambda args, kws: template(
            [types.unliteral(one) for one in args], {name: types.unliteral(one) for name, one in kws.items()}
        )
    return compiled


def _named_by_parts(function: Callable[P, R]) -> Callable[P, R]:
    """Add a digest of its closure, and of the kernels in place of its globals, to the name of a function.

    Numba derives the symbols of machine code from the name and a number that counts compilations in a process. Code of
    the same name, compiled with other constants in two processes and loaded from the cache into a third, could have the
    same symbol, and the linker would silently use the first for both.
    """
    if isinstance(function, FunctionType) and (function.__closure__ or MADE_WITH in vars(function)):
        digest = hashlib.sha256(repr(identity(function)).encode()).hexdigest()
        function.__qualname__ += f"-{digest[:16]}"
    return function


def inlined(function: Callable[P, R]) -> Callable[P, R]:
    """Compile a function into every kernel that calls it, so that dead code is removed there."""
    return _compiled(function, **INLINED)


def is_kernel(function: Callable[..., object]) -> bool:
    """Return whether a function is compiled; all are taken for that if the compiler is switched off."""
    return hasattr(function, "py_func") or bool(numba.config.DISABLE_JIT)  # type: ignore[attr-defined]


def fast(function: Callable[P, R]) -> Callable[P, R]:
    """Compile a function as `kernel` does, with fused multiply-adds; never for code that must verify to the bit.

    Parameters
    ----------
    function : callable
        As for `kernel`. Kernels that it calls stay strict, except those from `relaxed`.
    """
    return _compiled(function, **FAST)


_CHOICES: dict[Any, Callable[..., object]] = {}
"""Selection function that `specialised` registered for each function."""


def composed(
    function: Callable[P, R],
    compiler: Callable[[Callable[P, R]], Callable[P, R]] = kernel,
    **kernels: Callable[..., object],
) -> Callable[P, R]:
    """Compile a function with kernels made at run time in place of those that it names.

    Parameters
    ----------
    compiler : callable
        `kernel`, or `waiting` for a function that may sleep.
    **kernels : callable
        Kernels, by the name that they replace in the module of the function.
    """
    copy = FunctionType(function.__code__, {**function.__globals__, **kernels}, function.__name__)
    vars(copy)[MADE_WITH] = kernels
    return compiler(copy)


def specialised(function: Callable[..., object]) -> Callable[[Callable[..., object]], None]:
    """Let the decorated function select, by the types of the arguments, the code compiled in place of a function.

    Parameters
    ----------
    function : callable
        Plain Python; the selected code must perform the same operations in the same order.

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


def relaxed(function: Callable[P, R], instead: Mapping[Any, Any]) -> Callable[P, R]:
    """Return a copy of a strict kernel, and of all that it calls, for use in a `fast` one.

    So each equation is written once. The copy is compiled into its caller, and cached with it.

    Parameters
    ----------
    instead : mapping of callable to callable
        Replacements for functions that it calls.
    """
    done = dict(instead)

    def recompiled(found: Any) -> Any:
        text = getattr(found, "py_func", found)
        if not isinstance(text, FunctionType) or not text.__module__.startswith("netboard."):
            return found
        if found not in done:
            done[found] = _copied(text, recompiled)
            if found in _CHOICES:
                _choose_for_copy(done[found], _CHOICES[found], recompiled)
            elif found is not text:
                done[found] = _once_for_all_integers(numba.njit(**LOOSE)(done[found]))
        return done[found]

    copy: Callable[P, R] = recompiled(function)
    return copy


def _copied(text: FunctionType, recompiled: Callable[[Any], Any]) -> FunctionType:
    """Return a copy of a function with replaced globals and closure."""
    read = {step.argval for step in dis.get_instructions(text) if step.opname == "LOAD_GLOBAL"}
    known = {name: recompiled(found) for name, found in text.__globals__.items() if name in read}
    cells = tuple(CellType(recompiled(cell.cell_contents)) for cell in text.__closure__ or ())
    copy = FunctionType(text.__code__, {**text.__globals__, **known}, text.__name__, text.__defaults__, cells or None)
    vars(copy)[MADE_WITH] = {name: found for name, found in known.items() if found is not text.__globals__[name]}
    return copy


def _choose_for_copy(copy: FunctionType, choose: Callable[..., object], recompiled: Callable[[Any], Any]) -> None:
    """Register the selection of a function for its copy."""

    def chosen(*arguments: types.Type) -> Any:
        text: Any = choose(*arguments)
        return text and _copied(text, recompiled)

    # Numba refuses a selection whose arguments have other names than those of the function.
    names = ", ".join(inspect.signature(choose).parameters)
    alike = eval(f"lambda {names}: chosen({names})", {"chosen": chosen})
    overload(copy, jit_options=LOOSE, prefer_literal=True)(alike)  # type: ignore[arg-type]


def borrowed(value: A) -> A:
    """Return an array, or tuples of arrays, whose references a kernel does not count.

    Counting takes 5 ns for each tuple with an array and each call with it, more than an integration step.

    Parameters
    ----------
    value : ndarray or tuple
        An argument of the kernel; its caller keeps it alive while the kernel runs.
    """
    return value


def _uncounted(context: BaseContext, value: types.Type) -> Any:
    """Write the structure of the value without the owners of its arrays' memory."""

    def write(target: BaseContext, builder: ir.IRBuilder, signature: Signature, arguments: Sequence[ir.Value]) -> Any:
        return _without_owner(target, builder, value, arguments[0])

    return value(value), write


def _without_owner(target: BaseContext, builder: ir.IRBuilder, kind: types.Type, value: ir.Value) -> Any:
    kinds: Any = kind
    if isinstance(kind, types.BaseTuple):
        parts = [_without_owner(target, builder, one, builder.extract_value(value, k)) for k, one in enumerate(kinds)]
        return target.make_tuple(builder, kind, parts)
    if not isinstance(kind, types.Array):
        target.nrt.incref(builder, kind, value)
        return value
    made = cgutils.create_struct_proxy(kind)(target, builder, value)
    made.meminfo = cgutils.get_null_value(made.meminfo.type)
    made.parent = cgutils.get_null_value(made.parent.type)
    return made._getvalue()


_borrow: Any = intrinsic(_uncounted)


@specialised(borrowed)
def _borrowed(value: types.Type) -> Any:
    return lambda value: _borrow(value)


_COLOURS = re.compile(r"\x1b\[[0-9;]*m")


def compiler_words(error: Exception) -> str:
    """Return in one line why a kernel of somebody else does not compile, or what it raises."""
    if not isinstance(error, NumbaError):
        return f"{type(error).__name__}: {error}"
    lines = [line.strip() for line in _COLOURS.sub("", str(error)).splitlines()]
    said = next((line for line in lines if line and not line.startswith("Failed in ")), "it does not compile")
    where = next((line.rstrip(":") for line in lines if line.startswith("File ")), "")
    return f"{said} ({where})" if where else said


def machine_code(compiled: Callable[P, R], *arguments: object) -> Callable[P, R]:
    """Return a kernel for arguments of these types only, without the look-up of types at each call.

    That look-up takes longer than most kernels.
    """
    dispatcher: Any = compiled
    if not hasattr(dispatcher, "overloads"):  # the compiler is switched off
        return compiled
    signature = tuple(_type_of(argument) for argument in arguments)
    if signature not in dispatcher.overloads:
        dispatcher.compile(signature)
    return cast("Callable[P, R]", dispatcher.overloads[signature].entry_point)


_TYPES: dict[tuple[Any, ...], Any] = {}
"""Numba's types of arrays and records, by what distinguishes them: `numba.typeof` takes up to 1 ms."""


def _type_of(value: object) -> Any:
    """Return Numba's type of an argument."""
    if isinstance(value, tuple):
        return types.BaseTuple.from_types([_type_of(part) for part in value], type(value))
    key: tuple[Any, ...]
    if isinstance(value, np.ndarray | np.void):
        flags = value.flags
        layout = (flags.c_contiguous, flags.f_contiguous, flags.writeable, flags.aligned)
        key = (type(value), value.dtype, value.ndim, *layout)
    else:
        return numba.typeof(value)
    if key not in _TYPES:
        _TYPES[key] = numba.typeof(value)
    return _TYPES[key]
