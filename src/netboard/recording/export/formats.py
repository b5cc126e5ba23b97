"""Registry of the export formats, and the steps that all of them share.

A format is a function ``write(recordings, folder, progress)``, which fills an empty folder and raises a `NetboardError`
if it cannot. This module does the rest: a result gets its final name only when it is complete,
existing files are never overwritten, and a failed export leaves nothing behind.
"""

import os
import shutil
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import ExitStack, contextmanager, suppress
from dataclasses import dataclass
from glob import escape
from importlib import import_module
from importlib.util import find_spec
from pathlib import Path
from typing import Any, TypeVar, cast

from netboard.base import plugins
from netboard.base.errors import ConfigError, NetboardError, writing
from netboard.base.files.new import refuse_existing
from netboard.base.system.locks import lock

Progress = Callable[[str, int, int], None]
"""Progress callback: current step, amount done and total [1]."""

Ticks = TypeVar("Ticks", bound=Any)  # arrays or columns; no array type, as commands import this module without numpy


def reporting(portions: Iterable[Ticks], name: str, total: int, progress: Progress) -> Iterator[Ticks]:
    """Pass on the ticks of a recording, and report after each portion how many are done."""
    done = 0
    progress(name, done, total)
    for rows in portions:
        yield rows
        done += len(rows["tick"])
        progress(name, done, total)


@dataclass(frozen=True, slots=True)
class Format:
    """An export format."""

    name: str
    writer: str  # its function, as ``module:function``; imported when needed
    # What is written, and who reads it, for the documentation.
    about: str
    readers: str
    extra: str = ""  # optional dependency group of netboard that it needs; empty for none


PACKAGE = "netboard.recording.export"
"""Package of netboard's own writers."""

FORMATS = {
    one.name: one
    for one in (
        Format(
            "parquet",
            f"{PACKAGE}.tabular:write_parquet",
            "typed, compressed columns",
            "pandas, polars, R's arrow, DuckDB, MATLAB's `parquetread`; long studies",
            "parquet",
        ),
        Format(
            "csv",
            f"{PACKAGE}.tabular:write_csv",
            "text: UTF-8, commas; seven to nine times as large as Parquet",
            "everything else",
        ),
        Format(
            "mat",
            f"{PACKAGE}.matlab:write",
            "MATLAB version 5, a struct for each table",
            "MATLAB, GNU Octave, `scipy.io.loadmat`",
        ),
        Format(
            "bids", f"{PACKAGE}.bids:write", "a [Motion-BIDS](bids-nwb.md) dataset", "BIDS tools, MNE-BIDS, archives"
        ),
        Format(
            "nwb",
            f"{PACKAGE}.nwb:write",
            "an [NWB](bids-nwb.md) file for each person and run",
            "PyNWB, DANDI, MatNWB",
            "nwb",
        ),
        Format(
            "xdf",
            f"{PACKAGE}.xdf:write",
            "[XDF 1.0](lsl.md), as LabRecorder would write it",
            "pyxdf, EEGLAB, MNE, SigViewer",
        ),
    )
}
"""Registry of netboard's own export formats by name. A new format is one entry."""

GROUP = "netboard.export_formats"
"""Entry-point group of the formats of other packages; each entry names its writer."""

Writer = Callable[[Sequence[Path], Path, Progress], None]
"""Writes recordings into an empty folder."""


def names() -> tuple[str, ...]:
    """Return the names of all export formats, sorted."""
    return plugins.names(GROUP, FORMATS)


def writer_of(name: str) -> Writer:
    """Return the function that writes a format; raise `ConfigError` if there is none."""
    targets = {one.name: one.writer for one in FORMATS.values()}
    found = plugins.load(GROUP, name, targets, "export format", ConfigError)
    if not callable(found):
        raise ConfigError(f"the export format {name!r} is {found!r}, expected a function(recordings, folder, progress)")
    return cast(Writer, found)


def export(recordings: Sequence[Path], name: str, folder: Path, progress: Progress) -> None:
    """Export recordings to a new folder.

    Raises `ConfigError` if the folder exists, and `RecordingError` if it cannot be written or a recording cannot be
    read. Nothing is left behind then.
    """
    write = writer_of(name)
    with new_folder(folder) as part:
        write(recordings, part, _over_all(len(recordings), progress))


def _over_all(count: int, progress: Progress) -> Progress:
    """Return a callback for the progress in each of some recordings, one after the other; it reports that in all."""
    places: dict[str, int] = {}

    def tell(name: str, done: int, total: int) -> None:
        place, total = places.setdefault(name, len(places)), max(total, 1)
        progress(f"{name} ({place + 1} of {count})", place * total + done, count * total)

    return tell


@contextmanager
def new_folder(folder: Path) -> Iterator[Path]:
    """Create a folder that gets its name only when it is complete; after an error, nothing is left."""
    with scratch_folder(folder) as scratch:
        (part := scratch / "new").mkdir()
        yield part
        refuse_existing(folder)
        part.rename(folder)


@contextmanager
def scratch_folder(folder: Path) -> Iterator[Path]:
    """Create a temporary folder beside a new one, for what is not complete, and remove it at the end.

    What is left of a process that was killed is removed when the folder is made again.
    """
    refuse_existing(folder)
    part = folder.with_name(f".{folder.name}.{os.getpid()}.part")
    with writing(folder), ExitStack() as locks:
        folder.parent.mkdir(parents=True, exist_ok=True)
        for abandoned in folder.parent.glob(f".{escape(folder.name)}.*.part"):
            with suppress(OSError), _locked(abandoned):
                shutil.rmtree(abandoned, ignore_errors=True)
        part.mkdir()
        try:
            with suppress(OSError):  # a system without locks removes nothing either
                locks.enter_context(_locked(part))
            yield part
        except NetboardError as error:
            if isinstance(error.__cause__, OSError) and str(part) in str(error):
                raise error.__cause__ from None  # name the folder that was asked for, not the temporary one
            raise
        finally:
            shutil.rmtree(part, ignore_errors=True)


@contextmanager
def _locked(folder: Path) -> Iterator[None]:
    """Lock a folder; raise `OSError` if another process has locked it, or the system cannot lock it."""
    handle = os.open(folder, os.O_RDONLY)
    try:
        lock(handle)
        yield
    finally:
        os.close(handle)


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
