"""Passive hands and arms that yield, against closed forms and scenes integrated by another library."""

from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.integrate import solve_ivp

from netboard.analysis.measures.passive import Gains, PassiveHand, driven, passive_partner, yielding
from netboard.base.tables.scene import Physics
from netboard.physics.scene.parameters import pack_scene, parts_of
from netboard.physics.scene.rendering import gains_of

RATE = 1000.0
LEFT, RIGHT = (Gains(*gains[1:]) for gains in gains_of(parts_of(Physics(), True), pack_scene(Physics())[0]))


def steps(heights: list[float], every: float = 0.6, duration: float = 0.4) -> np.ndarray:
    """Minimum-jerk movements from one height to the next, one each `every` seconds."""
    t = np.arange(round(every * (len(heights) - 1) * RATE)) / RATE
    z = np.full(len(t), heights[0])
    for k, (before, after) in enumerate(pairwise(heights)):
        s = np.clip((t - k * every) / duration, 0.0, 1.0)
        z += (after - before) * s**3 * (10.0 - 15.0 * s + 6.0 * s**2)
    return z


def cooperative(left: np.ndarray, right: np.ndarray) -> float:
    """Share of the samples in which both hands move in opposite directions."""
    a, b = np.gradient(left, 1 / RATE), np.gradient(right, 1 / RATE)
    return float(np.mean((np.abs(a) >= 0.003) & (np.abs(b) >= 0.003) & (a * b < 0.0)))


@pytest.mark.evidence("truth", passive_partner)
@pytest.mark.parametrize(("stiffness", "millimetres"), [(50.0, -3.4), (150.0, -1.5), (300.0, -0.8)])
def test_passive_hand_moves_by_the_known_ratio_of_its_partner(stiffness: float, millimetres: float) -> None:
    hand = PassiveHand(stiffness=stiffness)
    for gains in (LEFT, RIGHT):
        assert gains.partner == pytest.approx(25.93, abs=0.01)
        moved = passive_partner(steps([0.0, 0.01, 0.01, 0.01, 0.01]), np.zeros(2400), RATE, hand, gains)
        assert moved[0] == 0.0
        assert moved[-1] == pytest.approx(-0.01 * gains.partner / (stiffness + gains.own), rel=1e-3)
        assert 1000.0 * moved[-1] == pytest.approx(millimetres, abs=0.05)


@pytest.mark.evidence("truth", driven)
def test_driven_hand_equals_the_closed_form() -> None:
    # A sine force, long after its beginning: amplitude and phase of 1 / (k - m w^2 + i b w).
    hand, w = PassiveHand(0.5, 8.0, 150.0), 2 * np.pi * 2.0
    t = np.arange(0.0, 5.0, 1 / RATE)
    z = driven(0.3 * np.sin(w * t), RATE, hand)
    response = 0.3 / (150.0 - 0.5 * w**2 + 8j * w)
    assert z[3000:] == pytest.approx(np.imag(response * np.exp(1j * w * t[3000:])), abs=1e-7)
    # A ramp, linear between samples, is exact at any rate: (t - (1 - e^-at) / a) / b without stiffness, a = b / m.
    free = driven(np.arange(50) / 50.0, 50.0, PassiveHand(0.5, 8.0, 0.0))
    s = np.arange(50) / 50.0
    assert free == pytest.approx((s**2 / 2 - s / 16.0 + (1 - np.exp(-16.0 * s)) / 256.0) / 8.0, abs=1e-9)
    assert driven([], RATE, hand).shape == (0,)


def whole_scene(active: np.ndarray, hand: PassiveHand, side: int) -> tuple[np.ndarray, np.ndarray]:
    """Integrate the paper's scene with one prescribed and one passive hand: passive heights, and the ball."""
    t = np.arange(len(active)) / RATE
    rate = np.gradient(active, 1 / RATE)
    y0 = np.array([0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0])

    def slopes(now: float, y: np.ndarray) -> list[float]:
        z, vz, theta, omega, p, vp, hand_z, hand_v = y
        ours = (np.interp(now, t, active), np.interp(now, t, rate))
        both = [ours, (hand_z, hand_v)] if side else [(hand_z, hand_v), ours]
        s, c = np.sin(theta), np.cos(theta)
        left = 200.0 * (both[0][0] - z + 0.25 * s) + 2.0 * (both[0][1] - vz + 0.25 * omega * c)
        right = 200.0 * (both[1][0] - z - 0.25 * s) + 2.0 * (both[1][1] - vz - 0.25 * omega * c)
        felt = right if side else left
        borne = 200.0 / 540.0 * 0.06 * 9.81  # what each coupling bears at rest
        return [
            vz,
            (left + right - 0.01 * 9.81 - 0.05 * 9.81 * c * c - 140.0 * z) / 0.01,
            omega,
            ((right - left) * 0.25 * c - 0.05 * 9.81 * p * c) / 0.0004,
            vp,
            -9.81 * s,
            hand_v,
            (-(felt - borne) - hand.damping * hand_v - hand.stiffness * hand_z) / hand.mass,
        ]

    y0[0] = -0.06 * 9.81 / 540.0
    solved = solve_ivp(slopes, (0.0, t[-1]), y0, t_eval=t, rtol=1e-7, atol=1e-9, max_step=0.005)
    return solved.y[6], solved.y[4]


