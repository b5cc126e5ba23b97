"""The stage: physics and trial machine composed into one tick. The only place that composes them.

`advance` is a pure function: from the state at a tick, the stylus samples used and the operator's command it makes the
forces, the event and the state at the next tick. It reads no clock, opens no socket, draws nothing and logs nothing.
The server runs it live, ``netboard replay --verify`` runs it over a recording and must get the same bits, and
simulations run it as fast as the machine allows.

A tick is one row of `TICK`: what went in, the state it found, and what came out. The state in row k+1 is what
`advance` made of row k, so any row can start a verification.
"""

from dataclasses import dataclass
from itertools import pairwise
from typing import Any

import numpy as np
from numpy.typing import NDArray

from netboard.compiled import kernel
from netboard.config import Config
from netboard.experiment.machine import (
    ACTION,
    HAS_EDGE,
    SUCCESSOR,
    Action,
    Cause,
    Phase,
    first_target,
    is_active,
    is_level,
    pack_rules,
    sense,
)
from netboard.physics.hold import constant_velocity
from netboard.physics.kernels import coupling, rk4_bare, rk4_fixed, rk4_free
from netboard.physics.scene import pack_scene
from netboard.tick import INPUT, OUTPUT, STATE, TICK, TICK_SECONDS

EXTRAPOLATION_REACH = 0.005
"""A stylus sample is extrapolated by its velocity over at most this time [s]."""

# Plain integers: what numba folds into the kernel below.
_NONE, _START, _FAULT = int(Cause.NONE), int(Cause.START), int(Cause.FAULT)
_LEVELLING, _RUNNING, _HOLDING = int(Phase.LEVELLING), int(Phase.RUNNING), int(Phase.HOLDING)
_PREPARE, _RELEASE, _MARK, _SUCCEED = int(Action.PREPARE), int(Action.RELEASE), int(Action.MARK), int(Action.SUCCEED)
_FAIL, _ADVANCE, _RETRY, _HALT = int(Action.FAIL), int(Action.ADVANCE), int(Action.RETRY), int(Action.HALT)


@kernel
def _used(live: int, z: float, vz: float, age: float, last: float, limit: float) -> tuple[float, float]:
    """Height and rate of a stylus at the tick, extrapolated and clipped; the last one, at rest, without a sample."""
    if live == 0 or not np.isfinite(z) or not np.isfinite(vz):
        return last, 0.0
    z = constant_velocity(z, vz, age, EXTRAPOLATION_REACH)
    if z > limit:
        return limit, 0.0
    if z < -limit:
        return -limit, 0.0
    return z, vz


@kernel
def _place_ball(s: Any, rules: Any) -> None:
    """Put the ball at rest opposite the target."""
    s["p"] = -s["target"] * rules["target_distance"]
    s["vp"] = 0.0


@kernel
def _act(s: Any, action: int, rules: Any) -> None:
    """Carry out the machine's action on the state."""
    if action == _RELEASE:
        s["run_ticks"] = 0
    elif action == _MARK:
        s["mark_ticks"] = s["run_ticks"]
    elif action == _SUCCEED:
        s["successes"] += 1
        s["completion"] = s["mark_ticks"] * TICK_SECONDS
    elif action == _FAIL:
        s["failures"] += 1
    elif action == _PREPARE:
        _place_ball(s, rules)
    elif action == _ADVANCE:
        s["target"] = -s["target"]
        s["trial"] += 1
        s["attempt"] = 1
        _place_ball(s, rules)
    elif action == _RETRY:
        s["attempt"] += 1
        _place_ball(s, rules)
    elif action == _HALT:
        s["vp"] = 0.0
    s["counted"] = 0


@kernel
def _count(s: Any, rules: Any) -> None:
    """Count this tick for the trial: since the release, level, inside the target."""
    phase = s["phase"]
    if phase == _LEVELLING:
        s["counted"] = s["counted"] + 1 if is_level(s["z"], s["theta"], s["omega"], rules) else 0
    elif phase == _RUNNING:
        s["run_ticks"] += 1
    elif phase == _HOLDING:
        s["run_ticks"] += 1
        s["counted"] += 1


@kernel
def _move(s: Any, cause: int, rules: Any) -> int:
    """Take the machine's edge for a cause and return the cause; without an edge do nothing and return 0."""
    phase = s["phase"]
    if not HAS_EDGE[phase, cause]:
        return _NONE
    s["phase"] = SUCCESSOR[phase, cause]
    _act(s, ACTION[phase, cause], rules)
    return cause


@kernel
def _decide(s: Any, command: int, rules: Any) -> int:
    """Run the trial machine on the state; return the cause of the edge taken, 0 for none."""
    _count(s, rules)
    phase = s["phase"]
    if _START <= command <= _FAULT and HAS_EDGE[phase, command]:
        return _move(s, command, rules)
    centre = s["target"] * rules["target_distance"]
    sensed = sense(phase, s["p"], centre, s["counted"], s["run_ticks"], s["successes"], rules)
    return _move(s, sensed, rules)


