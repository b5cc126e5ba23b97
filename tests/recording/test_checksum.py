"""The checksum of a chunk is that of zlib, however it is computed."""

import zlib

import pytest
from hypothesis import given
from hypothesis import strategies as st

from netboard.recording.format import checksum
from netboard.recording.format.checksum import BLOCK, crc32

LENGTHS = st.sampled_from([*range(0, 3 * BLOCK + 2), 65_536, 200_001])


@given(LENGTHS, st.randoms(use_true_random=False))
def test_checksum_equals_that_of_zlib(length: int, generator: object) -> None:
    data = generator.randbytes(length)  # type: ignore[attr-defined]
    assert crc32(data) == zlib.crc32(data)


@pytest.mark.parametrize("byte", [b"\0", b"\xff"])
@pytest.mark.parametrize("length", [2 * BLOCK, 10 * BLOCK + 7])
def test_constant_bytes_have_the_checksum_of_zlib(byte: bytes, length: int) -> None:
    assert crc32(byte * length) == zlib.crc32(byte * length)


def test_every_flipped_bit_of_three_blocks_changes_the_checksum() -> None:
    data = bytearray(range(3 * BLOCK))
    whole = crc32(bytes(data))
    for place in range(8 * len(data)):
        data[place // 8] ^= 1 << place % 8
        assert crc32(bytes(data)) != whole
        data[place // 8] ^= 1 << place % 8


def test_other_processors_leave_the_checksum_to_zlib(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(checksum, "IS_FAST", False)
    data = bytes(range(256)) * 9
    assert crc32(data) == zlib.crc32(data)
