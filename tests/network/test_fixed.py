"""The fixed-layout fast path reads and writes the codec's messages, and no others."""

from dataclasses import astuple

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from wire_strategies import messages_of

from netboard.network.protocol import fixed
from netboard.network.protocol.codec import decode, encode
from netboard.network.protocol.messages import Message
from netboard.network.protocol.motion import Force, Heartbeat, Point, Stylus


def written(message: Message, form: fixed.Form) -> bytes:
    """The message in its fixed form."""
    words = np.zeros(len(form.markers), np.int64)
    words.view(np.dtype(fixed.fields_of(type(message))))[0] = astuple(message)  # type: ignore[call-overload]
    frame = np.zeros(form.size, np.uint8)
    fixed.write(frame, form.head, form.markers, words)
    return frame.tobytes()


@pytest.mark.parametrize(("kind", "form"), [(Stylus, fixed.STYLUS), (Force, fixed.FORCE), (Point, fixed.POINT)])
def test_fixed_form_and_codec_read_each_frame_alike(kind: type, form: fixed.Form) -> None:
    @settings(max_examples=100, deadline=None)
    @given(messages_of(kind))
    def check(message: Message) -> None:
        frame = written(message, form)
        assert len(frame) == form.size
        assert repr(decode(frame)) == repr(message)
        words = np.zeros(len(form.markers), np.int64)
        assert fixed.read(frame, form.head, form.markers, words)
        record = words.view(np.dtype(fixed.fields_of(kind)))[0]  # type: ignore[call-overload]
        assert repr(kind(*record.tolist())) == repr(message)

    check()


@pytest.mark.slow
@settings(max_examples=300, deadline=None)
@given(st.integers(0, fixed.STYLUS.size - 1), st.integers(0, 255), messages_of(Stylus))
def test_frame_with_a_changed_byte_reads_as_in_the_codec_or_not_at_all(place: int, byte: int, message: Message) -> None:
    frame = bytearray(written(message, fixed.STYLUS))
    frame[place] = byte
    words = np.zeros(len(fixed.STYLUS.markers), np.int64)
    if fixed.read(bytes(frame), fixed.STYLUS.head, fixed.STYLUS.markers, words):
        record = words.view(np.dtype(fixed.fields_of(Stylus)))[0]
        assert repr(Stylus(*record.tolist())) == repr(decode(bytes(frame)))


def test_other_frames_are_left_to_the_codec() -> None:
    stylus = Stylus(1, 2, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0, 0, 0.0, -1, 0, 0, 0, 0)
    words = np.zeros(len(fixed.STYLUS.markers), np.int64)
    whole = written(stylus, fixed.STYLUS)
    for frame in (b"", encode(stylus), encode(Heartbeat(1, 2, 3, 4, True)), whole[:-1], whole + b"\0"):
        assert not fixed.read(frame, fixed.STYLUS.head, fixed.STYLUS.markers, words)
