"""The virtual coupling computed in the agent."""

import pytest

from netboard.devices.contract.device import Reading
from netboard.devices.safety.virtual_coupling import REACH, hand_force
from netboard.network.protocol.motion import Point

MS = 1_000_000
NOW = 5_000 * MS


def point(stamp_ns: int, z: float = 0.0, vz: float = 0.0) -> Point:
    return Point(7, 1, 3, stamp_ns, z, vz, 200.0, 2.0, 0)


def reading(z: float, vz: float = 0.0) -> Reading:
    return Reading(NOW, 0.0, 0.0, z, 0.0, 0.0, vz, 0, True)


def test_coupling_pulls_the_hand_to_the_control_point_and_damps_it() -> None:
    assert hand_force(point(NOW, 0.01), 0, reading(0.0)) == pytest.approx(2.0)
    assert hand_force(point(NOW), 0, reading(0.0, 0.25)) == pytest.approx(-0.5)
    assert hand_force(point(NOW, 0.01, 0.1), 0, reading(0.01, 0.1)) == pytest.approx(0.0)


@pytest.mark.parametrize(("age", "ahead"), [(0, 0.0), (2, 0.002), (-1, -0.001), (60, REACH), (-60, -REACH)])
def test_control_point_is_extrapolated_by_its_age_up_to_the_reach(age: int, ahead: float) -> None:
    force = hand_force(point(NOW - age * MS, 0.0, 0.1), 0, reading(0.0, 0.1))
    assert force == pytest.approx(200.0 * 0.1 * ahead)


def test_reception_time_replaces_an_unknown_time_stamp() -> None:
    assert hand_force(point(0, 0.0, 0.1), NOW - 3 * MS, reading(0.0, 0.1)) == pytest.approx(200.0 * 0.1 * 0.003)
