"""The codec decodes any malformed frame to the right message or a `WireError`, with bounded memory."""

import random
import struct
import tracemalloc
from contextlib import suppress
from itertools import islice
from pathlib import Path

import msgpack
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from evidence.faults.malformed_frames import NESTING_DEPTH, MalformedFrames, valid_frames
from evidence.fuzz.reference_decoder import bits, decode_with_both
from netboard.base.errors import WireError
from netboard.network.protocol import fixed
from netboard.network.protocol.codec import decode
from netboard.network.protocol.messages import KINDS, Message
from netboard.network.protocol.motion import Force, Stylus

GOLDEN = [path.read_bytes() for path in sorted((Path(__file__).parents[2] / "data" / "frames").glob("*.bin"))]
SEEDS = range(4)
FRAME_COUNT = 5000


@pytest.mark.parametrize("seed", SEEDS)
def test_malformed_frames_decode_as_the_reference_decoder_decodes_them(seed: int) -> None:
    accepted = sum(decode_with_both(frame) is not None for frame in islice(MalformedFrames(GOLDEN, seed), FRAME_COUNT))
    assert FRAME_COUNT // 50 < accepted < FRAME_COUNT // 2


def test_malformed_frames_reach_every_message_type() -> None:
    for frame in valid_frames(1):
        assert decode_with_both(frame) is not None
    kinds = set()
    for frame in islice(MalformedFrames(valid_frames(2), 3), FRAME_COUNT):
        try:
            kinds.add(type(decode(frame)).__name__)
        except WireError as error:
            kinds.add(str(error).split(":")[0])
    assert kinds >= {kind.message.__name__ for kind in KINDS.values()}


def test_the_same_seed_gives_the_same_frames() -> None:
    assert list(islice(MalformedFrames(GOLDEN, 7), 300)) == list(islice(MalformedFrames(GOLDEN, 7), 300))
    assert list(islice(MalformedFrames(GOLDEN, 7), 300)) != list(islice(MalformedFrames(GOLDEN, 8), 300))


items = st.one_of(
    st.binary(min_size=1, max_size=3),
    st.sampled_from(sorted(KINDS)).map(lambda kind: bytes([kind])),
    st.integers(0x80, 0xFF).map(lambda head: bytes([head])),
    st.sampled_from([b"\xdc", b"\xde", b"\xc5", b"\xda"]).flatmap(
        lambda head: st.integers(0, 2**16 - 1).map(lambda length: head + struct.pack(">H", length))
    ),
    st.sampled_from([b"\xdd", b"\xdf", b"\xc6", b"\xdb"]).flatmap(
        lambda head: st.sampled_from([0, 1, 5, 2**31, 2**32 - 1]).map(lambda length: head + struct.pack(">I", length))
    ),
    (st.none() | st.booleans() | st.integers(-(2**63), 2**64 - 1) | st.floats() | st.text() | st.binary()).map(
        msgpack.packb
    ),
)


@pytest.mark.slow
@settings(max_examples=500, deadline=None)
@given(st.lists(items, max_size=20).map(b"".join))
def test_any_sequence_of_items(frame: bytes) -> None:
    decode_with_both(frame)


@pytest.mark.slow
@settings(max_examples=500, deadline=None)
@given(st.sampled_from(sorted(KINDS)), st.integers(0, 20), st.lists(items, max_size=20).map(b"".join), st.booleans())
def test_any_sequence_of_items_after_a_valid_header(kind: int, length: int, rest: bytes, wide: bool) -> None:
    head = b"\xdc" + struct.pack(">H", length) if wide or length > 15 else bytes([0x90 | length])
    decode_with_both(head + bytes([kind]) + rest)


@pytest.mark.slow
@settings(max_examples=300, deadline=None)
@given(st.sampled_from(GOLDEN), st.data())
def test_any_item_in_place_of_any_bytes(frame: bytes, data: st.DataObject) -> None:
    begin = data.draw(st.integers(0, len(frame)))
    decode_with_both(frame[:begin] + data.draw(items) + frame[data.draw(st.integers(begin, len(frame))) :])


@pytest.mark.parametrize("kind", [1, 2, 3, 4, 20, 35, 52])
def test_the_codec_accepts_frames_up_to_the_size_limit(kind: int) -> None:
    tree = next(tree for frame in valid_frames(1) if (tree := msgpack.unpackb(frame))[0] == kind)
    longest = KINDS[kind].most_bytes
    at = max(index for index, value in enumerate(tree) if isinstance(value, str))
    tree[at] = ""
    for more in range(-8, 8):
        tree[at] = "x" * (longest - len(msgpack.packb([*tree[:at], "", *tree[at + 1 :]])) + more)
        frame = msgpack.packb(tree)
        assert (decode_with_both(frame) is None) == (len(frame) > longest)


