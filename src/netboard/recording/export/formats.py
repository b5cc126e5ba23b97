"""Registry of the export formats, and the steps that all of them share.

A format is a module with one function, ``write(recordings, folder, progress)``, which fills an empty folder and raises
a `NetboardError` if it cannot. This module does the rest: a result gets its final name only when it is complete,
existing files are never overwritten, and a failed export leaves nothing behind.
"""

import os
import shutil
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from importlib import import_module
from importlib.util import find_spec
from pathlib import Path
from typing import Any

from netboard.base.errors import ConfigError, RecordingError

Progress = Callable[[str, int, int], None]
"""Progress callback: current step, amount done and total [1]."""

FORMATS: dict[str, str] = {
    "parquet": "netboard.recording.export.parquet",
    "csv": "netboard.recording.export.delimited",
    "mat": "netboard.recording.export.matlab",
    "bids": "netboard.recording.export.bids",
    "nwb": "netboard.recording.export.nwb",
    "xdf": "netboard.recording.export.xdf",
    "xdf-lsl": "netboard.recording.export.xdf",  # the same format: files as LabRecorder would write them
}
"""Export formats: name to the module with its ``write``."""


def export(recordings: Sequence[Path], name: str, folder: Path, progress: Progress) -> None:
    """Export recordings to a new folder.

    Raises
    ------
    RecordingError
        If the folder exists or cannot be written, or a recording cannot be read. Nothing is left behind then.
    """
    if name not in FORMATS:
        raise ConfigError(f"--to {name}: expected one of {', '.join(FORMATS)}")
    write: Callable[[Sequence[Path], Path, Progress], None] = import_module(FORMATS[name]).write
    with new_folder(folder) as part:
        write(recordings, part, progress)


@contextmanager
def new_folder(folder: Path) -> Iterator[Path]:
    """Create a folder that gets its name only when it is complete; after an error, nothing is left."""
    refuse_existing(folder)
    part = folder.with_name(f".{folder.name}.{os.getpid()}.part")
    try:
        folder.parent.mkdir(parents=True, exist_ok=True)
        part.mkdir()
        try:
            yield part
            refuse_existing(folder)
            part.rename(folder)
        finally:
            shutil.rmtree(part, ignore_errors=True)
    except OSError as error:
        raise RecordingError(f"{folder}: cannot be written: {error.strerror or error}") from error


def refuse_existing(folder: Path) -> None:
    """Raise an error if the path exists."""
    if folder.exists():
        raise RecordingError(f"{folder}: is there already; name another --output")


def library(name: str, extra: str) -> Any:
    """Import an optional library of a format."""
    try:
        return import_module(name)
    except ImportError:
        raise _missing(name, extra) from None


def need(extra: str, *names: str) -> None:
    """Raise an error before a long export if a required library is missing; do not import it yet."""
    for name in names:
        if find_spec(name) is None:
            raise _missing(name, extra)


def _missing(name: str, extra: str) -> ConfigError:
    package = name.partition(".")[0]
    return ConfigError(f"this needs {package}, which is not installed: pip install 'netboard[{extra}]'")
