"""Cache on disk: a folder of entries, bounded in size, safe for any number of processes.

An entry is one file: a SHA-256 followed by the content that it covers. It is written under a temporary name and
renamed; a damaged entry is ignored. Above the size limit the least recently used entries are evicted, except those in
use: a larger study would otherwise evict what it reads next.

This module imports no numerical library.
"""

import hashlib
import os
import time
from contextlib import suppress
from itertools import accumulate
from pathlib import Path
from tempfile import NamedTemporaryFile

from netboard.base.errors import RecordingError

LIMIT = 2_000_000_000
"""Size limit for entries that are not in use, in bytes: some ten studies of the paper's size [1]."""

TABLES, ANALYSIS, FILE = ".tables", ".analysis", ".file"
"""Suffixes of entries: tables of a recording, the list of an analysis, one of its files."""

ENDINGS = (TABLES, ANALYSIS, FILE)

ABANDONED = 86_400.0
"""Age after which an unfinished entry is abandoned [s]."""

_DIGEST_BYTES = 32


def default_folder() -> Path:
    """Return the user's cache folder."""
    chosen = os.environ.get("XDG_CACHE_HOME")
    return (Path(chosen) if chosen else Path.home() / ".cache") / "netboard" / "measures"


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
        return RecordingError(f"{self._folder}: results cannot be kept there: {reason}; {self._advice}")

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
        content = memoryview(whole)[_DIGEST_BYTES:]
        if hashlib.sha256(content).digest() != whole[:_DIGEST_BYTES]:
            return None
        self._used.add(path)
        return content

    def put(self, name: str, content: bytes) -> None:
        """Store an entry."""
        part = None
        try:
            with NamedTemporaryFile(dir=self._folder, suffix=".part", delete=False) as file:
                part = Path(file.name)
                file.write(hashlib.sha256(content).digest())
                file.write(content)
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
