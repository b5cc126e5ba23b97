"""One board as a Gymnasium `Env`."""

from typing import Any, final

import gymnasium
import numpy as np
from numpy.typing import NDArray

from netboard.base.config import Config
from netboard.participants.batch.agents import block_of
from netboard.participants.batch.scenes import make_scenes
from netboard.participants.batch.spaces import SceneOptions
from netboard.participants.environments.rendering import draw
from netboard.participants.environments.vector import MAX_SEED, action_space, observation_space

_ONE = np.zeros(1, np.int64)


@final
class BoardEnv(gymnasium.Env):
    """One board with one agent: with one hand beside a partner, or with both hands.

    Parameters
    ----------
    seat, other : str
        As for `netboard.participants.batch.agents.block_of`.
    config : Config or None
        Scene, task, device and force condition; None for the defaults.
    render_mode : str or None
        ``rgb_array``, or None for no images.
    **options
        Those of `netboard.participants.batch.spaces.SceneOptions`.

    Raises
    ------
    ConfigError
        If environments do not simulate the block, or an option is impossible.
    """

    metadata: dict[str, Any] = {"render_modes": ["rgb_array"], "render_fps": 60}  # noqa: RUF012  (Gymnasium's own)

    def __init__(
        self,
        *,
        seat: str = "left",
        other: str = "person",
        config: Config | None = None,
        render_mode: str | None = None,
        **options: Any,
    ) -> None:
        if render_mode not in (None, *self.metadata["render_modes"]):
            raise ValueError(f"render_mode: found {render_mode!r}, expected None or 'rgb_array'")
        if seat == "each":
            raise ValueError("seat: found 'each', which has two agents; expected 'left', 'right' or 'both'")
        block, agents = block_of(config or Config(), seat, other)
        self.render_mode = render_mode
        self.scenes = make_scenes(block, agents, 1, SceneOptions(**options))
        hands = len(agents[0].sides)
        self.action_space = action_space(self.scenes.options, hands)
        self.observation_space = observation_space(self.scenes.options, hands)
        self._begun = False

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[NDArray[np.float32], dict[str, Any]]:
        """Begin an episode.

        Parameters
        ----------
        seed : int or None
            Seed of this episode and of those after it [1].
        options : dict or None
            Not used.
        """
        super().reset(seed=seed)
        self.scenes.reset(_ONE, [int(self.np_random.integers(MAX_SEED))])
        self._begun = True
        return self._observed(), {}

    def step(self, action: NDArray[np.floating[Any]]) -> tuple[NDArray[np.float32], float, bool, bool, dict[str, Any]]:
        """Run a step.

        Parameters
        ----------
        action : ndarray, shape (n,)
            What the agent does, from -1 to 1 [1].
        """
        if not self._begun:
            raise RuntimeError("step: reset the environment first")
        self.scenes.act(0, np.asarray(action)[np.newaxis])
        outcome = self.scenes.step()
        terminated, truncated = bool(outcome.terminated[0]), bool(outcome.truncated[0])
        infos: dict[str, Any] = {}
        if terminated or truncated:
            self.scenes.finish(0)
            infos = {"success": bool(self.scenes.succeeded[0]), "seconds": float(self.scenes.seconds[0])}
        return self._observed(), float(outcome.reward[0]), terminated, truncated, infos

    def _observed(self) -> NDArray[np.float32]:
        """Return what the agent observes."""
        out = np.zeros((1, *self.observation_space.shape), np.float32)
        self.scenes.observe(0, out)
        return np.asarray(out[0])

    def render(self) -> NDArray[np.uint8] | None:
        """Return an image of what the agent sees, (height, width, 3); None without ``render_mode``."""
        return None if self.render_mode is None else draw(self.scenes.seen(0, 0), self.scenes.config)
