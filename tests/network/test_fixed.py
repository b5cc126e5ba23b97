"""The fixed-layout fast path reads and writes the codec's messages, and no others."""

from dataclasses import astuple
from typing import get_type_hints

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from wire_strategies import messages_of

from netboard.network.protocol import fixed
from netboard.network.protocol.codec import decode, encode
from netboard.network.protocol.messages import Message
from netboard.network.protocol.motion import Force, Heartbeat, Point, Stylus

_FORMS = [(kind, fixed.form_of(kind)) for kind in (Stylus, Force, Point, Heartbeat)]


def written(message: Message, form: fixed.FixedForm) -> bytes:
    """The message in its fixed form."""
    words = np.zeros(len(form.markers), np.int64)
    words.view(np.dtype(fixed.fields_of(type(message))))[0] = astuple(message)  # type: ignore[call-overload]
    frame = np.zeros(form.size, np.uint8)
    fixed.write(frame, form, words)
    return frame.tobytes()


@pytest.mark.parametrize(("kind", "form"), _FORMS)
def test_fixed_form_and_codec_read_each_frame_alike(kind: type, form: fixed.FixedForm) -> None:
    @settings(max_examples=100, deadline=None)
    @given(messages_of(kind))
    def check(message: Message) -> None:
        frame = written(message, form)
        assert len(frame) == form.size
        assert repr(decode(frame)) == repr(message)
        assert repr(read(frame, kind, form)) == repr(message)

    check()


def read(frame: bytes, kind: type, form: fixed.FixedForm) -> Message | None:
    """The message in a frame of the fixed form, None if the frame has another form."""
    words = np.zeros(len(form.markers), np.int64)
    if not fixed.read(frame, form, words):
        return None
    numbers = words.view(np.dtype(fixed.fields_of(kind)))[0].tolist()  # type: ignore[call-overload]
    return kind(*(hint(n) for n, hint in zip(numbers, get_type_hints(kind).values(), strict=True)))  # type: ignore[no-any-return]


@pytest.mark.slow
@pytest.mark.parametrize(("kind", "form"), _FORMS)
def test_frame_with_a_changed_byte_reads_as_in_the_codec_or_not_at_all(kind: type, form: fixed.FixedForm) -> None:
    @settings(max_examples=200, deadline=None)
    @given(st.integers(0, form.size - 1), st.integers(0, 255), messages_of(kind))
    def check(place: int, byte: int, message: Message) -> None:
        frame = bytearray(written(message, form))
        frame[place] = byte
        if (found := read(bytes(frame), kind, form)) is not None:
            assert repr(found) == repr(decode(bytes(frame)))

    check()


def test_other_frames_are_left_to_the_codec() -> None:
    stylus = Stylus(1, 2, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0, 0, 0.0, -1, 0, 0, 0, 0)
    whole = written(stylus, fixed.STYLUS)
    for frame in (b"", encode(stylus), encode(Heartbeat(1, 2, 3, 4, True)), whole[:-1], whole + b"\0"):
        assert read(frame, Stylus, fixed.STYLUS) is None
