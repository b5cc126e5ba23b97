"""Results that are kept: the tables of a recording, by its bytes, the readings and the code that measured it.

An entry is one file: the SHA-256 of what follows, then each table as an Arrow stream. Whoever changes a byte of the
recording, its name, a reading that decides what is measured, or the code that measures, gets another key and measures
anew; summaries and exclusions are no part of it. An entry is written under another name and renamed; one that was
damaged since is not used. What was not used for longest goes when all entries are larger than a limit, but nothing that
is in use: a study that is larger than that would otherwise drop what it comes to next.
"""

import hashlib
import os
import time
from contextlib import suppress
from io import BytesIO
from pathlib import Path
from tempfile import NamedTemporaryFile

import numpy as np

from netboard.errors import RecordingError
from netboard.measuring.fingerprint import fingerprint
from netboard.measuring.readings import Readings, measured_with
from netboard.measuring.recordings import FIELDS, Measured
from netboard.measuring.streams import Streams

LIMIT = 2_000_000_000
"""What is kept beside what is in use is not more than this, in bytes: some twenty studies of the paper's size [1]."""

ENDING = ".tables"
"""What the name of an entry ends with."""

ABANDONED = 86_400.0
"""Nobody is writing an entry any more after this [s]."""

_DIGEST_BYTES = 32


def default_folder() -> Path:
    """Where results are kept for this user."""
    chosen = os.environ.get("XDG_CACHE_HOME")
    return (Path(chosen) if chosen else Path.home() / ".cache") / "netboard" / "measures"


class Cache:
    """A folder of results.

    Parameters
    ----------
    folder : Path
        The folder; it is made if need be.
    limit : int
        What is kept and not in use is dropped from this size on, in bytes [1].

    Raises
    ------
    RecordingError
        If it cannot be made.
    ConfigError
        If pyarrow is not installed.
    """

    def __init__(self, folder: Path, limit: int = LIMIT) -> None:
        self._streams = Streams("zstd")
        self._folder, self._limit = folder, limit
        self._used: set[Path] = set()
        try:
            folder.mkdir(parents=True, exist_ok=True)
        except OSError as error:
            raise self._refused(error) from error

    def _refused(self, error: OSError) -> RecordingError:
        reason = error.strerror or str(error)
        return RecordingError(f"{self._folder}: results cannot be kept there: {reason}; --no-cache keeps none")

    def _path(self, key: str) -> Path:
        return self._folder / f"{key}{ENDING}"

    def get(self, key: str) -> Measured | None:
        """Return the tables that are kept; None if there are none, or not as they were written.

        Parameters
        ----------
        key : str
            What `key_of` gives.
        """
        path = self._path(key)
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
        source = self._streams.source(content)
        return Measured(**{name: self._streams.read(source, fields) for name, fields in FIELDS.items()})

    def put(self, key: str, measured: Measured) -> None:
        """Keep the tables of a recording.

        Parameters
        ----------
        key : str
            What `key_of` gives.
        measured : Measured
            The tables.

        Raises
        ------
        RecordingError
            If they cannot be written.
        """
        sink = BytesIO()
        for name, fields in FIELDS.items():
            self._streams.write(sink, getattr(measured, name), fields)
        content = sink.getvalue()
        part = None
        try:
            with NamedTemporaryFile(dir=self._folder, suffix=".part", delete=False) as file:
                part = Path(file.name)
                file.write(hashlib.sha256(content).digest() + content)
            self._used.add(part.replace(self._path(key)))
        except OSError as error:
            raise self._refused(error) from error
        finally:
            if part is not None:
                part.unlink(missing_ok=True)

    def trim(self) -> None:
        """Drop what was not used for longest, down to the limit or what is in use, and what killed processes have left.

        Raises
        ------
        RecordingError
            If that is not allowed.
        """
        try:
            for part in self._folder.glob("*.part"):
                with suppress(FileNotFoundError):  # it got its name just now
                    if time.time() - part.stat().st_mtime > ABANDONED:
                        part.unlink()
            entries = [(path, path.stat()) for path in self._folder.glob(f"*{ENDING}")]
            newest_first = sorted(entries, key=lambda entry: -entry[1].st_mtime_ns)
            sizes = np.cumsum([stat.st_size for _, stat in newest_first])
            for (path, _), size in zip(newest_first, sizes, strict=True):
                if size > self._limit and path not in self._used:
                    path.unlink(missing_ok=True)
        except OSError as error:
            raise self._refused(error) from error


def key_of(name: str, sha256: str, readings: Readings) -> str:
    """Name the entry of a recording.

    Parameters
    ----------
    name : str
        What the recording is called, which its tables say.
    sha256 : str
        SHA-256 of its bytes, in hexadecimal.
    readings : Readings
        How it is measured.
    """
    parts = (name, sha256, measured_with(readings), fingerprint())
    return hashlib.sha256("\0".join(parts).encode()).hexdigest()
