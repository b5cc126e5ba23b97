"""Linear model of a dyad, as each partner takes it to be: two arms, both virtual couplings, board and ball, and senses.

The board is that of the scene, linearised about the level board (`netboard.physics.scene.linear`). The partner's arm is
taken to be like one's own. A spring-damper pulls each arm to its aim; the aim follows the commands, and changes at
random by what is not foreseen of them. In goal exchange the partner's aim approaches a goal that changes at random.
The noises of the senses are states, too, because they are coloured.

A step is one decision: ``x' = advance x + commands u + weight``, with the covariance `noise` of what is unforeseen. At
rest the state is ``rest (own height, partner's height, ball) + rest_weight``.
"""

from math import exp, radians, sqrt
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import expm

from netboard.base.config import Side
from netboard.base.tables.scene import Physics
from netboard.base.tables.simulated import Participant, VirtualDevice
from netboard.participants.body.device_models import DeviceModel, resolved
from netboard.participants.people.partner_models import tells
from netboard.participants.people.senses import DECISION_INTERVAL
from netboard.physics.scene.linear import scene_matrix
from netboard.physics.scene.parameters import load_mass, pack_scene, parts_of

Matrix = NDArray[np.float64]

_BOARD = ("z", "vz", "theta", "omega", "p", "vp")
_ARM = (
    "",
    "_rate",
    "_aim",
    "_load",
)  # height, its rate, the height that it is pulled to, and the force that it expects
_HANDS = ("own", "partner")
_NAMES = (
    *_BOARD,
    *(f"{hand}{part}" for hand in _HANDS for part in _ARM),
    *("p_noise", "theta_noise", "force_noise"),
    *("partner_aim_rate", "goal"),  # in goal exchange only
)
X = {name: place for place, name in enumerate(_NAMES)}
"""Place of each quantity in a state."""

STATES = 20
"""Length of a state: a multiple of the length of a vector register [1]."""

SEEN = ("p", "theta", "own")
"""What is seen: the ball, the tilt, and one's own hand."""

FLOOR = 1e-6
"""Standard deviation by which each quantity is less certain after a step, and each reading: it keeps the equations of
the filter regular where a noise is zero [SI]."""


class DyadModel(NamedTuple):
    """A dyad in steps of a decision [SI]."""

    advance: Matrix
    commands: Matrix  # effect of one's own and of the partner's commanded displacement in a step
    weight: Matrix  # effect of gravity in a step
    noise: Matrix
    seen: Matrix  # rows of `SEEN`
    seen_variance: Matrix
    felt: Matrix  # row of the force on one's own hand, + = up
    felt_variance: float
    rest: Matrix
    rest_weight: Matrix
    aim: Matrix  # row of the height to which the partner's movement leads


class _Mechanics(NamedTuple):
    """The same in continuous time."""

    rates: Matrix  # rates of change by state
    weight: Matrix  # rates of change by gravity
    forces: Matrix  # forces of one's own and of the partner's hand on the board by state


def felt_noise(person: Participant, physics: Physics, device: DeviceModel) -> float:
    """Return the standard deviation of the noise of a perceived force [N].

    It is a share of the force that a hand carries at height 0 (Weber's law), and the friction of the device that the
    arm does not compensate, which acts anywhere between both directions.
    """
    weight = (physics.M + physics.balls * physics.m) * physics.g
    carried = weight * physics.k_h / (2.0 * physics.k_h + physics.k_s) if physics.k_h > 0.0 else 0.0
    return sqrt((person.weber_fraction * carried) ** 2 + _friction(person, device) ** 2 / 3.0)


def _friction(person: Participant, device: DeviceModel) -> float:
    """Return the friction of the device that the arm does not compensate [N]."""
    return (1.0 - person.friction_skill) * device.friction


def _drift(share: float, person: Participant, physics: Physics) -> float:
    """Return the variance per time of an aim that changes, in each movement time, by a share of a hand's largest part.

    That part is the hand's in the largest tilt [m2/s].
    """
    return (share * physics.l * radians(person.max_tilt_deg)) ** 2 / person.movement_time


def dyad_model(person: Participant, physics: Physics, virtual: VirtualDevice, side: Side) -> DyadModel:
    """Return the model of a participant whose hand is on a side."""
    device = resolved(virtual)
    mechanics = _mechanics(person, physics, device, 1.0 if side == "right" else -1.0)
    aim = "goal" if tells(person) == "goal" else "partner_aim"
    advance, commands, weight = _step(mechanics, person, aim)
    seen = np.zeros((len(SEEN), STATES))
    for row, name in zip(seen, SEEN, strict=True):
        row[[X[name], X.get(f"{name}_noise", X[name])]] = 1.0
    felt = -mechanics.forces[0]
    felt[X["force_noise"]] = 1.0
    step = device.resolution**2 / 12.0  # variance of a height that is read in steps of the encoder
    return DyadModel(
        advance,
        commands,
        weight,
        _unforeseen(person, physics, device, aim),
        seen,
        np.diag([FLOOR**2, FLOOR**2, FLOOR**2 + step]),
        felt,
        FLOOR**2 + physics.k_h**2 * step,
        *_at_rest(mechanics, person, aim),
        np.eye(STATES)[X[aim]],
    )


