"""Cache of extracted tables, keyed by the recording's bytes, the settings and the extracting code.

An entry holds each table as an Arrow stream. A change of a byte of the recording, its name, a setting that affects the
measures, or the extracting code gives another key, and the recording is measured again. The settings for summaries and
exclusions are not part of the key.
"""

import hashlib
from io import BytesIO
from pathlib import Path

from netboard.analysis.extraction.fingerprint import fingerprint
from netboard.analysis.extraction.recordings import FIELDS, Measured
from netboard.analysis.extraction.settings import Readings, measured_with
from netboard.analysis.extraction.store import LIMIT, TABLES, Store
from netboard.analysis.extraction.streams import Streams


class Cache:
    """Cached tables in a folder, created if missing, or an open store; above `limit` bytes unused ones are evicted."""

    def __init__(self, folder: Path | Store, limit: int = LIMIT) -> None:
        self._streams = Streams("zstd")
        self._store = folder if isinstance(folder, Store) else Store(folder, limit)
        self.trim = self._store.trim

    def get(self, key: str) -> Measured | None:
        """Return the cached tables; None if there are none or the entry is damaged."""
        content = self._store.get(f"{key}{TABLES}")
        if content is None:
            return None
        source = self._streams.source(content)
        return Measured(**{name: self._streams.read(source, fields) for name, fields in FIELDS.items()})

    def put(self, key: str, measured: Measured) -> None:
        """Store the tables of a recording."""
        sink = BytesIO()
        for name, fields in FIELDS.items():
            self._streams.write(sink, getattr(measured, name), fields)
        self._store.put(f"{key}{TABLES}", sink.getvalue())


def key_of(name: str, sha256: str, readings: Readings) -> str:
    """Return the cache key of a recording."""
    parts = (name, sha256, measured_with(readings), fingerprint())
    return hashlib.sha256("\0".join(parts).encode()).hexdigest()
