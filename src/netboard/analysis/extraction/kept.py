"""Cache of whole analyses: every file of the output folder, keyed by all inputs.

The output of an analysis is a function of the bytes and names of its recordings, its settings, its options, the code
and the versions of libraries. All of these are in the key, so a cached file never stems from other data, settings or
code. The command line, which the folder quotes, is stored as a placeholder. Files are stored by content: files that two
analyses share are stored once.

This module imports no numerical library: a cached analysis needs none.
"""

import hashlib
import json
import platform
from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from functools import cache
from importlib.metadata import PackageNotFoundError, version
from importlib.util import find_spec
from pathlib import Path

from netboard.analysis.extraction.store import ANALYSIS, FILE, Store
from netboard.base.errors import RecordingError

PACKAGES = ("netboard", "netboard.services")
"""Packages whose sources affect an analysis."""

SOURCES = (".py", ".jinja", ".css", ".toml")

LIBRARIES = (
    *("jinja2", "markupsafe", "matplotlib", "mcap", "netboard", "numba", "numpy", "pandas", "pyarrow"),
    *("pydantic", "scipy", "statsmodels", "zstandard"),
)
"""Further distributions whose versions count."""


@cache
def code_digest() -> str:
    """Return the hexadecimal digest of netboard's sources and of its dependencies' versions."""
    digest = hashlib.sha256()
    for package in PACKAGES:
        spec = find_spec(package)
        for place in map(Path, (spec.submodule_search_locations or ()) if spec else ()):
            for path in sorted(path for path in place.rglob("*") if path.suffix in SOURCES):
                text = path.read_bytes()
                digest.update(f"{path.relative_to(place)} {len(text)}\n".encode() + text)
    digest.update(" ".join(f"{name} {_version(name)}" for name in LIBRARIES).encode())
    digest.update(f"{platform.python_version()} {platform.machine()}".encode())
    return digest.hexdigest()


def _version(name: str) -> str:
    try:
        return version(name)
    except PackageNotFoundError:
        return ""


def key_of_analysis(recordings: Sequence[Path], settings: bytes, options: Sequence[str]) -> str:
    """Return the cache key of an analysis from everything that affects its output."""
    with ThreadPoolExecutor() as pool:
        digests = list(pool.map(digest_of, recordings))
    named = [[str(path), digest] for path, digest in zip(recordings, digests, strict=True)]
    told = json.dumps([code_digest(), named, hashlib.sha256(settings).hexdigest(), list(options)])
    return hashlib.sha256(told.encode()).hexdigest()


def digest_of(path: Path) -> str:
    """Return the SHA-256 of a file, in hexadecimal."""
    try:
        with path.open("rb") as file:
            return hashlib.file_digest(file, "sha256").hexdigest()
    except OSError as error:
        raise RecordingError(f"{path}: cannot be read: {error.strerror}") from error


def keep(store: Store, key: str, folder: Path, words: Sequence[str]) -> None:
    """Store an analysis."""
    files = {}
    for path in sorted(path for path in folder.rglob("*") if path.is_file()):
        content = path.read_bytes()
        name = f"{hashlib.sha256(content).hexdigest()}{FILE}"
        if store.get(name) is None:
            store.put(name, content)
        files[path.relative_to(folder).as_posix()] = name
    store.put(f"{key}{ANALYSIS}", json.dumps({"files": files, "words": list(words)}).encode())
    store.trim()


def take(store: Store, key: str, folder: Path) -> tuple[str, ...] | None:
    """Write a completely cached analysis into an empty folder; return its messages, or None and write nothing."""
    listed = store.get(f"{key}{ANALYSIS}")
    if listed is None:
        return None
    told = json.loads(bytes(listed))
    contents = {name: store.get(entry) for name, entry in told["files"].items()}
    whole = {name: content for name, content in contents.items() if content is not None}
    if len(whole) < len(contents):
        return None
    for name, content in whole.items():
        (folder / name).parent.mkdir(parents=True, exist_ok=True)
        (folder / name).write_bytes(content)
    return tuple(told["words"])
