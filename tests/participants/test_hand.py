"""The hand, compared with closed forms: statics, damped oscillator, Coulomb decay and coloured noise."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.signal import lti, step

from held_stylus import HeldStylus
from netboard.base.errors import ConfigError
from netboard.base.tables.simulated import Participant, VirtualDevice
from netboard.participants.body.device_models import resolved
from netboard.participants.body.stylus import STEP
from netboard.participants.people.muscles import CAPACITY, hand_mechanics
from netboard.participants.people.submovement import Submovement

PERSON = Participant(force_noise=0.0, rest_skill=0.0, load_skill=0.0)
YIELDING = replace(PERSON, reflex_gain=1.5)
SMOOTH = VirtualDevice(friction=0.0)
TOUCH = resolved(VirtualDevice())
NO_FORCE = (0.0, 0.0, 0.0)


def make(person: Participant = PERSON, device: VirtualDevice = SMOOTH, held: bool = True, seed: int = 1) -> HeldStylus:
    return HeldStylus(person, device, held, seed)


def heights(hand: HeldStylus, steps: int, force: float = 0.0, every: int = 1) -> np.ndarray:
    found = []
    for k in range(0, steps, every):
        hand.advance(every, k * STEP, (0.0, 0.0, force))
        found.append(hand.position[2])
    return np.array(found)


def test_constant_force_deflects_the_arm_by_force_over_stiffness() -> None:
    hand = make()
    hand.advance(8000, 0.0, (0.0, 0.0, 0.3))
    assert hand.position[2] == pytest.approx(0.3 / PERSON.arm_stiffness, rel=1e-6)


def test_released_hand_follows_a_damped_oscillator() -> None:
    """The scheme is of first order; at 0.25 ms its error is below the encoder's resolution."""
    hand = make()
    hand.put(0.01)
    m, k = PERSON.arm_mass + TOUCH.mass, PERSON.arm_stiffness
    decay = (PERSON.arm_damping + TOUCH.damping) / (2 * m)
    omega = np.sqrt(k / m - decay**2)
    t = STEP * np.arange(1, 2001)
    theory = 0.01 * np.exp(-decay * t) * (np.cos(omega * t) + decay / omega * np.sin(omega * t))
    assert np.abs(heights(hand, 2000) - theory).max() < 0.01 * 5e-3


def test_friction_holds_a_resting_hand_exactly() -> None:
    hand = make(device=VirtualDevice(friction=0.26))
    hand.advance(40_000, 0.0, (0.0, 0.0, 0.2599))
    assert hand.position[2] == 0.0
    assert hand.velocity[2] == 0.0
    hand.advance(4000, 0.0, (0.0, 0.0, 0.2701))
    assert hand.position[2] > 0.0


def test_coulomb_friction_lowers_the_amplitude_linearly() -> None:
    """Without damping the amplitude falls by ``4 F / K`` per period, and then the hand sticks."""
    friction = 0.03
    hand = make(replace(PERSON, arm_damping=0.0), VirtualDevice(friction=friction, damping=0.0))
    hand.put(0.01)
    trajectory = heights(hand, 12_000)
    peaks = trajectory[1:-1][(trajectory[1:-1] > trajectory[:-2]) & (trajectory[1:-1] >= trajectory[2:])]
    fall = 4 * friction / PERSON.arm_stiffness
    steps = -np.diff(np.concatenate(([0.01], peaks[peaks > fall])))
    assert len(steps) >= 7
    assert steps == pytest.approx(fall, rel=0.05)
    hand.advance(4 * 12_000, 0.0, NO_FORCE)
    assert hand.velocity[2] == 0.0


def test_free_stylus_accelerates_under_the_motor_force() -> None:
    device = VirtualDevice(friction=0.0, damping=0.0, workspace=1.0)
    hand = make(device=device, held=False)
    hand.advance(400, 0.0, (0.0, 0.0, 0.05))
    assert hand.position[:2] == (0.0, 0.0)
    assert hand.position[2] == pytest.approx(0.05 / TOUCH.mass * 0.1**2 / 2, rel=5e-3)


def test_mechanical_stop_ends_every_movement() -> None:
    hand = make(held=False)
    hand.advance(8000, 0.0, (3.0, -3.0, 3.0))
    assert hand.position == (TOUCH.workspace, -TOUCH.workspace, TOUCH.workspace)
    assert hand.velocity == (0.0, 0.0, 0.0)


