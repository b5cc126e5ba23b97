"""Find the recordings in a list of files and folders, and the hash of a file.

This module imports no numerical library.
"""

import hashlib
import os
import time
from collections.abc import Iterable, Sequence
from glob import escape
from pathlib import Path

from netboard.base.errors import NoRecording, RecordingError, unreadable
from netboard.base.terminal.shell import shell_command

RECOVERABLE = "netboard recover makes a recording of it"
"""What to do about an unfinished or damaged recording, where no path may be named."""

UNFINISHED = f"is unfinished; {RECOVERABLE}"
"""Why an unfinished recording is left out."""

EMPTY = "is empty (0 bytes): it contains nothing to read or to recover"
"""What is wrong with a file of which nothing was written."""

GROWING_S = 10.0
"""An unfinished recording written to within this time may still be growing; a logger writes at least every 5 s [s]."""

_UNFINISHED = (".mcap.part", ".spill")
"""Endings of recordings that are not finished, and of records that no logger took from a server."""

_OF_THE_DISK = ("lost+found", "System Volume Information", "$RECYCLE.BIN")
"""Folders at the top of a disk that belong to the file system, and that only an administrator may read."""

_OF_MACOS = "._"
"""Start of the names of files in which macOS keeps what it knows about others, on disks of other systems."""


def find_recordings(paths: Sequence[Path]) -> tuple[Path, ...]:
    """Return the recordings that the paths name.

    Each comes once, in the order of `paths`, sorted by name within a folder. Raises `RecordingError` if a folder has no
    recording, a name cannot be written as text, or two different recordings share a file name: their outputs could not
    be told apart.
    """
    found: list[Path] = []
    for path in paths:
        here = _named(path, ".mcap") if path.is_dir() else [path]
        if not here:
            words = "".join(f"; {part.name} {UNFINISHED}" for part in find_unfinished([path])[:1])
            raise NoRecording(f"{path}: there is no recording (.mcap) in this folder{words}")
        found += here
    names: dict[str, Path] = {}
    for path in dict.fromkeys(found):
        if not _is_text(path):  # as of a disk that another system has written
            raise RecordingError(f"{path}: its path is not valid UTF-8, so no table can contain it; rename it")
        other = names.setdefault(path.stem, path)
        if other != path and not _same_content(other, path):
            raise RecordingError(f"{other} and {path} have the same name; take them one at a time, or rename one")
    return tuple(dict.fromkeys(found))


def _same_content(one: Path, other: Path) -> bool:
    """Return whether two files are one, or equal byte by byte."""
    try:
        if one.samefile(other):
            return True
        return one.stat().st_size == other.stat().st_size and sha256_of(one) == sha256_of(other)
    except (OSError, RecordingError):  # the command that reads it reports why
        return False


def _named(folder: Path, *endings: str) -> list[Path]:
    return sorted(path for path in folder.iterdir() if _ends(path.name, endings))


def _ends(name: str, endings: tuple[str, ...]) -> bool:
    return name.endswith(endings) and not name.startswith(_OF_MACOS)


def each_once(paths: Iterable[Path]) -> list[Path]:
    """Return the paths without those that name the same place again."""
    places: dict[str, Path] = {}
    for path in paths:
        places.setdefault(os.path.normpath(path.absolute()), path)
    return list(places.values())


def _is_text(path: Path) -> bool:
    """Return whether a path can be written as UTF-8."""
    try:
        str(path).encode()
    except UnicodeEncodeError:
        return False
    return True


def files_below(folder: Path, endings: tuple[str, ...]) -> list[Path]:
    """Return the files in a folder and its subfolders whose names have one of these endings, sorted.

    Raises `RecordingError` if a subfolder cannot be read: its files must not pass for absent. A disk's own folders, and
    hidden ones such as its trash, may be unreadable.
    """

    def refuse(error: OSError) -> None:
        where = Path(error.filename)
        if where != folder and (where.name in _OF_THE_DISK or where.name.startswith(".")):
            return
        raise RecordingError(f"{error.filename}: cannot be read: {error.strerror}") from error

    walked = os.walk(folder, onerror=refuse)
    found = (Path(place, name) for place, _, names in walked for name in names if _ends(name, endings))
    # A link to a file that is not there, as on a disk that is not mounted, must not pass for absent either.
    return sorted(path for path in found if path.is_file() or not path.exists())


def require_file(path: Path) -> None:
    """Refuse a folder, and a pipe or a device, which cannot be read from any position and may keep a reader waiting."""
    if path.is_dir():
        listing = shell_command("netboard", "sessions", path)
        raise NoRecording(f"{path}: is a folder, expected a recording; {listing} lists those in a folder")
    if path.exists() and not path.is_file():
        raise NoRecording(f"{path}: is a pipe or a device; save the recording as a file, and give that")


def sha256_of(path: Path) -> str:
    """Return the SHA-256 hash of a file, in hexadecimal."""
    try:
        with path.open("rb") as file:
            return hashlib.file_digest(file, "sha256").hexdigest()
    except OSError as error:
        raise unreadable(path, error) from error


def find_unfinished(paths: Sequence[Path]) -> tuple[Path, ...]:
    """Return the unfinished recordings and spills in the folders among the paths that have not been recovered."""
    found = sorted(file for path in paths if path.is_dir() for file in _named(path, *_UNFINISHED))
    return tuple(file for file in found if recovered_as(file) is None)


def recovered_path(path: Path) -> Path:
    """Return the recovered file's path: ``X.mcap.part``, ``X.mcap`` or ``X.spill`` becomes ``X.recovered.mcap``."""
    whole = path.with_suffix("") if path.suffix == ".part" else path
    return whole.with_suffix(".recovered.mcap")


def recovered_as(path: Path) -> Path | None:
    """Return the file as which another was recovered, the first of those of a spill; None if it was not recovered."""
    target = recovered_path(path)
    blocks = sorted(path.parent.glob(f"{escape(path.stem)}_block*.recovered.mcap")) if path.suffix == ".spill" else []
    return next((file for file in (target, *blocks) if file.exists()), None)


def recovery_advice(path: Path) -> str:
    """Return what to do about an unfinished or damaged recording."""
    try:
        if recovered := recovered_as(path):
            return f"it was recovered as {recovered}"
        growing = path.suffix == ".part" and abs(time.time() - path.stat().st_mtime) < GROWING_S
    except OSError:  # a logger has just finished and renamed it, or the disk does not answer
        growing = False
    return "a logger may still be writing it; after its session, " * growing + recovery_command(path)


def recovery_command(path: Path) -> str:
    """Return the command that recovers a recording, in words."""
    return f"run: {shell_command('netboard', 'recover', path)}"


def repair_advice(path: Path, source: str) -> str:
    """Return what to do about a recording that an older netboard recovered wrongly from a file of this name, if any."""
    whole = path.parent / source
    if not source or not whole.is_file():
        return recovery_advice(path)
    again = recovered_path(whole).name.replace(".recovered.mcap", "_again.recovered.mcap")
    return f"recover its source again: {shell_command('netboard', 'recover', whole, '-o', path.parent / again)}"
