"""Simulated hand on a stylus: mechanics at 4 kHz; muscles, delayed responses and force noise at 1 kHz.

The arm is a mass on a spring-damper to an equilibrium point. The equilibrium point is the sum of the planned
submovements, low-passed by two muscle lags. The device adds its mass, viscous damping, Coulomb friction and motor
force; compliant cables (`netboard.participants.body.cable`) lie between motors and arm. Motor noise is a low-pass
filtered force; the state of its random numbers is part of the hand's. Two optional responses shift the equilibrium
point along an unexpected force, and stiffen the arm where the hand misses its aim.

Rule 1: `Hand.advance` takes the number of steps as argument; there is no clock.
Rule 2: friction is solved implicitly, so a hand held by friction is exactly at rest and does not creep.
Rule 3: the axes x, y, z are integrated together as lanes of a vector register, a step at a time.
Rule 4: this module knows nothing of perception; see `netboard.participants.people.senses`.
"""

from collections.abc import Iterable
from typing import Any

import numpy as np
from numpy.typing import NDArray

from netboard.base.compiled import Records, inlined, kernel, machine_code
from netboard.base.errors import ConfigError
from netboard.base.tables.simulated import Participant, VirtualDevice
from netboard.participants.body.cable import CABLES, TIP, pack_cables, stretch
from netboard.participants.body.device_models import resolved
from netboard.participants.people.submovement import Submovement, minimum_jerk
from netboard.physics.arithmetic.random_numbers import STREAM, normal, pack_stream
from netboard.physics.arithmetic.simd import gathered, lanes_at, larger, put, smaller, where_within

STEP_NS = 250_000
"""Length of an integration step [ns]."""

STEP = STEP_NS * 1e-9
"""Length of an integration step [s]."""

UPDATE_STEPS = 4
"""Integration steps in an update of muscles, delayed responses and force noise, which are slow [1]."""

CAPACITY = 32
"""Most submovements that a hand can have under way at once [1]."""

FORCE_HISTORY = 128
"""Updates for which the force on the hand is kept for delayed responses, a power of 2 [1]."""

ARM = np.dtype(
    [
        ("mass", "<f8"),  # mass of arm and device [kg]
        ("stiffness", "<f8"),  # stiffness of the relaxed arm towards its equilibrium point [N/m]
        ("stiffest", "<f8"),  # largest stiffness [N/m]
        ("stiffening", "<f8"),  # growth of the stiffness in an update per distance from the aim [N/m/m]
        ("relaxing", "<f8"),  # fall of the stiffness in an update [N/m]
        ("damping", "<f8"),  # damping of arm and device [N s/m]
        ("friction", "<f8"),  # Coulomb friction of each axis, without the part that the arm compensates at rest [N]
        ("per_force", "<f8"),  # change of velocity per force in a step [m/s/N]
        ("friction_step", "<f8"),  # largest change of velocity by Coulomb friction in a step [m/s]
        ("damping_factor", "<f8"),  # factor of the velocity by damping in a step [1]
        ("largest_compensation", "<f8"),  # largest force with which the arm compensates friction [N]
        ("lag", "<f8"),  # decay factor of a muscle stage per update [1]
        ("noise_decay", "<f8"),  # decay factor of the force noise per update [1]
        ("noise_step", "<f8"),  # force noise per standard normal number [N]
        ("full_compensation", "<f8"),  # movement of the equilibrium point in an update at which it is full [m]
        ("swing", "<f8"),  # displacement along x per square of the equilibrium height [1/m]
        ("lateral_sd", "<f8"),  # standard deviation of the rest position along x and y [m]
        ("aim_limit", "<f8"),  # largest height at which the hand aims [m]
        ("stop", "<f8"),  # mechanical stop of each axis [m]
        ("yielding", "<f8"),  # displacement of the equilibrium point per unexpected force [m/N]
        ("loading", "<f8"),  # displacement of the equilibrium point against an expected force [m/N]
        ("expectation_decay", "<f8"),  # decay factor per update of the difference between force and expected force [1]
        ("delay_updates", "<i8"),  # delay of the responses to forces, in updates [1]
    ]
)
"""Constants of a hand, as one record for the kernels."""

LANES = 4
"""Lanes of a vector register in which the axes x, y, z are integrated together [1]."""

