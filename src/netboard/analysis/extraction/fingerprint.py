"""Digest of the extracting code, so that cached results of other code are never used.

The digest covers the extracting module and all netboard modules that it imports, byte by byte, and the versions of the
numerical libraries. Code that only reads the tables (results, figures, reports) is not included.
"""

import ast
import hashlib
from collections.abc import Iterator
from functools import cache
from importlib.metadata import version
from importlib.util import find_spec
from pathlib import Path

ROOT = "netboard.analysis.extraction.recordings"
"""Module that extracts the measures."""

LIBRARIES = ("numpy", "scipy", "numba")
"""Numerical libraries whose versions count."""

_PACKAGE = ROOT.partition(".")[0]


@cache
def fingerprint(root: str = ROOT) -> str:
    """Return the hexadecimal digest of the code of a module; it does not depend on the installation path."""
    digest = hashlib.sha256()
    for name, path in sorted(sources(root).items()):
        text = path.read_bytes()
        digest.update(f"{name} {len(text)}\n".encode() + text)
    digest.update(" ".join(f"{library} {version(library)}" for library in LIBRARIES).encode())
    return digest.hexdigest()


def sources(root: str = ROOT) -> dict[str, Path]:
    """Return a module and all that it imports; by default, those that take part in the extraction."""
    found: dict[str, Path] = {}
    waiting = [root]
    while waiting:
        name = waiting.pop()
        path = None if name in found else _file_of(name)
        if path is not None:
            found[name] = path
            waiting.extend(_imported(path))
    return found


def _imported(path: Path) -> Iterator[str]:
    """Yield a module's netboard imports: modules, and imported names that may be modules."""
    for node in ast.walk(ast.parse(path.read_bytes())):
        names = [alias.name for alias in node.names] if isinstance(node, ast.Import | ast.ImportFrom) else []
        if isinstance(node, ast.ImportFrom) and node.module:
            names = [node.module, *(f"{node.module}.{name}" for name in names)]
        yield from (name for name in names if name.startswith(f"{_PACKAGE}."))


def _file_of(name: str) -> Path | None:
    """Return the file of a module; None for another name, such as an imported function."""
    parent, _, last = name.rpartition(".")
    package = find_spec(parent)
    for place in (package.submodule_search_locations or ()) if package else ():
        for path in (Path(place) / f"{last}.py", Path(place) / last / "__init__.py"):
            if path.is_file():
                return path
    return None