def test_aim_beyond_the_stop_does_not_accumulate() -> None:
    """After any number of upward movements, one movement from the stop to the middle reaches the middle."""
    hand = make()
    for k in range(20):
        hand.plan([Submovement("left", 0.5 * k, 0.3, 0.05)])
        hand.advance(2000, 0.5 * k, NO_FORCE)
    assert hand.position[2] == pytest.approx(TOUCH.workspace)
    hand.plan([Submovement("left", 10.0, 0.3, -TOUCH.workspace - PERSON.aim_beyond_stop)])
    hand.advance(8000, 10.0, NO_FORCE)
    assert hand.position[2] == pytest.approx(0.0, abs=1e-6)


def test_submovements_are_superimposed_and_completed() -> None:
    hand = make()
    hand.plan([Submovement("left", 0.0, 0.3, 0.02), Submovement("left", 0.1, 0.3, -0.005)])
    hand.advance(8000, 0.0, NO_FORCE)
    assert hand.position[2] == pytest.approx(0.015, abs=1e-7)
    assert hand.muscle("moves") == 0


def test_movement_lags_by_the_delays_of_muscles_and_arm() -> None:
    hand = make()
    hand.plan([Submovement("left", 0.0, 0.6, 0.02)])
    trajectory = heights(hand, 8000)
    late = STEP * (1 + np.argmax(trajectory >= 0.01)) - 0.3
    assert late == pytest.approx(2 * PERSON.muscle_lag + PERSON.arm_damping / PERSON.arm_stiffness, abs=0.015)


def test_friction_skill_compensates_most_of_the_friction() -> None:
    """The final error of the arm is smaller than the dead band of the friction."""
    device = VirtualDevice()
    hand = make(device=device)
    hand.plan([Submovement("left", 0.0, 0.4, 0.02)])
    hand.advance(8000, 0.0, NO_FORCE)
    assert abs(hand.position[2] - 0.02) < 0.7 * TOUCH.friction / PERSON.arm_stiffness


def test_force_noise_has_the_configured_standard_deviation() -> None:
    hand = make(Participant(force_noise=0.02), seed=3)
    samples = []
    for _ in range(4000):
        hand.advance(400, 0.0, NO_FORCE)
        samples.append(hand.muscle("noise_z"))
    assert np.std(samples) == pytest.approx(0.02, rel=0.06)
    assert np.mean(samples) == pytest.approx(0.0, abs=0.002)


def test_lateral_offset_has_its_standard_deviation() -> None:
    offsets = np.array([make(seed=seed).position[:2] for seed in range(400)])
    assert offsets.std() == pytest.approx(PERSON.lateral_sd, rel=0.1)


def test_same_seed_gives_identical_states_for_any_partition_of_time() -> None:
    whole, parts = make(Participant(), seed=5), make(Participant(), seed=5)
    whole.advance(400, 0.0, (0.1, 0.2, 0.5))
    for k in range(100):
        parts.advance(4, k * 4 * STEP, (0.1, 0.2, 0.5))
    assert whole.bits() == parts.bits()


def test_plan_beyond_the_capacity_is_rejected() -> None:
    hand = make()
    hand.plan(Submovement("left", 9.0, 0.3, 0.0) for _ in range(CAPACITY))
    with pytest.raises(ValueError, match="at most"):
        hand.plan([Submovement("left", 9.0, 0.3, 0.0)])


def equilibria(hand: HeldStylus, steps: int, force: float) -> np.ndarray:
    found = []
    for k in range(steps):
        hand.advance(1, k * STEP, (0.0, 0.0, force))
        found.append(hand.muscle("equilibrium"))
    return np.array(found)


def test_reflex_response_to_a_force_step_is_a_band_pass() -> None:
    """``G/K T s / (1 + T s) / (1 + tau s)^2``, after the delay."""
    trajectory = equilibria(make(YIELDING), 4000, 0.3)
    late = round(YIELDING.reflex_delay / STEP)
    assert not trajectory[:late].any()
    adapting, muscle = [YIELDING.reflex_time, 1.0], [YIELDING.muscle_lag, 1.0]
    system = lti([YIELDING.reflex_time, 0.0], np.polymul(adapting, np.polymul(muscle, muscle)))
    _, theory = step(system, T=STEP * np.arange(4000 - late))
    gain = YIELDING.reflex_gain * 0.3 / YIELDING.arm_stiffness
    # The reflexes act once per millisecond.
    np.testing.assert_allclose(trajectory[late:], gain * theory, atol=0.02 * gain)


