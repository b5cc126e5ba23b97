"""The Falcon's kinematics: forward, inverse, Jacobian, and conservation of energy."""

from itertools import product
from math import degrees, hypot, isnan

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from netboard.devices.falcon.device import MAX_COMMAND, MAX_FORCE
from netboard.devices.falcon.kinematics import (
    ANGLE_PER_COUNT,
    CENTRE,
    REACH,
    angles_of,
    encoders_at,
    forward,
    inverse,
    jacobian,
    torques,
)

offset = st.floats(-REACH, REACH)
places = st.tuples(offset, offset, offset).map(lambda by: tuple(c + d for c, d in zip(CENTRE, by, strict=True)))
forces = st.tuples(*(st.floats(-10, 10),) * 3)


@given(places)
def test_forward_undoes_inverse(place: tuple) -> None:
    assert forward(inverse(place), CENTRE) == pytest.approx(place, abs=1e-12)


@given(places)
def test_inverse_undoes_forward(place: tuple) -> None:
    angles = inverse(place)
    assert inverse(forward(angles, CENTRE)) == pytest.approx(angles, abs=1e-9)


@given(places, places)
def test_forward_kinematics_is_independent_of_the_initial_guess(place: tuple, guess: tuple) -> None:
    assert forward(inverse(place), guess) == pytest.approx(place, abs=1e-12)


@given(places)
def test_jacobian_matches_finite_differences(place: tuple) -> None:
    angles = inverse(place)
    step = 1e-5
    for leg, column in enumerate(jacobian(angles, place)):
        ahead, behind = (
            forward(tuple(angle + sign * step * (k == leg) for k, angle in enumerate(angles)), place)
            for sign in (1, -1)
        )
        slope = (np.array(ahead) - np.array(behind)) / (2 * step)
        assert slope == pytest.approx(column, rel=1e-6, abs=1e-8)


@given(places, forces, forces)
def test_torques_satisfy_the_principle_of_virtual_work(place: tuple, force: tuple, direction: tuple) -> None:
    """Torque times rotation equals force times displacement, for a small displacement."""
    motion = 1e-7 * np.array(direction)
    ahead, behind = (inverse(tuple(np.array(place) + sign * motion / 2)) for sign in (1, -1))
    rotation = np.array(ahead) - np.array(behind)
    torque = torques(inverse(place), place, force)
    assert np.dot(torque, rotation) == pytest.approx(np.dot(force, motion), rel=1e-5, abs=1e-13)


def test_kinematics_is_symmetric_about_the_axis() -> None:
    """On the axis all arms have the same angle; a rotation by 120 degrees permutes the arms."""
    first, second, third = inverse((0.0, 0.0, 0.12))
    assert first == pytest.approx(second, abs=1e-15)
    assert second == pytest.approx(third, abs=1e-15)
    cos, sin = -0.5, 3**0.5 / 2
    x, y = 0.02, -0.01
    turned = inverse((cos * x - sin * y, sin * x + cos * y, 0.12))
    one, two, three = inverse((x, y, 0.12))
    assert turned == pytest.approx((two, three, one), abs=1e-14)


def test_unreachable_poses_give_nan() -> None:
    assert any(map(isnan, inverse((0.0, 0.0, 0.5))))
    assert any(map(isnan, inverse((0.2, 0.0, 0.1))))
    assert all(map(isnan, forward((3.0, 0.0, 0.0), CENTRE)))


@given(st.tuples(*(st.integers(-3000, 3000) | st.integers(-32768, 32767),) * 3))
def test_forward_kinematics_terminates_for_any_encoder_counts(encoders: tuple) -> None:
    """The result is NaN or a pose whose kinematic chains are closed."""
    angles = angles_of(encoders)
    place = forward(angles, CENTRE)
    assert isnan(place[0]) or inverse(place) == pytest.approx(angles, abs=1e-6)


@given(st.tuples(*(st.integers(-3000, 3000),) * 3))
def test_encoder_counts_round_trip_through_angles(encoders: tuple) -> None:
    assert encoders_at(angles_of(encoders)) == encoders


def test_resolution_matches_the_manufacturer_specification() -> None:
    """More than 400 dots per inch, in the middle of the workspace."""
    assert degrees(ANGLE_PER_COUNT) == pytest.approx(0.03643, abs=1e-5)
    step = ANGLE_PER_COUNT * max(hypot(*column) for column in jacobian(inverse(CENTRE), CENTRE))
    assert 3e-5 < step < 0.0254 / 400


def test_largest_command_gives_the_specified_maximum_force() -> None:
    """With the scale of the manufacturer's library, 10 cm in front of the base, sideways and upwards: two pounds."""
    place = (0.0, 0.0, 0.1)
    for force in ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0)):
        largest = MAX_COMMAND / 10000 / max(map(abs, torques(inverse(place), place, force)))
        assert largest == pytest.approx(MAX_FORCE, rel=0.03)


def test_jacobian_is_well_conditioned_in_the_workspace() -> None:
    sides = np.linspace(-REACH, REACH, 9)
    for by in product(sides, repeat=3):
        place = tuple(c + d for c, d in zip(CENTRE, by, strict=True))
        assert np.linalg.cond(np.array(jacobian(inverse(place), place))) < 6.4
