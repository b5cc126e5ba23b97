"""A simulated hand on its virtual device, a tick at a time: the samples that its agent would send to the server.

Its milliseconds are those of an agent that follows the server's ticks: the stylus is read `LEAD_NS` before the deadline
of a tick, and the force computed in that tick acts from the deadline on. Hand, encoder, velocity, fixture and the
motors' limit follow the equations of `netboard.devices.simulated.virtual` and the agent. A tick is one kernel. Of the
safety chain only the clamp is simulated: nothing else that it guards against happens here, so an armed chain passes the
force on. Motors do not heat up, and no step takes time.
"""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from netboard.base.compiled import Records, inlined
from netboard.base.config import SIDES, Config, Side
from netboard.base.errors import ConfigError
from netboard.base.safeguards import Safeguard
from netboard.base.tables.simulated import Participant
from netboard.base.tick import TICK_NS, TICK_WORDS
from netboard.participants.body.cable import CABLES, TIP
from netboard.participants.body.device_forces import fixture_force, within
from netboard.participants.body.device_models import resolved
from netboard.participants.body.velocity_window import AXES, SAMPLES, SLACK, make_windowed
from netboard.participants.people.hand import (
    ARM,
    CAPACITY,
    HAND,
    STEP,
    STEP_NS,
    UPDATE_STEPS,
    integrate,
    integrate_on_cables,
    make_hand,
    update_muscles,
)
from netboard.physics.arithmetic.simd import gathered, lane, nearest
from netboard.physics.scene.rendering import pack_rendering
from netboard.stage.stage import commanded_tick
from netboard.task.trials.state_machine import is_active

LEAD_NS = STEP_NS
"""Time from the reading of the stylus to the deadline of its tick [ns]."""

STEPS = TICK_NS // STEP_NS
"""Steps of the hand in a tick [1]."""

_BEFORE = LEAD_NS // STEP_NS
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
        ("vx", "<f8"),  # [m/s]
        ("vy", "<f8"),
        ("fx", "<f8"),  # force that acts [N]
        ("fy", "<f8"),
        ("fz", "<f8"),
        ("commanded", "<f8"),  # vertical force to act next [N]
        ("received", "<i8"),  # number of forces received [1]
        ("simulated", "<i8"),  # 1: held by a simulated hand; 0: at rest at height 0
    ]
)
"""A device as the kernels see it."""

BODY = np.dtype(
    [
        ("hand", HAND),
        ("tip", TIP),  # state of the stylus side, with compliant cables
        ("arm", ARM),
        ("cables", CABLES),
        ("rigid", "<i8"),  # 1: without compliant cables
        ("submovements", "<f8", (CAPACITY, 3)),  # start, duration and displacement of each submovement [s, s, m]
        ("device", _DEVICE),
    ]
)
"""A hand on its device, as one record, because kernels count references to arrays, which takes longer than a step."""

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
def _integrate(bodies: Records, first: int, stop: int, steps: int) -> None:
    """Integrate some of the hands for some steps, each under the force that acts on it."""
    for side in range(first, stop):
        body = bodies[side]
        d = body["device"]
        if body["rigid"]:
            integrate(body["hand"], body["arm"], d["fx"], d["fy"], d["fz"], steps)
        else:
            integrate_on_cables(body["hand"], body["tip"], body["cables"], d["fx"], d["fy"], d["fz"], steps)


@inlined
def advance(bodies: Records, first: int, stop: int, words: NDArray[np.int64], numbers: NDArray[np.float64]) -> None:
    """Integrate from the last reading to that of this tick, and write rendered forces and safeguards into its row.

    Each phase is done for all hands before the next one, so that the processor can overlap their computations.

    ``bodies``: BODY records of the left and the right hand, of which those from ``first`` to before ``stop`` advance.
    ``words``, ``numbers``: the row of this tick, as words and as numbers of the same memory; ``tick`` and ``time_ns``
    are set.
    """
    stamp_ns = words[_TIME] - LEAD_NS
    when = (stamp_ns - TICK_NS) * 1e-9 + 0.5 * UPDATE_STEPS * STEP
    for side in range(first, stop):
        body = bodies[side]
        words[_LIVE[side]], words[_SEQ[side]] = 1, words[_TICK]
        words[_STAMP[side]], words[_LEAD[side]] = stamp_ns, LEAD_NS
        update_muscles(body["hand"], body["arm"], body["submovements"], when, body["device"]["fz"])
    _integrate(bodies, first, stop, _BEFORE)
    for side in range(first, stop):
        _render(bodies[side]["device"], side, words, numbers)
    _integrate(bodies, first, stop, STEPS - _BEFORE)


