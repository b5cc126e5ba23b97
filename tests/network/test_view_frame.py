"""The compiled frame of a view is the message that `view_of` makes, and is written only if it shows something new."""

from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from netboard.base.config import SIDES, Side, parse
from netboard.base.tick import TICK
from netboard.network.protocol.codec import decode, encode
from netboard.network.protocol.messages import KINDS
from netboard.network.protocol.view_frame import CONTENT, MAX_SIZE, write_view
from netboard.stage.curtain import Curtain, Pause, make_curtain, view_of
from netboard.stage.view import View
from netboard.task.trials.state_machine import Phase

CURTAINS = [
    make_curtain(parse(text))
    for text in (
        "",
        '[block]\nconfiguration = "bimanual"\nblocks = 3',
        '[block]\nleft = "still"\nnumber = 2\nblocks = 2',
        "[physics]\nballs = 0",
        "[task]\nlevel_time = 0",
    )
]


def row(seed: int) -> Any:
    """A tick of random content, with zeros and numbers of all sizes."""
    rng = np.random.default_rng(seed)
    row = np.zeros(1, TICK)
    for name in TICK.names or ():
        if rng.random() < 0.8:
            row[name] = rng.normal() * 10.0 ** rng.integers(-9, 9) if TICK[name].kind == "f" else rng.integers(-3, 900)
    row["phase"], row["target"], row["attempt"] = rng.choice(list(Phase)), rng.choice((-1, 1)), rng.integers(0, 4)
    return row


def written(curtain: Curtain, tick: Any, station: Side, content: Any, *, at_any_rate: bool = False, **of: Any) -> bytes:
    """The frame of a station's view."""
    frame = np.zeros(MAX_SIZE, np.uint8)
    best, rest = of.get("best", np.nan), of.get("rest", np.nan)
    sent_ns, seq, pause = (of.get(name, 0) for name in ("sent_ns", "seq", "pause"))
    words, packed = tick.view(np.int64), curtain.stations[station]
    size = write_view(frame, packed, words, content, at_any_rate, best, sent_ns, seq, rest, pause)
    return frame[:size].tobytes()


@given(
    st.integers(0, 2**31),
    st.sampled_from(CURTAINS),
    st.sampled_from(SIDES),
    st.none() | st.floats(0.1, 99.0),
    st.none() | st.floats(0.1, 99.0),
    st.integers(0, 2**62),
    st.sampled_from(Pause),
)
def test_frame_is_the_view(
    seed: int, curtain: Curtain, station: Side, best: float | None, rest: float | None, sent_ns: int, pause: Pause
) -> None:
    tick = row(seed)
    known: dict[str, Any] = {name: value for name, value in (("best", best), ("rest", rest)) if value is not None}
    known |= {"sent_ns": sent_ns, "seq": seed, "pause": int(pause)}
    frame = written(curtain, tick, station, np.zeros(CONTENT, np.int64), **known)
    view = view_of(curtain, tick[0], station, best, sent_ns, seed, rest, pause)
    assert decode(frame) == view
    assert decode(encode(view)) == view


@given(st.integers(0, 2**31), st.sampled_from(CURTAINS), st.sampled_from(SIDES))
def test_frame_is_written_only_if_the_view_shows_something_new(seed: int, curtain: Curtain, station: Side) -> None:
    rng, tick, content = np.random.default_rng(seed), row(seed), np.zeros(CONTENT, np.int64)
    last = None
    for seq in range(30):
        name = rng.choice(["tick", "time_ns", "z", "left_used_z", "right_used_z", "failures", "counted", "left_force"])
        tick[name] += rng.integers(0, 2)
        view = view_of(curtain, tick[0], station, None, 0)
        shown = {name: getattr(view, name) for name in View.__slots__ if name != "tick"}
        frame = written(curtain, tick, station, content, sent_ns=seq, seq=seq, rest=float(seq))
        assert (frame != b"") == (shown != last)
        assert decode(written(curtain, tick, station, content, at_any_rate=True)) == view
        last = shown


def test_longest_view_fits_the_frame_and_the_protocol() -> None:
    limit = next(kind.most_bytes for kind in KINDS.values() if kind.message is View)
    sizes = []
    for phase in Phase:
        tick = row(1)
        tick["phase"], tick["completion"], tick["attempt"] = phase, 1.0, 2
        longest = {"best": 1.0, "rest": 1.0, "sent_ns": 2**62, "seq": 2**62, "pause": len(Pause) - 1}
        frame = written(CURTAINS[1], tick, "left", np.zeros(CONTENT, np.int64), **longest)
        sizes.append(len(frame))
    assert max(sizes) <= min(limit, MAX_SIZE)


def test_tick_of_an_unknown_phase_is_refused() -> None:
    tick = row(1)
    for phase in (-2, len(Phase)):
        tick["phase"] = phase
        with pytest.raises(ValueError, match="unknown phase"):
            written(CURTAINS[0], tick, "left", np.zeros(CONTENT, np.int64))
