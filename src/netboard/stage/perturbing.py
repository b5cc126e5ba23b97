"""Perturbations in a tick: a known force on the ball, the board or a stylus in some trials.

Rule 1: a perturbation acts in ticks that begin with the ball free, once an attempt, and ends with the attempt.
Rule 2: what it does depends on the state and the configuration alone, so that recordings verify. Rule 3: in a block
without perturbations none of this is compiled into the tick.

On the ball the force acts as an impulse at the beginning of each tick. On the board half of the force acts at each
control point, so that it has no torque. On a stylus it is added to the commanded force.
"""

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from netboard.base.compiled import inlined
from netboard.base.config import Config
from netboard.base.tables.declared import require
from netboard.base.tables.perturbations import ONSETS, PLACES
from netboard.base.tick import TICK_SECONDS
from netboard.physics.arithmetic.vectors import State
from netboard.physics.scene.models import struck
from netboard.physics.scene.parameters import Parts
from netboard.physics.scene.rendering import TRIAL_ENTRIES
from netboard.task.trials.state_machine import is_free, ticks

_KNOWN = ("none", "ball", "board", "left", "right")
NOWHERE, BALL, BOARD, LEFT, RIGHT = range(len(_KNOWN))
"""Places at which a force acts, as numbers."""

require("the places in netboard/stage/perturbing.py", _KNOWN, PLACES)

_KNOWN_ONSETS = ("time", "ball")
TIME, POSITION = range(len(_KNOWN_ONSETS))
"""What begins a perturbation, as numbers."""

require("the onsets in netboard/stage/perturbing.py", _KNOWN_ONSETS, ONSETS)

PERTURBING = np.dtype(
    [
        ("force", "<f8"),  # [N]
        ("position", "<f8"),  # of the ball, + = on the target's side [m]
        ("start_ticks", "<i8"),  # ticks from the release to the onset
        ("ticks", "<i8"),  # how many ticks it lasts
        ("signs", "<i1", (TRIAL_ENTRIES,)),  # sign of the force in each trial; 0: no perturbation
    ]
)
"""Parameters of the perturbations of a block: one record."""


class Perturbing(NamedTuple):
    """Structure of the perturbations of a block: compile-time constants of the kernels."""

    at: int  # place at which the force acts, its number
    onset: int  # number of what begins it


def perturbing_of(config: Config) -> Perturbing:
    """Return the structure of the perturbations of a block."""
    table = config.perturbation
    at = table.at if table.trials else "none"
    return Perturbing(_KNOWN.index(at), _KNOWN_ONSETS.index(table.onset) if at != "none" else TIME)


def pack_perturbing(config: Config) -> NDArray[Any]:
    """Pack the parameters of the perturbations for the kernels: ndarray of PERTURBING, shape (1,) [SI]."""
    table, packed = config.perturbation, np.zeros(1, PERTURBING)
    packed["force"], packed["position"] = table.force, table.position
    packed["start_ticks"], packed["ticks"] = ticks(table.time), ticks(table.duration)
    packed["signs"][0, list(table.trials)] = 1
    packed["signs"][0, list(table.opposite)] = -1
    return packed


PERTURBATION = "perturbation"
"""Name of the event at the first tick of a perturbation."""


def is_perturbed(rows: NDArray[Any] | np.void, config: Config) -> NDArray[np.bool_]:
    """Return a mask of the ticks of a block in which a perturbation acts, shape (n,) [1]."""
    return np.asarray((rows["perturbation"] != 0.0) & bool(config.perturbation.trials))


def begins_perturbation(rows: NDArray[Any] | np.void, config: Config) -> NDArray[np.bool_]:
    """Return a mask of the ticks of a block at which a perturbation begins, shape (n,) [1]."""
    return np.asarray(is_perturbed(rows, config) & (rows["perturbed_ticks"] == 0))


def perturbation_of(row: np.void, config: Config) -> dict[str, str]:
    """Return the beginning of a perturbation as event details."""
    return {
        "at": config.perturbation.at,
        "force": repr(float(row["perturbation"])),
        "duration": repr(config.perturbation.duration),
        "after_release": repr(int(row["run_ticks"]) * TICK_SECONDS),
        "trial": str(row["trial"]),
        "attempt": str(row["attempt"]),
    }


@inlined
def perturbation(s: np.void, packed: np.void, kind: Perturbing) -> float:
    """Return the force of the perturbation in a tick, and count the ticks of the perturbation.

    Parameters
    ----------
    packed : record of PERTURBING
        The perturbations of the block.
    kind : Perturbing
        Their structure.

    Returns
    -------
    float
        The force, + = up, for the ball + = right; 0 without a perturbation [N].
    """
    trial, done = s["trial"], s["perturbed_ticks"]
    if not is_free(s["phase"]) or not 0 < trial < TRIAL_ENTRIES or packed["signs"][trial] == 0:
        s["perturbed_ticks"] = 0
        return 0.0
    if done == 0 and not _begins(s, packed, kind):
        return 0.0
    if done >= packed["ticks"]:
        return 0.0
    s["perturbed_ticks"] = done + 1
    force = packed["signs"][trial] * packed["force"]
    return float(force * s["target"] if kind.at == BALL else force)


@inlined
def _begins(s: np.void, packed: np.void, kind: Perturbing) -> bool:
    """Return whether a perturbation begins, if it has not begun before."""
    if kind.onset == TIME:
        return bool(s["run_ticks"] >= packed["start_ticks"])
    return bool(s["p"] * s["target"] >= packed["position"])


@inlined
def push_ball(x: State, force: float, parts: Parts, scene: np.void) -> State:
    """Return the state with the impulse of a force on the ball in a tick.

    Parameters
    ----------
    x : tuple of float
        The state before the tick [SI].
    force : float
        The force along the board, + = right [N].
    parts : Parts
        Structure of the scene.
    """
    return struck(x, 0, force * TICK_SECONDS, parts, scene)


@inlined
def push_board(hands: State, force: float) -> State:
    """Return the drives of both hands with a force on the board.

    Parameters
    ----------
    hands : tuple of float, length 8
        Polynomials of both drives during a tick [SI].
    force : float
        The force at the board's centre, + = up [N].
    """
    half = 0.5 * force
    return hands[0] + half, hands[1], hands[2], hands[3], hands[4] + half, hands[5], hands[6], hands[7]