def _mechanics(person: Participant, physics: Physics, device: DeviceModel, sign: float) -> _Mechanics:
    """Return the mechanics of both arms on the board. ``sign``: + for an own hand on the right."""
    parts, scene = parts_of(physics), pack_scene(physics)[0]
    rates, forces, weight = np.zeros((STATES, STATES)), np.zeros((len(_HANDS), STATES)), np.zeros(STATES)
    rates[: len(_BOARD), : len(_BOARD)] = scene_matrix(parts, scene, len(_BOARD))  # with the couplings, held still
    balls = physics.balls * load_mass(parts, scene)
    heavy = physics.M + (balls if parts.lagrangian else 0.0)
    if parts.heaves:
        weight[X["vz"]] = -(physics.M + balls) * physics.g / heavy
    for force, hand, way in zip(forces, _HANDS, (sign, -sign), strict=True):
        side, lever = "right" if way > 0.0 else "left", way * physics.l
        k, c = float(scene[f"k_{side}"]), float(scene[f"c_{side}"])
        force[[X[hand], X[f"{hand}_rate"]]] = k, c
        rates[X["vz"]] += force / heavy * parts.heaves
        rates[X["omega"]] += lever * force / physics.I * parts.tilts
        force[[X["z"], X["vz"], X["theta"], X["omega"]]] = -k, -c, -k * lever, -c * lever
        _add_arm(rates, force, hand, person, device)
    return _Mechanics(rates, weight, forces)


def _add_arm(rates: Matrix, force: Matrix, hand: str, person: Participant, device: DeviceModel) -> None:
    """Add an arm to the rates of change. ``force``: of the hand on the board, by state."""
    place, rate, aim, load = (X[f"{hand}{part}"] for part in _ARM)
    rates[place, rate] = 1.0
    pull = -force
    pull[[aim, load]] += person.arm_stiffness, -person.load_skill
    pull[[place, rate]] -= person.arm_stiffness, person.arm_damping + device.damping
    rates[rate] = pull / (person.arm_mass + device.mass)
    rates[load] = -force / person.reflex_time
    rates[load, load] -= 1.0 / person.reflex_time


def _step(mechanics: _Mechanics, person: Participant, aim: str) -> tuple[Matrix, Matrix, Matrix]:
    """Return the effects of state, commands and gravity in a step; commands move the aims at a steady rate."""
    rates, dt, inputs = mechanics.rates.copy(), DECISION_INTERVAL, np.zeros((STATES, 3))
    inputs[X["own_aim"], 0] = inputs[X["partner_aim"], 1] = inputs[X[aim], 1] = 1.0 / dt
    inputs[:, 2] = mechanics.weight
    if aim == "goal":
        speed, places = person.goal_speed / person.movement_time, [X["goal"], X["partner_aim"], X["partner_aim_rate"]]
        rates[X["partner_aim"], X["partner_aim_rate"]] = 1.0
        rates[X["partner_aim_rate"], places] = speed**2, -(speed**2), -2.0 * speed
    whole = expm(np.block([[rates, inputs], [np.zeros((3, STATES + 3))]]) * dt)
    advance, driven = whole[:STATES, :STATES], whole[:STATES, STATES:]
    advance[~np.hstack((rates, inputs)).any(axis=1)] = 0.0  # what the scene or the partner's model does not have
    for name in ("p_noise", "theta_noise", "force_noise"):
        advance[X[name], X[name]] = exp(-dt / person.noise_time)
    return advance, driven[:, :2], driven[:, 2]


def _unforeseen(person: Participant, physics: Physics, device: DeviceModel, aim: str) -> Matrix:
    """Return the covariance of what is unforeseen in a step: of commands, forces on the arms, and noises of the senses.

    Friction and the force noise of an arm push it like a white noise of the same power at low frequencies.
    """
    dt, variances = DECISION_INTERVAL, dict.fromkeys(X, FLOOR**2)
    variances["own_aim"] += _drift(person.amplitude_cv, person, physics) * dt
    variances[aim] += _drift(person.partner_noise, person, physics) * dt
    pushed = (_friction(person, device) ** 2 + person.force_noise**2) * 2.0 * person.force_noise_time
    for hand in _HANDS:
        variances[f"{hand}_rate"] += pushed * dt / (person.arm_mass + device.mass) ** 2
    fresh = 1.0 - exp(-2.0 * dt / person.noise_time)
    variances["p_noise"] += fresh * person.position_noise**2
    variances["theta_noise"] += fresh * radians(person.tilt_noise_deg) ** 2
    variances["force_noise"] += fresh * felt_noise(person, physics, device) ** 2
    return np.diag([*variances.values(), *[FLOOR**2] * (STATES - len(X))])


def _at_rest(mechanics: _Mechanics, person: Participant, aim: str) -> tuple[Matrix, Matrix]:
    """Return the state at rest by the heights of both hands and the ball, and that by gravity."""
    given, board, balance = [X["own"], X["partner"], X["p"]], [X["z"], X["theta"]], [X["vz"], X["omega"]]
    rest, by_weight = np.zeros((STATES, len(given))), np.zeros(STATES)
    rest[given] = np.eye(len(given))
    springs = -np.linalg.pinv(mechanics.rates[np.ix_(balance, board)])  # singular for a board that is fixed
    rest[board], by_weight[board] = (
        springs @ mechanics.rates[np.ix_(balance, given)],
        springs @ mechanics.weight[balance],
    )
    for force, hand in zip(mechanics.forces, _HANDS, strict=True):
        for state in (rest, by_weight):
            pressed = force @ state
            state[X[f"{hand}_load"]] = -pressed
            state[X[f"{hand}_aim"]] = state[X[hand]] + (1.0 - person.load_skill) * pressed / person.arm_stiffness
    for state in (rest, by_weight):
        state[X[aim]] = state[X["partner_aim"]]
    return rest, by_weight
