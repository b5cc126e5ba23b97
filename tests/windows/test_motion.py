"""Extrapolation between views, from the newest two, never across a change of phase."""

from dataclasses import replace

import pytest
from display_parts import VIEW
from hypothesis import given
from hypothesis import strategies as st

from netboard.base.config import Config
from netboard.windows.participant.motion import MAX_TICKS, motion_after

CONFIG = Config()
MS = 1_000_000
TRAVEL = 300_000
"""Transit time of the fastest view plus the offset between the two clocks [ns]."""


def moved(*views, travel=TRAVEL):
    """The motion estimate after some views, each sent at its tick."""
    motion = None
    for changes in views:
        view = replace(VIEW, **changes)
        view = replace(view, sent_ns=view.tick * MS)
        motion = motion_after(motion, view, view.sent_ns + travel)
    return motion


def at(motion, ms):
    return motion.at(round(ms * MS) + TRAVEL, CONFIG)


def test_single_view_is_not_extrapolated():
    motion = moved({"tick": 100, "z": 0.01})
    assert motion.settled(0)
    assert at(motion, 105) == motion.view


def test_motion_is_extrapolated_for_one_interval_and_then_settles_on_the_view():
    motion = moved({"tick": 100, "z": 0.00, "left": 0.01}, {"tick": 108, "z": 0.008, "left": 0.01})
    assert at(motion, 108).z == pytest.approx(0.008)
    assert at(motion, 112).z == pytest.approx(0.012)
    assert at(motion, 118).z == pytest.approx(0.016)
    assert at(motion, 112).left == 0.01
    assert not motion.settled(120 * MS)
    assert motion.settled(130 * MS)
    assert at(motion, 130).z == 0.008


def test_delayed_view_does_not_slow_the_extrapolation():
    motion = moved({"tick": 100, "z": 0.0}, {"tick": 108, "z": 0.008})
    late = replace(VIEW, tick=116, z=0.016, sent_ns=116 * MS)
    motion = motion_after(motion, late, 121 * MS + TRAVEL)
    assert at(motion, 121).z == pytest.approx(0.021, abs=1e-5)


def test_clock_offset_restarts_for_another_server():
    motion = moved({"tick": 100, "z": 0.0}, {"tick": 108, "z": 0.008})
    other = replace(VIEW, tick=116, z=0.016, sent_ns=10**15)
    assert motion_after(motion, other, 130 * MS).origin_ns == 130 * MS - 10**15


@pytest.mark.parametrize("change", [{"phase": "levelling"}, {"trial": 5}, {"target": -0.15}, {"failures": 2}])
def test_motion_is_not_extrapolated_across_a_change_of_trial_or_phase(change):
    motion = moved({"tick": 100, "z": 0.0}, {"tick": 108, "z": 0.008, **change})
    assert motion.settled(109 * MS)
    assert at(motion, 112).z == 0.008


def test_no_rates_from_distant_or_equal_views():
    assert moved({"tick": 100, "z": 0.0}, {"tick": 101 + MAX_TICKS, "z": 0.008}).rates is None
    assert moved({"tick": 100, "z": 0.01}, {"tick": 108, "z": 0.01}).rates is None


def test_hidden_hand_stays_hidden():
    motion = moved({"tick": 100, "z": 0.0, "right": None}, {"tick": 108, "z": 0.008, "right": None})
    assert at(motion, 112).right is None


@given(
    st.sampled_from(("running", "holding", "levelling")),
    st.floats(-0.35, 0.35),
    st.floats(-0.35, 0.35),
    st.floats(0, 1),
    st.floats(-10, 40),
)
def test_extrapolated_ball_stays_where_its_phase_allows(phase, before, now, share, ms):
    target, half = 0.15, 0.035
    inside = abs(now - target) <= half
    phase = "holding" if inside and phase == "running" else "running" if phase == "holding" and not inside else phase
    motion = moved(
        {"tick": 100, "phase": phase, "p": before, "share": 0.0},
        {"tick": 108, "phase": phase, "p": now, "share": share},
    )
    seen = at(motion, 108 + ms)
    assert abs(seen.p) <= CONFIG.task.fall_distance
    assert 0 <= seen.share <= 1
    if phase == "holding":
        assert abs(seen.p - target) <= half + 1e-12
    if phase == "running":
        assert abs(seen.p - target) >= half - 1e-12
