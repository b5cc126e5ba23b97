"""Many scenes at reduced fidelity: the same task, hands, actions, observations and rewards, several times as fast.

`reduced_steps` says what differs from `netboard.participants.batch.scenes.Scenes`, and `netboard bench environments`
by how much. Reduced scenes have no haptic feedback, no policy at the other seat, and no recording.

Rule 1: a scene depends on the seed of its episode and on its actions, not on the scenes beside it or their number.
"""

from collections.abc import Sequence
from dataclasses import replace
from math import ceil, nan
from typing import Any, ClassVar, final

import numpy as np
from numpy.typing import NDArray

from netboard.base.compiled import machine_code
from netboard.base.config import SIDES, Config
from netboard.base.errors import ConfigError
from netboard.base.tables.experiment import STILL
from netboard.base.tick import START_NS, TICK_NS, TICK_SECONDS
from netboard.participants.batch.agents import (
    METHOD,
    SeatedAgent,
    StepResult,
    initial_doing,
    is_plain,
    mechanics_of,
    require,
    targets_of,
    timing_of,
)
from netboard.participants.batch.arrays import LANES
from netboard.participants.batch.reduced_steps import (
    HEIGHT,
    LONGEST,
    PHASE,
    ROWS,
    SEEN_AT,
    SEEN_P,
    SEEN_PHASE,
    SEEN_TARGET,
    SEEN_THETA,
    SEEN_Z,
    SUCCEEDED,
    TICKS,
    VIEW_ROWS,
    ReducedArrays,
    act,
    begin,
    make_observe,
    make_steps,
)
from netboard.participants.batch.spaces import ACTIONS, HAND, TRUTH, VIEW, SceneOptions, scales_of, weights_of
from netboard.participants.body.stylus import STEP
from netboard.participants.policy import SEEN, Nobody
from netboard.physics.scene.parameters import parts_of
from netboard.physics.stability.method_choice import choose
from netboard.stage.stage import make_stage
from netboard.task.trials.state_machine import Phase

_PHASES = {
    -1: Phase.IDLE,
    0: Phase.LEVELLING,
    1: Phase.RUNNING,
    2: Phase.HOLDING,
    3: Phase.SUCCEEDED,
    4: Phase.FAILED,
}


