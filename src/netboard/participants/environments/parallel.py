"""One board with an agent at each seat, as a PettingZoo `ParallelEnv`."""

from collections.abc import Mapping
from typing import Any, final

import numpy as np
from gymnasium import spaces
from gymnasium.utils import seeding
from numpy.typing import NDArray
from pettingzoo import ParallelEnv

from netboard.base.config import SIDES, Config
from netboard.participants.batch.agents import block_of
from netboard.participants.batch.scenes import make_scenes
from netboard.participants.batch.spaces import SceneOptions
from netboard.participants.environments.rendering import draw
from netboard.participants.environments.vector import MAX_SEED, action_space, observation_space

_ONE = np.zeros(1, np.int64)


@final
class BoardParallelEnv(ParallelEnv):
    """One board with the agents ``left`` and ``right``, one hand each, who see their own views and share the reward.

    Parameters
    ----------
    config : Config or None
        Scene, task, device and force condition; None for the defaults.
    render_mode : str or None
        ``rgb_array``: the view of the left agent above that of the right one; None for no images.
    max_cycles : int or None
        Largest number of steps of an episode; None for ``max_seconds`` alone [1].
    **options
        Those of `netboard.participants.batch.spaces.SceneOptions`.

    Raises
    ------
    ConfigError
        If environments do not simulate the block, or an option is impossible.
    """

    metadata: dict[str, Any] = {  # noqa: RUF012  (PettingZoo declares it so)
        "name": "netboard_board_v1",
        "render_modes": ["rgb_array"],
        "render_fps": 60,
    }

    def __init__(
        self,
        *,
        config: Config | None = None,
        render_mode: str | None = None,
        max_cycles: int | None = None,
        **options: Any,
    ) -> None:
        if render_mode not in (None, *self.metadata["render_modes"]):
            raise ValueError(f"render_mode: found {render_mode!r}, expected None or 'rgb_array'")
        block, agents = block_of(config or Config(), "each", "person")
        self.render_mode, self.max_cycles = render_mode, max_cycles
        self.scenes = make_scenes(block, agents, 1, SceneOptions(**options))
        self.possible_agents = list(SIDES)
        self.agents: list[str] = []
        self._actions: dict[str, spaces.Box] = {side: action_space(self.scenes.options, 1) for side in SIDES}
        self._observations: dict[str, spaces.Box] = {side: observation_space(self.scenes.options, 1) for side in SIDES}
        self._generator: np.random.Generator | None = None
        self._cycles = 0

    def observation_space(self, agent: str) -> spaces.Box:
        """Return what an agent observes."""
        return self._observations[agent]

    def action_space(self, agent: str) -> spaces.Box:
        """Return what an agent may do."""
        return self._actions[agent]

    def reset(
        self, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[dict[str, NDArray[np.float32]], dict[str, dict[str, Any]]]:
        """Begin an episode.

        Parameters
        ----------
        seed : int or None
            Seed of this episode and of those after it [1].
        options : dict or None
            Not used.
        """
        if seed is not None or self._generator is None:
            self._generator = seeding.np_random(seed)[0]
        self.scenes.reset(_ONE, [int(self._generator.integers(MAX_SEED))])
        self.agents, self._cycles = list(self.possible_agents), 0
        return self._observed(), {agent: {} for agent in self.agents}

    def step(self, actions: Mapping[str, NDArray[np.floating[Any]]]) -> tuple[Mapping[Any, Any], ...]:
        """Run a step; return observations, rewards, terminations, truncations and infos, by agent.

        Parameters
        ----------
        actions : mapping
            For each agent, what it does, from -1 to 1 [1].
        """
        if not self.agents:
            return {}, {}, {}, {}, {}
        for place, side in enumerate(SIDES):
            self.scenes.act(place, np.asarray(actions[side])[np.newaxis])
        outcome = self.scenes.step()
        self._cycles += 1
        terminated = bool(outcome.terminated[0])
        timed_out = bool(outcome.truncated[0]) or self._cycles == self.max_cycles
        truncated = timed_out and not terminated
        info: dict[str, Any] = {}
        if terminated or truncated:
            self.scenes.finish(0)
            info = {"success": bool(self.scenes.succeeded[0]), "seconds": float(self.scenes.seconds[0])}
        observed = self._observed()
        if terminated or truncated:
            self.agents = []
        shared = float(outcome.reward[0]), terminated, truncated
        return observed, *(dict.fromkeys(SIDES, value) for value in shared), {side: dict(info) for side in SIDES}

    def _observed(self) -> dict[str, NDArray[np.float32]]:
        """Return what the agents observe."""
        observed: dict[str, NDArray[np.float32]] = {}
        for place, side in enumerate(SIDES):
            out = np.zeros((1, *self._observations[side].shape), np.float32)
            self.scenes.observe(place, out)
            observed[side] = out[0]
        return observed

    def render(self) -> NDArray[np.uint8] | None:
        """Return an image of what both agents see, (2 height, width, 3); None without ``render_mode``."""
        if self.render_mode is None:
            return None
        return np.concatenate([draw(self.scenes.seen(place, 0), self.scenes.config) for place in range(len(SIDES))])

    def close(self) -> None:
        """Close nothing: the environment holds no file and no window."""
