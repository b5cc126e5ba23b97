"""Boards beside a population of simulated participants, as a `VecEnv` of Stable-Baselines3.

Each participant has a `BoardVectorEnv` of its own; this adapter joins them. SuperSuit's adapter expects environments
without autoreset modes, and so does not fit.
"""

from collections.abc import Sequence
from dataclasses import replace
from typing import Any, NamedTuple, final

import numpy as np
from gymnasium import Wrapper
from numpy.typing import NDArray
from stable_baselines3.common.vec_env import VecEnv
from stable_baselines3.common.vec_env.base_vec_env import VecEnvIndices

from netboard.base.config import SIDES, Config
from netboard.base.tables.simulated import Participant
from netboard.participants.batch.spaces import RewardWeights
from netboard.participants.environments.vector import MAX_SEED, BoardVectorEnv
from netboard.participants.robots.learned import PERIOD

MAX_SECONDS = 8.0
"""Length of an episode in training, after which it is truncated: shorter than a round, so each is counted [s]."""

REWARD = RewardWeights(time=0.5)
"""Time costs five times as much as by default: a partner is to be fast as well as sure."""


class TrainingEpisode(NamedTuple):
    """How an episode ended; ``seconds``: its length, with levelling and holding [s]."""

    success: bool
    truncated: bool
    seconds: float


def relaxed(config: Config) -> Config:
    """Return the task of training, which releases the ball from a board that is hardly level.

    An algorithm explores by noise on its actions. With that noise the board is never level for 0.5 s at less than
    1 deg/s, so the ball would never be released, and nothing be learned.
    """
    return replace(config, task=replace(config.task, level_time=0.05, level_rate_deg_s=60.0, level_angle_deg=3.0))


@final
class PopulationBoards(VecEnv):
    """Boards with the hand of a learned partner, beside participants that take turns at the left and the right side.

    ``each``: boards of a participant. ``finished`` are the episodes that have ended since it was last cleared.
    """

    def __init__(self, config: Config, people: Sequence[Participant], each: int) -> None:
        self._fleets = [
            BoardVectorEnv(
                each,
                seat=SIDES[place % len(SIDES)],
                config=replace(config, participant=person),
                learned_hand=True,
                ticks=PERIOD,
                copy=False,
                autoreset_mode="SameStep",
                max_seconds=MAX_SECONDS,
                reward=REWARD,
            )
            for place, person in enumerate(people)
        ]
        first = self._fleets[0]
        super().__init__(each * len(people), first.single_observation_space, first.single_action_space)
        self._parts = [slice(each * place, each * (place + 1)) for place in range(len(people))]
        self._observed = np.zeros((self.num_envs, *first.single_observation_space.shape), np.float32)
        self._reward, self._over = np.zeros(self.num_envs, np.float32), np.zeros(self.num_envs, bool)
        self._actions = np.zeros((self.num_envs, *first.single_action_space.shape), np.float32)
        self.finished: list[TrainingEpisode] = []

    def reset(self) -> NDArray[np.float32]:
        """Begin an episode on each board, with the seeds of the last call of `seed`."""
        for fleet, part in zip(self._fleets, self._parts, strict=True):
            seed = self._seeds[part.start]
            self._observed[part] = fleet.reset(seed=None if seed is None else seed % MAX_SEED)[0]
        self._reset_seeds()
        return self._observed.copy()

    def step_async(self, actions: NDArray[Any]) -> None:
        """Keep the actions for `step_wait`."""
        self._actions = actions

    def step_wait(self) -> tuple[NDArray[np.float32], NDArray[np.float32], NDArray[np.bool_], list[dict[str, Any]]]:
        """Run a step on each board."""
        infos: list[dict[str, Any]] = [{} for _ in range(self.num_envs)]
        for fleet, part in zip(self._fleets, self._parts, strict=True):
            self._observed[part], self._reward[part], terminated, truncated, info = fleet.step(self._actions[part])
            self._over[part] = over = terminated | truncated
            for board in np.flatnonzero(over):
                ended = info["final_info"]
                cut = bool(truncated[board])
                infos[part.start + board] = {
                    "terminal_observation": info["final_obs"][board],
                    "TimeLimit.truncated": cut,
                }
                self.finished.append(
                    TrainingEpisode(bool(ended["success"][board]), cut, float(ended["seconds"][board]))
                )
        return self._observed.copy(), self._reward.copy(), self._over.copy(), infos

    def close(self) -> None:
        """Close the boards."""
        for fleet in self._fleets:
            fleet.close()

    def get_attr(self, attr_name: str, indices: VecEnvIndices = None) -> list[Any]:
        """Return an attribute of the boards' environment, once for each board."""
        return [getattr(self._fleets[0], attr_name)] * len(list(self._get_indices(indices)))

    def set_attr(self, attr_name: str, value: object, indices: VecEnvIndices = None) -> None:
        """Refuse: boards have no attributes to set."""
        raise NotImplementedError(f"boards take no {attr_name}")

    def env_method(self, method_name: str, *args: object, indices: VecEnvIndices = None, **kwargs: object) -> list[Any]:
        """Refuse: boards have no methods to call one by one."""
        raise NotImplementedError(f"boards have no method {method_name}")

    def env_is_wrapped(
        self, wrapper_class: type[Wrapper[Any, Any, Any, Any]], indices: VecEnvIndices = None
    ) -> list[bool]:
        """Return that no board is wrapped."""
        return [False] * len(list(self._get_indices(indices)))
