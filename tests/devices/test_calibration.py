"""Calibration: the placement that follows from measured stylus positions."""

from math import inf

import pytest
from hypothesis import given
from hypothesis import strategies as st
from simulated import AT_REST, Puppet, SimulatedTime

from netboard.base.config import Config
from netboard.base.errors import ConfigError, NetboardError
from netboard.devices.contract.device import Box
from netboard.devices.contract.profile import Placement
from netboard.devices.setup import calibration
from netboard.devices.setup.loop import watch

POINTS = st.tuples(*[st.floats(-0.5, 0.5)] * 3)


def held_position(*places: tuple[float, float, float]) -> calibration.Point:
    device = Puppet(Config(), *(AT_REST._replace(x=x, y=y, z=z) for x, y, z in places))
    device.open()
    return calibration.held_at(watch(device, SimulatedTime(), 0.1))


def test_held_position_is_the_median_along_each_axis() -> None:
    assert held_position(*[(0.1, 0.2, 0.3)] * 60, (0.1, 0.2, 0.301)) == pytest.approx((0.1, 0.2, 0.3), abs=1e-3)


def test_moving_stylus_is_rejected() -> None:
    with pytest.raises(NetboardError, match="moved by 10 mm"):
        held_position((0.0, 0.0, 0.0), (0.0, 0.0, 0.01))


@pytest.mark.parametrize("unready", [0, 50])
def test_neutral_height_needs_a_device_that_is_ready(unready: int) -> None:
    device = Puppet(Config(), *[AT_REST] * unready, AT_REST._replace(ready=False), AT_REST)
    device.open()
    with pytest.raises(NetboardError, match="not ready for forces at the neutral height"):
        calibration.neutral_at(watch(device, SimulatedTime(), 0.1))
    assert calibration.neutral_at(watch(device, SimulatedTime(), 0.1)) == (0.0, 0.0, 0.0)


@given(POINTS, POINTS)
def test_box_contains_both_corners_in_either_order(one: calibration.Point, other: calibration.Point) -> None:
    if min(abs(a - b) for a, b in zip(one, other, strict=True)) < calibration.MIN_SIDE:
        with pytest.raises(NetboardError, match="corners"):
            calibration.box_between(one, other)
        return
    box = calibration.box_between(one, other)
    assert box.holds(*one)
    assert box.holds(*other)
    assert box == calibration.box_between(other, one)


@given(st.floats(-0.1, 0.1), st.floats(0.02, 0.2), st.floats(0.02, 0.2), st.floats(0.01, 0.2))
def test_scale_is_the_smallest_that_fits_the_task_range(zero: float, below: float, above: float, needed: float) -> None:
    box = Box(-inf, -inf, zero - below, inf, inf, zero + above)
    scale = calibration.scale_for(zero, box, needed)
    assert scale >= 1.0
    assert min(below, above) * scale >= needed - 1e-9
    assert scale == 1.0 or min(below, above) * scale == pytest.approx(needed)


def test_neutral_height_at_the_workspace_edge_is_rejected() -> None:
    with pytest.raises(NetboardError, match="neutral height, 99 mm"):
        calibration.scale_for(0.099, Box(-1, -1, -0.1, 1, 1, 0.1), 0.05)


def test_new_zero_keeps_scale_and_workspace() -> None:
    before = Placement(scale=2.0, z_max=0.1)
    after = calibration.placed(before, (0.01, 0.02, 0.03), None, 0.075, "now")
    assert (after.zero_x, after.zero_y, after.zero_z) == (0.01, 0.02, 0.03)
    assert (after.scale, after.z_max, after.calibrated) == (2.0, 0.1, "now")


def test_corners_set_workspace_and_scale() -> None:
    box = Box(-0.1, -0.1, -0.05, 0.1, 0.1, 0.05)
    after = calibration.placed(Placement(), (0.0, 0.0, 0.0), box, 0.075, "now")
    assert after.box == tuple(box)
    assert after.scale == pytest.approx(1.5)


def test_reach_is_that_in_the_smaller_workspace() -> None:
    place = Placement(zero_z=0.01, scale=2.0, z_min=-0.1, z_max=0.2)
    assert calibration.reach(place, None) == pytest.approx(0.22)
    assert calibration.reach(place, Box(-1, -1, -0.06, 1, 1, 0.06)) == pytest.approx(0.1)


def test_manual_values_override_only_the_given_keys() -> None:
    after = calibration.with_values(Placement(scale=2.0), {"zero_z": "0.02", "x_max": "0.1"}, "then")
    assert after == Placement(scale=2.0, zero_z=0.02, x_max=0.1, calibrated="then")


@pytest.mark.parametrize(
    ("given", "message"),
    [
        ({"zero": "1"}, r"\[placement\] zero: unknown key"),
        ({"scale": "big"}, r"\[placement\] scale: found big, expected a number"),
        ({"scale": "100"}, r"\[placement\] scale: found 100.0, expected a number >= 0.1 and <= 10"),
    ],
)
def test_error_names_invalid_manual_value(given: dict[str, str], message: str) -> None:
    with pytest.raises(ConfigError, match=message):
        calibration.with_values(Placement(), given, "then")
