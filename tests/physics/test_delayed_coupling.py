"""The exact delayed loop, compared with independent tables, rules of thumb and limits."""

import math
from dataclasses import replace

import numpy as np
import pytest

from evidence.coupling.boundary import largest_stiffness, passive_stiffness, ruled_stiffness
from netboard.base.tables.scene import Physics
from netboard.physics.stability.delayed_coupling import (
    FIXED,
    BoardEnd,
    Loop,
    Mechanism,
    delayed,
    ends_of,
    growth,
    is_stable,
    largest_delay,
    largest_round_trip,
    loop_matrix,
)

BARE_STYLUS = Mechanism(0.045, 0.1)


def longest_sample_delay(loop: Loop) -> int:
    """Largest stable delay in ticks when only the samples are delayed."""
    return next(delay for delay in range(80) if not is_stable(delayed(loop, delay, 0))) - 1


@pytest.mark.parametrize(
    ("delay", "stiffness"),
    [(0, 4202), (1, 1373), (2, 810), (3, 569), (5, 350), (8, 214), (10, 166), (15, 99), (20, 63)],
)
def test_largest_stable_wall_stiffness_at_each_delay(delay: int, stiffness: float) -> None:
    assert largest_stiffness(Loop(BARE_STYLUS, up=delay)) == pytest.approx(stiffness, rel=0.01)


@pytest.mark.parametrize(
    ("mass", "damping", "exact", "difference", "window", "undamped"),
    [
        (0.045, 0.0, 8, 7, 4, -1),
        (0.045, 0.1, 8, 8, 4, 0),
        (0.045, 0.5, 10, 9, 5, 2),
        (0.045, 2.0, 17, 16, 11, 10),
        (0.1, 0.5, 11, 10, 8, 2),
        (0.2, 2.0, 18, 18, 17, 9),
        (0.5, 5.0, 34, 34, 33, 25),
    ],
)
def test_largest_stable_delay_at_a_wall(
    mass: float, damping: float, exact: int, difference: int, window: int, undamped: int
) -> None:
    loop = Loop(Mechanism(mass, damping))
    assert longest_sample_delay(loop) == exact
    assert longest_sample_delay(replace(loop, window=1)) == difference
    assert longest_sample_delay(replace(loop, window=15)) == window
    assert longest_sample_delay(replace(loop, c=0.0)) == undamped


@pytest.mark.slow
@pytest.mark.parametrize(
    ("stylus", "end", "server", "both"),
    [
        ((0.045, 0.1), (0.1, 0.5, 100.0), 6, 18),
        ((0.045, 0.1), (0.3, 0.5, 100.0), 4, 39),
        ((0.1, 0.5), (0.1, 0.5, 100.0), 10, 19),
        ((0.1, 0.5), (0.3, 0.5, 100.0), 6, 25),
        ((0.2, 2.0), (0.3, 0.5, 100.0), 11, 25),
        ((0.2, 2.0), (1.0, 1.0, 400.0), 9, 40),
    ],
)
def test_largest_stable_delay_with_a_moving_end(
    stylus: tuple[float, float], end: tuple[float, float, float], server: int, both: int
) -> None:
    loop = Loop(Mechanism(*stylus), BoardEnd(*end))
    assert largest_delay(loop) == server
    distant_dyad = replace(loop, at="both")
    assert is_stable(delayed(distant_dyad, both, both))
    assert not is_stable(delayed(distant_dyad, both + 1, both + 1))


def test_coupling_on_both_sides_of_a_fixed_end_is_stable_at_long_delays() -> None:
    assert is_stable(Loop(BARE_STYLUS, FIXED, up=60, down=60, at="both", window=1))


def test_largest_stiffness_follows_the_linear_rule_at_short_delays() -> None:
    undamped = Loop(Mechanism(0.045, 0.5), c=0.0)
    for delay in (0, 1, 2):
        rule = ruled_stiffness(undamped.mechanism, 0.0, delay * 1e-3)
        assert largest_stiffness(delayed(undamped, delay, 0)) == pytest.approx(rule, rel=0.02)


def test_passive_stiffness_is_stable() -> None:
    mechanism = Mechanism(0.045, 1.0)
    passive = passive_stiffness(mechanism, 0.4)
    assert passive == pytest.approx(1200.0)
    assert is_stable(Loop(mechanism, k=passive, c=0.4))
    assert passive_stiffness(BARE_STYLUS, 2.0) == 0.0


def test_virtual_device_with_many_substeps_approaches_the_exact_motion() -> None:
    exact = loop_matrix(Loop(Mechanism(0.2, 2.0, 150.0), up=1))
    found = loop_matrix(Loop(Mechanism(0.2, 2.0, 150.0, substeps=1000), up=1))
    np.testing.assert_allclose(found, exact, atol=2e-4)


def test_undelayed_sample_is_not_extrapolated() -> None:
    moving = Loop(BARE_STYLUS, BoardEnd(0.005, 0.0, 70.0), window=1)
    assert growth(moving) == pytest.approx(growth(replace(moving, reach=0.1)))


def test_only_zero_order_hold_lags_at_constant_velocity() -> None:
    rate, up = 0.1, 4
    ages = np.arange(1, up + 2) * 1e-3
    samples = np.column_stack([-rate * ages, np.full(up + 1, rate)]).ravel()
    state = np.concatenate([[0.0, rate], [-rate * 1e-3], samples, [0.0, 0.0]])
    loop = Loop(Mechanism(0.045, 0.0), k=100.0, c=0.0, up=up)
    for hold, late in (("zoh", up * 1e-3), ("cv", 0.0), ("ca", 0.0)):
        after = loop_matrix(replace(loop, hold=hold)) @ state
        assert after[1] - rate == pytest.approx(100.0 * rate * late / 0.045 * 1e-3, abs=1e-12)


def test_largest_round_trip_is_capped_and_negative_if_never_stable() -> None:
    loop = Loop(BARE_STYLUS)
    assert largest_round_trip(loop) == 8
    assert largest_round_trip(Loop(BARE_STYLUS, k=1e6, c=0.0)) == -1
    assert largest_round_trip(loop, most=4) == 4


def test_loop_ends_follow_from_the_board_configuration() -> None:
    ends = ends_of(Physics())
    assert ends["heave"] == BoardEnd(0.005, 0.0, 70.0)
    assert ends["tilt"].mass == pytest.approx(0.0032)
    assert set(ends_of(Physics(board="hinged"))) == {"tilt"}
    assert set(ends_of(Physics(board="level"))) == {"heave"}
    assert math.isinf(FIXED.mass)
