"""Cache on disk: a folder of entries, bounded in size, safe for any number of processes; and whole analyses in it.

An entry is one sealed file (`netboard.base.files.sealed`), written under a temporary name and renamed; a damaged entry
is ignored. Above the size limit the least recently used entries are evicted, except those in
use: a larger study would otherwise evict what it reads next.

An analysis is kept with every file of its output folder, keyed by all inputs: the bytes and names of its recordings,
its settings, its options, the code and the versions of libraries. So a cached file never stems from other data,
settings or code. The command line, which the folder quotes, is stored as a placeholder. Files are stored by content:
files that two analyses share are stored once.

This module imports no numerical library: a cached analysis needs none.
"""

import hashlib
import json
import os
import platform
import time
from collections.abc import Callable, Collection, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from contextlib import suppress
from functools import cache
from importlib.metadata import PackageNotFoundError, version
from importlib.util import find_spec
from itertools import accumulate
from pathlib import Path
from tempfile import NamedTemporaryFile

from netboard.base.errors import RecordingError
from netboard.base.files.sealed import Damaged, sealed, unsealed
from netboard.base.process.resources import home_folder
from netboard.base.settings import parse_json
from netboard.recording.files.locate import sha256_of

LIMIT = 2_000_000_000
"""Size limit for entries that are not in use, in bytes: some ten studies of the paper's size [1]."""

TABLES, ANALYSIS, FILE = ".tables", ".analysis", ".file"
"""Suffixes of entries: tables of a recording, the list of an analysis, one of its files."""

ENDINGS = (TABLES, ANALYSIS, FILE)

ABANDONED = 86_400.0
"""Age after which an unfinished entry is abandoned [s]."""


def default_folder() -> Path:
    """Return the user's cache folder."""
    chosen = os.environ.get("XDG_CACHE_HOME")
    return (Path(chosen) if chosen else home_folder() / ".cache") / "netboard" / "measures"


class Store:
    """A folder of entries, above `limit` bytes without unused ones; `advice` is for a folder that cannot be used."""

    def __init__(self, folder: Path, limit: int = LIMIT, advice: str = "--no-cache keeps none") -> None:
        self._folder, self._limit, self._advice = folder, limit, advice
        self._used: set[Path] = set()
        try:
            folder.mkdir(parents=True, exist_ok=True)
        except OSError as error:
            raise self._refused(error) from error

    def _refused(self, error: OSError) -> RecordingError:
        reason = error.strerror or str(error)
        return RecordingError(f"{self._folder}: results cannot be cached there: {reason}; {self._advice}")

    def get(self, name: str) -> memoryview | None:
        """Return the content of an entry; None if it is missing or damaged."""
        path = self._folder / name
        try:
            whole = path.read_bytes()
            os.utime(path)
        except FileNotFoundError:
            return None
        except OSError as error:
            raise self._refused(error) from error
        try:
            content = unsealed(whole)
        except Damaged:
            return None
        self._used.add(path)
        return content

    def put(self, name: str, content: bytes) -> None:
        """Store an entry."""
        part = None
        try:
            with NamedTemporaryFile(dir=self._folder, suffix=".part", delete=False) as file:
                part = Path(file.name)
                file.write(sealed(content))
            self._used.add(part.replace(self._folder / name))
        except OSError as error:
            raise self._refused(error) from error
        finally:
            if part is not None:
                part.unlink(missing_ok=True)

    def trim(self) -> None:
        """Evict the least recently used entries down to the limit, and the partial files of killed processes."""
        try:
            for part in self._folder.glob("*.part"):
                with suppress(FileNotFoundError):  # it was renamed in the meantime
                    if time.time() - part.stat().st_mtime > ABANDONED:
                        part.unlink()
            entries = [(path, path.stat()) for ending in ENDINGS for path in self._folder.glob(f"*{ending}")]
            newest_first = sorted(entries, key=lambda entry: -entry[1].st_mtime_ns)
            sizes = accumulate(stat.st_size for _, stat in newest_first)
            for (path, _), size in zip(newest_first, sizes, strict=True):
                if size > self._limit and path not in self._used:
                    path.unlink(missing_ok=True)
        except OSError as error:
            raise self._refused(error) from error


class SpareStore(Store):
    """A store without which its user can go on: after a failed write nothing is written, and `failure` says why."""

    def __init__(self, folder: Path) -> None:
        super().__init__(folder)
        self.failure = ""

    def put(self, name: str, content: bytes) -> None:
        """Store an entry, if all before it could be stored."""
        if not self.failure:
            try:
                super().put(name, content)
            except RecordingError as error:
                self.failure = str(error)


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


def key_of_analysis(
    recordings: Sequence[Path], settings: bytes, options: Sequence[str], digests: Mapping[Path, str] | None = None
) -> str:
    """Return the cache key of an analysis from everything that affects its output. `digests`: if known."""
    named = [[str(path), digest] for path, digest in (digests or digests_or_errors(recordings)).items()]
    inputs = json.dumps([code_digest(), named, hashlib.sha256(settings).hexdigest(), list(options)])
    return hashlib.sha256(inputs.encode()).hexdigest()


def digests_or_errors(recordings: Sequence[Path]) -> dict[Path, str]:
    """Return the SHA-256 of files, or why one cannot be read."""
    return digests_of(recordings, _digest_or_error)


def _digest_or_error(path: Path) -> str:
    """Return the SHA-256 of a file, or why it cannot be read: the analysis may leave it out."""
    try:
        return sha256_of(path)
    except RecordingError as error:
        return str(error)


def digests_of(paths: Sequence[Path], digest: Callable[[Path], str] = sha256_of) -> dict[Path, str]:
    """Return the SHA-256 of files, in hexadecimal."""
    with ThreadPoolExecutor() as pool:
        return dict(zip(paths, pool.map(digest, paths), strict=True))


def store_files(store: Store, folder: Path, without: Collection[str] = ()) -> dict[str, str]:
    """Store the files of a folder that nobody else uses yet; return the entry of each for `store_entry`.

    ``without``: names of files that others will replace.
    """
    files = {}
    for path in sorted(path for path in folder.rglob("*") if path.is_file() and path.name not in without):
        content = path.read_bytes()
        name = f"{hashlib.sha256(content).hexdigest()}{FILE}"
        if store.get(name) is None:
            store.put(name, content)
        files[path.relative_to(folder).as_posix()] = name
    return files


def store_entry(store: Store, key: str, files: Mapping[str, str], words: Sequence[str]) -> None:
    """Store the list of an analysis, whose files are stored."""
    store.put(f"{key}{ANALYSIS}", json.dumps({"files": dict(files), "words": list(words)}).encode())
    store.trim()


def restore_analysis(store: Store, key: str, folder: Path) -> tuple[str, ...] | None:
    """Write a completely cached analysis into an empty folder; return its messages, or None and write nothing."""
    listed = store.get(f"{key}{ANALYSIS}")
    if listed is None:
        return None
    entry = parse_json(bytes(listed))
    contents = {name: store.get(file) for name, file in entry["files"].items()}
    whole = {name: content for name, content in contents.items() if content is not None}
    if len(whole) < len(contents):
        return None
    for name, content in whole.items():
        (folder / name).parent.mkdir(parents=True, exist_ok=True)
        (folder / name).write_bytes(content)
    return tuple(entry["words"])
