"""Compliant cables, compared with closed forms: static stretch, dynamics and stability."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from held_stylus import HeldStylus
from netboard.base.tables.simulated import Participant, VirtualDevice
from netboard.participants.body.cable import pack_cables, stretch
from netboard.participants.body.device_models import MODELS, DeviceModel, resolved
from netboard.participants.body.stylus import STEP
from netboard.participants.people.submovement import Submovement

PERSON = Participant(force_noise=0.0, rest_skill=0.0, load_skill=0.0)
FREE = VirtualDevice(friction=0.0, damping=0.0, workspace=1.0, cable_stiffness=1000.0, cable_damping=0.0)
NO_FORCE = (0.0, 0.0, 0.0)


def make(device: VirtualDevice, held: bool = True, person: Participant = PERSON) -> HeldStylus:
    return HeldStylus(person, device, held)


def constants(device: VirtualDevice) -> np.ndarray:
    return pack_cables(resolved(device), 0.0, 0.0, (0.0, 0.0), STEP)


def test_rigid_cables_do_not_stretch() -> None:
    hand = make(VirtualDevice())
    hand.advance(100, 0.0, (0.0, 0.0, 1.0))
    assert hand.tip == hand.position


def test_undamped_device_oscillates_at_its_natural_frequency() -> None:
    model = resolved(FREE)
    reduced = model.mass * model.tip_share * (1.0 - model.tip_share)
    omega = np.sqrt(model.cable_stiffness / reduced)
    cables, x, v, tip, rate = constants(FREE)[0], 0.0, 0.0, 0.001, 0.0
    stretches = []
    for _ in range(400):
        x, v, tip, rate = stretch(x, v, tip, rate, 0.0, 0.0, 0.0, cables)
        stretches.append(tip - x)
    # The implicit midpoint rule keeps the amplitude but lowers the frequency by the fraction (omega STEP)^2 / 12.
    discrete_omega = 2.0 / STEP * np.arctan(0.5 * omega * STEP)
    assert np.abs(np.array(stretches) - 0.001 * np.cos(discrete_omega * STEP * np.arange(1, 401))).max() < 1e-9
    assert discrete_omega == pytest.approx(omega, rel=1e-3)


def test_undamped_cables_conserve_energy() -> None:
    cables, model = constants(FREE)[0], resolved(FREE)
    x, v, tip, rate = 0.0, 0.02, 0.001, -0.01
    half = 0.5 * model.mass / 2.0

    def energy() -> float:
        return half * (v * v + rate * rate) + 0.5 * model.cable_stiffness * (tip - x) ** 2

    before = energy()
    for _ in range(100_000):
        x, v, tip, rate = stretch(x, v, tip, rate, 0.0, 0.0, 0.0, cables)
    assert energy() == pytest.approx(before, rel=1e-8)


def test_cable_damping_matches_the_closed_form() -> None:
    device = replace(FREE, cable_damping="model")
    model = resolved(device)
    reduced = model.mass * model.tip_share * (1.0 - model.tip_share)
    decay = model.cable_damping / (2.0 * reduced)
    omega = np.sqrt(model.cable_stiffness / reduced - decay**2)
    cables, x, v, tip, rate = constants(device)[0], 0.0, 0.0, 0.001, 0.0
    stretches = []
    for _ in range(200):
        x, v, tip, rate = stretch(x, v, tip, rate, 0.0, 0.0, 0.0, cables)
        stretches.append(tip - x)
    t = STEP * np.arange(1, 201)
    theory = 0.001 * np.exp(-decay * t) * (np.cos(omega * t) + decay / omega * np.sin(omega * t))
    assert np.abs(np.array(stretches) - theory).max() < 0.001 * 6e-3


def test_pushed_free_stylus_lags_by_the_cable_stretch() -> None:
    hand = make(replace(FREE, cable_damping="model"), held=False)
    hand.advance(4000, 0.0, (0.0, 0.0, 0.01))
    assert hand.position[2] - hand.tip[2] == pytest.approx(0.01 * 0.5 / 1000.0, rel=1e-6)
    middle = 0.5 * (hand.position[2] + hand.tip[2])
    assert middle == pytest.approx(0.5 * 0.01 / 0.045 * 1.0, rel=1e-3)


def test_device_held_by_friction_stays_exactly_at_rest_while_the_tip_yields() -> None:
    device = VirtualDevice(cable_stiffness="model")
    hand = make(device)
    moves = [Submovement("left", 0.0, 0.3, 0.0015)]  # 0.2 N, with 0.21 N of skill only while it moves
    hand.plan(moves)
    hand.advance(400, 0.0, NO_FORCE)
    hand.advance(8000, 0.1, NO_FORCE)
    held = hand.position
    hand.advance(8000, 2.1, NO_FORCE)
    assert hand.position == held
    assert hand.velocity == NO_FORCE
    load = PERSON.arm_stiffness * (0.0015 - hand.tip[2])
    assert hand.tip[2] - hand.position[2] == pytest.approx(load / 1020.0, rel=1e-6)


def test_only_the_cables_stretch_at_the_mechanical_stop() -> None:
    hand = make(VirtualDevice(cable_stiffness=1000.0))
    hand.plan([Submovement("left", 0.0, 0.3, 0.09)])
    for k in range(40):
        hand.advance(400, 0.1 * k, NO_FORCE)
    assert hand.position[2] == 0.075
    load = PERSON.arm_stiffness * (0.09 - hand.tip[2])
    assert hand.tip[2] == pytest.approx(0.075 + load / 1000.0, rel=1e-6)


def test_very_stiff_cables_approximate_rigid_ones() -> None:
    stiff, rigid = make(VirtualDevice(cable_stiffness=100_000.0)), make(VirtualDevice())
    for hand in (stiff, rigid):
        hand.plan([Submovement("left", 0.0, 0.3, 0.02)])
    for k in range(60):
        for hand in (stiff, rigid):
            hand.advance(40, 0.01 * k, (0.0, 0.0, 0.5))
        assert stiff.position[2] == pytest.approx(rigid.position[2], abs=5e-5)


@pytest.mark.parametrize("model", MODELS.values(), ids=MODELS)
def test_free_oscillation_of_every_model_decays(model: DeviceModel) -> None:
    cables = pack_cables(model, 0.0, 0.0, (0.0, 0.0), STEP)[0]
    x, v, tip, rate = 0.0, 0.0, 0.001, 0.0
    for _ in range(40_000):
        x, v, tip, rate = stretch(x, v, tip, rate, 0.0, 0.0, 0.0, cables)
    assert abs(tip - x) < 2e-6 + model.friction / model.cable_stiffness


@settings(max_examples=60)
@given(st.floats(1e-4, 5.0), st.floats(1.0, 100_000.0), st.floats(0.0, 1000.0), st.floats(0.01, 0.99), st.booleans())
def test_every_configurable_device_is_stable(
    mass: float, stiffness: float, damping: float, share: float, held: bool
) -> None:
    device = VirtualDevice(
        mass=mass, cable_stiffness=stiffness, cable_damping=damping, tip_share=share, friction=0.0, workspace=1.0
    )
    hand = make(device, held)
    hand.advance(200, 0.0, (0.0, 0.0, 1e-3))
    hand.advance(40_000, 0.05, NO_FORCE)
    positions = np.array([hand.position, hand.tip])
    assert np.isfinite(positions).all()
    assert np.abs(positions).max() < 10.0
    assert np.abs(hand.velocity).max() < 5.0
