"""Measured tables that are kept: those of a recording, by its bytes, the readings and the code that measured it.

An entry has each table as an Arrow stream. Whoever changes a byte of the recording, its name, a reading that decides
what is measured, or the code that measures, gets another key and measures anew; summaries and exclusions are no part of
it.
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
    """The measured tables in a folder of entries.

    Parameters
    ----------
    folder : Path or Store
        The folder, which is made if need be; or its entries.
    limit : int
        What is kept and not in use is dropped from this size on, in bytes [1].
    """

    def __init__(self, folder: Path | Store, limit: int = LIMIT) -> None:
        self._streams = Streams("zstd")
        self._store = folder if isinstance(folder, Store) else Store(folder, limit)
        self.trim = self._store.trim

    def get(self, key: str) -> Measured | None:
        """Return the tables that are kept; None if there are none, or not as they were written."""
        content = self._store.get(f"{key}{TABLES}")
        if content is None:
            return None
        source = self._streams.source(content)
        return Measured(**{name: self._streams.read(source, fields) for name, fields in FIELDS.items()})

    def put(self, key: str, measured: Measured) -> None:
        """Keep the tables of a recording."""
        sink = BytesIO()
        for name, fields in FIELDS.items():
            self._streams.write(sink, getattr(measured, name), fields)
        self._store.put(f"{key}{TABLES}", sink.getvalue())


def key_of(name: str, sha256: str, readings: Readings) -> str:
    """Name the entry of a recording."""
    parts = (name, sha256, measured_with(readings), fingerprint())
    return hashlib.sha256("\0".join(parts).encode()).hexdigest()
