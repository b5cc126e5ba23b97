"""One tick of an experiment: the physics and the trial state machine, composed here and nowhere else.

`Stage.advance` is a pure function. From the state at a tick, the stylus samples and the operator's command it computes
the forces, the event and the state at the next tick. It reads no clock, opens no socket, draws nothing and logs
nothing. The server runs it live, ``netboard replay --verify`` runs it over a recording and must get the same bits, and
simulations run it as fast as the machine allows.

A tick is one row of `TICK`: its inputs, the state before it, and its outputs. The state in row k+1 is the result of row
k, so a verification can start at any row.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cache
from typing import Any, NamedTuple

import numpy as np
from numba import literal_unroll
from numpy.typing import NDArray

from netboard.base.compiled import Records, borrowed, inlined
from netboard.base.config import Config
from netboard.base.errors import ConfigError
from netboard.base.tables.declared import number_of
from netboard.base.tables.forces import ForceInputs
from netboard.base.tick import STATE, TICK, TICK_SECONDS, TICK_WORDS
from netboard.physics.arithmetic.vectors import State, calm
from netboard.physics.hands.extrapolation import later, moving, resting
from netboard.physics.methods.catalogue import METHODS, NUMBER, advance
from netboard.physics.scene.models import coupling, stopped
from netboard.physics.scene.parameters import SCENE, Parts, pack_scene, parts_of
from netboard.physics.scene.rendering import (
    RENDERING,
    Rendering,
    force_on_hand,
    is_catch,
    is_listed,
    pack_rendering,
    rendering_of,
    scale_in,
)
from netboard.physics.stability.method_choice import MethodChoice, choose
from netboard.stage.perturbing import (
    BALL,
    BOARD,
    LEFT,
    NOWHERE,
    PERTURBING,
    RIGHT,
    Perturbing,
    pack_perturbing,
    perturbation,
    perturbing_of,
    push_ball,
    push_board,
)
from netboard.stage.styluses import KNOWN_EXTRAPOLATIONS, drives, sense_left, sense_right, used_lanes
from netboard.stage.trial_steps import decide, take_transition
from netboard.task.trials.state_machine import RULES, Cause, Phase, first_target, is_active, is_free, pack_rules

MAX_TILT = 1.5
"""A larger tilt of the board is a fault: styluses within their range cannot cause it [rad]."""

# Plain integers, which numba folds into the kernels below as constants.
_NONE, _FAULT = int(Cause.NONE), int(Cause.FAULT)


@inlined
def _command(
    s: np.void, row: np.void, on_board: tuple[float, float], felt: Rendering, packed: np.void, at: int
) -> None:
    """Write the forces of the couplings on the board, left and right, and the commanded forces.

    ``at``: where the perturbation of the row acts.
    """
    on_left, on_right = on_board
    row["left_coupling"], row["right_coupling"] = on_left, on_right
    row["left_force"], row["right_force"] = 0.0, 0.0
    if not (felt.left or felt.right) or not is_active(s["phase"]) or is_catch(s["trial"], packed, felt):
        return
    rolls = is_free(s["phase"])
    scale = scale_in(s["trial"], packed, felt)
    left_z, left_vz = row["left_used_z"], row["left_used_vz"]
    right_z, right_vz = row["right_used_z"], row["right_used_vz"]
    if felt.left and row["left_live"] != 0:
        gains = packed["left_free"] if rolls else packed["left_fixed"]
        hand = ForceInputs(on_left, left_z, right_z, left_vz, right_vz, s["p"], row["left_other"], gains)
        row["left_force"] = force_on_hand(hand, scale, felt)
        if at == LEFT:
            row["left_force"] += row["perturbation"]
    if felt.right and row["right_live"] != 0:
        gains = packed["right_free"] if rolls else packed["right_fixed"]
        hand = ForceInputs(on_right, right_z, left_z, right_vz, left_vz, s["p"], row["right_other"], gains)
        row["right_force"] = force_on_hand(hand, scale, felt)
        if at == RIGHT:
            row["right_force"] += row["perturbation"]


@inlined
def _settle(s: np.void, x: State) -> bool:
    """Store the state of board and ball; if it is implausible, put them at rest and return False."""
    # One test for all six: a NaN or an infinity makes the sum non-finite.
    sound = bool(np.isfinite(x[0] + x[1] + x[2] + x[3] + x[4] + x[5])) and abs(x[2]) <= MAX_TILT
    if sound:
        s["z"], s["vz"], s["theta"], s["omega"], s["p"], s["vp"] = x
    else:
        s["z"], s["vz"], s["theta"], s["omega"], s["vp"] = 0.0, 0.0, 0.0, 0.0, 0.0
    return sound


_TRIAL = TICK_WORDS["trial"]
_STATE_NAMES = tuple(STATE.names or ())


@inlined
def keep(row: np.void, s: np.void) -> None:
    """Copy the state into the row, one assignment for each field: a kernel finds fields by constant names only."""
    for name in literal_unroll(_STATE_NAMES):
        row[name] = s[name]


@inlined
def _resting(z: float, vz: float, az: float, k: float, c: float) -> State:
    """Return the drive of a hand under a zero-order hold; its acceleration does not count."""
    u = resting(z, vz, k, c)[0]
    return u, u - u, u - u, 0.0


@inlined
def _unstopped(x: State, parts: Parts, scene: np.void) -> State:
    """Return the state as it is: the board has no stops."""
    return x


class TickKernels(NamedTuple):
    """The kernels of a tick, in their order. Those of the board are for numbers and, without stops, for lanes."""

    sense: Callable[..., State]  # (s, row, limit, scene): the drives of both hands
    perturb: Callable[..., None]  # (s, row, packed): writes the force of a perturbation
    sense_lanes: Callable[..., Any]  # (z, vz, seen_vz, gap, age): what is used of lanes of good samples: z, vz, az
    drive: Callable[..., Any]  # (z, vz, az, k, c): the drive of one hand, also for lanes
    couple: Callable[..., tuple[float, float]]  # (board, hands, scene): forces of the couplings on the board [N]
    command: Callable[..., None]  # (s, row, on_board, packed): writes the forces
    push: Callable[..., tuple[State, State]]  # (x, hands, row, rolls, scene): both with a perturbation of ball or board
    roll: Callable[..., State]  # (x, hands, tables, scene): the state after the tick, with a free ball
    rest: Callable[..., State]  # the same with a fixed ball
    settle: Callable[..., None]  # (s, row, x, cause, rules): stores it, and the event
    pushes: bool  # whether there are perturbations of ball or board


@cache
def _tick_kernels(
    METHOD: int, SUBSTEPS: int, HOLD: int, FREE: Parts, FIXED: Parts, FELT: Rendering, PERTURBING: Perturbing
) -> TickKernels:
    """Compile the kernels of a kind of block: method, scene with the ball free and fixed, and commanded forces."""
    drive = moving if HOLD else _resting
    AT = PERTURBING.at

    # Recordings verify against these steps to the bit: another order or rounding would refute those that exist.
    @inlined
    def sense(s: np.void, row: np.void, limit: float, scene: np.void) -> State:
        sense_left(s, row, limit, HOLD)
        sense_right(s, row, limit, HOLD)
        return drives(row, HOLD, scene)

    @inlined
    def perturb(s: np.void, row: np.void, packed: np.void) -> None:
        row["perturbation"] = perturbation(s, packed, PERTURBING) if AT != NOWHERE else 0.0

    @inlined
    def sense_lanes(z: float, vz: float, seen_vz: float, gap: float, age: float) -> tuple[float, float, float]:
        return used_lanes(z, vz, seen_vz, gap, age, HOLD)

    @inlined
    def couple(board: State, hands: State, scene: np.void) -> tuple[float, float]:
        return coupling(board, hands[0], hands[4], FIXED, scene)

    @inlined
    def command(s: np.void, row: np.void, on_board: tuple[float, float], packed: np.void) -> None:
        _command(s, row, on_board, FELT, packed, AT)

    @inlined
    def push(x: State, hands: State, row: np.void, rolls: bool, scene: np.void) -> tuple[State, State]:
        if AT == BALL and rolls:
            x = push_ball(x, row["perturbation"], FREE, scene)
        if AT == BOARD:
            hands = push_board(hands, row["perturbation"])
        return x, hands

    @inlined
    def settle(s: np.void, row: np.void, x: State, cause: int, rules: np.void) -> None:
        if not _settle(s, calm(x)):
            cause = take_transition(s, _FAULT, rules) or cause
        row["event"] = cause

    pushes, (roll, rest) = AT in (BALL, BOARD), _integrating_kernels(METHOD, SUBSTEPS, FREE, FIXED)
    return TickKernels(sense, perturb, sense_lanes, drive, couple, command, push, roll, rest, settle, pushes)


def _integrating_kernels(
    METHOD: int, SUBSTEPS: int, FREE: Parts, FIXED: Parts
) -> tuple[Callable[..., State], Callable[..., State]]:
    """Compile the kernels that integrate the scene over a tick, with the ball free and fixed."""
    STEP = TICK_SECONDS / SUBSTEPS
    halted = stopped if FREE.stops else _unstopped

    @inlined
    def roll(x: State, hands: State, tables: NDArray[np.float64], scene: np.void) -> State:
        for step in range(SUBSTEPS):
            if step > 0:
                hands = later(hands, STEP)
            x = halted(advance(METHOD, x, STEP, hands, (tables, 0), FREE, scene), FREE, scene)
        return x

    @inlined
    def rest(x: State, hands: State, tables: NDArray[np.float64], scene: np.void) -> State:
        for step in range(SUBSTEPS):
            if step > 0:
                hands = later(hands, STEP)
            x = advance(METHOD, x, STEP, hands, (tables, 1), FIXED, scene)
        return x

    return roll, rest


@cache
def _make_ticks(kernels: TickKernels) -> Callable[..., None]:
    """Compile the ticks of a kind of block."""
    sense, perturb, _, _, couple, command, push, roll, rest, settle, _ = kernels

    @inlined
    def ticks(
        state: Records, rows: Records, first: int, count: int, book: Records, tables: NDArray[np.float64]
    ) -> None:
        s, scene, rules, packed = state[0], book[0]["scene"], book[0]["rules"], book[0]["rendering"]
        perturbing = book[0]["perturbing"]
        limit = book[0]["settings"]["stylus_range"]
        tables = borrowed(tables)
        place = first % len(rows)
        for _ in range(count):
            row = rows[place]
            place = place + 1 if place + 1 < len(rows) else 0
            keep(row, s)
            hands = sense(s, row, limit, scene)
            perturb(s, row, perturbing)
            # Read once, so that the sine and cosine of this tilt are computed once for the force and the first step.
            z, vz, theta, omega = s["z"], s["vz"], s["theta"], s["omega"]
            command(s, row, couple((z, vz, theta, omega), hands, scene), packed)
            cause = decide(s, row["command"], rules)
            rolls = is_free(s["phase"])
            x: State = (z, vz, theta, omega, s["p"], s["vp"] if rolls else 0.0)
            x, hands = push(x, hands, row, rolls, scene)
            x = roll(x, hands, tables, scene) if rolls else rest(x, hands, tables, scene)
            settle(s, row, x, cause, rules)

    return ticks


SETTINGS = np.dtype(
    [
        ("stylus_range", "<f8"),  # stylus heights are clipped to +- this [m]
        ("balls", "<i8"),  # 1: there is a ball
    ]
)
"""Settings of the stage itself: one record."""

BOOK = np.dtype(
    [
        ("scene", SCENE),
        ("rules", RULES),
        ("rendering", RENDERING),
        ("settings", SETTINGS),
        ("perturbing", PERTURBING),
    ]
)
"""All parameters of the ticks of a block: one record."""


@inlined
def commanded_tick(number: int, delay: int, trial: int, catch: NDArray[np.int64]) -> int:
    """Return the tick whose forces are commanded at a tick: `delay` before, in a catch trial the tick itself [1].

    In a catch trial, the delayed force may be of the trial before, and the tick itself has no force.

    Parameters
    ----------
    trial : int
        Number of the tick's trial [1].
    catch : ndarray
        1 for each catch trial, by number: ``catch`` of RENDERING [1].
    """
    return number if is_listed(trial, catch) else number - delay


@dataclass(frozen=True)
class Stage:
    """The parameters of one block, packed for the kernels. It holds no state: callers pass it in.

    Attributes
    ----------
    book : ndarray of BOOK, shape (1,)
        Scene, rules of the trial, commanded forces, settings, perturbations.
    choice : Choice
        Integration method, with the reason.
    tables : ndarray of float64, shape (2, k, 6, 6)
        Tables of the method for a free ball and for a fixed one [SI].
    kernels : TickKernels
        The kernels of a tick, compiled for this kind of block.
    first_target : int
        Side of the first target, that of trial 1: -1 left, +1 right [1].
    delay : int
        Delay of the commanded force, in ticks [1].
    """

    book: NDArray[Any]
    choice: MethodChoice
    tables: NDArray[np.float64]
    kernels: TickKernels
    first_target: int
    delay: int

    @property
    def ticks(self) -> Callable[..., None]:
        """The kernel of `advance`."""
        return _make_ticks(self.kernels)

    def initial(
        self,
        *,
        trial: int = 1,
        attempt: int = 1,
        successes: int = 0,
        failures: int = 0,
        extra: int = 0,
        block_ticks: int = 0,
    ) -> NDArray[Any]:
        """Return the state before the first tick, with a level board, which settles in 50 ms.

        A resumed block starts in the middle, with a trial and an attempt that have not begun.

        Parameters
        ----------
        trial, attempt : int
            Numbers of the first trial and attempt [1].
        successes, failures : int
            Successful trials and failed attempts so far [1].
        extra : int
            Trials added by operators so far [1].
        block_ticks : int
            Ticks of the block so far [1].

        Returns
        -------
        ndarray of STATE, shape (1,)
            The state, which `advance` updates.
        """
        state = np.zeros(1, STATE)
        state["phase"] = Phase.IDLE
        state["target"] = self.first_target if trial % 2 else -self.first_target
        state["trial"], state["attempt"] = trial, attempt
        state["successes"], state["failures"] = successes, failures
        state["extra"], state["block_ticks"] = extra, block_ticks
        if self.book["settings"]["balls"][0]:
            state["p"] = -state["target"] * self.book["rules"]["target_distance"]
        return state

    def advance(self, state: NDArray[Any], rows: NDArray[Any], first: int = 0, count: int = 1) -> None:
        """Run `count` ticks.

        Parameters
        ----------
        state : ndarray of STATE, shape (1,)
            The state at the first tick; updated in place.
        rows : ndarray of TICK, shape (n,)
            A ring buffer. Inputs are read from its rows; states and outputs are written to them.
        first : int
            Number of the first tick; its row is ``first % n`` [1].
        count : int
            Number of ticks [1].
        """
        self.ticks(state, rows, first, count, self.book, self.tables)

    def commanded_row(self, words: NDArray[np.int64], number: int) -> Any:
        """Return the row whose forces are commanded at a tick: that of `commanded_tick`, which Python need not compile.

        Parameters
        ----------
        words : ndarray of int64, shape (n, m)
            A ring buffer of rows as words, longer than `delay`; rows before the first tick are zeros [1].

        Returns
        -------
        ndarray of int64, shape (m,)
            The row as words [1].
        """
        row, catch = words[number % len(words)], self.book["rendering"]["catch"][0]
        listed = 0 < row[_TRIAL] < len(catch) and catch[row[_TRIAL]] != 0
        return row if listed else words[(number - self.delay) % len(words)]

    def warm(self) -> None:
        """Compile `advance`, or load it from the cache, so that the first tick meets its deadline."""
        self.advance(self.initial(), np.zeros(1, TICK))


def make_stage(config: Config) -> Stage:
    """Pack a configuration for the kernels, as the stage of its block.

    Raises
    ------
    ConfigError
        If no method can integrate the scene stably in ticks.
    """
    physics = config.physics
    if physics.balls > 1:
        raise ConfigError(
            f"[physics] balls: found {physics.balls}, expected 0 or 1: a trial is about one ball "
            "(scenes of several are for `netboard simulate`)"
        )
    book = np.zeros(1, BOOK)
    book["scene"] = pack_scene(physics)
    book["rules"] = pack_rules(config.task, config.geometry, config.block)
    book["rendering"] = pack_rendering(config)
    book["settings"] = (config.task.stylus_range, physics.balls)
    book["perturbing"] = pack_perturbing(config)
    choice = choose(physics, TICK_SECONDS)
    method, kinds = NUMBER[choice.method], (parts_of(physics), parts_of(physics, free=False))
    step = TICK_SECONDS / choice.substeps
    return Stage(
        book=book,
        choice=choice,
        tables=np.stack([METHODS[method].tables(book["scene"][0], parts, 6, step) for parts in kinds]),
        kernels=_tick_kernels(
            method,
            choice.substeps,
            number_of(physics.hold, KNOWN_EXTRAPOLATIONS, "[physics] hold"),
            *kinds,
            rendering_of(config.block),
            perturbing_of(config),
        ),
        first_target=first_target(config),
        delay=config.block.force_delay_ms,
    )


def commanded_forces(ticks: NDArray[Any], delay: int, catch: Sequence[int] = ()) -> NDArray[np.float64]:
    """Return the commanded forces of a recording, before the gains of the server.

    Parameters
    ----------
    ticks : ndarray of TICK, shape (n,)
        The recorded ticks, in order; some may be missing.
    catch : sequence of int
        Numbers of the catch trials [1].

    Returns
    -------
    ndarray of float64, shape (n, 2)
        For the left and the right hand, + = up; 0 in a pause, in a catch trial, or where the undelayed tick does not
        exist [N].
    """
    forces = np.zeros((len(ticks), 2))
    if len(ticks):
        then = np.searchsorted(ticks["tick"], ticks["tick"] - delay)
        known = (ticks["tick"][then] == ticks["tick"] - delay) & _active(ticks["phase"])
        known &= ~np.isin(ticks["trial"], catch)
        for place, side in enumerate(("left", "right")):
            forces[known, place] = ticks[f"{side}_force"][then[known]]
    return forces


def _active(phases: NDArray[np.int64]) -> NDArray[np.bool_]:
    """Return for each phase whether a trial is running."""
    return np.array([is_active(int(phase)) for phase in Phase])[phases]