@pytest.mark.evidence("independent", passive_partner, by="scipy")
@pytest.mark.slow
@pytest.mark.parametrize("side", [0, 1])
def test_linear_partner_equals_the_integrated_scene(side: int) -> None:
    active, hand = steps([0.0, 0.008, -0.004, 0.003, 0.0]), PassiveHand()
    there, p = whole_scene(active, hand, side)
    here = passive_partner(active, p, RATE, hand, (LEFT, RIGHT)[side])
    assert here == pytest.approx(there, abs=0.02 * np.abs(there).max())
    # And by the paper's rule both of them cooperate.
    assert cooperative(active, here) == pytest.approx(cooperative(active, there), abs=0.005)


def arms(stiffness: float = 150.0, friction: float = 0.0) -> tuple[PassiveHand, PassiveHand]:
    hand = PassiveHand(stiffness=stiffness, friction=friction)
    return hand, hand


@pytest.mark.evidence("truth", yielding)
@pytest.mark.parametrize(("stiffness", "millimetres"), [(50.0, -3.4), (150.0, -1.5), (300.0, -0.8)])
def test_arm_at_rest_yields_as_a_passive_hand(stiffness: float, millimetres: float) -> None:
    active, still = steps([0.0, 0.01, 0.01, 0.01, 0.01]), np.zeros(2400)
    force = np.array([still, -RIGHT.partner * active])
    found = yielding(force, np.zeros_like(force), RATE, (None, arms(stiffness)[1]), (LEFT, RIGHT))
    assert not found.z[0].any()
    assert not found.vz[0].any()
    assert 1000.0 * found.z[1, -1] == pytest.approx(millimetres, abs=0.05)
    expected = passive_partner(active, still, RATE, PassiveHand(stiffness=stiffness), RIGHT)
    assert found.z[1] == pytest.approx(expected, abs=2e-5)
    assert found.vz[1] == pytest.approx(np.gradient(expected, 1 / RATE), abs=5e-4)


@pytest.mark.evidence("independent", yielding, by="scipy")
def test_two_arms_that_yield_to_each_other_equal_solve_ivp() -> None:
    t = np.arange(1500) / RATE
    force = np.array([0.4 * np.sin(7.0 * t), 0.3 * np.sin(4.0 * t)])
    hand = PassiveHand()

    def slopes(now: float, y: np.ndarray) -> list[float]:
        left, right, left_v, right_v = y
        push = 0.4 * np.sin(7.0 * now), 0.3 * np.sin(4.0 * now)
        pulls = (
            (hand.stiffness + LEFT.own) * left + LEFT.partner * right,
            (hand.stiffness + RIGHT.own) * right + RIGHT.partner * left,
        )
        accelerations = [
            (own - pull - hand.damping * v) / hand.mass
            for own, pull, v in zip(push, pulls, (left_v, right_v), strict=True)
        ]
        return [left_v, right_v, *accelerations]

    solved = solve_ivp(slopes, (0.0, t[-1]), np.zeros(4), t_eval=t, rtol=1e-9, atol=1e-12)
    found = yielding(force, np.zeros_like(force), RATE, arms(), (LEFT, RIGHT))
    assert found.z == pytest.approx(solved.y[:2], abs=0.01 * np.abs(solved.y[:2]).max())
    assert found.vz == pytest.approx(solved.y[2:], abs=0.02 * np.abs(solved.y[2:]).max())


@pytest.mark.evidence("truth", yielding)
def test_friction_holds_a_hand_at_rest_and_not_one_that_slides() -> None:
    ramp = np.minimum(np.arange(2000) / 1000.0, 1.0)
    force, rest = np.array([0.2 * ramp, 0.0 * ramp]), np.zeros((2, 2000))
    held = yielding(force, rest, RATE, arms(friction=0.26), (LEFT, RIGHT))
    assert np.abs(held.vz).max() < 1e-12
    fast = rest + 0.05
    slid, free = (yielding(force, fast, RATE, arms(friction=k), (LEFT, RIGHT)) for k in (0.26, 0.0))
    assert slid.z == pytest.approx(free.z, abs=1e-9)
    # A force against the movement stops the hand, and the friction then holds it: its whole velocity is 0.
    against = yielding(np.array([-5.0 * ramp, 0.0 * ramp]), rest + 0.003, RATE, arms(friction=8.0), (LEFT, RIGHT))
    assert against.vz[0, -1] == pytest.approx(-0.003, abs=1e-6)


