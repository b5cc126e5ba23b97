"""Muscles of a simulated arm at 1 kHz: equilibrium point, stiffness, delayed responses to forces, and force noise.

The arm pulls the stylus to an equilibrium point with a spring-damper. The equilibrium point is the sum of the planned
submovements, low-passed by two muscle lags. The force noise is low-pass filtered; the state of its random numbers is
part of that of the muscles. Two optional responses shift the equilibrium point along an unexpected force, and stiffen
the arm where the hand misses its aim. `netboard.participants.body.stylus` integrates what the muscles do.

Rule 1: time is an argument; there is no clock.
Rule 2: this module knows nothing of perception; see `netboard.participants.people.senses`.
"""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from netboard.base.compiled import inlined
from netboard.base.errors import ConfigError
from netboard.base.tables.simulated import Participant
from netboard.participants.body.device_models import DeviceModel
from netboard.participants.body.stylus import STEP, UPDATE_STEPS, HandMechanics
from netboard.participants.people.partner_models import arm_gain
from netboard.participants.people.submovement import minimum_jerk
from netboard.physics.arithmetic.random_numbers import STREAM, normal, pack_stream

CAPACITY = 32
"""Most submovements that a hand can have under way at once [1]."""

FORCE_HISTORY = 128
"""Updates for which the force on the hand is kept for delayed responses, a power of 2 [1]."""

ARM = np.dtype(
    [
        ("relaxed", "<f8"),  # stiffness of the relaxed arm towards its equilibrium point [N/m]
        ("damping", "<f8"),  # damping of the arm [N s/m]
        ("stiffest", "<f8"),  # largest stiffness [N/m]
        ("stiffening", "<f8"),  # growth of the stiffness in an update per distance from the aim [N/m/m]
        ("relaxing", "<f8"),  # fall of the stiffness in an update [N/m]
        ("largest_compensation", "<f8"),  # largest force with which the arm compensates friction [N]
        ("lag", "<f8"),  # decay factor of a muscle stage per update [1]
        ("noise_decay", "<f8"),  # decay factor of the force noise per update [1]
        ("noise_step", "<f8"),  # force noise per standard normal number [N]
        ("full_compensation", "<f8"),  # movement of the equilibrium point in an update at which it is full [m]
        ("swing", "<f8"),  # displacement along x per square of the equilibrium height [1/m]
        ("aim_limit", "<f8"),  # largest height at which the hand aims [m]
        ("yielding", "<f8"),  # displacement of the equilibrium point per unexpected force [m/N]
        ("loading", "<f8"),  # displacement of the equilibrium point against an expected force [m/N]
        ("expectation_decay", "<f8"),  # decay factor per update of the difference between force and expected force [1]
        ("delay_updates", "<i8"),  # delay of the responses to forces, in updates [1]
    ]
)
"""Constants of an arm, as one record for the kernels."""

MUSCLES = np.dtype(
    [
        ("rest_x", "<f8"),  # rest position of the arm across the vertical path, at height 0 [m]
        ("rest_y", "<f8"),
        ("noise_x", "<f8"),  # force noise [N]
        ("noise_y", "<f8"),
        ("noise_z", "<f8"),
        ("aim", "<f8"),  # equilibrium height after all completed submovements [m]
        ("muscle", "<f8"),  # output of the first muscle lag [m]
        ("equilibrium", "<f8"),  # output of the second lag: the present equilibrium height [m]
        ("stiffness", "<f8"),  # present stiffness of the arm [N/m]
        ("updates", "<i8"),  # updates so far
        ("expected", "<f8"),  # expected vertical motor force [N]
        ("forces", "<f8", (FORCE_HISTORY,)),  # vertical motor force at the last updates [N]
        ("random", STREAM),  # random numbers that drive the force noise
        ("moves", "<i8"),  # number of submovements under way or planned
        ("submovements", "<f8", (CAPACITY, 3)),  # start, duration and displacement of each [s, s, m]
    ]
)
"""State of an arm."""


