"""Many scenes of one kind of block, with agents at their seats: reset, step, observe and reward.

The environments of this room are thin shells round `Scenes`. An episode is one attempt at a trial: it begins with a
level board and the ball fixed, and ends when the ball has stayed in the target, has fallen, or the time is over.

Rule 1: a scene depends on the seed of its episode and on its actions, not on the scenes beside it or their number.
"""

from collections.abc import Callable, Sequence
from dataclasses import replace
from math import ceil, nan
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from netboard.base.compiled import Numbers, inlined, kernel, machine_code
from netboard.base.config import SIDES, Config, Side
from netboard.base.errors import ConfigError
from netboard.base.tables.experiment import PERSON, STILL
from netboard.base.tick import START_NS, STATE, TICK, TICK_NS, TICK_SECONDS
from netboard.participants.body.device_models import resolved
from netboard.participants.body.stylus import ACTION, MECHANICS, HandMechanics, pack_mechanics
from netboard.participants.body.velocity_window import SAMPLES
from netboard.participants.environments.spaces import ACTIONS, BOUND, HAND, TRUTH, VIEW, SceneOptions, scales_of
from netboard.participants.environments.stepping import (
    DAMPING,
    ENDED_IN_FAILURE,
    ENDED_IN_SUCCESS,
    LANES,
    STIFFNESS,
    Partner,
    SceneArrays,
    Viewers,
    make_begin,
    make_steps,
    write_samples,
)
from netboard.participants.people.muscles import hand_mechanics
from netboard.participants.policy import SEEN, Nobody, Policy
from netboard.participants.robots.learned import SPEED, Trainee
from netboard.participants.seat.body import refuse_flaws
from netboard.participants.seat.closed_loop import make_seat, policy_at
from netboard.stage.stage import make_stage
from netboard.task.trials.state_machine import Cause, Phase, is_free

Array = NDArray[np.float64]

_LEVELLING, _RUNNING, _HOLDING = (int(phase) for phase in (Phase.LEVELLING, Phase.RUNNING, Phase.HOLDING))


METHOD = "rk4"
"""The integration method of environments: the one that is compiled for lanes."""


class SeatedAgent(NamedTuple):
    """An agent: the station whose views it sees, and the hands that it moves."""

    station: Side
    sides: tuple[Side, ...]


class RecordedEpisode(NamedTuple):
    """A finished episode that was recorded: the configuration of its block, and its rows."""

    config: Config
    rows: NDArray[Any]


class StepResult(NamedTuple):
    """Results of a step, for each scene; valid until the next."""

    reward: Array
    terminated: NDArray[np.bool_]
    truncated: NDArray[np.bool_]


@inlined
def _potential(s: np.void, distance: float) -> float:
    """Return how far a trial has come: -2 to 0."""
    if is_free(s["phase"]):
        return float(-min(1.0, abs(s["p"] - s["target"] * distance) / (2.0 * distance)))
    return float(-1.0 - 0.5 * min(1.0, abs(s["theta"]) / 0.2) - 0.5 * min(1.0, abs(s["z"]) / 0.05))


@kernel
def _score(sc: SceneArrays, limit: int, distance: float, weights: Numbers, potential: Numbers, reward: Numbers) -> None:
    """Write the reward of each scene; ``weights``: of the time in a tick and in a step, progress, success, failure."""
    for i in range(len(reward)):
        reward[i] = -weights[1]
        if sc.ended[i] == ENDED_IN_SUCCESS:
            reward[i] += weights[3]
        elif sc.ended[i] == ENDED_IN_FAILURE:
            reward[i] -= weights[4] + weights[0] * max(limit - sc.ticks[i], 0) + weights[2] * (potential[i] + 2.0)
        else:
            now = _potential(sc.states[i], distance)
            reward[i] += weights[2] * (now - potential[i])
            potential[i] = now


@inlined
def _clipped(value: float) -> float:
    """Return an observed number within its bounds, 0 for what is hidden."""
    return 0.0 if np.isnan(value) else min(max(value, -BOUND), BOUND)


