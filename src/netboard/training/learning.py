"""Proximal policy optimisation (PPO, Schulman et al. 2017) of a learned partner, by Stable-Baselines3.

Training is a sequence of rounds. Each begins with new episodes and random numbers from its seed, and ends with a
checkpoint: a training that is resumed gets the same bits as one that was not interrupted.

Rule 1: PyTorch runs in one thread; more slow it down with networks as small as these. Rule 2: a checkpoint is numbers
and JSON; reading one runs no code from it.
"""

import json
from collections.abc import Iterator
from dataclasses import asdict, dataclass
from pathlib import Path
from time import monotonic, process_time

import numpy as np
import torch
from stable_baselines3 import PPO
from stable_baselines3.common.utils import set_random_seed

from netboard.base.config import Config
from netboard.base.errors import ConfigError
from netboard.base.files.new import new_file
from netboard.base.files.text import read_text
from netboard.base.settings import parse_json
from netboard.base.tables.simulated import Participant
from netboard.participants.robots.network import TrainedNetwork
from netboard.training.boards import PopulationBoards, relaxed
from netboard.training.warm_start import imitate, samples_of, teacher_of
from netboard.training.weights import weights_of_round, write_weights

CHECKPOINT, PROGRESS = "checkpoint.pt", "progress.json"
"""Files of a checkpoint: the weights and the state of the optimiser, and the learning curve so far."""

STEPS = 64
"""Steps of each board between two updates of the network [1]."""

LEARNING_RATES = (7e-4, 2e-4)
"""Learning rate in the first round and the last; it falls by the same factor from round to round [1]."""

EXPLORATION = (0.2, 0.08)
"""Standard deviation of the noise on actions, likewise [1]. A partner that learned with much noise alone stalls without
it: the noise moves a ball on that has come to rest beside the target."""


@dataclass(frozen=True, slots=True)
class TrainingRequest:
    """A training.

    ``rounds`` of ``updates`` updates each, with ``people`` participants and ``boards`` of each. Two hidden layers of
    ``units`` units.
    """

    seed: int = 1
    rounds: int = 6
    updates: int = 8
    people: int = 16
    boards: int = 16
    units: int = 32

    @property
    def steps(self) -> int:
        """Environment steps of the whole training."""
        return self.rounds * self.steps_of_round

    @property
    def steps_of_round(self) -> int:
        """Environment steps of a round."""
        return self.updates * STEPS * self.people * self.boards


@dataclass(frozen=True, slots=True)
class TrainingRound:
    """A point of the learning curve: the episodes that ended in a round, with the noise of exploration."""

    round: int
    steps: int
    episodes: int
    success: float  # share of them [1]
    truncated: float  # share that took too long [1]
    seconds: float  # mean length of the successful ones; NaN without any [s]
    exploration: float  # standard deviation of an action [1]
    cpu_seconds: float  # processor time of the training so far [s]
    wall_seconds: float  # elapsed time of the training so far [s]


