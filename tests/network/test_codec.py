"""The codec: round trips, and a message or a WireError for any bytes."""

import dataclasses
import typing

import msgpack
import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st
from wire_strategies import CLASSES, messages, messages_of

from fakes import STATUS
from netboard.base.errors import WireError
from netboard.base.safeguards import Safeguard
from netboard.network.protocol.codec import decode, encode
from netboard.network.protocol.control import Command, StatusRequest
from netboard.network.protocol.joining import Hello, Refusal
from netboard.network.protocol.messages import CHOICES, KINDS, Message
from netboard.network.protocol.motion import Force, Heartbeat, Stylus
from netboard.network.protocol.records import EventRecord, LogBatch, LogEnd
from netboard.network.protocol.views import Frames
from netboard.stage.view import View

HELLO = Hello("agent", "left", 1, "here", "0.1.0", {})
FORCE = Force(1, 2, 3, 0.5, 4)


def same(one: Message, other: Message) -> bool:
    """Equal in class, types and values, with NaN equal to NaN and -0.0 apart from 0.0."""
    return type(one) is type(other) and repr(one) == repr(other)


def frame(*parts: object) -> bytes:
    packed: bytes = msgpack.packb(parts)
    return packed


@pytest.mark.parametrize("message", CLASSES, ids=lambda message: message.__name__)
def test_message_survives_a_round_trip(message: type[Message]) -> None:
    @settings(max_examples=40, deadline=None)
    @given(messages_of(message))
    def check(sent: Message) -> None:
        assert same(decode(encode(sent)), sent)

    check()


@settings(max_examples=300, deadline=None)
@given(st.binary(max_size=200))
@example(b"")
@example(b"\xc1")
@example(b"\xdc")
@example(b"\xdc\x00\x11")
@example(b"\x92\x0a")
@example(b"\xdd\xff\xff\xff\xff\x0a")
def test_arbitrary_bytes_decode_to_a_message_or_raise_wire_error(junk: bytes) -> None:
    check_decodes_or_raises(junk)


@pytest.mark.slow
@settings(max_examples=300, deadline=None)
@given(messages(), st.data())
def test_damaged_frame_decodes_to_a_message_or_raises_wire_error(sent: Message, data: st.DataObject) -> None:
    damaged = bytearray(encode(sent))
    for _ in range(data.draw(st.integers(1, 3))):
        at = data.draw(st.integers(0, len(damaged) - 1))
        match data.draw(st.sampled_from(("change", "remove", "insert", "cut"))):
            case "change":
                damaged[at] = data.draw(st.integers(0, 255))
            case "remove" if len(damaged) > 1:
                del damaged[at]
            case "insert":
                damaged.insert(at, data.draw(st.integers(0, 255)))
            case _:
                damaged = damaged[: max(at, 1)]
    check_decodes_or_raises(bytes(damaged))


@pytest.mark.slow
@settings(max_examples=300, deadline=None)
@given(
    st.sampled_from(sorted(KINDS)),
    st.lists(
        st.recursive(
            st.none()
            | st.booleans()
            | st.integers(-(2**63), 2**64 - 1)
            | st.floats()
            | st.text(max_size=4)
            | st.binary(max_size=4),
            lambda inner: st.lists(inner, max_size=3) | st.dictionaries(st.text(max_size=2), inner, max_size=2),
            max_leaves=6,
        ),
        max_size=18,
    ),
)
def test_arbitrary_values_decode_to_a_message_or_raise_wire_error(kind: int, values: list[object]) -> None:
    check_decodes_or_raises(frame(kind, *values))


def check_decodes_or_raises(junk: bytes) -> None:
    """Check that bytes raise `WireError` or decode to a message that survives a round trip."""
    try:
        message = decode(junk)
    except WireError:
        return
    assert same(decode(encode(message)), message)


def test_every_message_class_has_one_kind() -> None:
    assert sorted(kind.message.__name__ for kind in KINDS.values()) == sorted(c.__name__ for c in CLASSES)
    assert all(1 <= number <= 127 for number in KINDS)


def test_every_choice_belongs_to_a_text_field() -> None:
    for message, name in CHOICES:
        assert typing.get_type_hints(message)[name] is str