@kernel
def _observe(
    sc: SceneArrays,
    viewers: Viewers,
    a: int,
    hands: NDArray[np.int64],
    truth: bool,
    view: Numbers,
    hand: Numbers,
    true: Numbers,
    out: NDArray[np.float32],
) -> None:
    """Write what an agent observes in each scene: views, own hands and, if it may, the true state."""
    views = viewers.seen.shape[2] - 1
    for i in range(len(out)):
        g, j, at = i // LANES, i % LANES, 0
        row, newest = out[i], viewers.following[a, i] - viewers.every[a]
        now = (START_NS + (sc.ticks[i] - 1) * TICK_NS) * 1e-9
        first = 1 if newest >= sc.ticks[i] - 1 else 0
        for k in range(first, first + views):
            seen = viewers.seen[a, i, k]
            known = not np.isnan(seen["time"])
            phase = seen["phase"]
            row[at] = 1.0 if known and phase == _LEVELLING else 0.0
            row[at + 1] = 1.0 if known and phase == _RUNNING else 0.0
            row[at + 2] = 1.0 if known and phase == _HOLDING else 0.0
            row[at + 3], row[at + 4] = _clipped(seen["z"] / view[3]), _clipped(seen["theta"] / view[4])
            row[at + 5], row[at + 6] = _clipped(seen["p"] / view[5]), _clipped(seen["target"] / view[6])
            row[at + 7] = _clipped((now - seen["time"]) / view[7])
            at += 8
        for side in range(2):
            if hands[side]:
                row[at] = _clipped(sc.reading[g, side, j] / hand[0])
                row[at + 1] = _clipped(sc.reading[g, 2 + side, j] / hand[1])
                row[at + 2] = _clipped(sc.motor[g, side, j] / hand[2])
                at += 3
        if truth:
            s = sc.states[i]
            row[at], row[at + 1] = _clipped(s["z"] / true[0]), _clipped(s["vz"] / true[1])
            row[at + 2], row[at + 3] = _clipped(s["theta"] / true[2]), _clipped(s["omega"] / true[3])
            row[at + 4], row[at + 5] = _clipped(s["p"] / true[4]), _clipped(s["vp"] / true[5])
            row[at + 6], row[at + 7] = _clipped(sc.place[g, 0, j] / true[6]), _clipped(sc.v[g, 0, j] / true[7])
            row[at + 8], row[at + 9] = _clipped(sc.place[g, 1, j] / true[8]), _clipped(sc.v[g, 1, j] / true[9])


@kernel
def _act(
    sc: SceneArrays,
    side: int,
    column: int,
    rows: NDArray[np.int64],
    scale: Numbers,
    offset: Numbers,
    actions: NDArray[np.float32],
) -> None:
    """Let one hand of each scene do what is decided; ``rows``: what the columns of the actions are."""
    for i in range(len(actions)):
        g, j = i // LANES, i % LANES
        for k in range(len(rows)):
            value = min(max(float(actions[i, column + k]), -1.0), 1.0)
            sc.doing[g, rows[k], side, j] = offset[k] + scale[k] * value


