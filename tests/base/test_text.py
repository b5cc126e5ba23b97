"""Texts that a user has written are read the same way everywhere: UTF-8, with or without a byte order mark."""

import os
from collections.abc import Callable
from pathlib import Path

import pytest

from netboard.base.errors import ConfigError
from netboard.base.files.text import find_text, open_text, read_text


def streamed(path: Path) -> str:
    with open_text(path) as file:
        return "".join(file)


READERS = (read_text, find_text, streamed)


@pytest.mark.parametrize("read", READERS)
@pytest.mark.parametrize("mark", [b"", b"\xef\xbb\xbf"])
def test_byte_order_mark_is_no_part_of_the_text(read: Callable[[Path], str], mark: bytes, tmp_path: Path) -> None:
    path = tmp_path / "words.toml"
    path.write_bytes(mark + 'a = "é"\n'.encode())
    assert read(path) == 'a = "é"\n'


@pytest.mark.parametrize("read", READERS)
@pytest.mark.parametrize("encoding", ["latin-1", "utf-16"])
def test_other_encodings_are_refused_with_file_and_line(
    read: Callable[[Path], str], encoding: str, tmp_path: Path
) -> None:
    path = tmp_path / "words.toml"
    path.write_bytes('a = 1\nb = "é"\n'.encode(encoding))
    line = 2 if encoding == "latin-1" else 1
    with pytest.raises(ConfigError, match=rf"words\.toml: line {line}: is not UTF-8; save the file as UTF-8"):
        read(path)


@pytest.mark.parametrize("read", [read_text, streamed])
def test_missing_file_is_wrong_input(read: Callable[[Path], str], tmp_path: Path) -> None:
    assert find_text(tmp_path / "none.toml") is None
    with pytest.raises(ConfigError, match=r"none\.toml: cannot be read: No such file"):
        read(tmp_path / "none.toml")


def test_utf16_without_byte_order_mark_is_recognised(tmp_path: Path) -> None:
    path = tmp_path / "words.toml"
    path.write_bytes("a = 1\nb = 2\n".encode("utf-16-le"))
    with pytest.raises(ConfigError, match="line 1: is not UTF-8"):
        read_text(path)


def test_line_ends_of_other_systems_are_line_ends(tmp_path: Path) -> None:
    path = tmp_path / "words.toml"
    path.write_bytes(b"a = 1\r\nb = 2\rc = 3\n")
    assert read_text(path) == "a = 1\nb = 2\nc = 3\n"


@pytest.mark.skipif(os.name != "posix", reason="no file without end")
def test_text_without_end_is_refused() -> None:
    with pytest.raises(ConfigError, match="/dev/zero: cannot be read: File too large, expected at most"):
        read_text(Path("/dev/zero"))
