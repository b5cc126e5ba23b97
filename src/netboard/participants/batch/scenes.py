"""Many scenes of one kind of block, with agents at their seats: reset, step, observe and reward.

The environments are thin shells round `make_scenes`. An episode is one attempt at a trial: it begins with a
level board and the ball fixed, and ends when the ball has stayed in the target, has fallen, or the time is over.

Rule 1: a scene depends on the seed of its episode and on its actions, not on the scenes beside it or their number.
"""

from collections.abc import Callable, Sequence
from dataclasses import replace
from math import ceil, nan
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from netboard.base.compiled import machine_code
from netboard.base.config import SIDES, Config, Side
from netboard.base.errors import ConfigError
from netboard.base.tables.experiment import STILL
from netboard.base.tick import STATE, TICK, TICK_NS, TICK_SECONDS
from netboard.participants.batch.agents import (
    METHOD,
    SeatedAgent,
    StepResult,
    initial_doing,
    is_plain,
    mechanics_of,
    other_policy,
    require,
    robot_of,
    targets_of,
    timing_of,
)
from netboard.participants.batch.arrays import LANES, Partner, make_arrays, make_partner, make_viewers
from netboard.participants.batch.observing import act, observe, score
from netboard.participants.batch.reduced import ReducedScenes
from netboard.participants.batch.sensing import write_samples
from netboard.participants.batch.spaces import ACTIONS, HAND, REDUCED, TRUTH, VIEW, SceneOptions, scales_of, weights_of
from netboard.participants.batch.stepping import (
    ENDED_IN_SUCCESS,
    make_begin,
    make_steps,
)
from netboard.participants.body.velocity_window import SAMPLES
from netboard.participants.policy import SEEN, Policy
from netboard.participants.robots.learned import SPEED
from netboard.stage.stage import make_stage
from netboard.task.trials.state_machine import Cause, Phase

Array = NDArray[np.float64]

_LEVELLING, _RUNNING, _HOLDING = (int(phase) for phase in (Phase.LEVELLING, Phase.RUNNING, Phase.HOLDING))


class RecordedEpisode(NamedTuple):
    """A finished episode that was recorded: the configuration of its block, and its rows."""

    config: Config
    rows: NDArray[Any]