HAND = np.dtype(
    [
        ("place", "<f8", (LANES,)),  # position x, y, z [m]
        ("v", "<f8", (LANES,)),  # velocity [m/s]
        ("rest_x", "<f8"),  # rest position of the arm across the vertical path, at height 0 [m]
        ("rest_y", "<f8"),
        ("lateral", "<f8"),  # present rest position along x [m]
        ("noise_x", "<f8"),  # force noise [N]
        ("noise_y", "<f8"),
        ("noise_z", "<f8"),
        ("aim", "<f8"),  # equilibrium height after all completed submovements [m]
        ("muscle", "<f8"),  # output of the first muscle lag [m]
        ("equilibrium", "<f8"),  # output of the second lag: the present equilibrium height [m]
        ("stiffness", "<f8"),  # present stiffness of the arm [N/m]
        ("compensation", "<f8"),  # force with which the arm compensates friction, along z [N]
        ("moves", "<i8"),  # number of submovements under way or planned
        ("steps", "<i8"),  # steps so far
        ("expected", "<f8"),  # expected vertical motor force [N]
        ("forces", "<f8", (FORCE_HISTORY,)),  # vertical motor force at the last updates [N]
        ("random", STREAM),  # random numbers that drive the force noise
    ]
)
"""State of a hand."""

RIGID = np.zeros(0, CABLES)
"""Constants of rigid cables: none."""


def make_hand(participant: Participant, device: VirtualDevice, rng: np.random.Generator, held: bool = True) -> "Hand":
    """Put a hand on a device, with compliant cables if the device has them.

    Raises
    ------
    ConfigError
        If the cables are compliant and the arm's stiffness is not constant, which the cables' solver requires.
    """
    arm, own = pack_arm(participant, device, held), resolved(device)
    if own.cable_stiffness > 0.0 and participant.impedance_gain > 0.0:
        raise ConfigError(
            f"[participant] impedance_gain: found {participant.impedance_gain:g}, expected 0: with compliant cables "
            "(virtual.cable_stiffness) the stiffness of the simulated arm is constant"
        )
    return Hand(arm, rng, pack_cables(own, arm, STEP) if own.cable_stiffness > 0.0 else RIGID)


def pack_arm(participant: Participant, device: VirtualDevice, held: bool = True) -> NDArray[Any]:
    """Return the constants of a hand, packed for the kernels: ndarray of ARM, shape (1,) [SI]."""
    arm, own = np.zeros(1, ARM), resolved(device)
    arm["mass"] = own.mass
    arm["damping"] = own.damping
    arm["friction"] = own.friction
    arm["stop"] = own.workspace
    arm["lag"] = np.exp(-UPDATE_STEPS * STEP / participant.muscle_lag)
    arm["noise_decay"] = np.exp(-UPDATE_STEPS * STEP / participant.force_noise_time)
    arm["aim_limit"] = own.workspace + participant.aim_beyond_stop
    arm["full_compensation"] = UPDATE_STEPS * STEP * participant.compensation_speed
    arm["swing"], arm["lateral_sd"] = 0.5 / participant.forearm, participant.lateral_sd
    if held:
        arm["mass"] += participant.arm_mass
        arm["damping"] += participant.arm_damping
        arm["stiffness"] = participant.arm_stiffness
        arm["stiffest"] = participant.impedance_limit * participant.arm_stiffness
        arm["stiffening"] = participant.impedance_gain * UPDATE_STEPS * STEP
        arm["relaxing"] = participant.impedance_decay * UPDATE_STEPS * STEP
        arm["largest_compensation"] = participant.friction_skill * own.friction * (1.0 - participant.rest_skill)
        arm["friction"] -= participant.friction_skill * own.friction * participant.rest_skill
        arm["loading"] = participant.load_skill / participant.arm_stiffness
        arm["yielding"] = participant.reflex_gain / participant.arm_stiffness
        arm["expectation_decay"] = np.exp(-UPDATE_STEPS * STEP / participant.reflex_time)
        arm["delay_updates"] = round(participant.reflex_delay / (UPDATE_STEPS * STEP))
        arm["noise_step"] = participant.force_noise * np.sqrt(1.0 - arm["noise_decay"] ** 2)
    arm["per_force"] = STEP / arm["mass"]
    arm["friction_step"] = arm["per_force"] * arm["friction"]
    arm["damping_factor"] = 1.0 / (1.0 + arm["per_force"] * arm["damping"])
    return arm


@inlined
def _advanced(place: Any, v: Any, force: Any, arm: np.void) -> tuple[Any, Any]:
    """Advance all axes by one step: implicit friction and damping (Moreau's time stepping), then the stops."""
    v = v + arm["per_force"] * force
    v = arm["damping_factor"] * (v - smaller(larger(v, -arm["friction_step"]), arm["friction_step"]))
    place, stop = place + STEP * v, arm["stop"]
    return smaller(larger(place, -stop), stop), where_within(place, -stop, stop, v, 0.0)


