"""Many boards as one Gymnasium `VectorEnv`, whose step is one kernel."""

from collections.abc import Mapping, Sequence
from typing import Any, final

import numpy as np
from gymnasium import spaces
from gymnasium.utils import seeding
from gymnasium.vector import AutoresetMode, VectorEnv
from gymnasium.vector.utils import batch_space
from numpy.typing import NDArray

from netboard.base.config import Config
from netboard.participants.batch.agents import block_of
from netboard.participants.batch.scenes import make_scenes
from netboard.participants.batch.spaces import BOUND, SceneOptions
from netboard.participants.environments.rendering import draw

MAX_SEED = 2**31 - 1
"""Largest seed of an episode [1]."""

_AHEAD = 16
"""Seeds of episodes that are drawn for a board at once: a generator takes as long for one [1]."""

_AGENT = 0


def action_space(options: SceneOptions, hands: int) -> spaces.Box:
    """Return the actions of an agent: the numbers of `SceneOptions.actions` for each hand."""
    return spaces.Box(-1.0, 1.0, (hands * len(options.actions),), np.float32)


def observation_space(options: SceneOptions, hands: int) -> spaces.Box:
    """Return the observations of an agent: the numbers of `SceneOptions.observed`."""
    return spaces.Box(-BOUND, BOUND, (len(options.observed(hands)),), np.float32)


@final
class EpisodeSeeds:
    """Seeds of the episodes of some boards, each from a generator of its own; they do not depend on each other."""

    def __init__(self, seeds: Sequence[int | None]) -> None:
        self._generators = [seeding.np_random(seed)[0] for seed in seeds]
        self._drawn, self._used = np.zeros((len(seeds), _AHEAD), np.int64), np.full(len(seeds), _AHEAD)

    def reseed(self, board: int, seed: int) -> None:
        """Begin with the first episode of a seed."""
        self._generators[board] = seeding.np_random(seed)[0]
        self._used[board] = _AHEAD

    def following(self, boards: NDArray[np.int64]) -> NDArray[np.int64]:
        """Return the seeds of the next episodes of some boards."""
        for board in boards[self._used[boards] == _AHEAD]:
            self._drawn[board] = self._generators[board].integers(MAX_SEED, size=_AHEAD)
            self._used[board] = 0
        seeds: NDArray[np.int64] = self._drawn[boards, self._used[boards]]
        self._used[boards] += 1
        return seeds


