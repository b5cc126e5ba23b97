"""The hand of a rehearsal equals the virtual device of a punctual agent, with rigid and compliant cables."""

from dataclasses import replace

import numpy as np
import pytest

from lateral import lateral_force
from netboard.base.config import Config
from netboard.base.safeguards import Safeguard
from netboard.base.tables.simulated import Participant, VirtualDevice
from netboard.base.tick import TICK, TICK_NS
from netboard.devices.simulated.virtual import VirtualTouch
from netboard.participants.people.controller import MOVE
from netboard.participants.people.submovement import Submovement
from netboard.participants.seat.body import LEAD_NS, Body, plan
from netboard.task.trials.state_machine import Phase

T0 = 1_000_000_000


def simulate_hand(config: Config, forces: list[float], move: Submovement) -> list[np.void]:
    body = Body(config, "right", config.participant, np.random.default_rng((config.block.seed, 1)))
    plan(body.bodies, np.array([(1, move.start, move.duration, move.displacement)], MOVE), 1)
    rows = np.zeros(len(forces), TICK)
    words = rows.view(np.int64).reshape(len(rows), -1)
    for k, force in enumerate(forces):
        rows[k]["tick"], rows[k]["time_ns"], rows[k]["phase"] = k, T0 + k * TICK_NS, Phase.RUNNING
        body.fill(words[k])
        rows[k]["right_force"] = force
        body.apply_force(words[k])
    return list(rows)


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
    body = Body(Config(), "left", Participant(), np.random.default_rng(1))
    row = np.zeros(1, TICK)
    row["left_force"], row["phase"] = 0.5, Phase.PAUSED
    words = row.view(np.int64)
    assert body.apply_force(words) == 0.0
    row["phase"] = Phase.HOLDING
    assert body.apply_force(words) == 0.5
    assert body.commanded == 0.5