@kernel
def _integrate(s: Any, left_vz: float, right_vz: float, ball: bool, scene: Any) -> bool:
    """Move the board and the ball by one tick; put the board at rest and return False if that is not finite."""
    z, vz, theta, omega, p, vp = s["z"], s["vz"], s["theta"], s["omega"], s["p"], s["vp"]
    left_z, right_z, h = s["left_z"], s["right_z"], TICK_SECONDS
    if not ball:
        z, vz, theta, omega, p, vp = rk4_bare(z, vz, theta, omega, p, vp, left_z, left_vz, right_z, right_vz, h, scene)
    elif s["phase"] == _RUNNING or s["phase"] == _HOLDING:
        z, vz, theta, omega, p, vp = rk4_free(z, vz, theta, omega, p, vp, left_z, left_vz, right_z, right_vz, h, scene)
    else:
        z, vz, theta, omega, p, vp = rk4_fixed(z, vz, theta, omega, p, vp, left_z, left_vz, right_z, right_vz, h, scene)
    finite = bool(np.isfinite(z + vz + theta + omega + p + vp))
    if finite:
        s["z"], s["vz"], s["theta"], s["omega"], s["p"], s["vp"] = z, vz, theta, omega, p, vp
    else:
        s["z"], s["vz"], s["theta"], s["omega"], s["vp"] = 0.0, 0.0, 0.0, 0.0, 0.0
    return finite


_STATE_NAMES = tuple(STATE.names or ())
_STATE_WORD = len(INPUT.names or ())
"""The state begins in a row after so many words: every field is one word of 64 bits [1]."""


def _words(records: NDArray[Any]) -> NDArray[np.int64]:
    """The same memory as 64-bit words, shape (records, words)."""
    return records.view(np.int64).reshape(len(records), -1)


@kernel
def _tick(s: Any, row: Any, settings: Any, scene: Any, rules: Any) -> None:
    """Do one tick: read the inputs of the row, write the outputs to it, move the state on."""
    limit = settings["stylus_range"]
    left_age = (row["time_ns"] - row["left_stamp_ns"]) * 1e-9
    right_age = (row["time_ns"] - row["right_stamp_ns"]) * 1e-9
    left_z, left_vz = _used(row["left_live"], row["left_sent_z"], row["left_sent_vz"], left_age, s["left_z"], limit)
    right_z, right_vz = _used(
        row["right_live"], row["right_sent_z"], row["right_sent_vz"], right_age, s["right_z"], limit
    )
    s["left_z"], s["right_z"] = left_z, right_z
    on_left, on_right = coupling(s["z"], s["vz"], s["theta"], s["omega"], left_z, left_vz, right_z, right_vz, scene)
    row["left_used_z"], row["left_used_vz"], row["left_coupling"] = left_z, left_vz, on_left
    row["right_used_z"], row["right_used_vz"], row["right_coupling"] = right_z, right_vz, on_right
    felt = settings["haptics"] != 0 and is_active(s["phase"])
    row["left_force"] = -on_left if felt and row["left_live"] != 0 else 0.0
    row["right_force"] = -on_right if felt and row["right_live"] != 0 else 0.0
    cause = _decide(s, row["command"], rules)
    if not _integrate(s, left_vz, right_vz, settings["ball"] != 0, scene):
        cause = _move(s, _FAULT, rules) or cause
    row["event"] = cause


@kernel
def _ticks(
    state: Any,
    rows: Any,
    state_words: Any,
    row_words: Any,
    first: int,
    count: int,
    settings: Any,
    scene: Any,
    rules: Any,
) -> None:
    """Do `count` ticks on the rows from `first`, round the end of the array.

    The state found is copied to its place in the row word by word, through views of the same memory.
    """
    for number in range(first, first + count):
        i = number % len(rows)
        row_words[i, _STATE_WORD : _STATE_WORD + len(state_words)] = state_words
        _tick(state[0], rows[i], settings[0], scene[0], rules[0])


SETTINGS = np.dtype(
    [
        ("stylus_range", "<f8"),  # stylus heights are clipped to +- this [m]
        ("ball", "<i8"),  # 1: there is a ball
        ("haptics", "<i8"),  # 1: the hands feel the board
    ]
)
"""What the stage itself needs to know of the block: one record."""


