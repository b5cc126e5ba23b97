"""Compliant cables against closed forms: static stretch, dynamics, and stability."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from netboard.base.tables.simulated import Participant, VirtualDevice
from netboard.participants.cable import pack_cables, stretch
from netboard.participants.device_models import MODELS, DeviceModel, resolved
from netboard.participants.hand import STEP, Hand, make_hand, pack_arm
from netboard.participants.submovement import Submovement

PERSON = Participant(force_noise=0.0, rest_skill=0.0, load_skill=0.0)
FREE = VirtualDevice(friction=0.0, damping=0.0, workspace=1.0, cable_stiffness=1000.0, cable_damping=0.0)
NO_FORCE = (0.0, 0.0, 0.0)


def make(device: VirtualDevice, held: bool = True, person: Participant = PERSON) -> Hand:
    return make_hand(person, device, np.random.default_rng(1), held)


def constants(device: VirtualDevice, held: bool = False) -> np.ndarray:
    return pack_cables(resolved(device), pack_arm(PERSON, device, held), STEP)


def test_rigid_cables_are_none() -> None:
    hand = make(VirtualDevice())
    hand.advance(100, 0.0, (0.0, 0.0, 1.0))
    assert hand.tip == hand.position


def test_the_bare_device_swings_at_the_root_of_stiffness_over_reduced_mass() -> None:
    own = resolved(FREE)
    reduced = own.mass * own.tip_share * (1.0 - own.tip_share)
    turn = np.sqrt(own.cable_stiffness / reduced)
    cables, x, v, tip, rate = constants(FREE)[0], 0.0, 0.0, 0.001, 0.0
    apart = []
    for _ in range(400):
        x, v, tip, rate = stretch(x, v, tip, rate, 0.0, 0.0, 0.0, cables)
        apart.append(tip - x)
    # The implicit midpoint rule keeps the size and turns a little too slowly: by (turn STEP)^2 / 12.
    slowed = 2.0 / STEP * np.arctan(0.5 * turn * STEP)
    assert np.abs(np.array(apart) - 0.001 * np.cos(slowed * STEP * np.arange(1, 401))).max() < 1e-9
    assert slowed == pytest.approx(turn, rel=1e-3)


def test_without_damping_energy_is_kept_for_ever() -> None:
    cables, own = constants(FREE)[0], resolved(FREE)
    x, v, tip, rate = 0.0, 0.02, 0.001, -0.01
    half = 0.5 * own.mass / 2.0

    def energy() -> float:
        return half * (v * v + rate * rate) + 0.5 * own.cable_stiffness * (tip - x) ** 2

    before = energy()
    for _ in range(100_000):
        x, v, tip, rate = stretch(x, v, tip, rate, 0.0, 0.0, 0.0, cables)
    assert energy() == pytest.approx(before, rel=1e-8)


def test_damping_of_the_cables_is_that_of_the_closed_form() -> None:
    device = replace(FREE, cable_damping="model")
    own = resolved(device)
    reduced = own.mass * own.tip_share * (1.0 - own.tip_share)
    decay = own.cable_damping / (2.0 * reduced)
    turn = np.sqrt(own.cable_stiffness / reduced - decay**2)
    cables, x, v, tip, rate = constants(device)[0], 0.0, 0.0, 0.001, 0.0
    apart = []
    for _ in range(200):
        x, v, tip, rate = stretch(x, v, tip, rate, 0.0, 0.0, 0.0, cables)
        apart.append(tip - x)
    t = STEP * np.arange(1, 201)
    theory = 0.001 * np.exp(-decay * t) * (np.cos(turn * t) + decay / turn * np.sin(turn * t))
    assert np.abs(np.array(apart) - theory).max() < 0.001 * 6e-3


def test_a_pushed_stylus_that_nobody_holds_hangs_back_by_its_share_of_the_force() -> None:
    hand = make(replace(FREE, cable_damping="model"), held=False)
    hand.advance(4000, 0.0, (0.0, 0.0, 0.01))
    assert hand.position[2] - hand.tip[2] == pytest.approx(0.01 * 0.5 / 1000.0, rel=1e-6)
    middle = 0.5 * (hand.position[2] + hand.tip[2])
    assert middle == pytest.approx(0.5 * 0.01 / 0.045 * 1.0, rel=1e-3)


def test_what_friction_holds_is_at_rest_to_the_bit_while_the_tip_gives() -> None:
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


def test_at_the_stop_only_the_cables_give() -> None:
    hand = make(VirtualDevice(cable_stiffness=1000.0))
    hand.plan([Submovement("left", 0.0, 0.3, 0.09)])
    for k in range(40):
        hand.advance(400, 0.1 * k, NO_FORCE)
    assert hand.position[2] == 0.075
    load = PERSON.arm_stiffness * (0.09 - hand.tip[2])
    assert hand.tip[2] == pytest.approx(0.075 + load / 1000.0, rel=1e-6)


def test_very_stiff_cables_are_as_good_as_rigid_ones() -> None:
    stiff, rigid = make(VirtualDevice(cable_stiffness=100_000.0)), make(VirtualDevice())
    for hand in (stiff, rigid):
        hand.plan([Submovement("left", 0.0, 0.3, 0.02)])
    for k in range(60):
        for hand in (stiff, rigid):
            hand.advance(40, 0.01 * k, (0.0, 0.0, 0.5))
        assert stiff.position[2] == pytest.approx(rigid.position[2], abs=5e-5)


@pytest.mark.parametrize("model", MODELS.values(), ids=MODELS)
def test_every_model_holds(model: DeviceModel) -> None:
    cables = pack_cables(model, pack_arm(PERSON, VirtualDevice(mass=model.mass), held=False), STEP)[0]
    x, v, tip, rate = 0.0, 0.0, 0.001, 0.0
    for _ in range(40_000):
        x, v, tip, rate = stretch(x, v, tip, rate, 0.0, 0.0, 0.0, cables)
    assert abs(tip - x) < 2e-6 + model.friction / model.cable_stiffness


@settings(max_examples=60)
@given(st.floats(1e-4, 5.0), st.floats(1.0, 100_000.0), st.floats(0.0, 1000.0), st.floats(0.01, 0.99), st.booleans())
def test_no_device_that_can_be_configured_is_unstable(
    mass: float, stiffness: float, damping: float, share: float, held: bool
) -> None:
    device = VirtualDevice(
        mass=mass, cable_stiffness=stiffness, cable_damping=damping, tip_share=share, friction=0.0, workspace=1.0
    )
    hand = make(device, held)
    hand.advance(200, 0.0, (0.0, 0.0, 1e-3))
    hand.advance(40_000, 0.05, NO_FORCE)
    places = np.array([hand.position, hand.tip])
    assert np.isfinite(places).all()
    assert np.abs(places).max() < 10.0
    assert np.abs(hand.velocity).max() < 5.0
