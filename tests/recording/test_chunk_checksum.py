"""A chunk whose checksum is not that of zlib is refused."""

import struct
import zlib

import pytest
import zstandard
from hypothesis import given
from hypothesis import strategies as st

from netboard.base.errors import RecordingError
from netboard.recording.format.chunks import unpack_chunk


def chunk_of(data: bytes, crc: int) -> bytes:
    packed = zstandard.compress(data)
    return struct.pack("<QQQII", 0, 0, len(data), crc, 4) + b"zstd" + struct.pack("<Q", len(packed)) + packed


@given(st.sampled_from([1, 15, 64, 1000, 65_536, 200_001]), st.randoms(use_true_random=False))
def test_chunk_with_the_checksum_of_zlib_is_read(length: int, generator: object) -> None:
    data = generator.randbytes(length)  # type: ignore[attr-defined]
    assert unpack_chunk(chunk_of(data, zlib.crc32(data))) == data


@pytest.mark.parametrize("bit", range(32))
def test_chunk_with_another_checksum_is_refused(bit: int) -> None:
    data = bytes(range(256)) * 9
    with pytest.raises(RecordingError, match="its checksum is wrong"):
        unpack_chunk(chunk_of(data, zlib.crc32(data) ^ 1 << bit))
