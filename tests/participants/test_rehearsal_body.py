"""The hand of a rehearsal equals the virtual device of a punctual agent, with rigid and compliant cables."""

from dataclasses import replace

import numpy as np
import pytest

from lateral import lateral_force
from netboard.base.compiled import kernel
from netboard.base.config import Config
from netboard.base.safeguards import Safeguard
from netboard.base.tables.simulated import VirtualDevice
from netboard.base.tick import TICK, TICK_NS
from netboard.devices.simulated.virtual import VirtualTouch
from netboard.participants.body.device_models import resolved
from netboard.participants.body.stylus import ACTION, HandMechanics
from netboard.participants.people.hand import Hand
from netboard.participants.people.muscles import hand_mechanics, update_muscles
from netboard.participants.people.submovement import Submovement
from netboard.participants.seat.body import BODY, LEAD_NS, READINGS, advance, apply_force, pack_body, read
from netboard.physics.scene.rendering import pack_rendering
from netboard.task.trials.state_machine import Phase

T0 = 1_000_000_000


def simulate_hand(config: Config, forces: list[float], move: Submovement) -> list[np.void]:
    model = resolved(config.virtual)
    hand = Hand(config.participant, model, np.random.default_rng((config.block.seed, 1)))
    hand.plan([move])
    bodies, actions, readings = np.zeros(2, BODY), np.zeros(2, ACTION), np.zeros(1, READINGS)
    x, y, _ = hand.stylus.position
    pack_body(config, hand_mechanics(config.participant, model), (x, y), bodies[1])
    rows, queue, catch = np.zeros(len(forces), TICK), np.zeros((2, 1)), pack_rendering(config)["catch"][0].copy()
    words = rows.view(np.int64).reshape(len(rows), -1)
    for k, force in enumerate(forces):
        rows[k]["tick"], rows[k]["time_ns"], rows[k]["phase"] = k, T0 + k * TICK_NS, Phase.RUNNING
        numbers = words[k].view(np.float64)
        when = (T0 + k * TICK_NS - TICK_NS - LEAD_NS) * 1e-9
        _muscles(hand.muscles, hand.stylus.held.holder[1], when, bodies[1:], actions[1:])
        advance(bodies, actions, 1, 2, words[k], numbers)
        read(bodies, 1, 2, readings[0], words[k], numbers)
        rows[k]["right_force"] = force
        apply_force(bodies, 1, queue, catch, words[k], numbers)
    return list(rows)


@kernel
def _muscles(muscles: np.ndarray, arm: np.ndarray, when: float, bodies: np.ndarray, actions: np.ndarray) -> None:
    body = bodies[0]
    update_muscles(muscles[0], arm[0], when, body["stylus"]["place"][2], body["device"]["fz"], actions[0])


@pytest.mark.slow
@pytest.mark.parametrize("virtual", [VirtualDevice(), VirtualDevice(cable_stiffness="model")])
def test_rehearsal_hand_equals_the_virtual_device(virtual: VirtualDevice) -> None:
    config = replace(Config(), virtual=virtual)
    forces = [0.5 * np.sin(k / 20) for k in range(400)]
    move = Submovement("right", T0 * 1e-9 + 0.05, 0.3, 0.02)
    device = VirtualTouch("right", config)
    device.open()
    device.command([move])
    device.live(T0 - LEAD_NS - TICK_NS)
    for k, row in enumerate(simulate_hand(config, forces, move)):
        device.live(T0 + k * TICK_NS - LEAD_NS)
        reading = device.read(T0 + k * TICK_NS - LEAD_NS)
        assert reading.z == pytest.approx(row["right_sent_z"], abs=1e-9)
        assert reading.vz == pytest.approx(row["right_sent_vz"], abs=1e-9)
        assert (reading.x, reading.y) == pytest.approx((row["right_x"], row["right_y"]), abs=1e-9)
        device.write(*lateral_force(reading, config.fixture), forces[k])
        device.live(T0 + k * TICK_NS)


@pytest.mark.slow
def test_large_force_is_clamped_and_flagged() -> None:
    rows = simulate_hand(Config(), [10.0] * 3, Submovement("right", 0.0, 0.3, 0.0))
    assert rows[0]["right_safeguards"] == Safeguard.ARMED
    assert rows[2]["right_safeguards"] == Safeguard.ARMED | Safeguard.CLAMPED
    assert 2.5 < rows[2]["right_rendered"] <= 3.0


@pytest.mark.slow
def test_no_force_acts_outside_a_trial() -> None:
    bodies, row, queue = np.zeros(2, BODY), np.zeros(1, TICK), np.zeros((2, 1))
    pack_body(Config(), HandMechanics(), (0.0, 0.0), bodies[0])
    catch = pack_rendering(Config())["catch"][0].copy()
    row["left_force"], row["phase"] = 0.5, Phase.PAUSED
    words, numbers = row.view(np.int64), row.view(np.float64)
    assert apply_force(bodies, 0, queue, catch, words, numbers) == 0.0
    row["phase"] = Phase.HOLDING
    assert apply_force(bodies, 0, queue, catch, words, numbers) == 0.5
    assert bodies["device"]["commanded"][0] == 0.5