def test_reflexes_move_a_hand_held_by_friction() -> None:
    """A force below the device's friction moves the hand only by reflex."""
    device = VirtualDevice(friction=0.26)
    stiff, yielding = make(device=device), make(YIELDING, device)
    assert not heights(stiff, 2000, 0.2).any()
    assert heights(yielding, 2000, 0.2).max() > 0.2 / YIELDING.arm_stiffness / 4


def test_reflex_response_to_a_sustained_force_decays_to_zero() -> None:
    assert equilibria(make(YIELDING), 12_000, 0.3)[-1] == pytest.approx(0.0, abs=1e-6)


def test_load_skill_compensates_a_sustained_load() -> None:
    hand = make(replace(PERSON, load_skill=1.0))
    trajectory = heights(hand, 12_000, 0.3)
    assert trajectory.max() > 0.5 * 0.3 / PERSON.arm_stiffness
    assert trajectory[-1] == pytest.approx(0.0, abs=1e-5)
    half = make(replace(PERSON, load_skill=0.5))
    assert heights(half, 12_000, 0.3)[-1] == pytest.approx(0.15 / PERSON.arm_stiffness, rel=1e-2)


def test_compensation_at_rest_leaves_the_uncompensated_friction() -> None:
    hand = make(replace(PERSON, friction_skill=0.8, rest_skill=1.0), VirtualDevice(friction=0.26))
    hand.advance(8000, 0.0, (0.0, 0.0, 0.0519))
    assert hand.position[2] == 0.0
    hand.advance(8000, 0.0, (0.0, 0.0, 0.0521))
    assert hand.position[2] > 0.0


def stiffness(hand: HeldStylus) -> float:
    return hand.muscle("stiffness")


def test_impedance_adapts_until_the_error_equals_decay_over_gain() -> None:
    """With ``e = F/K``, ``dK/dt = alpha F/K - gamma`` has its equilibrium at ``K = alpha F / gamma``."""
    hand = make(replace(PERSON, impedance_gain=2e5, impedance_decay=200.0))
    hand.advance(60_000, 0.0, (0.0, 0.0, 0.3))
    assert stiffness(hand) == pytest.approx(2e5 * 0.3 / 200.0, rel=1e-3)
    assert hand.position[2] == pytest.approx(200.0 / 2e5, rel=1e-3)


def test_stiffness_decays_at_a_constant_rate_to_the_relaxed_arm() -> None:
    hand = make(replace(PERSON, impedance_gain=2e5, impedance_decay=200.0))
    hand.advance(60_000, 0.0, (0.0, 0.0, 0.3))
    hand.advance(2000, 15.0, NO_FORCE)  # until the hand is back at its target
    before = stiffness(hand)
    hand.advance(1000, 15.5, NO_FORCE)
    assert before - stiffness(hand) == pytest.approx(200.0 * 0.25, rel=1e-2)
    hand.advance(8000, 15.75, NO_FORCE)
    assert stiffness(hand) == PERSON.arm_stiffness


def test_stiffness_is_bounded_by_its_limit() -> None:
    hand = make(replace(PERSON, impedance_gain=1e6, impedance_limit=2.0))
    hand.advance(8000, 0.0, (0.0, 0.0, 3.0))
    assert stiffness(hand) == 2.0 * PERSON.arm_stiffness


def test_stiffness_is_constant_by_default() -> None:
    hand = make()
    hand.advance(8000, 0.0, (0.0, 0.0, 3.0))
    assert stiffness(hand) == PERSON.arm_stiffness


def test_variable_stiffness_is_rejected_with_compliant_cables() -> None:
    device = VirtualDevice(cable_stiffness=2000.0)
    with pytest.raises(ConfigError, match="impedance_gain: found 100, expected 0: with compliant cables"):
        hand_mechanics(replace(PERSON, impedance_gain=100.0), resolved(device))