@dataclass(frozen=True)
class Stage:
    """The rules of one block, packed for the kernels. Holds no state: that is passed in and handed back.

    Attributes
    ----------
    scene : ndarray of SCENE, shape (1,)
        The physics.
    rules : ndarray of RULES, shape (1,)
        The trial.
    settings : ndarray of SETTINGS, shape (1,)
        The rest.
    first_target : int
        Side of the first target: -1 left, +1 right [1].
    """

    scene: NDArray[Any]
    rules: NDArray[Any]
    settings: NDArray[Any]
    first_target: int

    def initial(self) -> NDArray[Any]:
        """State before the first tick: the board at its static rest would be reached in 50 ms, so it starts flat.

        Returns
        -------
        ndarray of STATE, shape (1,)
            The state, to be moved on by `advance`.
        """
        state = np.zeros(1, STATE)
        state["phase"] = Phase.IDLE
        state["target"] = self.first_target
        state["trial"] = state["attempt"] = 1
        if self.settings["ball"][0]:
            state["p"] = -self.first_target * self.rules["target_distance"]
        return state

    def advance(self, state: NDArray[Any], rows: NDArray[Any], first: int = 0, count: int = 1) -> None:
        """Do `count` ticks.

        Parameters
        ----------
        state : ndarray of STATE, shape (1,)
            The state at the first of the ticks; moved on in place.
        rows : ndarray of TICK, shape (n,)
            A ring of rows. The inputs of the rows are read; the state found and the outputs are written to them.
        first : int
            Number of the first tick; its row is ``first % n`` [1].
        count : int
            How many ticks [1].
        """
        _ticks(state, rows, _words(state)[0], _words(rows), first, count, self.settings, self.scene, self.rules)

    def warm(self) -> None:
        """Compile (or load from the cache) everything `advance` needs, so that no first tick is late."""
        self.advance(self.initial(), np.zeros(1, TICK))


def make_stage(config: Config) -> Stage:
    """Pack a configuration.

    Parameters
    ----------
    config : Config
        The whole configuration.

    Returns
    -------
    Stage
        The rules of its block.

    Raises
    ------
    ConfigError
        If the live tick cannot hold the scene.
    """
    settings = np.zeros(1, SETTINGS)
    settings["stylus_range"] = config.task.stylus_range
    settings["ball"] = config.physics.balls
    settings["haptics"] = config.block.haptics
    return Stage(
        scene=pack_scene(config.physics),
        rules=pack_rules(config.task, config.geometry, config.block),
        settings=settings,
        first_target=first_target(config),
    )


@dataclass(frozen=True)
class Verdict:
    """Outcome of a verification.

    Attributes
    ----------
    checked : int
        Ticks computed again and compared [1].
    gaps : int
        Places where ticks are missing and the comparison started afresh [1].
    tick : int or None
        First tick that is not identical to the bit; None if all are [1].
    field : str
        Its first field that differs.
    recorded, computed : float
        The two values of that field, in its own unit [SI].
    """

    checked: int
    gaps: int
    tick: int | None = None
    field: str = ""
    recorded: float = 0.0
    computed: float = 0.0

    @property
    def identical(self) -> bool:
        """Whether every tick is identical to the bit."""
        return self.tick is None


_RESULTS = [*_STATE_NAMES, *(OUTPUT.names or ())]


def verify(stage: Stage, ticks: NDArray[Any]) -> Verdict:
    """Run the stage over recorded inputs and compare every tick to the bit.

    Parameters
    ----------
    stage : Stage
        Made from the recording's own configuration.
    ticks : ndarray of TICK, shape (n,)
        The recorded ticks, in order. After a gap the recorded state is taken over.

    Returns
    -------
    Verdict
        Identical, or where and how not.
    """
    runs = _runs(ticks["tick"])
    for first, stop in runs:
        recorded = ticks[first:stop]
        computed = recorded.copy()
        state = state_of(recorded[:1])
        stage.advance(state, computed, 0, len(computed))
        difference = _first_difference(recorded, computed)
        if difference is not None:
            i, name = difference
            return Verdict(
                first + i + 1, len(runs) - 1, int(recorded["tick"][i]), name, recorded[name][i], computed[name][i]
            )
    return Verdict(len(ticks), max(len(runs) - 1, 0))


def state_of(row: NDArray[Any]) -> NDArray[Any]:
    """State found by a tick, from its row.

    Parameters
    ----------
    row : ndarray of TICK, shape (1,)
        The row.

    Returns
    -------
    ndarray of STATE, shape (1,)
        The state at that tick.
    """
    state = np.zeros(1, STATE)
    for name in _STATE_NAMES:
        state[name] = row[name]
    return state


def _runs(numbers: NDArray[np.int64]) -> list[tuple[int, int]]:
    """Split consecutive tick numbers into (first index, index after the last)."""
    if len(numbers) == 0:
        return []
    breaks = np.flatnonzero(np.diff(numbers) != 1) + 1
    edges = [0, *breaks.tolist(), len(numbers)]
    return list(pairwise(edges))


def _bits(values: NDArray[Any]) -> NDArray[np.int64]:
    """The 64-bit patterns of a column, so that NaN equals NaN and -0 is not 0."""
    return np.ascontiguousarray(values).view(np.int64)


def _first_difference(recorded: NDArray[Any], computed: NDArray[Any]) -> tuple[int, str] | None:
    """Index and field of the first value that is not the same to the bit."""
    found: list[tuple[int, str]] = []
    for name in _RESULTS:
        same = _bits(recorded[name]) == _bits(computed[name])
        if not same.all():
            found.append((int(np.argmin(same)), name))
    return min(found, key=lambda place: place[0], default=None)
