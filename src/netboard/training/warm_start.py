"""Warm start of a network: it imitates a control law before it learns by itself (behaviour cloning).

The teacher is the PD law with an integral of the robots that lead (`netboard.participants.robots.steering`), from the
same inputs as the network, with the default gains. It plays with noise of different strength on its actions, so that
the network also learns what to do off its path. The network then imitates the teacher without the noise.
"""

from collections.abc import Callable

import numpy as np
import torch
from numpy.typing import NDArray

from netboard.base.config import Config
from netboard.participants.robots.learned import INPUTS, SPEED
from netboard.participants.robots.sight import pack_board
from netboard.participants.robots.steering import SteeringParameters
from netboard.training.boards import PopulationBoards

Array = NDArray[np.float32]

STEPS = 400
"""Steps of each board that the teacher plays [1]."""

NOISE = (0.0, 0.05, 0.1, 0.3)
"""Standard deviations of the noise on the teacher's actions; boards have them in turn [1]."""

EPOCHS, BATCH, LEARNING_RATE = 20, 1024, 2e-3
"""How the network imitates: passes through the samples, samples of a step, and the rate at its start [1]."""

_PLACES = {one.name: place for place, one in enumerate(INPUTS)}


def teacher_of(config: Config) -> Callable[[Array], Array]:
    """Return the control law: from inputs, shape (n, inputs), to actions, shape (n, 1) [1]."""
    p, board = SteeringParameters(), pack_board(config, SteeringParameters(), "right")[0]
    l, slope, most = float(board["l"]), float(board["slope"]), float(board["max_tilt"])  # noqa: E741

    def teach(inputs: Array) -> Array:
        x = {name: inputs[:, place] * INPUTS[place].scale for name, place in _PLACES.items()}
        integral = np.clip(p.ki * x["stall"], -most * slope, most * slope)
        wanted = np.clip((p.kp * x["error"] + p.kd * x["ball_rate"] + integral) / slope, -most, most) * x["free"]
        speed = p.lead * (l * (wanted - x["tilt"]) - p.centring * x["z"]) * x["active"]
        return np.asarray(np.clip(speed / SPEED, -1.0, 1.0)[:, np.newaxis], np.float32)

    return teach


def samples_of(
    boards: PopulationBoards, teach: Callable[[Array], Array], rng: np.random.Generator
) -> tuple[Array, Array]:
    """Let the teacher play; return inputs and its actions without noise, (n, inputs) and (n, 1) [1]."""
    spread = np.resize(NOISE, boards.num_envs)[:, np.newaxis]
    seen, done, observed = [], [], boards.reset()
    for _ in range(STEPS):
        actions = teach(observed)
        seen.append(observed)
        done.append(actions)
        noisy = actions + spread * rng.standard_normal(actions.shape)
        observed, *_ = boards.step(np.clip(noisy, -1.0, 1.0).astype(np.float32))
    return np.concatenate(seen), np.concatenate(done)


def imitate(network: torch.nn.Module, inputs: Array, actions: Array, rng: np.random.Generator) -> float:
    """Fit a network to the samples; return the root mean square of its error in the last pass [1]."""
    optimizer = torch.optim.Adam(network.parameters(), lr=LEARNING_RATE)
    rate = torch.optim.lr_scheduler.ExponentialLR(optimizer, 0.85)
    given, wanted = torch.from_numpy(inputs), torch.from_numpy(actions)
    for _ in range(EPOCHS):
        squares = 0.0
        for batch in np.array_split(rng.permutation(len(inputs)), max(len(inputs) // BATCH, 1)):
            loss = torch.nn.functional.mse_loss(network(given[batch]), wanted[batch])
            optimizer.zero_grad()
            loss.backward()
            optimizer.step()
            squares += float(loss.detach()) * len(batch)
        rate.step()
    return float(np.sqrt(squares / len(inputs)))
