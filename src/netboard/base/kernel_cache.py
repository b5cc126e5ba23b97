"""Cache of compiled kernels: the folder of this version of the source, its files, and their locks.

Numba recompiles a cached kernel when its own file has changed, but not when a kernel that it calls has changed in
another file; it would silently run the old code. Therefore each version of the source that kernels depend on has its
own cache folder: that of the modules that import `netboard.base.compiled`, and of all that these import. A kernel is
made of the text of such modules, of constants that they import, and of the constants and kernels that `identity` finds.
Folders of other versions are removed after a day, because a running process may still use one.

The cache can always be made again, so nothing in it stops a process. A kernel whose file is damaged, by a power cut or
a failing disk, is compiled again and replaced; a kernel that cannot be kept is compiled at each start. The log says so
once. Numba's own cache trusts its files, so `KernelCache` takes its place: one sealed file for each kernel and types of
arguments, in which the whole key is compared.

Processes that start together need the same kernels. One compiles a kernel, and the others wait and load it.
"""

import hashlib
import logging
import os
import pickle
import re
import shutil
import sys
import time
import warnings
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from functools import cache
from pathlib import Path
from types import FunctionType
from typing import IO, Any

import numba
from numba import types
from numba.core.compiler import CompileResult
from numba.core.registry import cpu_target
from numba.core.serialize import dumps

from netboard.base.compilation import compilation
from netboard.base.errors import ConfigError
from netboard.base.files.sealed import Damaged, unsealed, write_sealed
from netboard.base.system.locks import lock

log = logging.getLogger(__name__)

PREFIX = "kernels-"

MADE_WITH = "made_with"
"""Attribute of a copy of a function: the kernels in place of its globals, by name."""

SUFFIXES = (".nbc", ".so")
"""Endings of the files with compiled code: of kernels, and of callbacks in C."""

UNUSED_S = 24 * 3600.0
"""Age at which an unchanged cache folder of another source version is removed [s]."""

PATIENCE_S = 60.0
"""Time after which a process compiles a kernel itself that another one has not finished: it may be suspended [s]."""

_IMPORT = re.compile(r"^[ \t]*(?:from|import)[ \t]+(netboard[\w.]*)(?:[ \t]+import[ \t]+(\([^)]*\)|.*))?", re.MULTILINE)


def sources(package: Path) -> list[Path]:
    """Return the files, in the folder of a copy of the package, on which the machine code of its kernels may depend."""
    paths = {_module(path, package): path for path in package.rglob("*.py")}
    texts = {name: path.read_text(encoding="utf-8") for name, path in paths.items()}
    left = [name for name, text in texts.items() if "compiled" in text and "netboard.base.compiled" in _imports(text)]
    found: set[str] = set()
    while left:
        if (name := left.pop()) not in found:
            found.add(name)
            left += texts.keys() & _imports(texts[name])
    return sorted(paths[name] for name in found)


def _module(path: Path, package: Path) -> str:
    return ".".join(path.relative_to(package.parent).with_suffix("").parts).removesuffix(".__init__")


def _imports(text: str) -> set[str]:
    """Return the modules that a text may import from the package; what follows a from may be a module or a name."""
    found = set()
    for module, names in _IMPORT.findall(text):
        parts = module.split(".")
        found |= {".".join(parts[:count]) for count in range(1, len(parts) + 1)}
        found |= {f"{module}.{name}" for name in re.findall(r"\w+", names)}
    return found


def _choose_folder() -> None:
    """Set the cache folder for this process and its children."""
    os.environ["NUMBA_CACHE_DIR"] = str(_folder_of_this_version())


def _folder_of_this_version() -> Path:
    """Return the cache folder of this version of the source: the first that may be written to, or else be read."""
    package = Path(__file__).parents[1]
    state = hashlib.sha256()
    for source in sources(package):
        state.update(source.read_bytes())
    name = f"{PREFIX}{state.hexdigest()[:16]}"
    filled = []
    for place in (places := _places(package)):
        with suppress(OSError, RuntimeError):  # RuntimeError: a user without a home
            folder = Path(place).expanduser()
            folder = folder if folder.name == name else folder / name  # a parent process has named it already
            is_new = not folder.exists()
            folder.mkdir(parents=True, exist_ok=True)
            if os.access(folder, os.W_OK):
                if is_new:
                    _remove_unused(folder.parent)
                return folder
            filled.append(folder)
    if filled:
        return filled[0]
    raise ConfigError(
        f"compiled code can be kept in none of these folders, which cannot be written to: {', '.join(places)}; "
        "set the environment variable NUMBA_CACHE_DIR to one that can"
    )