AFTER_COMPLETIONS = [
    *(0, [], [], "", [], []),
    *("S01", "D01", "", False, False, True, True, "", 1, 1, "", "", 0.0, "", 0, [], [], [], [], [], [], [], [], []),
]
"""The fields of a `Status` after the completion times."""


@pytest.mark.parametrize(
    ("kind", "before", "item", "after"),
    [
        (21, ["left"], [1, 2, 3], [0]),
        (31, [0, 0], b"", []),
        (52, ["", 0, "", 0, 0, 0, 0], 0.5, AFTER_COMPLETIONS),
        (55, [0], [1, 1, 1, "success", 0.5, "", 0], []),
        (57, [], [5, 0.0, 0.0, 0.0, 0.0, 0.5, 0.0, 0.0], []),
    ],
)
def test_the_codec_accepts_arrays_up_to_the_length_limit(kind: int, before: list, item: object, after: list) -> None:  # type: ignore[type-arg]
    longest = KINDS[kind].most_items
    assert decode_with_both(msgpack.packb([kind, *before, [item] * longest, *after])) is not None
    assert decode_with_both(msgpack.packb([kind, *before, [item] * (longest + 1), *after])) is None


# --- memory ------------------------------------------------------------------------------------------------------


def peak_memory(frame: bytes) -> int:
    """Return the peak memory of decoding a frame [bytes]."""
    tracemalloc.start()
    try:
        with suppress(WireError):
            decode(frame)
        return tracemalloc.get_traced_memory()[1]
    finally:
        tracemalloc.stop()


def nested_frames(kind: int) -> list[bytes]:
    """Return frames with nested arrays, maps or strings, each with the largest length that its limit allows."""
    most = max(KINDS[kind].most_items, 15)
    head = bytes([0x90 | 15, kind])
    openings = (b"\x91", b"\x9f", b"\x81\xa0", b"\x8f\xa0", b"\xdc" + struct.pack(">H", min(most, 65_535)))
    tails = (b"", b"\xc0" * 4000, b"\xdb\xff\xff\xff\xff", b"\xc6\x7f\xff\xff\xff", b"\xdf\xff\xff\xff\xff")
    exact = bytes([0x90 | min(15, 1 + len(KINDS[kind].message.__dataclass_fields__)), kind])
    return [
        (first + opening * times + tail)[: KINDS[kind].most_bytes]
        for first in (head, exact)
        for opening in openings
        for times in (1, 100, 500, NESTING_DEPTH)
        for tail in tails
    ]


@pytest.mark.parametrize("kind", sorted(KINDS))
def test_the_memory_for_nested_frames_is_bounded_by_their_length(kind: int) -> None:
    for frame in nested_frames(kind):
        assert peak_memory(frame) < 200_000 + 100 * len(frame), frame[:40].hex()


def test_the_memory_for_malformed_frames_is_bounded_by_their_length() -> None:
    for frame in islice(MalformedFrames(GOLDEN, 9), 2000):
        assert peak_memory(frame) < 200_000 + 100 * len(frame), frame[:40].hex()


# --- the fixed form ----------------------------------------------------------------------------------------------


@pytest.mark.slow
@pytest.mark.parametrize(("form", "kind"), [(fixed.STYLUS, Stylus), (fixed.FORCE, Force)])
def test_the_fixed_form_reader_agrees_with_the_codec(form: fixed.FixedForm, kind: type[Message]) -> None:
    rng = random.Random(4)
    words = np.zeros(1, fixed.fields_of(kind))
    numbers = words.view(np.int64)
    taken = 0
    for frame in islice(MalformedFrames([fixed_frame(form, kind, rng) for _ in range(50)], 5), FRAME_COUNT):
        if not fixed.read(frame, form, numbers):
            continue
        taken += 1
        assert bits(decode(frame)) == bits(kind(*words[0].item()))
    assert taken > FRAME_COUNT // 100


def fixed_frame(form: fixed.FixedForm, kind: type[Message], rng: random.Random) -> bytes:
    """Return a frame of the fixed form with random numbers."""
    words = np.frombuffer(rng.randbytes(8 * len(form.markers)), np.int64)
    frame = np.zeros(form.size, np.uint8)
    fixed.write(frame, form, words)
    return frame.tobytes()