@inlined
def _aim(s: np.void, plan: NDArray[np.float64], when: float, bound: float) -> float:
    """Return the commanded height at a time; completed submovements are added to ``aim`` and removed from the plan."""
    wanted = s["aim"]
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
    place = s["steps"] // UPDATE_STEPS
    s["forces"][place & (FORCE_HISTORY - 1)] = force
    late = s["forces"][(place - arm["delay_updates"]) & (FORCE_HISTORY - 1)]
    s["expected"] = late + (s["expected"] - late) * arm["expectation_decay"]
    softer = arm["stiffness"] / s["stiffness"]  # the same force displaces a stiffer arm less
    return float(softer * (arm["yielding"] * (late - s["expected"]) - arm["loading"] * s["expected"]))


@inlined
def _stiffen(s: np.void, arm: np.void) -> None:
    """Adapt the arm's stiffness to the hand's distance from its aim: ``dK/dt = alpha |d| - gamma``, within limits.

    A person contracts opposing muscles together where errors are large, and relaxes slowly where they are not
    (Franklin et al., J. Neurosci. 2008).
    """
    if arm["stiffening"] > 0.0:
        wanted = s["stiffness"] + arm["stiffening"] * abs(s["equilibrium"] - s["place"][2]) - arm["relaxing"]
        s["stiffness"] = min(max(wanted, arm["stiffness"]), arm["stiffest"])


@inlined
def update_muscles(s: np.void, arm: np.void, plan: NDArray[np.float64], when: float, force: float) -> None:
    """Update stiffness, equilibrium point, friction compensation and force noise.

    Parameters
    ----------
    when : float
        Middle of the interval until the next update, on the clock of the submovements [s].
    force : float
        Vertical motor force on the hand, + = up [N].
    """
    _stiffen(s, arm)
    wanted = _aim(s, plan, when, arm["aim_limit"]) + _force_response(s, arm, force)
    s["muscle"] = wanted + (s["muscle"] - wanted) * arm["lag"]
    before = s["equilibrium"]
    s["equilibrium"] = s["muscle"] + (before - s["muscle"]) * arm["lag"]
    s["lateral"] = s["rest_x"] + arm["swing"] * s["equilibrium"] * s["equilibrium"]
    moving = (s["equilibrium"] - before) / arm["full_compensation"]
    s["compensation"] = arm["largest_compensation"] * max(-1.0, min(1.0, moving))
    s["noise_x"] = s["noise_x"] * arm["noise_decay"] + normal(s["random"]) * arm["noise_step"]
    s["noise_y"] = s["noise_y"] * arm["noise_decay"] + normal(s["random"]) * arm["noise_step"]
    s["noise_z"] = s["noise_z"] * arm["noise_decay"] + normal(s["random"]) * arm["noise_step"]


@inlined
def integrate(s: np.void, arm: np.void, fx: float, fy: float, fz: float, steps: int) -> None:
    """Advance a hand between two updates, under a constant motor force."""
    stiffness = s["stiffness"]
    push = gathered(
        (
            stiffness * s["lateral"] + s["noise_x"] + fx,
            stiffness * s["rest_y"] + s["noise_y"] + fy,
            stiffness * s["equilibrium"] + s["compensation"] + s["noise_z"] + fz,
        ),
        LANES,
    )
    place, v = lanes_at(s["place"], 0, LANES), lanes_at(s["v"], 0, LANES)
    for _ in range(steps):
        place, v = _advanced(place, v, push - stiffness * place, arm)
    put(s["place"], 0, place)
    put(s["v"], 0, v)
    s["steps"] += steps


@kernel
def integrate_on_cables(s: np.void, tip: np.void, cables: np.void, fx: float, fy: float, fz: float, steps: int) -> None:
    """Advance a hand as `integrate` does, with compliant cables; `s` is then the state of the motor side."""
    t, load = tip, s["compensation"] + s["noise_z"]
    place, v = s["place"], s["v"]
    for _ in range(steps):
        place[0], v[0], t["x"], t["vx"] = stretch(
            place[0], v[0], t["x"], t["vx"], fx, s["noise_x"], s["lateral"], cables
        )
        place[1], v[1], t["y"], t["vy"] = stretch(
            place[1], v[1], t["y"], t["vy"], fy, s["noise_y"], s["rest_y"], cables
        )
        place[2], v[2], t["z"], t["vz"] = stretch(place[2], v[2], t["z"], t["vz"], fz, load, s["equilibrium"], cables)
    s["steps"] += steps