@final
class BoardVectorEnv(VectorEnv):
    """Many boards, each with one agent; its actions and observations are those of `BoardEnv`.

    Parameters
    ----------
    num_envs : int
        Number of boards [1].
    seat, other : str
        As for `netboard.participants.batch.agents.block_of`; ``each`` has two agents and is for
        `netboard.participants.environments.parallel.BoardParallelEnv`.
    config : Config or None
        Scene, task, device and force condition; None for the defaults.
    autoreset_mode : gymnasium.vector.AutoresetMode or str
        What follows the end of an episode: ``NextStep``, ``SameStep`` or ``Disabled``.
    copy : bool
        False: `step` returns the same arrays each time, which the next step overwrites.
    render_mode : str or None
        ``rgb_array``, or None for no images.
    **options
        Those of `netboard.participants.batch.spaces.SceneOptions`.

    Raises
    ------
    ConfigError
        If environments do not simulate the block, or an option is impossible.
    """

    metadata: dict[str, Any] = {  # noqa: RUF012  (Gymnasium declares it so)
        "render_modes": ["rgb_array"],
        "render_fps": 60,
        "autoreset_mode": AutoresetMode.NEXT_STEP,
    }

    def __init__(
        self,
        num_envs: int = 1,
        *,
        seat: str = "left",
        other: str = "person",
        config: Config | None = None,
        autoreset_mode: AutoresetMode | str = AutoresetMode.NEXT_STEP,
        copy: bool = True,
        render_mode: str | None = None,
        **options: Any,
    ) -> None:
        if render_mode not in (None, *self.metadata["render_modes"]):
            raise ValueError(f"render_mode: found {render_mode!r}, expected None or 'rgb_array'")
        if seat == "each":
            raise ValueError("seat: found 'each', which has two agents; expected 'left', 'right' or 'both'")
        block, agents = block_of(config or Config(), seat, other)
        self.num_envs, self.render_mode, self.copy = num_envs, render_mode, copy
        self.autoreset_mode = AutoresetMode(autoreset_mode)
        self.metadata = {**self.metadata, "autoreset_mode": self.autoreset_mode}
        self.scenes = make_scenes(block, agents, num_envs, SceneOptions(**options))
        hands = len(agents[_AGENT].sides)
        self.single_action_space = action_space(self.scenes.options, hands)
        self.single_observation_space = observation_space(self.scenes.options, hands)
        self.action_space = batch_space(self.single_action_space, num_envs)
        self.observation_space = batch_space(self.single_observation_space, num_envs)
        self._seeds: EpisodeSeeds | None = None
        self._observations = np.zeros((num_envs, *self.single_observation_space.shape), np.float32)
        self._done = np.ones(num_envs, bool)

    def reset(
        self, *, seed: int | Sequence[int | None] | None = None, options: Mapping[str, Any] | None = None
    ) -> tuple[NDArray[np.float32], dict[str, Any]]:
        """Begin an episode on each board, or on those of ``options["reset_mask"]``.

        Parameters
        ----------
        seed : int, sequence of int or None
            A number: board i gets it + i [1].
        options : mapping or None
            ``reset_mask``: ndarray of bool, shape (num_envs,).
        """
        chosen = self._chosen((options or {}).get("reset_mask"))
        self._reseed(seed, chosen)
        self._begin(chosen)
        self.scenes.observe(_AGENT, self._observations)
        return self._handed_over(self._observations), {}

    def _chosen(self, mask: NDArray[np.bool_] | None) -> NDArray[np.int64]:
        """Return the boards of a mask, all without one."""
        if mask is None:
            return np.arange(self.num_envs)
        if not isinstance(mask, np.ndarray) or mask.dtype != np.bool_ or mask.shape != (self.num_envs,):
            raise ValueError(f"reset_mask: expected an array of {self.num_envs} bool, found {mask!r}")
        if not mask.any():
            raise ValueError("reset_mask: expected one True at least, found none")
        return np.flatnonzero(mask)

    def _reseed(self, seed: int | Sequence[int | None] | None, chosen: NDArray[np.int64]) -> None:
        """Seed the random numbers of boards; without a seed, those that have none yet."""
        if seed is None or isinstance(seed, int | np.integer):
            seeds = [None if seed is None else int(seed) + i for i in range(self.num_envs)]
        else:
            seeds = list(seed)
        if len(seeds) != self.num_envs:
            raise ValueError(f"seed: found {len(seeds)} of them, expected {self.num_envs}")
        if self._seeds is None:
            self._seeds = EpisodeSeeds(seeds)
            return
        for board in chosen:
            if (one := seeds[board]) is not None:
                self._seeds.reseed(board, one)

    def _begin(self, boards: NDArray[np.int64]) -> None:
        """Begin an episode on some boards."""
        assert self._seeds is not None
        self.scenes.reset(boards, self._seeds.following(boards))
        self._done[boards] = False

    def step(
        self, actions: NDArray[np.floating[Any]]
    ) -> tuple[NDArray[np.float32], NDArray[np.float64], NDArray[np.bool_], NDArray[np.bool_], dict[str, Any]]:
        """Run a step on each board.

        Parameters
        ----------
        actions : ndarray, shape (num_envs, n)
            What the agents do, from -1 to 1 [1].
        """
        if self._seeds is None:
            raise RuntimeError("step: reset the environment first")
        if self.autoreset_mode == AutoresetMode.DISABLED and self._done.any():
            raise RuntimeError("step: reset the boards whose episode is over first, by options={'reset_mask': ...}")
        over = self._done.copy()
        self.scenes.act(_AGENT, actions)
        reward, terminated, truncated = self.scenes.step()
        if self.autoreset_mode == AutoresetMode.NEXT_STEP and over.any():
            self._begin(np.flatnonzero(over))
            reward[over], terminated[over], truncated[over] = 0.0, False, False
        self._done = terminated | truncated
        infos = self._infos()
        self.scenes.observe(_AGENT, self._observations)
        if self._done.any():
            self._end(infos)
        results = self._observations, reward, terminated, truncated
        return *map(self._handed_over, results), infos  # type: ignore[return-value]

    def _infos(self) -> dict[str, Any]:
        """Return what is known of the boards whose episode is over."""
        if not self._done.any():
            return {}
        known = {
            "success": self.scenes.succeeded & self._done,
            "seconds": np.where(self._done, self.scenes.seconds, 0.0),
        }
        return known | {f"_{name}": self._done.copy() for name in known}

    def _end(self, infos: dict[str, Any]) -> None:
        """End the episodes that are over; with ``SameStep`` begin the next, and tell what was observed last."""
        over = np.flatnonzero(self._done)
        for board in over:
            self.scenes.finish(int(board))
        if self.autoreset_mode != AutoresetMode.SAME_STEP:
            return
        last = np.full(self.num_envs, None, object)
        for board in over:
            last[board] = self._observations[board].copy()
        info = {name: infos.pop(name) for name in list(infos)}
        infos.update(final_obs=last, _final_obs=self._done.copy(), final_info=info, _final_info=self._done.copy())
        self._begin(over)
        self.scenes.observe(_AGENT, self._observations)

    def _handed_over(self, array: NDArray[Any]) -> NDArray[Any]:
        """Return an array, or a copy that later steps do not change."""
        return array.copy() if self.copy else array

    def render(self) -> tuple[NDArray[np.uint8], ...] | None:
        """Return an image of what the agent of each board sees, (height, width, 3); None without ``render_mode``."""
        if self.render_mode is None:
            return None
        return tuple(draw(self.scenes.seen(_AGENT, board), self.scenes.config) for board in range(self.num_envs))
