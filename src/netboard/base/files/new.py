"""A new file, complete or absent: written under a temporary name, then renamed; and checks of its name and folder."""

import os
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from itertools import count
from pathlib import Path
from tempfile import TemporaryFile

from netboard.base.errors import ConfigError, NetboardError, writing


def refuse_existing(path: Path, or_else: str = "") -> None:
    """Refuse an output that exists already; ``or_else``: what the command can do besides taking another name."""
    with suppress(FileNotFoundError, NotADirectoryError):
        path.lstat()  # not `exists`: a link to data that git-annex has not fetched is to be kept, too
        raise ConfigError(f"{path}: already exists; name another output{or_else}")


def try_writing(folder: Path) -> None:
    """Raise OSError if no file can be made in a folder; leave nothing in it."""
    with TemporaryFile(dir=folder):
        pass


def write_synced(path: Path, text: str) -> None:
    """Write a text to disk, so that a power cut after a later renaming leaves no empty file."""
    with path.open("w", encoding="utf-8", newline="\n") as file:
        file.write(text)
        file.flush()
        os.fsync(file.fileno())


def free_backup(path: Path) -> Path:
    """Return the name of the next backup of a file: no earlier backup is replaced."""
    first = path.with_name(f"{path.name}.bak")
    numbered = (path.with_name(f"{path.name}.bak.{number}") for number in count(2))
    return first if not first.exists() else next(name for name in numbered if not name.exists())


@contextmanager
def new_file(path: Path, *, force: bool = False) -> Iterator[Path]:
    """Yield the temporary path; at the end the file gets its name. No error leaves a part.

    An existing file is refused, or with ``force`` replaced.
    """
    part = path.with_name(f".{path.name}.{os.getpid()}.part")
    with writing(path, NetboardError):
        try:
            if not force:
                refuse_existing(path)
            yield part
            if not force:  # it may have appeared meanwhile
                refuse_existing(path)
            part.replace(path)
        finally:
            with suppress(OSError):
                part.unlink(missing_ok=True)
