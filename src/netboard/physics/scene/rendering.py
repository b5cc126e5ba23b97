"""Commanded force of each hand under a force condition (`netboard.base.tables.forces`).

The partial conditions use the force of the board at rest. Near level, its height and tilt follow from a linear balance
of forces and torques for the present positions of styluses and ball, and the force of a hand on the board is

    F_own = weight + own z_own + partner z_partner + ball p

with four gains for each hand that depend on the scene alone. Rates, damping and the motion of the board have no effect
on the partial conditions. docs/explanation/forces.md has the equations.
"""

from typing import Any, NamedTuple

import numpy as np
from numba import types
from numpy.typing import NDArray

from netboard.base.compiled import inlined, specialised
from netboard.base.config import Config
from netboard.base.errors import ConfigError
from netboard.base.tables.declared import number_of
from netboard.base.tables.experiment import MAX_TRIALS, STILL, Block
from netboard.base.tables.forces import CONDITIONS, FORCES, ForceInputs
from netboard.physics.scene.parameters import Parts, load_mass, pack_scene, parts_of

TRIAL_ENTRIES = MAX_TRIALS + 1
"""First trial number without an entry in the tables below; only trials that operators add reach it [1]."""

GAINS = np.dtype(
    [
        ("weight", "<f8"),  # force with both styluses and the ball at 0 [N]
        ("own", "<f8"),  # change with the height of this hand's stylus [N/m]
        ("partner", "<f8"),  # change with the height of the partner's stylus [N/m]
        ("ball", "<f8"),  # change with the position of the ball [N/m]
    ]
)
"""Force of one hand on the board at rest, + = up."""

RENDERING = np.dtype(
    [
        ("left_fixed", GAINS),  # left hand, while the ball is fixed
        ("right_fixed", GAINS),
        ("left_free", GAINS),  # while it rolls
        ("right_free", GAINS),
        ("scale", "<f8"),  # factor of the commanded force [1]
        ("catch", "u1", (TRIAL_ENTRIES,)),  # 1: catch trial, without force
        ("scales", "<f8", (TRIAL_ENTRIES,)),  # factor of the commanded force in each trial [1]
    ]
)
"""Parameters of the commanded forces: one record."""


class Rendering(NamedTuple):
    """Structure of the force rendering: compile-time constants of the kernels.

    Attributes
    ----------
    force : int
        Number of the force condition, its place in `FORCES` [1].
    scaled : bool
        The force has a factor.
    left, right : bool
        A person or a simulated partner moves the hand at this side.
    catches : bool
        There are catch trials.
    varies : bool
        The factor differs between trials.
    """

    force: int
    scaled: bool
    left: bool
    right: bool
    catches: bool
    varies: bool = False


NO_FORCE = Rendering(FORCES.index("none"), scaled=False, left=False, right=False, catches=False)


def _rendered(number: int, hand: ForceInputs) -> float:
    """Return the force of a condition, by its number [N].

    An unknown condition has no number: the safety chain refuses NaN, where a zero would pass for a condition.
    """
    if not 0 <= number < len(FORCES):
        return np.nan
    return CONDITIONS[FORCES[number]].force(hand)


_KERNELS = {f"force{place}": inlined(CONDITIONS[name].force) for place, name in enumerate(FORCES)}


@specialised(_rendered)
def _compiled_rendered(number: types.Type, hand: types.Type) -> Any:
    """Write the choice out; the number is a constant of a block, so the compiler keeps one condition."""
    text = "nan"
    for place in reversed(range(len(FORCES))):
        text = f"force{place}(hand) if number == {place} else ({text})"
    return eval(f"lambda number, hand: {text}", {"nan": np.nan, **_KERNELS})


@inlined
def force_on_hand(hand: ForceInputs, scale: float, rendering: Rendering) -> float:
    """Return the commanded force on a hand, + = up [N].

    Parameters
    ----------
    hand : ForceInputs
        What the force condition may use.
    scale : float
        Factor of the force in this tick, which only a scaled rendering uses [1].
    """
    force = _rendered(rendering.force, hand)
    return scale * force if rendering.scaled else force


@inlined
def is_listed(trial: int, catch: NDArray[np.int64]) -> bool:
    """Return whether a trial is in the list of catch trials.

    Parameters
    ----------
    catch : ndarray
        ``catch`` of RENDERING: by number of the trial, 1 for a catch trial [1].
    """
    return 0 < trial < TRIAL_ENTRIES and catch[trial] != 0


@inlined
def is_catch(trial: int, packed: np.void, rendering: Rendering) -> bool:
    """Return whether a trial is a catch trial, without force."""
    return rendering.catches and is_listed(trial, packed["catch"])


