"""A simulated device in its holder's hand, a tick at a time: the samples that its agent would send to the server.

Its milliseconds are those of an agent that follows the server's ticks: the stylus is read `LEAD_NS` before the deadline
of a tick, and the force computed in that tick acts from the deadline on. Stylus, encoder, velocity, fixture and the
motors' limit follow the equations of `netboard.devices.simulated.device` and the agent. Of the safety chain only the
clamp is simulated: nothing else that it guards against happens here, so an armed chain passes the force on. Motors do
not heat up, and no step takes time.
"""

import numpy as np
from numpy.typing import NDArray

from netboard.base.compiled import Records, inlined
from netboard.base.config import SIDES, Config
from netboard.base.errors import ConfigError
from netboard.base.safeguards import Safeguard
from netboard.base.tick import TICK_NS, TICK_WORDS
from netboard.participants.body.cable import CABLES, TIP
from netboard.participants.body.device_forces import fixture_force, within
from netboard.participants.body.device_models import resolved
from netboard.participants.body.stylus import (
    ACTION,
    MECHANICS,
    STEP_NS,
    STYLUS,
    HandMechanics,
    hold,
    integrate,
    integrate_on_cables,
)
from netboard.participants.body.velocity_window import AXES, SAMPLES, SLACK, make_windowed
from netboard.physics.arithmetic.simd import gathered, lane, nearest
from netboard.stage.stage import commanded_tick
from netboard.task.trials.state_machine import is_active

LEAD_NS = STEP_NS
"""Time from the reading of the stylus to the deadline of its tick [ns]."""

STEPS = TICK_NS // STEP_NS
"""Steps of the hand in a tick [1]."""

BEFORE = LEAD_NS // STEP_NS
"""Those of them in which the force of the tick before still acts [1]."""

_ARMED, _CLAMPED = int(Safeguard.ARMED), int(Safeguard.CLAMPED)

_TICK, _TIME, _PHASE, _TRIAL = (TICK_WORDS[name] for name in ("tick", "time_ns", "phase", "trial"))


def _places(field: str) -> tuple[int, int]:
    """Return where a row has a field of the left and of the right side."""
    return TICK_WORDS[f"{SIDES[0]}_{field}"], TICK_WORDS[f"{SIDES[1]}_{field}"]


_LIVE, _SEQ, _STAMP, _Z, _VZ = map(_places, ("live", "seq", "stamp_ns", "sent_z", "sent_vz"))
_X, _Y, _RENDERED, _GUARDS = map(_places, ("x", "y", "rendered", "safeguards"))
_LOOP, _LEAD, _FORCE = map(_places, ("loop_ns", "lead_ns", "force"))

_DEVICE = np.dtype(
    [
        ("k", "<f8"),  # stiffness of the fixture [N/m]
        ("c", "<f8"),  # its damping [N s/m]
        ("limit", "<f8"),  # largest force, of the motors or of the safety chain [N]
        ("resolution", "<f8"),  # size of an encoder step [m]
        ("x", "<f8"),  # the newest reading [m]
        ("y", "<f8"),
        ("z", "<f8"),
        ("vx", "<f8"),  # [m/s]
        ("vy", "<f8"),
        ("vz", "<f8"),
        ("fx", "<f8"),  # force that acts [N]
        ("fy", "<f8"),
        ("fz", "<f8"),
        ("commanded", "<f8"),  # vertical force to act next [N]
        ("received", "<i8"),  # number of forces received [1]
        ("held", "<i8"),  # 1: in a hand; 0: at rest at height 0
    ]
)
"""A device as the kernels see it."""

BODY = np.dtype(
    [
        ("stylus", STYLUS),
        ("tip", TIP),  # state of the stylus side, with compliant cables
        ("mechanics", MECHANICS),
        ("cables", CABLES),
        ("rigid", "<i8"),  # 1: without compliant cables
        ("device", _DEVICE),
    ]
)
"""A stylus and its device, as one record: kernels count references to arrays, which takes longer than a step."""