class Scenes:
    """Many scenes with one agent or two, and a policy, a hand held still, or nobody else, at the other seat.

    ``config``: the block; ``left`` and ``right`` in it are the movers of the hands that no agent moves.
    """

    def __init__(self, config: Config, agents: Sequence[SeatedAgent], count: int, options: SceneOptions) -> None:
        _require(config)
        self.config, self.agents, self.count, self.options = config, tuple(agents), count, options
        self.stage = make_stage(config)
        if self.stage.choice.method != METHOD:
            raise ConfigError(
                f"[physics]: found a scene that {self.stage.choice.method} integrates, expected one for which {METHOD} "
                "is stable: environments have no other method"
            )
        padded = ceil(count / LANES) * LANES
        moved = {side for agent in agents for side in agent.sides}
        self.policy, self._station = _other(config, moved)
        self.robot = _robot_of(config, self.agents, options)
        self._arrays = _arrays(config, padded, moved, self.policy, self.robot, self.stage.delay)
        self._viewers = _viewers(config, self.agents, padded, options.views)
        self._partner = _partner(config, self.policy, self._station, padded)
        self._robot = _partner(config, self.robot, agents[0].station, padded)
        self._fresh = self._partner.seat.observation[:1].copy()
        self._record = np.zeros((padded, options.ticks) if options.record else (1, 1), TICK)
        self._pieces: list[list[NDArray[Any]]] = [[] for _ in range(count if options.record else 0)]
        self.finished: list[RecordedEpisode] = []
        self._potential = np.zeros(padded)
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
        self._begin = make_begin(self.policy.decide)
        self._begin_robot = make_begin(self.robot.decide)
        weights = self.options.reward
        tick = weights.time * TICK_SECONDS
        self._weights = np.array([tick, tick * self.options.ticks, weights.progress, weights.success, weights.failure])
        self._hands = tuple(np.array([side in agent.sides for side in SIDES], np.int64) for agent in self.agents)
        self._scales = scales_of(VIEW), scales_of(HAND), scales_of(TRUTH)
        actions = self.options.actions
        self._rows = np.array([ACTIONS.index(action) for action in actions if action in ACTIONS])
        self._action_scale = scales_of(actions)
        self._action_offset = np.array([action.offset for action in actions])

    def reset(self, scenes: NDArray[np.int64], seeds: Sequence[int]) -> None:
        """Begin an episode in some scenes, each with a seed of its own."""
        arrays, viewers = self._arrays, self._viewers
        g, j = scenes // LANES, scenes % LANES
        write_samples(arrays, scenes)
        targets = self._targets(seeds)
        for target in (-1, 1):
            arrays.states[scenes[targets == target]] = self._initial(target)
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
        seeds: Sequence[int],
    ) -> None:
        """Put a policy at its start in some scenes."""
        for scene, seed in zip(scenes, seeds, strict=True):
            partner.seat.state[scene] = policy.initial((int(seed),))[0]
        partner.seat.observation[scenes] = self._fresh[0]
        partner.following[scenes] = partner.seat.timing[1]
        begin(self._arrays, partner, scenes)

    def _targets(self, seeds: Sequence[int]) -> NDArray[np.int64]:
        """Return the side of the target in episodes with these seeds."""
        if self.config.block.first_target != "random":
            return np.full(len(seeds), self.stage.first_target)
        return np.where(np.asarray(seeds) % 2 == 0, -1, 1)

    def _initial(self, target: int) -> np.void:
        """Return the state of a scene at the start, with the target on a side."""
        state: np.void = replace(self.stage, first_target=target).initial()[0]
        return state

    def act(self, agent: int, actions: NDArray[Any]) -> None:
        """Let the hands of an agent do what it decides; ``actions``: shape (n, hands x quantities), -1 to 1 [1]."""
        if not np.isfinite(actions).all():
            raise ValueError(f"action: found {actions[~np.isfinite(actions)][0]}, expected numbers from -1 to 1")
        if self.robot.sides:
            self._robot.seat.state["speed"][: len(actions)] = SPEED * np.clip(actions[:, 0], -1.0, 1.0)
            return
        width = len(self._rows)
        for place, side in enumerate(self.agents[agent].sides):
            _act(
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
        _score(self._arrays, self._limit, distance, self._weights, self._potential, outcome.reward)
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
        _observe(self._arrays, self._viewers, agent, hands, truth, view, hand, true, out)

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

    @property
    def _doing(self) -> Array:
        """What the hands do at the start: rows of `stepping`, columns by side."""
        doing, person = np.zeros((4, len(SIDES))), self.config.participant
        for agent in self.agents:
            for side in agent.sides:
                doing[STIFFNESS, SIDES.index(side)] = person.arm_stiffness
                doing[DAMPING, SIDES.index(side)] = person.arm_damping
        return doing

    @property
    def _first_views(self) -> NDArray[np.int64]:
        """For each agent, the tick of its first view."""
        return np.array([_timing(self.config, agent)[1] for agent in self.agents])


_UNSEEN = np.full(1, nan, np.dtype([(name, "<f8") for name in SEEN.names or ()]))[0]
"""A view before the first one."""


def _require(config: Config) -> None:
    """Refuse a block that environments do not simulate."""
    refuse_flaws(config)
    refused = {
        "[block] force": (config.block.force, config.block.force == "unrelated"),
        "[virtual] cable_stiffness": (config.virtual.cable_stiffness, resolved(config.virtual).cable_stiffness > 0.0),
        "[physics] ball_stop": (config.physics.ball_stop, config.physics.ball_stop > 0.0),
        "[physics] balls": (config.physics.balls, config.physics.balls != 1),
    }
    for key, (found, wrong) in refused.items():
        if wrong:
            raise ConfigError(f"{key}: found {found!r}, expected another value: environments do not simulate this")


def _other(config: Config, moved: set[Side]) -> tuple[Policy, Side]:
    """Return the policy of the hand that no agent moves, `Nobody` if it is held still, and its station."""
    for side, mover in zip(SIDES, (config.block.left, config.block.right), strict=True):
        if side not in moved and mover != STILL:
            people = {"A": config.participant, "B": config.participant}
            return policy_at(config, (side,), people), side
    return Nobody(), "left"


def _robot_of(config: Config, agents: tuple[SeatedAgent, ...], options: SceneOptions) -> Policy:
    """Return the robot through which the agent acts, `Nobody` if it moves its hands itself."""
    if not options.learned_hand:
        return Nobody()
    if len(agents) != 1 or len(agents[0].sides) != 1:
        raise ConfigError("learned_hand: found with more than one hand, expected one agent with one hand")
    return Trainee(config, agents[0].sides[0])


def _arrays(config: Config, count: int, moved: set[Side], policy: Policy, robot: Policy, delay: int) -> SceneArrays:
    """Make the arrays of some scenes, each hand on its device."""
    groups, device = count // LANES, resolved(config.virtual)
    mechanics = np.zeros(len(SIDES), MECHANICS)
    for place, side in enumerate(SIDES):
        hand = HandMechanics()
        if side in robot.sides:
            hand = robot.hand()
        elif side in moved:
            hand = hand_mechanics(config.participant, device)
        elif side in policy.sides:
            hand = policy.hand()
        mechanics[place] = pack_mechanics(device, hand)[0]
    rows = np.zeros(LANES, TICK)
    hands = (groups, len(SIDES), LANES)
    return SceneArrays(
        states=np.zeros(count, STATE),
        ticks=np.zeros(count, np.int64),
        ended=np.zeros(count, np.int64),
        place=np.zeros(hands),
        v=np.zeros(hands),
        motor=np.zeros(hands),
        commanded=np.zeros(hands),
        smooth=np.zeros(groups, np.int64),
        seen_vz=np.zeros(hands),
        used_z=np.zeros(hands),
        reading=np.zeros((groups, 2 * len(SIDES), LANES)),
        doing=np.zeros((groups, 4, len(SIDES), LANES)),
        stamps=np.tile(-TICK_NS * np.arange(SAMPLES, dtype=np.int64), (groups, 1)),
        places=np.zeros((groups, SAMPLES, len(SIDES) * LANES)),
        queue=np.zeros((count, len(SIDES), delay + 1)),
        rows=rows,
        words=rows.view(np.int64).reshape(LANES, -1),
        numbers=rows.view(np.float64).reshape(LANES, -1),
        room=np.zeros((27, LANES)),
        mechanics=mechanics,
        device=np.array([device.resolution, min(device.max_force, config.safety.max_force)]),
    )


def _timing(config: Config, agent: SeatedAgent) -> NDArray[np.int64]:
    """Return the ticks between two views of a station, and the first of them."""
    return make_seat(config, Nobody(), agent.station, (0,)).timing


def _viewers(config: Config, agents: Sequence[SeatedAgent], count: int, views: int) -> Viewers:
    """Make what the seats of agents are shown."""
    seats = [make_seat(config, Nobody(), agent.station, (0,)) for agent in agents]
    return Viewers(
        np.concatenate([seat.curtain for seat in seats]),
        np.array([seat.timing[0] for seat in seats]),
        np.zeros((len(agents), count), np.int64),
        np.zeros((len(agents), count, views + 1), SEEN),
    )


def _partner(config: Config, policy: Policy, station: Side, count: int) -> Partner:
    """Put a policy into its seat in each scene."""
    seat = make_seat(config, policy, station, (0,))
    repeated = {name: np.repeat(getattr(seat, name), count) for name in ("state", "constants", "observation")}
    return Partner(seat._replace(**repeated), np.zeros((count, len(SIDES)), ACTION), np.zeros(count, np.int64))


def block_of(config: Config, seat: str, other: str) -> tuple[Config, tuple[SeatedAgent, ...]]:
    """Return the configuration of a block of one trial, and its agents.

    Parameters
    ----------
    seat : str
        ``left`` or ``right``: one agent with one hand; ``both``: one with both hands; ``each``: two with one hand each.
    other : str
        What moves the other hand of one agent: ``person``, a simulated participant; ``still``; or a robot partner.
    """
    block = replace(config.block, trials=1, left=PERSON, right=PERSON, configuration="dyadic")
    if seat == "both":
        block = replace(block, configuration="bimanual")
        return replace(config, block=block), (SeatedAgent(block.station, SIDES),)
    if seat == "each":
        return replace(config, block=block), tuple(SeatedAgent(side, (side,)) for side in SIDES)
    if seat == "left":
        return replace(config, block=replace(block, right=other)), (SeatedAgent("left", ("left",)),)
    if seat == "right":
        return replace(config, block=replace(block, left=other)), (SeatedAgent("right", ("right",)),)
    raise ConfigError(f'seat: found {seat!r}, expected "left", "right", "both" or "each"')