def _places(package: Path) -> tuple[str, ...]:
    """Return the folders that may have the cache: the one that the user has set, or the usual ones in their order."""
    if of_choice := os.environ.get("NUMBA_CACHE_DIR"):
        return (of_choice,)
    # A systemd service has its own cache (CacheDirectory=), and may not write into the package. Nor may other users.
    of_the_service = os.environ.get("CACHE_DIRECTORY", "").partition(os.pathsep)[0]
    of_the_user = f"{os.environ.get('XDG_CACHE_HOME') or '~/.cache'}/netboard"
    return of_the_service or str(package / "__pycache__"), of_the_user


def _remove_unused(place: Path) -> None:
    """Remove the cache folders of versions that no process has used for a day."""
    with suppress(OSError):
        for other in place.glob(f"{PREFIX}*"):
            if time.time() - other.stat().st_mtime > UNUSED_S:
                shutil.rmtree(other, ignore_errors=True)


_choose_folder()


def folder() -> Path:
    """Return the cache folder of compiled code."""
    return Path(os.environ["NUMBA_CACHE_DIR"])


def compiler() -> tuple[str, ...]:
    """Return what compiles kernels here, and for which processor: those of others are not loaded."""
    return (*cpu_target.target_context.codegen().magic_tuple(), numba.__version__, sys.version)


class KernelCache:
    """Compiled code of one function, for the types of arguments that it was called with; Numba calls it.

    A function that was typed at a prompt is not cached: its constants may have changed, and there is no file to tell.
    """

    def __init__(self, function: FunctionType) -> None:
        self._function = function
        self._name = f"{function.__module__}.{function.__qualname__}"
        self._is_kept = all(map(_source_of, _functions_in(function)))

    @property
    def cache_path(self) -> str:
        """Folder of the files."""
        return str(folder())

    def load_overload(self, signature: tuple[types.Type, ...], target: Any) -> Any:
        """Return the compiled code for these types; None if it must be compiled."""
        target.refresh()
        if self._is_kept:
            key = self._key(signature, target.codegen())
            path = self._path(key)
            try:
                return _loaded(path, key, target)
            except FileNotFoundError:
                pass
            except (Damaged, OSError) as error:
                _warn_once("damaged", f"{path}: {_reason(error)}; compiled kernels that are damaged are compiled again")
        compilation.begins()
        return None

    def save_overload(self, signature: tuple[types.Type, ...], made: Any) -> None:
        """Keep compiled code, if the disk takes it."""
        compilation.ends()
        if not self._is_kept:
            return
        if made.library.has_dynamic_globals:
            warnings.warn(f"{self._name} refers to addresses in this process and cannot be cached", stacklevel=2)
            return
        key = self._key(signature, made.codegen)
        path = self._path(key)
        try:
            path.parent.mkdir(parents=True, exist_ok=True)
            write_sealed(path, dumps((key, made._reduce())))
        except OSError as error:
            why = f"compiled kernels cannot be kept there: {error.strerror or error}; each start compiles them again"
            _warn_once("not kept", f"{path.parent}: {why}")

    def _key(self, signature: tuple[types.Type, ...], codegen: Any) -> tuple[Any, ...]:
        """Return what a kernel's machine code depends on, within a version of the source of netboard."""
        return (signature, codegen.magic_tuple(), identity(self._function), numba.__version__, sys.version)

    def _path(self, key: tuple[Any, ...]) -> Path:
        """Return the file for a key; the key in the file tells whether it is the right one."""
        readable = re.sub(r"[^\w.-]", "", self._name)[-80:]
        return folder() / f"{readable}-{hashlib.sha256(repr(key).encode()).hexdigest()[:16]}{SUFFIXES[0]}"