def hand_mechanics(participant: Participant, device: DeviceModel) -> HandMechanics:
    """Return what the arm of a participant adds to the mechanics of a device.

    Raises
    ------
    ConfigError
        If the cables are compliant and the arm's stiffness is not constant, which the cables' solver requires.
    """
    stiffening = arm_gain(participant, "impedance_gain")
    if device.cable_stiffness > 0.0 and stiffening > 0.0:
        raise ConfigError(
            f"[participant] impedance_gain: found {stiffening:g}, expected 0: with compliant cables "
            "(virtual.cable_stiffness) the stiffness of the simulated arm is constant"
        )
    friction = participant.friction_skill * device.friction * participant.rest_skill
    impedance = participant.arm_stiffness, participant.arm_damping
    return HandMechanics(participant.arm_mass, friction, impedance)


def pack_arm(participant: Participant, device: DeviceModel) -> NDArray[Any]:
    """Return the constants of an arm, packed for the kernels: ndarray of ARM, shape (1,) [SI]."""
    arm = np.zeros(1, ARM)
    update = UPDATE_STEPS * STEP
    arm["lag"] = np.exp(-update / participant.muscle_lag)
    arm["noise_decay"] = np.exp(-update / participant.force_noise_time)
    arm["aim_limit"] = device.workspace + participant.aim_beyond_stop
    arm["full_compensation"] = update * participant.compensation_speed
    arm["swing"] = 0.5 / participant.forearm
    arm["relaxed"], arm["damping"] = participant.arm_stiffness, participant.arm_damping
    arm["stiffest"] = participant.impedance_limit * participant.arm_stiffness
    arm["stiffening"] = arm_gain(participant, "impedance_gain") * update
    arm["relaxing"] = participant.impedance_decay * update
    arm["largest_compensation"] = participant.friction_skill * device.friction * (1.0 - participant.rest_skill)
    arm["loading"] = participant.load_skill / participant.arm_stiffness
    arm["yielding"] = arm_gain(participant, "reflex_gain") / participant.arm_stiffness
    arm["expectation_decay"] = np.exp(-update / participant.reflex_time)
    arm["delay_updates"] = round(participant.reflex_delay / update)
    arm["noise_step"] = participant.force_noise * np.sqrt(1.0 - arm["noise_decay"] ** 2)
    return arm


def initial_muscles(participant: Participant, rng: np.random.Generator) -> NDArray[Any]:
    """Return the state of an arm at rest: ndarray of MUSCLES, shape (1,) [SI]."""
    state = np.zeros(1, MUSCLES)
    state["stiffness"] = participant.arm_stiffness
    for name in ("rest_x", "rest_y"):
        state[name] = participant.lateral_sd * rng.standard_normal()
    state["random"] = pack_stream(rng)
    return state


@inlined
def _aim(s: np.void, when: float, bound: float) -> float:
    """Return the commanded height at a time; completed submovements are added to ``aim`` and removed from the plan."""
    wanted, plan = s["aim"], s["submovements"]
    kept = 0
    for i in range(s["moves"]):
        share = minimum_jerk((when - plan[i, 0]) / plan[i, 1])
        wanted += share * plan[i, 2]
        if share >= 1.0:
            s["aim"] = min(max(s["aim"] + plan[i, 2], -bound), bound)
        else:
            if kept < i:
                plan[kept, 0], plan[kept, 1], plan[kept, 2] = plan[i, 0], plan[i, 1], plan[i, 2]
            kept += 1
    s["moves"] = kept
    return float(min(max(wanted, -bound), bound))