@pytest.mark.evidence("properties", yielding, of=("mirror", "unit", "constant", "time"))
@given(st.floats(0.1, 5.0), st.floats(-1.0, 1.0), st.integers(1, 200))
def test_yielding_is_linear_without_friction_and_mirror_symmetric(scale: float, offset: float, late: int) -> None:
    t = np.arange(600) / RATE
    force, rates = np.array([np.sin(9.0 * t), np.cos(5.0 * t) - 1.0]), np.array([np.cos(3.0 * t), np.sin(2.0 * t)])
    once = yielding(force, rates, RATE, arms(), (LEFT, RIGHT))
    scaled = yielding(-scale * force + offset, rates, RATE, arms(), (LEFT, RIGHT))
    assert scaled.z == pytest.approx(-scale * once.z, abs=1e-9)
    mirrored = yielding(force[::-1], rates[::-1], RATE, arms(friction=0.2), (RIGHT, LEFT))
    straight = yielding(force, rates, RATE, arms(friction=0.2), (LEFT, RIGHT))
    assert mirrored.z == pytest.approx(straight.z[::-1], abs=1e-12)
    held = np.pad(force, ((0, 0), (late, 0)), mode="edge"), np.pad(rates, ((0, 0), (late, 0)))
    assert yielding(*held, RATE, arms(), (LEFT, RIGHT)).z[:, late:] == pytest.approx(once.z, abs=1e-12)


@pytest.mark.evidence("disturbance", yielding, of=("holes", "noise"))
def test_arms_are_unknown_after_a_hole_and_smooth_noise() -> None:
    noise = np.random.default_rng(3).normal(size=(2, 20_000))
    found = yielding(noise, np.zeros_like(noise), RATE, arms(), (LEFT, RIGHT))
    # The deviation of m z'' + b z' + k z = white force of density S is sqrt(S / (2 b k)), S = 1 / rate.
    assert found.z[0, 1000:].std() == pytest.approx(np.sqrt(1 / RATE / (2 * 8.0 * (150.0 + LEFT.own))), rel=0.15)
    noise[1, 500] = np.nan
    holed = yielding(noise, np.zeros_like(noise), RATE, arms(), (LEFT, RIGHT))
    assert holed.z[:, :500] == pytest.approx(found.z[:, :500])
    assert np.isnan(holed.z[:, 500:]).all()
    assert np.isnan(holed.vz[:, 500:]).all()


def test_invalid_arguments_are_refused() -> None:
    with pytest.raises(ValueError, match="a mass"):
        PassiveHand(mass=0.0)
    with pytest.raises(ValueError, match="two sides"):
        yielding(np.zeros((2, 4)), np.zeros((2, 5)), RATE, arms(), (LEFT, RIGHT))


@pytest.mark.slow
@pytest.mark.evidence("properties", passive_partner, of=("unit", "constant", "mirror", "rate"))
@given(st.floats(-5.0, 5.0), st.floats(-0.05, 0.05), st.floats(20.0, 400.0))
def test_passive_partner_is_linear_and_mirror_symmetric(scale: float, offset: float, stiffness: float) -> None:
    active, hand = steps([0.0, 0.01, -0.005, 0.0]), PassiveHand(stiffness=stiffness)
    ball = 0.1 * np.sin(np.arange(len(active)) / 300.0)
    once = passive_partner(active, ball, RATE, hand, LEFT)
    assert passive_partner(scale * active + offset, scale * ball, RATE, hand, LEFT) == pytest.approx(
        scale * once, abs=1e-9
    )
    assert passive_partner(active, -ball, RATE, hand, RIGHT) == pytest.approx(once, abs=1e-9)
    twice = passive_partner(active[::2], ball[::2], RATE / 2, hand, LEFT)
    assert twice == pytest.approx(once[::2], abs=2e-6)


@pytest.mark.parametrize("stiffness", [50.0, 150.0])
def test_friction_holds_weak_forces_and_reduces_strong_ones(stiffness: float) -> None:
    hand = PassiveHand(stiffness=stiffness, friction=0.26)
    ramp = np.minimum(np.arange(4000) / 2000.0, 1.0)
    assert not driven(0.25 * ramp, RATE, hand).any()
    # Pushed slowly and held there, it comes to rest where the push less friction balances the spring.
    assert driven(1.0 * ramp, RATE, hand)[-1] == pytest.approx((1.0 - 0.26) / stiffness, rel=0.02)


@pytest.mark.evidence("disturbance", driven, of="holes")
def test_vanishing_friction_has_no_effect_and_holes_give_nan() -> None:
    force = np.sin(np.arange(3000) / 200.0)
    without, hardly = driven(force, RATE, PassiveHand()), driven(force, RATE, PassiveHand(friction=1e-9))
    assert hardly == pytest.approx(without, abs=0.01 * np.ptp(without))
    force[1000] = np.nan
    holed = driven(force, RATE, PassiveHand(friction=0.26))
    assert np.isfinite(holed[:1000]).all()
    assert np.isnan(holed[1000:]).all()


def test_device_mechanics_add_to_those_of_the_arm() -> None:
    assert PassiveHand(0.5, 8.0, 50.0).holding(0.045, 0.1, 0.26) == PassiveHand(0.545, 8.1, 50.0, 0.26)
    with pytest.raises(ValueError, match="friction"):
        PassiveHand(friction=-0.1)