@inlined
def _render(d: np.void, side: int, words: NDArray[np.int64], numbers: NDArray[np.float64]) -> None:
    """Let the commanded force act, with that of the fixture, and write what a device has rendered."""
    words[_GUARDS[side]] = _ARMED
    numbers[_RENDERED[side]] = 0.0
    if d["simulated"] == 0:
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
    left, right, step = bodies[0]["hand"]["place"], bodies[1]["hand"]["place"], bodies[first]["device"]["resolution"]
    places = gathered((left[0], left[1], left[2], 0.0, right[0], right[1], right[2]), _BOTH)
    if step > 0.0:
        places = nearest(places / step) * step
    stamp_ns = words[_TIME] - LEAD_NS
    readings["count"], v = _windowed(
        readings["stamps"], readings["places"], readings["count"], SLACK * step, stamp_ns, places
    )
    for side in range(first, stop):
        d, x = bodies[side]["device"], AXES * side
        if d["simulated"]:
            d["x"], d["y"], d["vx"], d["vy"] = lane(places, x), lane(places, x + 1), lane(v, x), lane(v, x + 1)
            numbers[_X[side]], numbers[_Y[side]] = d["x"], d["y"]
            numbers[_Z[side]], numbers[_VZ[side]] = lane(places, x + 2), lane(v, x + 2)


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
    received, size = d["received"], force_queue.shape[1]
    force_queue[side, _slot(received, size)] = numbers[_FORCE[side]]
    d["received"] = received + 1
    sent = commanded_tick(received, size - 1, words[_TRIAL], catch)
    d["commanded"] = force_queue[side, _slot(sent, size)] if is_active(words[_PHASE]) else 0.0
    return float(d["commanded"])


@inlined
def _slot(number: int, size: int) -> int:
    """Return the slot of a tick in a queue; without a delay there is one, and a remainder takes long."""
    return number % size if size > 1 else 0


@inlined
def plan(bodies: Records, moves: Records, count: int) -> None:
    """Begin the first ``count`` of these `netboard.participants.people.controller.MOVE` records."""
    for k in range(count):
        move = moves[k]
        hand, course = bodies[move["side"]]["hand"], bodies[move["side"]]["submovements"]
        under_way = hand["moves"]
        if under_way == CAPACITY:
            raise ValueError("a simulated hand has too many submovements under way")
        course[under_way, 0], course[under_way, 1] = move["start"], move["duration"]
        course[under_way, 2] = move["displacement"]
        hand["moves"] = under_way + 1


def pack_body(
    config: Config, side: Side, person: Participant | None, rng: np.random.Generator, bodies: NDArray[Any]
) -> None:
    """Put a hand on its device, in the record of its side.

    ``person``: the participant whose hand it is; None for a stylus that is held still at height 0.
    """
    refuse_flaws(config)
    device_model = resolved(config.virtual)
    hand, body = make_hand(person or config.participant, config.virtual, rng), bodies[SIDES.index(side)]
    body["hand"], body["tip"], body["arm"] = hand.state[0], hand.end[0], hand.arm[0]
    body["rigid"] = len(hand.cables) == 0
    if len(hand.cables):
        body["cables"] = hand.cables[0]
    device = body["device"]
    device["k"], device["c"] = config.fixture.stiffness, config.fixture.damping
    device["limit"] = min(device_model.max_force, config.safety.max_force)
    device["resolution"], device["simulated"] = device_model.resolution, person is not None


class Body:
    """One hand on one device, by itself: that of a robot partner. ``person``: as in `pack_body`."""

    def __init__(self, config: Config, side: Side, person: Participant | None, rng: np.random.Generator) -> None:
        self.bodies = np.zeros(len(SIDES), BODY)
        self._place = SIDES.index(side)
        pack_body(config, side, person, rng, self.bodies)
        self._force_queue = np.zeros((len(SIDES), config.block.force_delay_ms + 1))
        self._catch = pack_rendering(config)["catch"][0].copy()
        self._readings = np.zeros(1, READINGS)[0]

    @property
    def commanded(self) -> float:
        """Vertical force on the hand that acts next [N]."""
        return float(self.bodies["device"]["commanded"][self._place])

    def warm(self) -> None:
        """Compile or load the kernels by running a tick of this body, which changes its state."""
        words = np.zeros(len(TICK_WORDS), np.int64)
        self.fill(words)
        self.apply_force(words)

    def fill(self, words: NDArray[np.int64]) -> None:
        """Advance by a millisecond, and put the stylus into a tick's row."""
        numbers = words.view(np.float64)
        sides = self._place, self._place + 1
        advance(self.bodies, *sides, words, numbers)
        read(self.bodies, *sides, self._readings, words, numbers)

    def apply_force(self, words: NDArray[np.int64]) -> float:
        """Take the force of a tick; return the vertical force that acts next [N]."""
        numbers = words.view(np.float64)
        return apply_force(self.bodies, self._place, self._force_queue, self._catch, words, numbers)


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
                f"[virtual] {key}: found {value:g}, expected 0: a rehearsal and a robot partner have motors that stay "
                "cool and devices that answer at once (only agents with virtual devices have the others)"
            )