@inlined
def _force_response(s: np.void, arm: np.void, force: float) -> float:
    """Return the displacement of the equilibrium point by forces: along an unexpected one, against an expected one [m].

    ``r = G (F(t - delay) - expected) / K``, where the expected force follows the delayed one with a time constant; the
    two muscle lags smooth it. Only the delay is that of short- and long-latency responses of the arm, 25 to 100 ms
    (Cluff, Crevecoeur and Scott, Vision Res. 110, 2015); a stretch reflex would oppose the force.
    """
    if arm["yielding"] == 0.0 and arm["loading"] == 0.0:
        return 0.0
    place = s["updates"]
    s["forces"][place & (FORCE_HISTORY - 1)] = force
    late = s["forces"][(place - arm["delay_updates"]) & (FORCE_HISTORY - 1)]
    s["expected"] = late + (s["expected"] - late) * arm["expectation_decay"]
    softer = arm["relaxed"] / s["stiffness"]  # the same force displaces a stiffer arm less
    return float(softer * (arm["yielding"] * (late - s["expected"]) - arm["loading"] * s["expected"]))


@inlined
def _stiffen(s: np.void, arm: np.void, height: float) -> None:
    """Adapt the arm's stiffness to the hand's distance from its aim: ``dK/dt = alpha |d| - gamma``, within limits.

    A person contracts opposing muscles together where errors are large, and relaxes slowly where they are not
    (Franklin et al., J. Neurosci. 2008).
    """
    if arm["stiffening"] > 0.0:
        wanted = s["stiffness"] + arm["stiffening"] * abs(s["equilibrium"] - height) - arm["relaxing"]
        s["stiffness"] = min(max(wanted, arm["relaxed"]), arm["stiffest"])


@inlined
def update_muscles(s: np.void, arm: np.void, when: float, height: float, force: float, action: np.void) -> None:
    """Update stiffness, equilibrium point, friction compensation and force noise, and write what the arm does.

    Parameters
    ----------
    when : float
        Time of the update, on the clock of the submovements [s].
    height : float
        Height of the hand [m].
    force : float
        Vertical motor force on the hand, + = up [N].
    """
    _stiffen(s, arm, height)
    middle = when + 0.5 * UPDATE_STEPS * STEP
    wanted = _aim(s, middle, arm["aim_limit"]) + _force_response(s, arm, force)
    s["muscle"] = wanted + (s["muscle"] - wanted) * arm["lag"]
    before = s["equilibrium"]
    s["equilibrium"] = s["muscle"] + (before - s["muscle"]) * arm["lag"]
    s["noise_x"] = s["noise_x"] * arm["noise_decay"] + normal(s["random"]) * arm["noise_step"]
    s["noise_y"] = s["noise_y"] * arm["noise_decay"] + normal(s["random"]) * arm["noise_step"]
    s["noise_z"] = s["noise_z"] * arm["noise_decay"] + normal(s["random"]) * arm["noise_step"]
    s["updates"] += 1
    _write_action(s, arm, before, action)


@inlined
def _write_action(s: np.void, arm: np.void, before: float, action: np.void) -> None:
    """Write what the arm does until the next update. ``before``: equilibrium height before this one [m]."""
    moving = (s["equilibrium"] - before) / arm["full_compensation"]
    compensation = arm["largest_compensation"] * max(-1.0, min(1.0, moving))
    target, force = action["target"], action["force"]
    target[0] = s["rest_x"] + arm["swing"] * s["equilibrium"] * s["equilibrium"]
    target[1], target[2] = s["rest_y"], s["equilibrium"]
    force[0], force[1], force[2] = s["noise_x"], s["noise_y"], compensation + s["noise_z"]
    action["stiffness"], action["damping"] = s["stiffness"], arm["damping"]


@inlined
def begin(s: np.void, start: float, duration: float, displacement: float) -> None:
    """Add a submovement to those under way [s, s, m]; a start may be in the past."""
    under_way = s["moves"]
    if under_way == CAPACITY:
        raise ValueError("a simulated hand has too many submovements under way")
    plan = s["submovements"]
    plan[under_way, 0], plan[under_way, 1], plan[under_way, 2] = start, duration, displacement
    s["moves"] = under_way + 1