@final
class ReducedScenes:
    """Many scenes at reduced fidelity, with one agent or two; a hand that no agent moves is held still.

    Its attributes and methods are those of `netboard.participants.batch.scenes.Scenes`.
    """

    finished: ClassVar[tuple[()]] = ()
    """Recorded episodes: none."""

    def __init__(self, config: Config, agents: Sequence[SeatedAgent], count: int, options: SceneOptions) -> None:
        require(config)
        _require_reduced(config, agents)
        self.config, self.agents, self.count, self.options = config, tuple(agents), count, options
        self.policy = self.robot = Nobody()
        self.stage = make_stage(config)
        self._length = step_length(config, options.ticks)
        self._seconds = self._length * TICK_SECONDS
        self._limit = round(options.max_seconds / TICK_SECONDS)
        padded = ceil(count / LANES) * LANES
        self._timing = np.array([timing_of(config, agent) for agent in agents])
        self._arrays = self._make_arrays(padded // LANES)
        self._doing = initial_doing(config, self.agents)
        self._usual = {side: self._doing[:, place].copy() for place, side in enumerate(SIDES)}
        self._first_views = self._timing[:, 1].copy()
        self._reward, self._ends = np.zeros(padded), np.zeros((2, padded), bool)
        self.outcome = StepResult(self._reward[:count], *self._ends[:, :count])
        self._compile()
        self.reset(np.arange(padded), range(padded))

    def _make_arrays(self, groups: int) -> ReducedArrays:
        """Make the arrays of some groups of scenes."""
        agents, hands = len(self.agents), np.zeros((len(SIDES), 4))
        moved = {side for agent in self.agents for side in agent.sides}
        for place, one in enumerate(mechanics_of(self.config, moved, self.policy, self.robot)):
            mobility = one["per_force"] / STEP
            hands[place] = mobility, one["damping"], one["friction_step"] / one["per_force"], one["stop"]
        return ReducedArrays(
            rows=np.zeros((groups, ROWS, LANES)),
            following=np.zeros((agents, groups, LANES)),
            seen=np.zeros((agents, groups, self.options.views + 1, VIEW_ROWS, LANES)),
            every=self._timing[:, 0].astype(float),
            hands=hands,
        )

    def _compile(self) -> None:
        """Compile the kernels, or load them from the cache."""
        physics, options, every = self.config.physics, self.options, int(self._timing[:, 0].min())
        parts = parts_of(physics), parts_of(physics, free=False)
        alike = physics.model == "paper" and physics.fixed_ball == "loads_board"
        steps = make_steps(*parts, self._length, options.ticks // self._length, alike, ceil(self._length / every))
        weights = np.append(weights_of(options), float(self._limit))
        self._run_arguments = (
            self._arrays,
            self.stage.book,
            np.zeros(1),
            weights,
            self._reward,
            self._ends[0],
            self._ends[1],
        )
        self._run = machine_code(steps, *self._run_arguments)
        self._observers = tuple(
            make_observe(options.views, "left" in agent.sides, "right" in agent.sides, options.truth)
            for agent in self.agents
        )
        self._scales = scales_of(VIEW), scales_of(HAND), scales_of(TRUTH)
        self._room = np.zeros((len(options.observed(len(SIDES))), LANES))
        self._columns = np.array([ACTIONS.index(action) for action in options.actions])
        self._action_scale = scales_of(options.actions)
        self._action_offset = np.array([action.offset for action in options.actions])
        plain, some = np.zeros((1, 1), np.float32), np.zeros(1, np.int64)
        decided = self._columns, self._action_scale, self._action_offset, some.astype(float), self._seconds
        self._impedance = bool({"stiffness", "damping"} & set(options.act))
        self._act = machine_code(act, self._arrays, 0, 0, *decided, self._impedance, plain)
        self._observe = tuple(
            machine_code(one, self._arrays, 0, *self._scales, self._room, plain) for one in self._observers
        )
        begun = some, some, self.config.geometry.target_distance, some, self._doing, self._seconds
        self._begin = machine_code(begin, self._arrays, *begun)

    def reset(self, scenes: NDArray[np.int64], seeds: Sequence[int] | NDArray[np.int64]) -> None:
        """Begin an episode in some scenes, each with a seed of its own."""
        targets = targets_of(self.config, self.stage.first_target, seeds)
        distance = self.config.geometry.target_distance
        begun = np.ascontiguousarray(scenes), targets, distance, self._first_views, self._doing, self._seconds
        self._begin(self._arrays, *begun)

    def act(self, agent: int, actions: NDArray[Any]) -> None:
        """Let the hands of an agent do what it decides; ``actions``: shape (n, hands x quantities), -1 to 1 [1]."""
        if not np.isfinite(actions).all():
            raise ValueError(f"action: found {actions[~np.isfinite(actions)][0]}, expected numbers from -1 to 1")
        width, run = len(self._columns), self._act if is_plain(actions) else act
        for place, side in enumerate(self.agents[agent].sides):
            run(
                self._arrays,
                SIDES.index(side),
                place * width,
                self._columns,
                self._action_scale,
                self._action_offset,
                self._usual[side],
                self._seconds,
                self._impedance,
                actions,
            )

    def step(self) -> StepResult:
        """Run the ticks of a step in all scenes."""
        self._run(*self._run_arguments)
        return self.outcome

    def observe(self, agent: int, out: NDArray[Any]) -> None:
        """Write what an agent observes in each scene, shape (n, `SceneOptions.observed`)."""
        run = self._observe[agent] if is_plain(out) else self._observers[agent]
        run(self._arrays, agent, *self._scales, self._room, out)

    def finish(self, scene: int) -> None:
        """Do nothing: no episode is recorded."""

    @property
    def succeeded(self) -> NDArray[np.bool_]:
        """For each scene, whether its trial has succeeded."""
        return np.asarray(self._row(PHASE) == SUCCEEDED)

    @property
    def seconds(self) -> NDArray[np.float64]:
        """For each scene, the time since the start of its episode [s]."""
        return self._row(TICKS) * TICK_SECONDS

    def _row(self, row: int) -> NDArray[np.float64]:
        """Return a number of each scene."""
        return self._arrays.rows[:, row].ravel()[: self.count]

    def seen(self, agent: int, scene: int) -> np.void:
        """Return the newest view that an agent has seen, a record of SEEN, with its own hands as they are now."""
        arrays, (g, j) = self._arrays, divmod(scene, LANES)
        seen: np.void = np.zeros(1, SEEN)[0]
        newest = arrays.following[agent, g, j] - arrays.every[agent]
        first = 1 if newest >= arrays.rows[g, TICKS, j] - 1 else 0
        view = arrays.seen[agent, g, first, :, j]
        for place, side in enumerate(SIDES):
            seen[side] = arrays.rows[g, HEIGHT + place, j] if side in self.agents[agent].sides else nan
        seen["phase"] = _PHASES[int(view[SEEN_PHASE])]
        seen["z"], seen["theta"], seen["p"] = view[SEEN_Z], view[SEEN_THETA], view[SEEN_P]
        seen["target"] = view[SEEN_TARGET]
        seen["time"] = (START_NS + (view[SEEN_AT] + 1) * TICK_NS) * 1e-9 if view[SEEN_AT] >= 0.0 else nan
        return seen


def step_length(config: Config, ticks: int) -> int:
    """Return the length of the integration steps in a step of some ticks: as long as is stable and exact enough [1].

    Raises
    ------
    ConfigError
        If another method is configured, or the scene is so stiff that RK4 takes several steps in a tick.
    """
    if config.physics.method not in ("auto", METHOD):
        raise ConfigError(f'physics.method: found "{config.physics.method}", expected "auto" or "{METHOD}"')
    physics = replace(config.physics, method="auto", substeps=0)  # a named method would only have to be stable
    for length in range(min(LONGEST, ticks), 0, -1):
        choice = choose(physics, length * TICK_SECONDS)
        if ticks % length == 0 and (choice.method, choice.substeps) == (METHOD, 1):
            return length
    raise ConfigError("fidelity: found reduced with a scene that needs several steps in a tick, expected strict")


def _require_reduced(config: Config, agents: Sequence[SeatedAgent]) -> None:
    """Refuse what reduced scenes do not simulate."""
    block, moved = config.block, {side for agent in agents for side in agent.sides}
    for side, mover in zip(SIDES, (block.left, block.right), strict=True):
        if side not in moved and mover != STILL:
            raise ConfigError(f'other: found {mover!r}, expected "still": at reduced fidelity nobody else moves a hand')
    if block.haptics:
        raise ConfigError(
            f'[block] force: found {block.force!r}, expected "none": at reduced fidelity there is no haptic feedback'
        )
    if config.perturbation.at != "none" and config.perturbation.trials:
        raise ConfigError("[perturbation]: found some, expected none: reduced fidelity has no perturbations")