@inlined
def scale_in(trial: int, packed: np.void, rendering: Rendering) -> float:
    """Return the factor of the commanded force in a trial [1]."""
    if rendering.varies and 0 < trial < TRIAL_ENTRIES:
        return float(packed["scales"][trial])
    return float(packed["scale"])


def rendering_of(block: Block) -> Rendering:
    """Return the structure of the force rendering of a block.

    Raises
    ------
    ConfigError
        If the force condition is unknown.
    """
    left, right = block.left != STILL, block.right != STILL
    varies = bool(block.trial_scales)
    force = number_of(block.force, FORCES, "[block] force")
    if block.force == "none" or (block.force_scale == 0.0 and not varies) or not (left or right):
        return NO_FORCE
    scaled = varies or block.force_scale != 1.0
    return Rendering(force, scaled, left, right, bool(block.catch), varies)


def pack_rendering(config: Config) -> NDArray[Any]:
    """Pack the parameters of the commanded forces for the kernels: ndarray of RENDERING, shape (1,) [SI].

    Raises
    ------
    ConfigError
        If the block needs gains, but the springs do not determine height and tilt of the board.
    """
    packed = np.zeros(1, RENDERING)
    packed["scale"] = config.block.force_scale
    packed["catch"][0, list(config.block.catch)] = 1
    if scales := config.block.trial_scales:
        packed["scales"][0, 1:] = np.resize(scales, TRIAL_ENTRIES - 1)
    number = number_of(config.block.force, FORCES, "[block] force")
    scene, known = pack_scene(config.physics)[0], CONDITIONS[FORCES[number]].quasi_static
    for name, free in (("fixed", False), ("free", True)):
        left, right = gains_of(parts_of(config.physics, free), scene) if known else (np.nan, np.nan)
        packed[f"left_{name}"], packed[f"right_{name}"] = left, right
    return packed


def gains_of(parts: Parts, scene: np.void) -> tuple[tuple[float, ...], tuple[float, ...]]:
    """Return the gains of both hands, as in `GAINS`, from the linear static balance of the board [N, N/m].

    Plain arithmetic instead of a library gives the same bits on every machine, so that recordings verify.

    Raises
    ------
    ConfigError
        If the springs do not determine height and tilt of the board, or the ball would tip it over.
    """
    k_left, k_right, arm = float(scene["k_left"]), float(scene["k_right"]), float(scene["l"])
    load = load_mass(parts, scene) * float(scene["g"])
    weight = -float(scene["M"]) * float(scene["g"]) - load
    left, right = [], []
    # Height and tilt for each of four loads: weight, left stylus, right stylus, ball (its weight is in the first).
    for force, torque in ((weight, 0.0), (k_left, -k_left * arm), (k_right, k_right * arm), (0.0, -load)):
        z, theta = _rest(force, torque, parts, scene)
        left.append(k_left * (arm * theta - z))
        right.append(k_right * (-arm * theta - z))
    left[1] += k_left
    right[2] += k_right
    return (left[0], left[1], left[2], left[3]), (right[0], right[2], right[1], right[3])


def _rest(force: float, torque: float, parts: Parts, scene: np.void) -> tuple[float, float]:
    """Return height and tilt at which the springs balance a force and a torque, linear [m, rad]."""
    k_left, k_right, arm = float(scene["k_left"]), float(scene["k_right"]), float(scene["l"])
    heave = k_left + k_right + float(scene["k_s"])
    mixed = (k_right - k_left) * arm
    tilt = (k_left + k_right) * arm * arm
    springs_only = tilt
    if parts.lagrangian and not parts.free:
        tilt -= load_mass(parts, scene) * float(scene["g"]) * float(scene["ball_height"])
    if not parts.tilts:
        _require_springs(heave > 0.0)
        return force / heave, 0.0
    if not parts.heaves:
        _require_springs(tilt > 0.0)
        return 0.0, torque / tilt
    determinant = heave * tilt - mixed * mixed
    _require_springs(determinant > 1e-12 * heave * springs_only)
    return (force * tilt - mixed * torque) / determinant, (heave * torque - mixed * force) / determinant


def _require_springs(holds: bool) -> None:
    """Refuse a scene in which the springs do not determine height and tilt of the board."""
    if not holds:
        parts = ", ".join(f'"{name}"' for name in FORCES if CONDITIONS[name].quasi_static)
        raise ConfigError(
            f"[block] force: found one of {parts}, which are parts of the force of a board at rest; expected a scene "
            "in which springs hold the board's height and tilt: [physics] k_h, k_s, coupling"
        )
