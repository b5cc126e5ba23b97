"""The passive partner of the analysis, compared with a simulated dyad in which one hand never acts.

The full simulation has the board's motion, the device with its friction, encoder and cables, the safety chain and the
virtual coupling; the right hand is only an arm that holds its stylus.
"""

from dataclasses import astuple, replace

import closed_loop
import numpy as np
import pytest
from closed_loop import make_controllers, play, with_block
from numpy.typing import NDArray
from scipy.signal import butter, filtfilt

from netboard.analysis.extraction.devices import DeviceMechanics
from netboard.analysis.measures.movements import classify, movement_times
from netboard.analysis.measures.passive import Gains, PassiveHand, passive_partner
from netboard.base.config import Config
from netboard.participants.body.device_models import resolved
from netboard.physics.scene.parameters import pack_scene, parts_of
from netboard.physics.scene.rendering import gains_of

RATE = 1000.0


def smooth(x: NDArray[np.float64]) -> NDArray[np.float64]:
    return np.asarray(filtfilt(*butter(2, 10.0, fs=RATE), x))


def cooperative_share(left: NDArray[np.float64], right: NDArray[np.float64]) -> float:
    return float(movement_times(classify(np.gradient(left, 1 / RATE), np.gradient(right, 1 / RATE)), RATE).shares[0])


@pytest.mark.slow
@pytest.mark.parametrize("stiffness", [50.0, 150.0])
def test_passive_hand_with_the_device_matches_the_full_simulation(
    stiffness: float, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(closed_loop, "make_controllers", lambda config: make_controllers(config)[:1])
    config = with_block(Config(), "dyadic", True, 4, 3)
    passive = replace(config.participant, arm_stiffness=stiffness, force_noise=0.0, rest_skill=0.0, load_skill=0.0)
    config = replace(config, participant=passive)
    rows = play(config, 15.0).rows[200:]
    left, right, p = (smooth(rows[name].astype(float)) for name in ("left_sent_z", "right_sent_z", "p"))
    gains = Gains(*gains_of(parts_of(config.physics), pack_scene(config.physics)[0])[1][1:])
    person, device = config.participant, resolved(config.virtual)
    arm = PassiveHand(person.arm_mass, person.arm_damping, stiffness)
    holding = arm.holding(*astuple(DeviceMechanics(device.mass, device.damping, device.friction)))
    without, held = (passive_partner(left, p, RATE, hand, gains) for hand in (arm, holding))
    expected = cooperative_share(left, right)
    assert np.ptp(held) == pytest.approx(np.ptp(right), rel=0.35)
    assert np.ptp(without) > 1.5 * np.ptp(right)
    assert cooperative_share(left, held) == pytest.approx(expected, abs=0.02)
    assert cooperative_share(left, without) > expected + 0.1
