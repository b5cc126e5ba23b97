"""The passive partner, against closed forms and the scene integrated by another library."""

from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.integrate import solve_ivp

from netboard.analysis.measures.passive import (
    Gains,
    Heights,
    PassiveHand,
    driven,
    linear_partner,
    passive_control,
    passive_partner,
)
from netboard.analysis.statistics.estimates import bootstrap, ratio_of_sums
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


def trials(seed: int, follow: float) -> list[Heights]:
    """Trials whose left hand moves up and down, and whose right hand mirrors it, scaled by `follow`."""
    source = np.random.default_rng(seed)
    left = [steps([0.0, *source.uniform(-0.02, 0.02, 6)]) for _ in range(4)]
    return [Heights(z, -follow * z + 0.0, np.zeros(len(z))) for z in left]


@pytest.mark.evidence("truth", passive_control, linear_partner)
def test_fully_passive_partner_explains_the_whole_effect() -> None:
    hand = PassiveHand()
    respond = linear_partner(RATE, hand, LEFT, RIGHT)
    off = [trials(seed, 0.0) for seed in range(4)]
    on = [[Heights(one.left, respond(one.left, one.p, "right"), one.p) for one in dyad] for dyad in off]

    def left_alone(left: np.ndarray, right: np.ndarray) -> float:
        # What the right hand does when the left one is the active one; the other way round nothing is known of.
        return cooperative(left, right) if np.ptp(left) > np.ptp(right) else 0.0

    found = passive_control(on, off, respond, left_alone)
    assert found.effect == pytest.approx([cooperative(*dyad[0][:2]) for dyad in on], abs=0.2)
    assert found.effect.min() > 0.3
    assert found.share == pytest.approx(0.5, abs=0.01)
    assert (found.n, found.unit) == (4, "dyad")


def test_active_partners_leave_a_small_passive_share() -> None:
    respond = linear_partner(RATE, PassiveHand(), LEFT, RIGHT)
    off, on = [trials(seed, 0.0) for seed in range(5)], [trials(seed, 0.8) for seed in range(5)]

    def opposed(left: np.ndarray, right: np.ndarray) -> float:
        return -float(np.cov(left, right)[0, 1]) * 1e6

    found = passive_control(on, off, respond, opposed)
    assert 0.05 < found.share < 0.35
    interval = bootstrap([found.passive, found.effect], ratio_of_sums, np.random.default_rng(1))
    assert interval.value == pytest.approx(found.share)
    assert interval.low < found.share < interval.high
    without_effect = passive_control(off, off, lambda active, p, side: np.zeros_like(active), opposed)
    assert np.isnan(without_effect.share)
    assert without_effect.passive.tolist() == [0.0] * 5


def test_invalid_arguments_are_refused() -> None:
    with pytest.raises(ValueError, match="a mass"):
        PassiveHand(mass=0.0)
    with pytest.raises(ValueError, match="each dyad"):
        passive_control([trials(0, 0.0)], [], linear_partner(RATE, PassiveHand(), LEFT, RIGHT), cooperative)


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