_BOTH = len(SIDES) * AXES

READINGS = np.dtype(
    [
        ("count", "<i8"),  # positions from which the velocity is computed [1]
        ("stamps", "<i8", (SAMPLES,)),  # times of the newest positions [ns]
        ("places", "<f8", (SAMPLES, _BOTH)),  # the positions, of the left and of the right stylus [m]
    ]
)
"""Newest readings of both devices, which are read at once: all their axes are lanes of one vector register."""

_windowed = make_windowed(_BOTH)


@inlined
def _integrate(bodies: Records, actions: Records, first: int, stop: int, steps: int) -> None:
    """Integrate some of the styluses for some steps, each under the force that acts on it."""
    for side in range(first, stop):
        body, action = bodies[side], actions[side]
        d = body["device"]
        if body["rigid"]:
            integrate(body["stylus"], body["mechanics"], action, d["fx"], d["fy"], d["fz"], steps)
        else:
            integrate_on_cables(body["stylus"], body["tip"], body["cables"], action, d["fx"], d["fy"], d["fz"], steps)


@inlined
def advance(
    bodies: Records,
    actions: Records,
    first: int,
    stop: int,
    words: NDArray[np.int64],
    numbers: NDArray[np.float64],
) -> None:
    """Integrate from the last reading to that of this tick, and write rendered forces and safeguards into its row.

    Each phase is done for all styluses before the next one, so that the processor can overlap their computations.

    ``bodies``, ``actions``: BODY and ACTION records of the left and the right side, of which those from ``first`` to
    before ``stop`` advance. ``words``, ``numbers``: the row of this tick, as words and as numbers of the same memory;
    ``tick`` and ``time_ns`` are set.
    """
    stamp_ns = words[_TIME] - LEAD_NS
    for side in range(first, stop):
        words[_LIVE[side]], words[_SEQ[side]] = 1, words[_TICK]
        words[_STAMP[side]], words[_LEAD[side]] = stamp_ns, LEAD_NS
    _integrate(bodies, actions, first, stop, BEFORE)
    for side in range(first, stop):
        _render(bodies[side]["device"], side, words, numbers)
    _integrate(bodies, actions, first, stop, STEPS - BEFORE)


@inlined
def _render(d: np.void, side: int, words: NDArray[np.int64], numbers: NDArray[np.float64]) -> None:
    """Let the commanded force act, with that of the fixture, and write what a device has rendered."""
    words[_GUARDS[side]] = _ARMED
    numbers[_RENDERED[side]] = 0.0
    if d["held"] == 0:
        return
    fx, fy = fixture_force(d["k"], d["c"], d["x"], d["vx"]), fixture_force(d["k"], d["c"], d["y"], d["vy"])
    fx, fy, fz = within(d["limit"], fx, fy, d["commanded"])
    d["fx"], d["fy"], d["fz"] = fx, fy, fz
    numbers[_RENDERED[side]], words[_LOOP[side]] = fz, LEAD_NS
    if fz != d["commanded"]:
        words[_GUARDS[side]] = _ARMED | _CLAMPED


@inlined
def read(
    bodies: Records, first: int, stop: int, readings: np.void, words: NDArray[np.int64], numbers: NDArray[np.float64]
) -> None:
    """Put positions and velocities, as read by the encoders, into a tick's row.

    ``first``, ``stop``: the hands that are read, as in `advance`. ``readings``: a record of `READINGS`.
    """
    left, right, step = (
        bodies[0]["stylus"]["place"],
        bodies[1]["stylus"]["place"],
        bodies[first]["device"]["resolution"],
    )
    places = gathered((left[0], left[1], left[2], 0.0, right[0], right[1], right[2]), _BOTH)
    if step > 0.0:
        places = nearest(places / step) * step
    stamp_ns = words[_TIME] - LEAD_NS
    readings["count"], v = _windowed(
        readings["stamps"], readings["places"], readings["count"], SLACK * step, stamp_ns, places
    )
    for side in range(first, stop):
        d, x = bodies[side]["device"], AXES * side
        if d["held"]:
            d["x"], d["y"], d["z"] = lane(places, x), lane(places, x + 1), lane(places, x + 2)
            d["vx"], d["vy"], d["vz"] = lane(v, x), lane(v, x + 1), lane(v, x + 2)
            numbers[_X[side]], numbers[_Y[side]] = d["x"], d["y"]
            numbers[_Z[side]], numbers[_VZ[side]] = d["z"], d["vz"]


