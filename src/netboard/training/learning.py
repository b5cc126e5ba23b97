"""Proximal policy optimisation (PPO, Schulman et al. 2017) of a learned partner, by Stable-Baselines3.

Training is a sequence of rounds. Each begins with new episodes and random numbers from its seed, and ends with a
checkpoint: a training that is resumed gets the same bits as one that was not interrupted.

Rule 1: PyTorch runs in one thread; more slow it down with networks as small as these. Rule 2: a checkpoint is numbers
and JSON; reading one runs no code from it.
"""

from collections.abc import Iterator
from pathlib import Path
from time import monotonic, process_time

import numpy as np
import torch
from stable_baselines3 import PPO
from stable_baselines3.common.utils import set_random_seed

from netboard.base.config import Config
from netboard.base.errors import ConfigError
from netboard.base.tables.simulated import Participant
from netboard.participants.robots.network import TrainedNetwork
from netboard.training.boards import PopulationBoards, relaxed
from netboard.training.progress import STEPS, TrainingFolder, TrainingRequest, TrainingRound
from netboard.training.warm_start import imitate, samples_of, teacher_of
from netboard.training.weights import weights_of_round, write_weights

LEARNING_RATES = (7e-4, 2e-4)
"""Learning rate in the first round and the last; it falls by the same factor from round to round [1]."""

EXPLORATION = (0.2, 0.08)
"""Standard deviation of the noise on actions, likewise [1]. A partner that learned with much noise alone stalls without
it: the noise moves a ball on that has come to rest beside the target."""


class Training:
    """A training under way; ``folder`` keeps its checkpoints, and has the rounds that were run before."""

    def __init__(
        self, request: TrainingRequest, config: Config, people: list[Participant], folder: TrainingFolder
    ) -> None:
        torch.set_num_threads(1)
        self.request, self._folder, self._config = request, folder, config
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
        if (checkpoint := folder.checkpoint) is not None:
            self._load(checkpoint)

    @property
    def curve(self) -> list[TrainingRound]:
        """The learning curve so far."""
        return self._folder.curve

    def _scheduled(self, ends: tuple[float, float]) -> float:
        """Return a quantity of the present round that falls geometrically from its first value to its last."""
        share = len(self.curve) / max(self.request.rounds - 1, 1)
        return float(ends[0] * (ends[1] / ends[0]) ** share)

    def rounds(self) -> Iterator[TrainingRound]:
        """Run the rounds that are still to be run; each is saved before it is yielded."""
        while len(self.curve) < self.request.rounds:
            self._save(self._run())
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

    def _save(self, done: TrainingRound) -> None:
        """Write the weights of a round, and a checkpoint."""
        policy = self._model.policy
        write_weights(weights_of_round(self._folder.path, done.round), self.network(), force=True)
        state = {"policy": policy.state_dict(), "optimizer": policy.optimizer.state_dict()}
        self._folder.save(done, lambda path: torch.save(state, path))

    def _load(self, path: Path) -> None:
        """Continue from a checkpoint."""
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
