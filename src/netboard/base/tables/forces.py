"""Force conditions: one `ForceCondition` for each, from which everything else that knows conditions follows.

The choices of ``[block] force``, the kernels, the checks of a configuration, names and marks in figures, descriptions
in exports and the tables of the documentation are made from `CONDITIONS`. docs/explanation/forces.md explains them.
"""

from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Literal

import numpy as np

from netboard.base.compiled import inlined

Kernel = Callable[[float, float, float, float, float, Any], float]
"""Of a hand: force of its coupling on the board [N], own and partner's stylus height [m], ball along the board [m],
recorded force [N], and the gains of the hand (`netboard.physics.scene.rendering.GAINS`); returns the force on the hand,
+ = up [N]."""


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
    """

    feels: str
    partner: str
    label: str
    force: Kernel
    quasi_static: bool = False
    recorded: bool = False
    local: bool = False


@inlined
def _none(coupling: float, own_z: float, partner_z: float, p: float, recorded: float, gains: Any) -> float:
    """Return no force [N]."""
    return 0.0


@inlined
def _full(coupling: float, own_z: float, partner_z: float, p: float, recorded: float, gains: Any) -> float:
    """Return the reaction of the coupling [N]."""
    return -coupling


@inlined
def _partner_only(coupling: float, own_z: float, partner_z: float, p: float, recorded: float, gains: Any) -> float:
    """Return the term of the partner's height [N]."""
    force: float = -(gains["partner"] * partner_z)
    return force


@inlined
def _environment_only(coupling: float, own_z: float, partner_z: float, p: float, recorded: float, gains: Any) -> float:
    """Return the terms of the weight, of its own height and of the ball [N]."""
    force: float = -(gains["weight"] + gains["own"] * own_z + gains["ball"] * p)
    return force


@inlined
def _unrelated(coupling: float, own_z: float, partner_z: float, p: float, recorded: float, gains: Any) -> float:
    """Return the recorded force, 0 where it is not finite [N]."""
    return recorded if np.isfinite(recorded) else 0.0


@inlined
def _own_only(coupling: float, own_z: float, partner_z: float, p: float, recorded: float, gains: Any) -> float:
    """Return the terms of the weight and of its own height [N]."""
    force: float = -(gains["weight"] + gains["own"] * own_z)
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
    ),
    "unrelated": ForceCondition(
        "the force that a hand felt in another session", "nothing", "unrelated force", _unrelated, recorded=True
    ),
    "own_only": ForceCondition(
        "weights and its own height, as if the partner's stylus rested at z = 0 and the ball at the centre",
        "nothing",
        "own force",
        _own_only,
        quasi_static=True,
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