@inlined
def apply_force(
    bodies: Records,
    side: int,
    force_queue: NDArray[np.float64],
    catch: NDArray[np.int64],
    words: NDArray[np.int64],
    numbers: NDArray[np.float64],
) -> float:
    """Give a body the force of a tick; if the block has a force delay, an earlier tick's.

    ``force_queue``: forces of the last n ticks on both hands, for a delay of n - 1 ticks [N]. ``catch``: that of
    `netboard.physics.scene.rendering.RENDERING`. Returns the vertical force on the hand that acts next, zero unless a
    trial is running [N].
    """
    d = bodies[side]["device"]
    received = d["received"]
    d["received"] = received + 1
    d["commanded"] = delayed_force(
        force_queue[side], received, numbers[_FORCE[side]], words[_TRIAL], words[_PHASE], catch
    )
    return float(d["commanded"])


@inlined
def delayed_force(
    queue: NDArray[np.float64], received: int, force: float, trial: int, phase: int, catch: NDArray[np.int64]
) -> float:
    """Put the force of a tick into the queue of a hand; return that which acts next [N].

    ``received``: forces before it [1]. ``trial``, ``phase``: of the tick.
    """
    size = len(queue)
    queue[_slot(received, size)] = force
    sent = commanded_tick(received, size - 1, trial, catch)
    return float(queue[_slot(sent, size)]) if is_active(phase) else 0.0


@inlined
def _slot(number: int, size: int) -> int:
    """Return the slot of a tick in a queue; without a delay there is one, and a remainder takes long."""
    return number % size if size > 1 else 0


def pack_body(config: Config, hand: HandMechanics | None, place: tuple[float, float], body: np.void) -> None:
    """Put a stylus on its device, in the record of its side.

    ``hand``: what the hand adds; None for a stylus that is held still at height 0. ``place``: where the hand is across
    the vertical line [m].
    """
    refuse_flaws(config)
    model = resolved(config.virtual)
    held = hold(model, hand or HandMechanics(), np.zeros(1, ACTION))
    body["stylus"], body["tip"], body["mechanics"] = held.stylus[0], held.tip[0], held.mechanics[0]
    body["rigid"] = len(held.cables) == 0
    if len(held.cables):
        body["cables"] = held.cables[0]
    for axis, (name, at) in enumerate(zip("xy", place, strict=True)):
        body["stylus"]["place"][axis] = body["tip"][name] = at
    device = body["device"]
    device["k"], device["c"] = config.fixture.stiffness, config.fixture.damping
    device["limit"] = min(model.max_force, config.safety.max_force)
    device["resolution"], device["held"] = model.resolution, hand is not None


def refuse_flaws(config: Config) -> None:
    """Refuse device faults that a rehearsal does not simulate."""
    virtual = config.virtual
    flaws = {
        "thermal_time": resolved(virtual).thermal_time,
        "read_latency_ms": virtual.read_latency_ms,
        "write_latency_ms": virtual.write_latency_ms,
    }
    for key, value in flaws.items():
        if value > 0.0:
            raise ConfigError(
                f"[virtual] {key}: found {value:g}, expected 0: a rehearsal has motors that stay cool and devices that "
                "answer at once (only agents with virtual devices have the others)"
            )
