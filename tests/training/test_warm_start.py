"""The teacher of the warm start is the control law of the robots that lead; a network learns to imitate it."""

import numpy as np
import pytest

pytest.importorskip("stable_baselines3", reason="needs netboard[train]")

import torch

from netboard.base.config import Config
from netboard.participants.robots.learned import INPUTS, SPEED
from netboard.participants.robots.sight import SIGHT
from netboard.participants.robots.steering import SteeringParameters, pack_steering, speed_of, wanted_tilt
from netboard.training.warm_start import imitate, teacher_of

SCALES = np.array([one.scale for one in INPUTS])
PLACES = {one.name: place for place, one in enumerate(INPUTS)}


def law(x: np.ndarray) -> float:
    """The law of the robots, by their kernels, for inputs in their units."""
    p, sight = SteeringParameters(), np.zeros(1, SIGHT)[0]
    c = pack_steering(Config(), p, "right")[0]
    sight["free"], sight["ball_now"], sight["ball_rate_now"] = 1, x[PLACES["error"]], x[PLACES["ball_rate"]]
    sight["tilt_now"], sight["z_now"] = x[PLACES["tilt"]], x[PLACES["z"]] + c["board"]["rest"]
    sight["integral"] = p.ki * x[PLACES["stall"]]
    wanted = wanted_tilt(c, sight, 0.0, 0.0, 0.0)
    return float(speed_of(c, sight, 1.0, wanted, 0.0))


def test_teacher_is_the_law_of_the_robots_that_lead() -> None:
    inputs = np.random.default_rng(1).normal(0.0, 1.0, (100, len(INPUTS)))
    inputs[:, PLACES["active"]] = inputs[:, PLACES["free"]] = 1.0
    inputs[:, PLACES["ball_rate"]] += np.sign(inputs[:, PLACES["ball_rate"]])  # a ball that moves
    taught = teacher_of(Config())(inputs.astype(np.float32))[:, 0]
    expected = [np.clip(law(x) / SPEED, -1.0, 1.0) for x in inputs * SCALES]
    assert taught == pytest.approx(expected, abs=1e-5)
    assert np.mean(np.abs(taught) < 1.0) > 0.1, "most are within the limits"


def test_network_imitates_the_teacher() -> None:
    rng = np.random.default_rng(1)
    inputs = rng.normal(0.0, 0.3, (40_000, len(INPUTS))).astype(np.float32)
    inputs[:, PLACES["active"]] = inputs[:, PLACES["free"]] = 1.0
    torch.manual_seed(1)
    network = torch.nn.Sequential(torch.nn.Linear(len(INPUTS), 16), torch.nn.Tanh(), torch.nn.Linear(16, 1))
    actions = teacher_of(Config())(inputs)
    assert imitate(network, inputs, actions, rng) < 0.5 * float(actions.std())  # the root mean square of a constant: 1