@pytest.mark.parametrize(
    ("bad", "reason"),
    [
        (b"", "0 bytes are no message"),
        (b"\x90", "1 bytes are no message"),
        (frame(99, 1), "no message of kind 99"),
        (frame(0), "no message of kind 0"),
        (frame(11, 1, 2, 3, 4), "Force: not an array of 6"),
        (frame(11, 1, 2, 3, 0.5, 0, 4), "Force: not MessagePack within the limits: 7 exceeds"),
        (frame(11, 1, 2, 3, 0.5) + b"\xc0", "Force: not MessagePack"),
        (frame(11, 1, 2, 3, 0.5)[:-1], "Force: not MessagePack"),
        (frame(11, 1, 2, 3, 1, 4), "Force: force: expected float, got 1"),
        (frame(11, 1, 2, 3, None, 4), "Force: force: expected float, got None"),
        (frame(11, True, 2, 3, 0.5, 4), "Force: tick: expected an integer of 64 bits, got True"),
        (frame(11, 1.0, 2, 3, 0.5, 4), "Force: tick: expected an integer"),
        (frame(11, 1, 2**63, 3, 0.5, 4), "Force: sent_ns: expected an integer of 64 bits"),
        (frame(3, b"no"), "Refusal: reason: expected str"),
        (frame(34, "row"), "TickRecord: row: expected bytes"),
        (frame(50, "explode", "", 1), "Command: name: expected one of"),
        (frame(1, "king", "", 1, "", "", {}), "Hello: role: expected one of"),
        (frame(1, "agent", "middle", 1, "", "", {}), "Hello: side: expected one of"),
        (frame(1, "agent", "left", 1, "", "", {"n": 1}), "Hello: details: expected str, got 1"),
        (frame(1, "agent", "left", 1, "", "", {1: "n"}), "Hello: not MessagePack"),
        (frame(1, "agent", "left", 1, "", "", []), "Hello: details: expected dict"),
        (frame(21, "left", [[1, 2]], 0), "Frames: shown: expected 3 items, got 2"),
        (frame(21, "left", [1], 0), "Frames: shown: expected tuple"),
        (frame(31, 0, 0, ["x"]), "LogBatch: records: expected bytes"),
        (frame(3, msgpack.Timestamp(1)), "Refusal: not MessagePack"),
        (b"\x92\x03\xa1\xff", "Refusal: not MessagePack"),  # not UTF-8
        (b"\x81\x0b\xc0", "Force: not MessagePack"),  # a map
        (b"\xa1\x0b", "Force: not an array"),  # a string
        (b"\xa2\x03x", "Refusal: not an array"),  # a string as long as the array would be
        (b"\x92\xcc\x03", "no message of kind 204"),  # a kind in two bytes
    ],
)
def test_refused_frame_gives_the_reason(bad: bytes, reason: str) -> None:
    with pytest.raises(WireError, match="^" + reason.replace("(", r"\(")):
        decode(bad)


def test_hostile_sizes_are_refused_before_allocation() -> None:
    for bad in (
        b"\x92\x03\xdb\xff\xff\xff\xff",  # a string of 4 GiB
        b"\x92\x22\xc6\xff\xff\xff\xff",  # bytes
        b"\x94\x1f\x00\x00\xdd\xff\xff\xff\xff",  # an array of 2**32 records
        b"\x97\x01\xa0\xa0\x01\xa0\xa0\xdf\xff\xff\xff\xff",  # a map
        b"\x92\x03" + b"\x91" * 4000,  # deep, then cut
        b"\x92\x03" + b"\x91" * 1010 + b"\xc0",  # deep and whole: more than Python recurses, less than msgpack refuses
        b"\x92\x03" + b"\x91" * 1500 + b"\xc0",
        b"\x92\x03" + b"\x81\xa0" * 900 + b"\xc0",
        b"\x92\x03" + b"\xdc\x0f\xff" * 1000,  # deep arrays that each claim 4095 items
        b"\x92\x03" + b"\xa0" * 1_100_000,
    ):
        with pytest.raises(WireError):
            decode(bad)


