"""Decodes a chunk: verifies and decompresses its bytes, and iterates over its messages.

The upstream library creates one Python object per message. Walking the bytes here is several times faster, so an hour
of 1 kHz ticks loads in seconds.
"""

import struct
from collections.abc import Callable, Iterator, Sequence
from mmap import mmap
from threading import local
from typing import NamedTuple

import lz4.frame
import numpy as np
import zstandard
from isal.isal_zlib import crc32
from mcap.exceptions import McapError
from mcap.opcode import Opcode
from numpy.typing import NDArray

from netboard.base.compiled import Bytes, waiting
from netboard.base.errors import RecordingError
from netboard.recording.format.claims import require_chunk, shown

MAGIC = b"\x89MCAP0\r\n"
"""First and last bytes of an MCAP file."""

RECORD_HEAD = struct.Struct("<BQ")
"""Opcode and length, at the start of every MCAP record."""

UNSOUND = (McapError, struct.error, UnicodeDecodeError, OverflowError)
"""Exceptions that the upstream library raises on damaged bytes."""

_WRONG_LENGTH = "a damaged chunk: the length of a record in it is wrong"
_CONTRADICTION = "a damaged chunk: its sizes contradict each other"
_CHUNK_HEAD = struct.Struct("<QQQII")
_LENGTH = struct.Struct("<Q")
_MESSAGE_HEAD = struct.Struct("<BQHIQQ")
_HEAD_SIZE, _MESSAGE_SIZE, _MESSAGE = RECORD_HEAD.size, _MESSAGE_HEAD.size, int(Opcode.MESSAGE)


class ChunkMessage(NamedTuple):
    """One message in a chunk."""

    channel_id: int
    sequence: int
    # Time stamps of the logger and of the source [ns].
    log_time_ns: int
    publish_time_ns: int
    data: bytes


class _Decompressor(local):
    """A decompressor for each thread, whose buffers take longer to allocate than a chunk takes to decompress."""

    def __init__(self) -> None:
        self.zstd = zstandard.ZstdDecompressor()


_decompressor = _Decompressor()


def unpack_chunk(body: bytes) -> bytes:
    """Decompress a chunk and verify its size and checksum."""
    try:
        size, crc, compression, packed = _parts(body)
        require_chunk(size, len(packed))
        if compression not in _UNPACK:
            raise RecordingError(f"a damaged chunk: its compression is {shown(compression.decode(errors='replace'))}")
        data = _UNPACK[compression](packed, size)
    except (*UNSOUND, RuntimeError, zstandard.ZstdError) as error:  # lz4 raises a RuntimeError
        raise RecordingError(f"a damaged chunk: {error!s:.200}") from error
    if len(data) != size:
        raise RecordingError(_CONTRADICTION)
    if crc and crc32(data) != crc:
        raise RecordingError("a damaged chunk: its checksum is wrong")
    return data


def _unpack_zstd(packed: memoryview, size: int) -> bytes:
    # Check the size first: the library allocates what the frame claims.
    if zstandard.frame_content_size(packed) != size:
        raise RecordingError(_CONTRADICTION)
    return _decompressor.zstd.decompress(packed)


def _unpack_lz4(packed: memoryview, size: int) -> bytes:
    return bytes(lz4.frame.LZ4FrameDecompressor().decompress(packed, size + 1))


_UNPACK: dict[bytes, Callable[[memoryview, int], bytes]] = {
    b"zstd": _unpack_zstd,
    b"lz4": _unpack_lz4,
    b"": lambda packed, size: bytes(packed),
}
"""Decompression of a chunk of a known size, by the name of its compression."""


def _parts(body: bytes) -> tuple[int, int, bytes, memoryview]:
    """Split a chunk record into uncompressed size, checksum, compression and data."""
    _, _, size, crc, name = _CHUNK_HEAD.unpack_from(body)
    compression = bytes(body[_CHUNK_HEAD.size : _CHUNK_HEAD.size + name])
    (length,) = _LENGTH.unpack_from(body, _CHUNK_HEAD.size + name)
    start = _CHUNK_HEAD.size + name + _LENGTH.size
    if start + length != len(body):
        raise RecordingError("a damaged chunk: its length is wrong")
    return size, crc, compression, memoryview(body)[start:]


def has_right_length(data: "mmap | bytes", start: int, stop: int) -> bool:
    """Return whether the parts of the chunk record between two places in a file fill it, without copying it."""
    at = start + RECORD_HEAD.size
    if at + _CHUNK_HEAD.size > stop:
        return False
    name: int = at + _CHUNK_HEAD.size + _CHUNK_HEAD.unpack_from(data, at)[4]
    if name + _LENGTH.size > stop:
        return False
    length: int = _LENGTH.unpack_from(data, name)[0]
    return stop == name + _LENGTH.size + length


def _record_in(data: bytes, position: int) -> tuple[int, int]:
    """Return opcode and end of the record at a place in a decompressed chunk."""
    opcode, length = RECORD_HEAD.unpack_from(data, position)
    end: int = position + RECORD_HEAD.size + length
    if end > len(data) or (opcode == Opcode.MESSAGE and length < _MESSAGE_HEAD.size - RECORD_HEAD.size):
        raise RecordingError(_WRONG_LENGTH)
    return opcode, end


def messages(data: bytes) -> Iterator[ChunkMessage]:
    """Iterate over the messages of a decompressed chunk, in file order."""
    position = 0
    while position < len(data):
        opcode, end = _record_in(data, position)
        if opcode == Opcode.MESSAGE:
            _, _, channel_id, sequence, log_time, publish_time = _MESSAGE_HEAD.unpack_from(data, position)
            yield ChunkMessage(channel_id, sequence, log_time, publish_time, data[position + _MESSAGE_HEAD.size : end])
        position = end


def payloads_of(data: bytes, channel_ids: Sequence[int]) -> tuple[list[memoryview], ...]:
    """Return the data of the messages of some channels, each in file order; the chunk is walked once, not copied."""
    places = np.empty((len(data) // RECORD_HEAD.size + 1, 3), np.int64)
    count = _find_messages(np.frombuffer(data, np.uint8), places)
    if count < 0:
        raise RecordingError(_WRONG_LENGTH)
    found: dict[int, list[memoryview]] = {number: [] for number in channel_ids}
    whole = memoryview(data)
    for channel, start, stop in places[:count].tolist():
        if channel in found:
            found[channel].append(whole[start:stop])
    return tuple(found[number] for number in channel_ids)


@waiting
def _find_messages(data: Bytes, places: NDArray[np.int64]) -> int:
    """Write channel, start and stop of the data of each message; return their number, -1 if a length is wrong."""
    position, count = 0, 0
    while position < len(data):
        body = position + _HEAD_SIZE
        if body > len(data):
            return -1
        length = np.uint64(0)
        for k in range(8):
            length |= np.uint64(data[position + 1 + k]) << np.uint64(8 * k)
        if length > np.uint64(len(data) - body):
            return -1
        end = body + np.int64(length)
        if data[position] == _MESSAGE:
            start = position + _MESSAGE_SIZE
            if start > end:
                return -1
            places[count, 0] = np.int64(data[body]) | np.int64(data[body + 1]) << 8
            places[count, 1], places[count, 2] = start, end
            count += 1
        position = int(end)
    return count