class Scenes:
    """Many scenes with one agent or two, and a policy, a hand held still, or nobody else, at the other seat.

    ``config``: the block; ``left`` and ``right`` in it are the movers of the hands that no agent moves.
    """

    def __init__(self, config: Config, agents: Sequence[SeatedAgent], count: int, options: SceneOptions) -> None:
        require(config)
        self.config, self.agents, self.count, self.options = config, tuple(agents), count, options
        self.stage = make_stage(config)
        if self.stage.choice.method != METHOD:
            raise ConfigError(
                f"[physics]: found a scene that {self.stage.choice.method} integrates, expected one for which {METHOD} "
                "is stable: environments have no other method"
            )
        padded = ceil(count / LANES) * LANES
        moved = {side for agent in agents for side in agent.sides}
        self.policy, self._station = other_policy(config, moved)
        self.robot = robot_of(config, self.agents, options)
        self._arrays = make_arrays(
            config, padded, mechanics_of(config, moved, self.policy, self.robot), self.stage.delay
        )
        self._viewers = make_viewers(config, self.agents, padded, options.views)
        self._partner = make_partner(config, self.policy, self._station, padded)
        self._robot = make_partner(config, self.robot, agents[0].station, padded)
        self._fresh = self._partner.seat.observation[:1].copy()
        self._record = np.zeros((padded, options.ticks) if options.record else (1, 1), TICK)
        self._pieces: list[list[NDArray[Any]]] = [[] for _ in range(count if options.record else 0)]
        self.finished: list[RecordedEpisode] = []
        self._potential = np.zeros(padded)
        self._doing = initial_doing(config, self.agents)
        self._initial = np.concatenate([replace(self.stage, first_target=target).initial() for target in (-1, 1)])
        self._first_views = np.array([timing_of(config, agent)[1] for agent in agents])
        self.outcome = StepResult(np.zeros(count), np.zeros(count, bool), np.zeros(count, bool))
        self._limit = round(options.max_seconds / TICK_SECONDS)
        self._compile()

    def _compile(self) -> None:
        """Compile the kernels, or load them from the cache."""
        block = self.config.block
        felt = block.haptics and any(mover != STILL for mover in (block.left, block.right))
        steps = make_steps(
            self.stage.kernels,
            self.policy.decide,
            self.robot.decide,
            felt,
            bool(self.policy.sides),
            bool(self.robot.sides),
            self.options.record,
        )
        self._run_arguments = (
            self._arrays,
            self._viewers,
            self._partner,
            self._robot,
            self.stage.book,
            self.stage.tables,
            self.options.ticks,
            self._record,
        )
        self._run = machine_code(steps, *self._run_arguments)
        some = np.zeros(1, np.int64)
        self._write_samples = machine_code(write_samples, self._arrays, some)
        self._begin = machine_code(make_begin(self.policy.decide), self._arrays, self._partner, some)
        self._begin_robot = machine_code(make_begin(self.robot.decide), self._arrays, self._robot, some)
        self._weights = weights_of(self.options)
        self._hands = tuple(np.array([side in agent.sides for side in SIDES], np.int64) for agent in self.agents)
        self._scales = scales_of(VIEW), scales_of(HAND), scales_of(TRUTH)
        actions = self.options.actions
        self._rows = np.array([ACTIONS.index(action) for action in actions if action in ACTIONS])
        self._action_scale = scales_of(actions)
        self._action_offset = np.array([action.offset for action in actions])
        plain, distance = np.zeros((1, 1), np.float32), self.config.geometry.target_distance
        decided = self._rows, self._action_scale, self._action_offset
        self._act = machine_code(act, self._arrays, 0, 0, *decided, plain)
        shown = self._hands[0], self.options.truth, *self._scales
        self._observe = machine_code(observe, self._arrays, self._viewers, 0, *shown, plain)
        scored = self._limit, distance, self._weights, self._potential, self.outcome.reward
        self._score = machine_code(score, self._arrays, *scored)

    def reset(self, scenes: NDArray[np.int64], seeds: Sequence[int] | NDArray[np.int64]) -> None:
        """Begin an episode in some scenes, each with a seed of its own."""
        scenes = np.ascontiguousarray(scenes)
        arrays, viewers = self._arrays, self._viewers
        g, j = scenes // LANES, scenes % LANES
        self._write_samples(arrays, scenes)
        targets = targets_of(self.config, self.stage.first_target, seeds)
        arrays.states[scenes] = self._initial[(targets > 0).astype(np.int64)]
        arrays.ticks[scenes] = arrays.ended[scenes] = 0
        for array in (arrays.place, arrays.v, arrays.motor, arrays.commanded, arrays.reading):
            array[g, :, j] = 0.0
        arrays.places.reshape(len(arrays.places), SAMPLES, 2, LANES)[g, :, :, j] = 0.0
        arrays.doing[g, :, :, j] = self._doing
        arrays.queue[scenes] = 0.0
        viewers.following[:, scenes] = self._first_views[:, np.newaxis]
        viewers.seen[:, scenes] = _UNSEEN
        if self.policy.sides:
            self._reset_partner(self.policy, self._partner, self._begin, scenes, seeds)
        if self.robot.sides:
            self._reset_partner(self.robot, self._robot, self._begin_robot, scenes, seeds)
        self._potential[scenes] = -1.0
        for scene in scenes if self.options.record else ():
            self._pieces[scene] = []

    def _reset_partner(
        self,
        policy: Policy,
        partner: Partner,
        begin: Callable[..., None],
        scenes: NDArray[np.int64],
        seeds: Sequence[int] | NDArray[np.int64],
    ) -> None:
        """Put a policy at its start in some scenes."""
        for scene, seed in zip(scenes, seeds, strict=True):
            partner.seat.state[scene] = policy.initial((int(seed),))[0]
        partner.seat.observation[scenes] = self._fresh[0]
        partner.following[scenes] = partner.seat.timing[1]
        begin(self._arrays, partner, scenes)

    def act(self, agent: int, actions: NDArray[Any]) -> None:
        """Let the hands of an agent do what it decides; ``actions``: shape (n, hands x quantities), -1 to 1 [1]."""
        if not np.isfinite(actions).all():
            raise ValueError(f"action: found {actions[~np.isfinite(actions)][0]}, expected numbers from -1 to 1")
        if self.robot.sides:
            self._robot.seat.state["speed"][: len(actions)] = SPEED * np.clip(actions[:, 0], -1.0, 1.0)
            return
        width, run = len(self._rows), self._act if is_plain(actions) else act
        for place, side in enumerate(self.agents[agent].sides):
            run(
                self._arrays,
                SIDES.index(side),
                place * width,
                self._rows,
                self._action_scale,
                self._action_offset,
                actions,
            )

    def step(self) -> StepResult:
        """Run the ticks of a step in all scenes."""
        self._run(*self._run_arguments)
        if self.options.record:
            for scene, pieces in enumerate(self._pieces):
                pieces.append(self._record[scene].copy())
        outcome, ended = self.outcome, self._arrays.ended[: self.count]
        distance = self.config.geometry.target_distance
        self._score(self._arrays, self._limit, distance, self._weights, self._potential, outcome.reward)
        np.not_equal(ended, 0, out=outcome.terminated)
        np.greater_equal(self._arrays.ticks[: self.count], self._limit, out=outcome.truncated)
        outcome.truncated[outcome.terminated] = False
        return outcome

    def observe(self, agent: int, out: NDArray[Any]) -> None:
        """Write what an agent observes in each scene, shape (n, `SceneOptions.observed`)."""
        if self.robot.sides:
            out[:] = self._robot.seat.state["inputs"][: len(out)]
            return
        hands, truth = self._hands[agent], self.options.truth
        view, hand, true = self._scales
        run = self._observe if is_plain(out) else observe
        run(self._arrays, self._viewers, agent, hands, truth, view, hand, true, out)

    def finish(self, scene: int) -> None:
        """Keep the rows of a scene whose episode is over; its block is stopped unless it has ended."""
        if not self.options.record or not self._pieces[scene]:
            return
        rows = np.concatenate(self._pieces[scene])
        self._pieces[scene] = []
        target: Side = "left" if rows["target"][0] < 0 else "right"
        config = replace(self.config, block=replace(self.config.block, first_target=target))
        self.finished.append(RecordedEpisode(config, self._stopped(rows, self._arrays.states[scene])))

    def _stopped(self, rows: NDArray[Any], state: np.void) -> NDArray[Any]:
        """Return the rows of an episode up to the end of its block, with that end added if it has not come yet."""
        ended = np.flatnonzero(rows["event"] == Cause.LAST)
        if len(ended):
            return rows[: ended[0] + 1]
        last = rows[-1:].copy()
        last["tick"] += 1
        last["command"] = Cause.STOP
        for name in ("time_ns", "left_stamp_ns", "right_stamp_ns"):
            last[name] += TICK_NS
        last["left_seq"] = last["right_seq"] = last["tick"]
        self.stage.advance(np.array([state], STATE), last)
        return np.concatenate([rows, last])

    @property
    def succeeded(self) -> NDArray[np.bool_]:
        """For each scene, whether its trial has succeeded."""
        return np.asarray(self._arrays.ended[: self.count] == ENDED_IN_SUCCESS)

    @property
    def seconds(self) -> Array:
        """For each scene, the time since the start of its episode [s]."""
        return np.asarray(self._arrays.ticks[: self.count] * TICK_SECONDS)

    def seen(self, agent: int, scene: int) -> np.void:
        """Return the newest view that an agent has seen, a record of SEEN."""
        viewers = self._viewers
        newest = viewers.following[agent, scene] - viewers.every[agent]
        first = 1 if newest >= self._arrays.ticks[scene] - 1 else 0
        seen: np.void = viewers.seen[agent, scene, first]
        return seen


_UNSEEN = np.full(1, nan, np.dtype([(name, "<f8") for name in SEEN.names or ()]))[0]
"""A view before the first one."""


def make_scenes(
    config: Config, agents: Sequence[SeatedAgent], count: int, options: SceneOptions
) -> Scenes | ReducedScenes:
    """Make scenes of the fidelity that the options ask for."""
    made = ReducedScenes if options.fidelity == REDUCED else Scenes
    return made(config, agents, count, options)