@pytest.mark.parametrize("number", sorted(KINDS))
def test_each_kind_limits_the_frame_size(number: int) -> None:
    with pytest.raises(WireError, match="at most"):
        decode(bytes([0x92, number]) + bytes(KINDS[number].most_bytes))


def test_encoder_converts_number_types() -> None:
    assert same(decode(encode(Force(np.int64(1), 2, True, 1, 4))), Force(1, 2, 1, 1.0, 4))  # type: ignore[arg-type]
    assert same(decode(encode(Force(1, 2, 3, np.float32(0.5), 4))), Force(1, 2, 3, 0.5, 4))  # type: ignore[arg-type]
    stylus = Stylus(0, 0, 0, 0, 0, 0, 0, 0, 0, Safeguard.ARMED | Safeguard.STALE, 0, -1, 0, 0, 0, 0)
    received = decode(encode(stylus))
    assert isinstance(received, Stylus)
    assert (received.safeguards, type(received.safeguards), type(received.x)) == (17, int, float)


@pytest.mark.parametrize(
    "mistake",
    [
        Force(1, 2, 3, "0.5", 4),  # type: ignore[arg-type]
        Force(1, 2, 3, None, 4),  # type: ignore[arg-type]
        Force(1.5, 2, 3, 0.5, 4),  # type: ignore[arg-type]
        Force(2**63, 2, 3, 0.5, 4),
        Force(1, -(2**63) - 1, 3, 0.5, 4),
        Command("explode", "", 1),
        dataclasses.replace(HELLO, details={"n": 1}),  # type: ignore[dict-item]
        dataclasses.replace(HELLO, details=None),  # type: ignore[arg-type]
        Refusal(b"bytes"),  # type: ignore[arg-type]
        Refusal("\ud800"),
        Refusal("x" * 9000),
        Frames("left", ((1, 2),), 0),  # type: ignore[arg-type]
        Frames("left", [(1, 2, 3)], 0),  # type: ignore[arg-type]
    ],
    ids=repr,
)
def test_encoding_a_wrong_value_raises_type_or_value_error(mistake: Message) -> None:
    with pytest.raises((TypeError, ValueError)):
        encode(mistake)


def test_decoder_accepts_every_message_up_to_the_encoder_limits() -> None:
    longest = KINDS[52].most_items
    status = dataclasses.replace(STATUS, completions=(1.5,) * longest)
    assert decode(encode(status)) == status
    batch = LogBatch(0, 0, (bytes(250),) * KINDS[31].most_items)
    assert decode(encode(batch)) == batch
    event = EventRecord(0, 0, 0, "note", {"text": "ä" * 32_000})
    assert decode(encode(event)) == event
    hello = dataclasses.replace(HELLO, name="n" * (KINDS[1].most_bytes - 40))
    assert decode(encode(hello)) == hello
    assert encode(Refusal(f"there is already an agent called {hello.name}"))
    with pytest.raises(ValueError, match="at most 4096 items, got 4097"):
        encode(dataclasses.replace(batch, records=(b"",) * (KINDS[31].most_items + 1)))


def test_decoder_accepts_other_widths_of_the_same_number() -> None:
    """Another language may write an integer in eight bytes, or a float in four."""
    wide = b"\x96\x0c\xd3" + (1).to_bytes(8, "big") + b"\xcf" + (2).to_bytes(8, "big") + b"\xd0\x03\x04\xc2"
    assert decode(wide) == Heartbeat(1, 2, 3, 4, False)
    assert decode(b"\x96\x0b\x01\x02\x03\xca\x3f\x00\x00\x00\x04") == FORCE


def test_short_messages_encode_to_known_bytes() -> None:
    assert encode(StatusRequest()) == b"\x91\x33"
    assert decode(b"\x91\x33") == StatusRequest()
    assert encode(LogEnd(-1)) == b"\x92\x21\xff"
    assert encode(Heartbeat(1, 2, 3, 4, True)) == b"\x96\x0c\x01\x02\x03\x04\xc3"


def test_view_encodes_hidden_fields_as_nil() -> None:
    view = View("left", 1, 2, "running", 0.0, 0.0, None, 0.15, 0.01, None, 1, 6, 0, None, None, "", 7, 0.5, 1, 2, 3.5)
    assert decode(encode(view)) == view
