"""Read a text that a user has written: configurations, studies, manifests, settings, words of a display, tables.

It is UTF-8, with or without the byte order mark that some editors add. Anything else is an error that names the file
and the line, and says how to save it. A whole text has a largest size; a table is read line by line.
"""

import errno
from codecs import BOM_UTF8, BOM_UTF16_BE, BOM_UTF16_LE
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TextIO

from netboard.base.errors import ConfigError

LONGEST = 4_000_000
"""Largest size of a text [bytes]; thousands of recordings fit the manifest of an import."""


SAVE_AS_UTF8 = "save the file as UTF-8 in the program that made it"
"""What to do about a file that is not UTF-8, where a person has written it."""


def read_text(
    path: Path | str, missing: str = "cannot be read: No such file or directory", not_utf8: str = SAVE_AS_UTF8
) -> str:
    """Return a text; raise `ConfigError` for one that cannot be read, or that has no end, as ``/dev/zero`` has none.

    ``missing``: what to say of a file that does not exist; ``not_utf8``: what to do about one that is not UTF-8.
    """
    text = find_text(Path(path), not_utf8)
    if text is None:
        raise ConfigError(f"{path}: {missing}")
    return text


def find_text(path: Path, not_utf8: str = SAVE_AS_UTF8) -> str | None:
    """Return a text as `read_text`, or None if the file does not exist."""
    with _readable(path):
        try:
            with path.open("rb") as file:
                data = file.read(LONGEST + 1)
        except FileNotFoundError:
            return None
        if len(data) > LONGEST:
            raise OSError(errno.EFBIG, f"File too large, expected at most {LONGEST} bytes", str(path))
    if data.startswith((BOM_UTF16_LE, BOM_UTF16_BE)) or b"\0" in data:
        raise ConfigError(_not_utf8(path, data[: data.find(b"\0")].count(b"\n") + 1, not_utf8))
    try:
        text = data.removeprefix(BOM_UTF8).decode()
    except UnicodeDecodeError:
        raise ConfigError(_not_utf8(path, _first_wrong(data.splitlines()), not_utf8)) from None
    return text.replace("\r\n", "\n").replace("\r", "\n")


@contextmanager
def open_text(path: Path) -> Iterator[TextIO]:
    """Open a text of any size, for `csv`; raise `ConfigError` where it cannot be read."""
    with _readable(path):
        try:
            with path.open(encoding="utf-8-sig", newline="") as file:
                yield file
        except UnicodeDecodeError:
            with path.open("rb") as lines:
                line = _first_wrong(lines)
            raise ConfigError(_not_utf8(path, line)) from None


@contextmanager
def _readable(path: Path) -> Iterator[None]:
    """Convert an error of the disk into one that names the file."""
    try:
        yield
    except OSError as error:
        raise ConfigError(f"{path}: cannot be read: {error.strerror or error}") from error


def _first_wrong(lines: Iterable[bytes]) -> int:
    """Return the number of the first line that is not UTF-8, from 1."""
    for number, line in enumerate(lines, start=1):
        try:
            line.decode()
        except UnicodeDecodeError:
            return number
    raise ValueError("every line is UTF-8")


def _not_utf8(path: Path, line: int, what_to_do: str = SAVE_AS_UTF8) -> str:
    """Say that a file is no text in UTF-8, and what to do."""
    return f"{path}: line {line}: is not UTF-8; {what_to_do}"
