"""The minimum-jerk profile, compared with closed forms."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from netboard.participants.people.submovement import Submovement, minimum_jerk


def test_minimum_jerk_starts_and_ends_at_rest() -> None:
    assert minimum_jerk(0.0) == 0.0
    assert minimum_jerk(1.0) == 1.0
    assert minimum_jerk(-3.0) == 0.0
    assert minimum_jerk(7.0) == 1.0
    h = 1e-4
    for end in (0.0, 1.0):
        inside = end + (h if end == 0.0 else -h)
        assert abs(minimum_jerk(inside) - end) < 11 * h**3


@given(st.floats(0.0, 1.0))
def test_minimum_jerk_is_symmetric_about_its_midpoint(s: float) -> None:
    assert minimum_jerk(s) + minimum_jerk(1.0 - s) == pytest.approx(1.0, abs=1e-14)


@given(st.floats(-1.0, 2.0), st.floats(0.0, 1.0))
def test_minimum_jerk_is_monotonic(s: float, more: float) -> None:
    assert minimum_jerk(s + more) >= minimum_jerk(s) - 1e-14


@pytest.mark.parametrize("share", [0.1, 0.2, 0.4, 0.9])
def test_minimum_jerk_reaches_a_share_of_peak_velocity_at_the_derived_time(share: float) -> None:
    """Velocity is ``30 s^2 (1 - s)^2``, so it first reaches f of its peak at ``(1 - sqrt(1 - sqrt f)) / 2``."""
    grid = np.linspace(0.0, 0.5, 200_001)
    profile = np.array([minimum_jerk(s) for s in grid])
    velocity = np.gradient(profile, grid)
    reached = grid[np.argmax(velocity >= share * 15 / 8)]
    assert reached == pytest.approx((1 - np.sqrt(1 - np.sqrt(share))) / 2, abs=1e-5)


def test_submovement_progress_follows_start_and_duration() -> None:
    move = Submovement("left", start=2.0, duration=0.4, displacement=0.01)
    assert [move.progress(t) for t in (1.9, 2.0, 2.2, 2.4, 9.0)] == pytest.approx([0.0, 0.0, 0.5, 1.0, 1.0])
