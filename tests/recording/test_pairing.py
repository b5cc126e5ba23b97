"""Two recordings on a common timeline."""

from itertools import accumulate

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from made_recordings import loaded_recording, two_trials
from netboard.base.tick import TICK_SECONDS
from netboard.recording.replay.pairing import divide, pair


def slower():
    """The same two trials; the first starts 2 s later and lasts 1 s longer."""
    ticks = two_trials()
    ticks = np.concatenate([np.repeat(ticks[:1], 2000), ticks[:2000], np.repeat(ticks[2000:2001], 1000), ticks[2000:]])
    ticks["tick"] = 100 + np.arange(len(ticks))
    ticks["time_ns"] = np.arange(len(ticks)) * 1_000_000
    return ticks


RECORDINGS = loaded_recording(two_trials()), loaded_recording(slower())


def test_pairing_by_time_aligns_the_first_release():
    pairing = pair(RECORDINGS, "time")
    assert pairing.begin == pytest.approx(2.5)
    assert pairing.at(pairing.begin) == pytest.approx((0.5, 2.5))
    assert pairing.at(0.0) == pytest.approx((0.0, 0.0))
    assert pairing.at(2.0) == pytest.approx((0.0, 2.0))
    assert pairing.at(5.0) == pytest.approx((3.0, 5.0))
    assert pairing.length == pytest.approx(2.5 + 10.499)


def test_pairing_by_trial_aligns_each_trial_and_holds_the_shorter_one():
    pairing = pair(RECORDINGS, "trial")
    assert pairing.at(2.501) == pytest.approx((0.501, 2.501))
    assert pairing.at(6.501) == pytest.approx((4.0, 6.501)), "the first one has done its trial, and shows its end"
    assert pairing.at(7.0) == pytest.approx((4.0, 7.0))
    assert pairing.at(7.001) == pytest.approx((4.001, 7.001))
    assert pairing.at(8.001) == pytest.approx((5.001, 8.001))


def test_single_recording_keeps_its_own_timeline():
    pairing = pair(RECORDINGS[:1], "trial")
    for position in (0.0, 0.2, 0.5, 3.3, 9.999):
        assert pairing.at(position) == pytest.approx((position,))
        assert pairing.of(0, position) == pytest.approx(position)
    assert (pairing.begin, pairing.length) == pytest.approx((0.501, 9.999))


def test_pairing_by_trial_falls_back_to_time_without_a_common_trial():
    alone = loaded_recording(two_trials()[:900])
    assert pair((RECORDINGS[0], alone), "trial") == pair((RECORDINGS[0], alone), "time")


@st.composite
def _divisions(draw):
    count = draw(st.integers(2, 8))
    spans = st.lists(st.floats(0.001, 10.0), min_size=count, max_size=count)
    return [(0.0, *accumulate(draw(spans))) for _ in range(draw(st.integers(1, 3)))]


@given(_divisions(), st.lists(st.floats(0, 1), min_size=2, max_size=20))
def test_paired_positions_are_monotonic_and_cover_every_division(own, shares):
    pairing = divide(own)
    positions = [pairing.at(share * pairing.length) for share in sorted(shares)]
    for which, divisions in enumerate(own):
        mine = [position[which] for position in positions]
        assert np.all(np.diff(mine) >= -1e-9)
        assert min(mine) >= 0.0
        assert max(mine) <= divisions[-1] + 1e-9
        for common, division in zip(pairing.common[1:], divisions[1:], strict=True):
            assert pairing.at(common)[which] == pytest.approx(division, abs=1e-9)
        for share in shares:
            there = share * divisions[-1]
            assert pairing.at(pairing.of(which, there))[which] == pytest.approx(there, abs=TICK_SECONDS + 1e-9)
