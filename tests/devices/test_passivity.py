"""Passivity control: its energy bound, unaffected motions, and the decay of a delayed spring."""

from collections import deque
from math import isnan, nan

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from netboard.devices.safety.passivity import MAX_DAMPING, SLOW, STORED, Passivity

K, B, T = 200.0, 2.0, 1e-3


@settings(max_examples=200, deadline=None)
@given(st.lists(st.tuples(st.floats(-3.0, 3.0), st.floats(-1e-3, 1e-3), st.floats(-1e-3, 1e-3)), max_size=80))
def test_large_energy_deficit_grows_only_by_unestimated_motion(ticks: list[tuple[float, float, float]]) -> None:
    """Beyond the allowed deficit, the hand gains energy only from motion that the velocity estimate missed."""
    control, height, rendered = Passivity(), 0.0, 0.0
    for number, (force, moved, estimated) in enumerate(ticks):
        control.remember(number, height)
        rendered = control.step(force, max(number - 5, 0), height, estimated / T, rendered)
        if control.energy < -STORED and abs(estimated / T) >= SLOW:
            assert rendered * moved <= abs(rendered) * abs(moved - estimated) + 1e-15
        assert control.energy <= STORED
        height += moved


@settings(max_examples=100, deadline=None)
@given(st.floats(-3.0, 3.0), st.floats(-1.0, 1.0).filter(lambda v: abs(v) > 1e-3), st.floats(0.0, 1.0))
def test_added_damping_is_bounded_and_opposes_the_motion(force: float, velocity: float, deficit: float) -> None:
    control = Passivity()
    control.energy = -deficit
    limited = control.step(force, 0, 0.0, velocity, 0.0)
    assert abs(limited - force) <= max(MAX_DAMPING * abs(velocity), abs(force)) + 1e-12
    assert (limited - force) * velocity <= 1e-12 or limited == 0.0


def test_undelayed_force_at_rest_is_unchanged() -> None:
    control, rendered = Passivity(), 0.0
    for number in range(200):
        control.remember(number, 0.01)
        rendered = control.step(-2.0, number, 0.01, 0.0, rendered)
        assert rendered == -2.0


def test_sustained_force_of_a_moving_partner_is_not_reduced() -> None:
    """The partner moves the board and the hand follows: the energy into the network covers the energy out of it."""
    control, rendered, delay = Passivity(), 0.0, 5
    for number in range(1000):
        height = 5e-5 * number
        control.remember(number, height)
        rendered = control.step(0.8, max(number - delay, 0), height, 0.05, rendered)
    assert rendered == pytest.approx(0.8, abs=0.01)


def test_reset_clears_the_energy_deficit() -> None:
    control = Passivity()
    control.energy = -1.0
    control.reset()
    assert control.step(1.0, 0, 0.0, 0.1, 0.0) == 1.0
    assert control.energy == 0.0


def test_non_finite_values_pass_through_and_reset_the_energy() -> None:
    control = Passivity()
    control.remember(0, 0.0)
    control.step(1.0, 0, 0.0, 0.0, 0.0)
    for _ in range(2):
        assert isnan(control.step(nan, 0, 0.0, 0.0, 1.0))
    assert control.step(1.0, 0, 0.0, 0.1, nan) == 1.0
    assert control.energy == 0.0


def residual_amplitude(mass: float, damping: float, round_trip: int, *, limited: bool) -> float:
    """Release a stylus from a delayed spring; return its largest displacement in the last half second [m]."""
    control, x, v, rendered = Passivity(), 0.0, 0.0, 0.0
    in_flight = deque([(0, 0.0)] * (round_trip + 1))
    largest = 0.0
    for number in range(4000):
        guided = number < 600
        if guided:
            x, v = 0.01 * min(number / 300, 1.0), 0.0 if number > 300 else 0.01 / 0.3
        control.remember(number, x)
        in_flight.append((number, -K * x - B * v))
        seq, force = in_flight.popleft()
        rendered = control.step(force, seq, x, v, rendered) if limited else force
        rendered = min(max(rendered, -3.0), 3.0)
        if guided:
            continue
        v += T * (rendered - damping * v) / mass
        x += T * v
        largest = max(largest, abs(x)) if number >= 3500 else 0.0
    return largest


@pytest.mark.parametrize("round_trip", [0, 2, 8, 20, 40, 60])
@pytest.mark.parametrize(("mass", "damping"), [(0.045, 0.1), (0.1, 0.5), (0.5, 5.0)])
def test_released_stylus_comes_to_rest_at_any_round_trip_time(mass: float, damping: float, round_trip: int) -> None:
    assert residual_amplitude(mass, damping, round_trip, limited=True) < 1e-3


def test_released_stylus_oscillates_without_passivity_control() -> None:
    assert residual_amplitude(0.045, 0.1, 40, limited=False) > 0.1
