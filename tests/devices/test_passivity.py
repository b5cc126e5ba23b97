"""Passivity control: its energy bound, unaffected motions, and the decay of a delayed spring."""

from collections import deque

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from netboard.devices.safety.passivity import MAX_DAMPING, SLOW, STORED, Passivity

K, B, T = 200.0, 2.0, 1e-3


@settings(max_examples=200, deadline=None)
@given(st.lists(st.tuples(st.floats(-3.0, 3.0), st.floats(-1e-3, 1e-3), st.floats(-1e-3, 1e-3)), max_size=80))
def test_whoever_owes_too_much_gives_nothing_but_by_surprise(ticks: list[tuple[float, float, float]]) -> None:
    """In debt, energy is handed out only for what the stylus moved otherwise than it seemed to."""
    control, height, rendered = Passivity(), 0.0, 0.0
    for number, (force, moved, seemed) in enumerate(ticks):
        control.remember(number, height)
        rendered = control.step(force, max(number - 5, 0), height, seemed / T, rendered)
        if control.energy < -STORED and abs(seemed / T) >= SLOW:
            assert rendered * moved <= abs(rendered) * abs(moved - seemed) + 1e-15
        assert control.energy <= STORED
        height += moved


@settings(max_examples=100, deadline=None)
@given(st.floats(-3.0, 3.0), st.floats(-1.0, 1.0).filter(lambda v: abs(v) > 1e-3), st.floats(0.0, 1.0))
def test_the_damping_is_bounded_and_never_pushes_on(force: float, velocity: float, debt: float) -> None:
    control = Passivity()
    control.energy = -debt
    limited = control.step(force, 0, 0.0, velocity, 0.0)
    assert abs(limited - force) <= max(MAX_DAMPING * abs(velocity), abs(force)) + 1e-12
    assert (limited - force) * velocity <= 1e-12 or limited == 0.0


def test_without_a_delay_or_at_rest_nothing_is_changed() -> None:
    control, rendered = Passivity(), 0.0
    for number in range(200):
        control.remember(number, 0.01)
        rendered = control.step(-2.0, number, 0.01, 0.0, rendered)
        assert rendered == -2.0


def test_a_partner_may_push_for_as_long_as_it_likes() -> None:
    """The board is moved under the hand: force and answered way go together, as far as the hand follows."""
    control, rendered, delay = Passivity(), 0.0, 5
    for number in range(1000):
        height = 5e-5 * number
        control.remember(number, height)
        rendered = control.step(0.8, max(number - delay, 0), height, 0.05, rendered)
    assert rendered == pytest.approx(0.8, abs=0.01)


def test_a_new_account_knows_nothing_of_the_old() -> None:
    control = Passivity()
    control.energy = -1.0
    control.reset()
    assert control.step(1.0, 0, 0.0, 0.1, 0.0) == 1.0
    assert control.energy == 0.0


def test_what_is_not_finite_is_passed_on_and_forgotten() -> None:
    control = Passivity()
    control.remember(0, 0.0)
    control.step(1.0, 0, 0.0, 0.0, 0.0)
    assert control.step(float("nan"), 0, 0.0, 0.0, 1.0) != control.step(float("nan"), 0, 0.0, 0.0, 1.0)
    assert control.step(1.0, 0, 0.0, 0.1, float("nan")) == 1.0
    assert control.energy == 0.0


def swing(mass: float, damping: float, round_trip: int, *, limited: bool) -> float:
    """Let a stylus go that a delayed spring was led to hold; how far it is from rest in the last half second [m]."""
    control, x, v, rendered = Passivity(), 0.0, 0.0, 0.0
    coming = deque([(0, 0.0)] * (round_trip + 1))
    largest = 0.0
    for number in range(4000):
        led = number < 600
        if led:
            x, v = 0.01 * min(number / 300, 1.0), 0.0 if number > 300 else 0.01 / 0.3
        control.remember(number, x)
        coming.append((number, -K * x - B * v))
        seq, force = coming.popleft()
        rendered = control.step(force, seq, x, v, rendered) if limited else force
        rendered = min(max(rendered, -3.0), 3.0)
        if led:
            continue
        v += T * (rendered - damping * v) / mass
        x += T * v
        largest = max(largest, abs(x)) if number >= 3500 else 0.0
    return largest


@pytest.mark.parametrize("round_trip", [0, 2, 8, 20, 40, 60])
@pytest.mark.parametrize(("mass", "damping"), [(0.045, 0.1), (0.1, 0.5), (0.5, 5.0)])
def test_a_stylus_that_is_let_go_comes_to_rest_at_any_distance(mass: float, damping: float, round_trip: int) -> None:
    assert swing(mass, damping, round_trip, limited=True) < 1e-3


def test_and_does_not_without() -> None:
    assert swing(0.045, 0.1, 40, limited=False) > 0.1