@kernel
def advance_hand(
    state: Records,
    tip: Records,
    constants: Records,
    cables: Records,
    plan: NDArray[np.float64],
    origin: float,
    fx: float,
    fy: float,
    fz: float,
    steps: int,
) -> None:
    """Advance a hand under a constant motor force, over any number of updates.

    Parameters
    ----------
    state : ndarray of HAND, shape (1,)
        State of the hand, changed in place.
    tip : ndarray of TIP, shape (1,)
        With compliant cables, the state of the stylus side, changed in place.
    constants : ndarray of ARM, shape (1,)
        Constants of device and arm.
    origin : float
        Time of the initial state, on the clock of the submovements [s].
    """
    s, arm = state[0], constants[0]
    done = 0
    while done < steps:
        if s["steps"] % UPDATE_STEPS == 0:
            when = origin + (done + 0.5 * UPDATE_STEPS) * STEP
            update_muscles(s, arm, plan, when, fz)
        part = min(UPDATE_STEPS - s["steps"] % UPDATE_STEPS, steps - done)
        if len(cables) > 0:
            integrate_on_cables(s, tip[0], cables[0], fx, fy, fz, part)
        else:
            integrate(s, arm, fx, fy, fz, part)
        done += part


class Hand:
    """One simulated hand on one stylus.

    Parameters
    ----------
    arm : ndarray of ARM, shape (1,)
        Constants, from `pack_arm`.

    Attributes
    ----------
    state : ndarray of HAND, shape (1,)
        State of the hand; with compliant cables, that of the motor side.
    end : ndarray of TIP, shape (1,)
        With compliant cables, the state of the stylus side.
    submovements : ndarray, shape (CAPACITY, 3)
        Start, duration and displacement of the submovements that are not complete [s, s, m].
    parts : tuple of ndarray
        The first arguments of `advance_hand`.
    """

    def __init__(self, arm: NDArray[Any], rng: np.random.Generator, cables: NDArray[Any] = RIGID) -> None:
        self.state = np.zeros(1, HAND)
        self.end = np.zeros(1, TIP)
        self.cables = cables
        self._record = self.state[0]
        self._record["stiffness"] = arm["stiffness"][0]
        self.arm = arm
        self.submovements = np.zeros((CAPACITY, 3))
        self.parts = self.state, self.end, self.arm, self.cables, self.submovements
        self._advance_hand = machine_code(advance_hand, *self.parts, *(0.0,) * 4, 0)
        if arm["stiffness"][0] > 0.0:
            for k, axis in enumerate(("x", "y")):
                self._record["place"][k] = self._record[f"rest_{axis}"] = arm["lateral_sd"][0] * rng.standard_normal()
                self.end[axis] = self._record["place"][k]
        self.state["random"] = pack_stream(rng)

    def plan(self, moves: Iterable[Submovement]) -> None:
        """Add submovements to those under way.

        Parameters
        ----------
        moves : iterable of Submovement
            New submovements; a start may be in the past.

        Raises
        ------
        ValueError
            If more than `CAPACITY` submovements would be under way.
        """
        for move in moves:
            count = int(self._record["moves"])
            if count >= CAPACITY:
                raise ValueError(f"a hand can have at most {CAPACITY} submovements under way")
            self.submovements[count] = move.start, move.duration, move.displacement
            self._record["moves"] = count + 1

    def put(self, z: float) -> None:
        """Put the hand at rest at a height.

        Parameters
        ----------
        z : float
            Height at the encoders [m].
        """
        self._record["place"][2], self._record["v"][2] = z, 0.0

    def advance(self, steps: int, origin: float, force: tuple[float, float, float]) -> None:
        """Advance the hand under a constant force.

        Parameters
        ----------
        origin : float
            Time before the steps, on the clock of the submovements [s].
        force : tuple of float
            Motor force on the stylus along x, y, z [N].
        """
        self._advance_hand(*self.parts, origin, force[0], force[1], force[2], steps)

    @property
    def tip(self) -> tuple[float, float, float]:
        """Position x, y, z of the stylus; with compliant cables it differs from that at the encoders [m]."""
        if len(self.cables) == 0:
            return self.position
        t = self.end[0]
        return float(t["x"]), float(t["y"]), float(t["z"])

    @property
    def position(self) -> tuple[float, float, float]:
        """Position x, y, z at the encoders [m]."""
        x, y, z, _ = self._record["place"].tolist()
        return x, y, z

    @property
    def velocity(self) -> tuple[float, float, float]:
        """Velocity x, y, z at the encoders [m/s]."""
        vx, vy, vz, _ = self._record["v"].tolist()
        return vx, vy, vz
