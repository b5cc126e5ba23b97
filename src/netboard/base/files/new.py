"""A file that is complete or absent: written under a temporary name, and then renamed; and a check of its folder."""

import os
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from tempfile import TemporaryFile

from netboard.base.errors import NetboardError, writing


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


@contextmanager
def new_file(path: Path) -> Iterator[Path]:
    """Yield the temporary path; at the end the file gets its name, in place of an existing one. No error leaves a part.

    A caller that keeps existing files refuses them as the last step.
    """
    part = path.with_name(f".{path.name}.{os.getpid()}.part")
    with writing(path, NetboardError):
        try:
            yield part
            part.replace(path)
        finally:
            with suppress(OSError):
                part.unlink(missing_ok=True)
