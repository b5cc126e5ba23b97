"""Which code measures: a digest of it, so that results of other code are never taken for its own.

The code is the module that measures and all of netboard that it imports, to the byte, and the versions of the libraries
that compute. What only reads the tables (findings, pictures, reports) is not in it.
"""

import ast
import hashlib
from collections.abc import Iterator
from functools import cache
from importlib.metadata import version
from importlib.util import find_spec
from pathlib import Path

ROOT = "netboard.analysis.extraction.recordings"
"""The module that measures."""

LIBRARIES = ("numpy", "scipy", "numba")
"""What computes besides."""

_PACKAGE = ROOT.partition(".")[0]


@cache
def fingerprint() -> str:
    """Return a digest of the code that measures, in hexadecimal: the same for the same code, wherever it lies."""
    digest = hashlib.sha256()
    for name, path in sorted(sources().items()):
        text = path.read_bytes()
        digest.update(f"{name} {len(text)}\n".encode() + text)
    digest.update(" ".join(f"{library} {version(library)}" for library in LIBRARIES).encode())
    return digest.hexdigest()


def sources() -> dict[str, Path]:
    """Find the modules that take part in measuring."""
    found: dict[str, Path] = {}
    waiting = [ROOT]
    while waiting:
        name = waiting.pop()
        path = None if name in found else _file_of(name)
        if path is not None:
            found[name] = path
            waiting.extend(_imported(path))
    return found


def _imported(path: Path) -> Iterator[str]:
    """Yield what a module imports of netboard: modules, and names in them that may be modules."""
    for node in ast.walk(ast.parse(path.read_bytes())):
        names = [alias.name for alias in node.names] if isinstance(node, ast.Import | ast.ImportFrom) else []
        if isinstance(node, ast.ImportFrom) and node.module:
            names = [node.module, *(f"{node.module}.{name}" for name in names)]
        yield from (name for name in names if name.startswith(f"{_PACKAGE}."))


def _file_of(name: str) -> Path | None:
    """Find the file of a module; None for what is none, such as a function that is imported."""
    parent, _, last = name.rpartition(".")
    package = find_spec(parent)
    for place in (package.submodule_search_locations or ()) if package else ():
        for path in (Path(place) / f"{last}.py", Path(place) / last / "__init__.py"):
            if path.is_file():
                return path
    return None