def identity(value: object) -> tuple[Any, ...] | bytes:
    """Return what tells a constant or a kernel from any other, alike in each process.

    A kernel is the text of its function, with its constants and with the kernels that it is made with. Numba pickles a
    kernel with a number of this process, and Python describes it with its address.
    """
    function = getattr(value, "py_func", value)
    if not isinstance(function, FunctionType):
        return bytes(dumps(value))
    code = function.__code__
    text = hashlib.sha256(code.co_code).hexdigest(), code.co_firstlineno, _source_of(function)
    options = tuple(sorted(getattr(value, "targetoptions", {}).items()))
    return function.__module__, function.__qualname__, text, options, tuple(map(identity, _parts_of(function)))


def _parts_of(function: FunctionType) -> tuple[Any, ...]:
    """Return the constants and kernels that a function is made with: in its closure, and in place of its globals."""
    instead = vars(function).get(MADE_WITH, {})
    return *(cell.cell_contents for cell in function.__closure__ or ()), *instead.keys(), *instead.values()


def _functions_in(function: FunctionType) -> Iterator[FunctionType]:
    """Yield a function, and those of all kernels that it is made with."""
    yield function
    for part in _parts_of(function):
        if isinstance(found := getattr(part, "py_func", part), FunctionType):
            yield from _functions_in(found)


def _source_of(function: FunctionType) -> str:
    """Return the digest of the source of a function; empty if there is none."""
    return _source_in(function.__module__, function.__code__.co_filename)


@cache
def _source_in(module: str, path: str) -> str:
    """Return the digest of a source file as it was when its first kernel was declared; empty if there is none.

    The folder's name tells the version of netboard only: a kernel of another package may call any other kernel there.
    """
    package = module.partition(".")[0]
    try:
        texts = [Path(path).read_bytes()]
        if package not in {"netboard", module}:
            others = sorted(path for place in sys.modules[package].__path__ for path in Path(place).rglob("*.py"))
            texts += [path.read_bytes() for path in others]
    except (OSError, ValueError):
        return ""
    return hashlib.sha256(b"".join(texts)).hexdigest()


def _loaded(path: Path, key: tuple[Any, ...], target: Any) -> Any:
    """Return the compiled code in a file; raise `Damaged` if it is not that of the key."""
    content = unsealed(path.read_bytes())
    try:
        kept, reduced = pickle.loads(content)
        found = CompileResult._rebuild(target, *reduced) if kept == key else None
    except Exception as error:  # whatever a sound file of an unexpected content raises: it can be compiled instead
        raise Damaged(f"does not load: {error!r}") from error
    if found is None:
        raise Damaged("belongs to other code")
    return found


def _reason(error: Damaged | OSError) -> str:
    return str(error) if isinstance(error, Damaged) else f"cannot be read: {error.strerror}"


_WARNED: set[str] = set()
"""Events that the log has already: a damaged cache has hundreds of files."""


def _warn_once(event: str, text: str) -> None:
    if event not in _WARNED:
        _WARNED.add(event)
        log.warning("%s", text)


def count() -> int:
    """Return how many kernels are in the cache [1]."""
    return sum(1 for _ in folder().glob(f"*{SUFFIXES[0]}"))


def examine() -> tuple[int, int, list[str]]:
    """Return how many files of compiled code there are, their size in bytes, and those that are damaged, in words."""
    size, damaged = 0, []
    paths = sorted(path for path in folder().glob("*") if path.suffix in SUFFIXES)
    for path in paths:
        try:
            size += len(unsealed(path.read_bytes()))
        except (Damaged, OSError) as error:
            damaged.append(f"{path.name} {_reason(error)}")
    return len(paths), size, damaged


@contextmanager
def locked(name: str) -> Iterator[None]:
    """Hold the lock of a kernel among processes that share a cache, for `PATIENCE_S` at most waiting for it."""
    place = folder() / "locks" / hashlib.sha256(name.encode()).hexdigest()[:16]
    try:
        place.parent.mkdir(parents=True, exist_ok=True)
        file = place.open("w")
    except OSError:  # a cache that cannot be written to is shared with nobody
        yield
        return
    with file:  # closing it unlocks it
        until = time.monotonic() + PATIENCE_S
        while not _try_lock(file) and time.monotonic() < until:
            time.sleep(0.02)
        yield


def _try_lock(file: IO[str]) -> bool:
    """Lock a file if no other process has; where files cannot be locked, each process compiles for itself."""
    try:
        lock(file.fileno())
    except BlockingIOError:
        return False
    except OSError:
        return True
    return True