class Training:
    """A training under way; ``folder`` keeps its checkpoints."""

    def __init__(
        self, request: TrainingRequest, config: Config, people: list[Participant], folder: Path, *, resume: bool = False
    ) -> None:
        torch.set_num_threads(1)
        self.request, self._folder, self._config = request, folder, config
        self.curve: list[TrainingRound] = []
        self._boards = PopulationBoards(relaxed(config), people, request.boards)
        self._model = PPO(
            "MlpPolicy",
            self._boards,
            learning_rate=lambda _: self._scheduled(LEARNING_RATES),
            n_steps=STEPS,
            batch_size=2048,
            n_epochs=5,
            gamma=0.995,
            gae_lambda=0.95,
            clip_range=0.2,
            ent_coef=0.0,
            seed=request.seed,
            device="cpu",
            policy_kwargs={"net_arch": [request.units, request.units]},
        )
        self._model.policy.log_std.requires_grad_(False)  # its schedule is ours
        if resume:
            self._load()

    def _scheduled(self, ends: tuple[float, float]) -> float:
        """Return a quantity of the present round that falls geometrically from its first value to its last."""
        share = len(self.curve) / max(self.request.rounds - 1, 1)
        return float(ends[0] * (ends[1] / ends[0]) ** share)

    def rounds(self) -> Iterator[TrainingRound]:
        """Run the rounds that are still to be run; each is saved before it is yielded."""
        while len(self.curve) < self.request.rounds:
            self.curve.append(self._run())
            self._save()
            yield self.curve[-1]

    def _warm_start(self) -> None:
        """Let the network imitate a control law."""
        set_random_seed(_seed_of(self.request.seed, 0, 2))
        rng = np.random.default_rng(_seed_of(self.request.seed, 0, 3))
        self._boards.seed(_seed_of(self.request.seed, 0, 4))
        policy = self._model.policy
        actor = torch.nn.Sequential(policy.mlp_extractor.policy_net, policy.action_net)
        imitate(actor, *samples_of(self._boards, teacher_of(self._config), rng), rng)

    def _run(self) -> TrainingRound:
        """Run a round."""
        number = len(self.curve)
        cpu, wall = process_time(), monotonic()
        if number == 0:
            self._warm_start()
        for layer in (self._model.policy.mlp_extractor.policy_net, self._model.policy.action_net):
            layer.requires_grad_(number > 0)  # the critic learns first: what it says at its start misleads
        set_random_seed(_seed_of(self.request.seed, number, 0))
        self._boards.seed(_seed_of(self.request.seed, number, 1))
        self._boards.finished.clear()
        self._model.policy.log_std.data.fill_(float(np.log(self._scheduled(EXPLORATION))))
        self._model._last_obs = None  # it resets the boards
        self._model.learn(self.request.steps_of_round, reset_num_timesteps=False)
        ended = self._boards.finished
        done = [episode for episode in ended if episode.success]
        before = self.curve[-1] if self.curve else None
        return TrainingRound(
            round=number + 1,
            steps=(number + 1) * self.request.steps_of_round,
            episodes=len(ended),
            success=len(done) / len(ended) if ended else float("nan"),
            truncated=sum(episode.truncated for episode in ended) / len(ended) if ended else float("nan"),
            seconds=float(np.mean([episode.seconds for episode in done])) if done else float("nan"),
            exploration=float(self._model.policy.log_std.detach().exp().mean()),
            cpu_seconds=process_time() - cpu + (before.cpu_seconds if before else 0.0),
            wall_seconds=monotonic() - wall + (before.wall_seconds if before else 0.0),
        )

    def network(self) -> TrainedNetwork:
        """Return the network as it is now."""
        policy = self._model.policy
        layers = [policy.mlp_extractor.policy_net[0], policy.mlp_extractor.policy_net[2], policy.action_net]
        arrays = [
            (layer.weight.detach().numpy().T.astype(np.float64), layer.bias.detach().numpy().astype(np.float64))
            for layer in layers
        ]
        return TrainedNetwork(tuple(arrays), {})

    def _save(self) -> None:
        """Write the weights of the round, and a checkpoint."""
        policy = self._model.policy
        write_weights(weights_of_round(self._folder, len(self.curve)), self.network(), force=True)
        with new_file(self._folder / CHECKPOINT, force=True) as part:
            torch.save({"policy": policy.state_dict(), "optimizer": policy.optimizer.state_dict()}, part)
        progress = {"request": asdict(self.request), "curve": [asdict(one) for one in self.curve]}
        with new_file(self._folder / PROGRESS, force=True) as part:
            part.write_text(json.dumps(progress, indent=1), encoding="utf-8")

    def _load(self) -> None:
        """Continue from a checkpoint."""
        path = self._folder / CHECKPOINT
        self.curve = _curve_of(self._folder / PROGRESS, self.request)
        try:
            found = torch.load(path, weights_only=True)
            self._model.policy.load_state_dict(found["policy"])
            self._model.policy.optimizer.load_state_dict(found["optimizer"])
        except Exception as error:  # PyTorch raises many kinds for a file that is not one
            raise ConfigError(f"{path}: expected a checkpoint of this training ({type(error).__name__})") from error
        self._model.num_timesteps = len(self.curve) * self.request.steps_of_round


def _seed_of(*numbers: int) -> int:
    """Return a seed that differs for each sequence of numbers."""
    return int(np.random.SeedSequence(numbers).generate_state(1)[0]) // 2


def _curve_of(path: Path, request: TrainingRequest) -> list[TrainingRound]:
    """Read the learning curve of a checkpoint."""
    text = read_text(path, "no such file; expected a folder of netboard train partner, to resume it")
    try:
        found = parse_json(text)
        rounds = [TrainingRound(**one) for one in found["curve"]]
        began = TrainingRequest(**found["request"])
    except (KeyError, TypeError, ValueError) as error:
        raise ConfigError(f"{path}: expected the progress of netboard train partner ({error!r})") from error
    if began != request:
        raise ConfigError(f"{path}: was begun with {began}, expected the same options: {request}")
    return rounds
