"""Force conditions: one `ForceCondition` for each, from which everything else that knows conditions follows.

The choices of ``[block] force``, the kernels, the checks of a configuration, names and marks in figures, descriptions
in exports and the tables of the documentation are made from `CONDITIONS`. docs/explanation/forces.md explains them.
"""

from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Literal, NamedTuple

import numpy as np


class ForceInputs(NamedTuple):
    """What the kernel of a force condition gets in a tick, for one hand.

    A further input is a field here, set in `_force` of `netboard.stage.stage`.

    Attributes
    ----------
    coupling : float
        Force of the hand's coupling on the board, + = up [N].
    own_z, partner_z : float
        Heights of both styluses, extrapolated and clipped [m].
    own_vz, partner_vz : float
        Their rates; 0 without a fresh sample, and where a height is clipped [m/s].
    ball : float
        Position of the ball along the board [m].
    recorded : float
        Commanded force of a hand in another session, + = up [N].
    gains : GAINS record
        Gains of the hand (`netboard.physics.scene.rendering.GAINS`), for a free or a fixed ball; NaN unless the
        condition is quasi-static.
    """

    coupling: float
    own_z: float
    partner_z: float
    own_vz: float
    partner_vz: float
    ball: float
    recorded: float
    gains: Any


Kernel = Callable[[ForceInputs], float]
"""Kernel of a force condition: returns the force on the hand, + = up [N]."""


@dataclass(frozen=True)
class ForceCondition:
    """A force condition: which forces the haptic feedback of a hand contains.

    Attributes
    ----------
    feels : str
        What the hand feels, for the documentation.
    partner : str
        Information about the partner in the force, for the documentation.
    label : str
        Name in figures and tables.
    force : callable
        A `Kernel`.
    quasi_static : bool
        It is a part of the force of the board at rest, made of the gains.
    recorded : bool
        It needs forces of another recording.
    local : bool
        An agent can compute it from its own coupling alone.
    control : bool
        It contains nothing of the partner's hand, so that its effect is a control of that of the whole force.
    """

    feels: str
    partner: str
    label: str
    force: Kernel
    quasi_static: bool = False
    recorded: bool = False
    local: bool = False
    control: bool = False


def _none(hand: ForceInputs) -> float:
    """Return no force [N]."""
    return 0.0


def _full(hand: ForceInputs) -> float:
    """Return the reaction of the coupling [N]."""
    return -hand.coupling


def _partner_only(hand: ForceInputs) -> float:
    """Return the term of the partner's height [N]."""
    force: float = -(hand.gains["partner"] * hand.partner_z)
    return force


def _environment_only(hand: ForceInputs) -> float:
    """Return the terms of the weight, of its own height and of the ball [N]."""
    force: float = -(hand.gains["weight"] + hand.gains["own"] * hand.own_z + hand.gains["ball"] * hand.ball)
    return force


def _unrelated(hand: ForceInputs) -> float:
    """Return the recorded force, 0 where it is not finite [N]."""
    return hand.recorded if np.isfinite(hand.recorded) else 0.0


def _own_only(hand: ForceInputs) -> float:
    """Return the terms of the weight and of its own height [N]."""
    force: float = -(hand.gains["weight"] + hand.gains["own"] * hand.own_z)
    return force


CONDITIONS: dict[str, ForceCondition] = {
    "none": ForceCondition("nothing", "nothing", "haptics off", _none, local=True),
    "full": ForceCondition(
        "the force of its coupling", "all, with the board's motion and damping", "haptics on", _full, local=True
    ),
    "partner_only": ForceCondition(
        "the effect of the partner's height on the board at rest, and nothing else",
        "the height of the other stylus, up to a factor",
        "partner's force",
        _partner_only,
        quasi_static=True,
    ),
    "environment_only": ForceCondition(
        "the rest: weights, the ball, its own height, as if the partner's stylus rested at z = 0",
        "nothing of the hand; the ball, which both have moved",
        "environment's force",
        _environment_only,
        quasi_static=True,
        control=True,
    ),
    "unrelated": ForceCondition(
        "the force that a hand felt in another session",
        "nothing",
        "unrelated force",
        _unrelated,
        recorded=True,
        control=True,
    ),
    "own_only": ForceCondition(
        "weights and its own height, as if the partner's stylus rested at z = 0 and the ball at the centre",
        "nothing",
        "own force",
        _own_only,
        quasi_static=True,
        control=True,
    ),
}
"""All conditions by name, in display order; a condition's number in kernels is its place. Append new ones."""

FORCES: tuple[str, ...] = tuple(CONDITIONS)
"""Their names."""

FORCE_WORDS = f"{', '.join(FORCES[:-1])} or {FORCES[-1]}"
"""The same as text."""

if TYPE_CHECKING:
    Force = str
else:
    Force = Literal[FORCES]
"""Type of ``[block] force``."""
