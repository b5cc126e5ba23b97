"""A simulated hand on its virtual device, a tick at a time: what its agent would send the server.

Its milliseconds are those of an agent that follows the server's ticks: the stylus is read `LEAD_NS` before the deadline
of a tick, and the force computed in that tick acts from the deadline on. Hand, encoder, velocity, fixture and the
motors' limit follow the equations of `netboard.devices.simulated.virtual` and the agent. A tick is one kernel. Of the
safety chain only the clamp is simulated: nothing else that it guards against happens here, so an armed chain passes the
force on. Motors do not heat up, and no step takes time.
"""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from netboard.base.compiled import kernel
from netboard.base.config import SIDES, Config, Side
from netboard.base.errors import ConfigError
from netboard.base.tables.simulated import Participant
from netboard.base.tick import TICK, TICK_NS
from netboard.devices.contract.velocity import SAMPLES, SLACK, taken
from netboard.devices.safety.fixture import drawn_in
from netboard.devices.simulated.virtual import encoded, within
from netboard.network.protocol.motion import Safeguard
from netboard.participants.cable import CABLES
from netboard.participants.device_models import resolved
from netboard.participants.hand import CAPACITY, STEP, STEP_NS, hold, swing, swing_on_cables
from netboard.task.trials.state_machine import is_active

LEAD_NS = STEP_NS
"""Time from the reading of the stylus to the deadline of its tick [ns]."""

STEPS = TICK_NS // STEP_NS
"""Steps of the hand in a tick [1]."""

_BEFORE = LEAD_NS // STEP_NS
"""Those of them in which the force of the tick before still acts [1]."""

_ARMED, _CLAMPED = int(Safeguard.ARMED), int(Safeguard.CLAMPED)

_AT = {name: place for place, name in enumerate(TICK.names or ())}
_TICK, _TIME, _PHASE = _AT["tick"], _AT["time_ns"], _AT["phase"]


def _places(field: str) -> tuple[int, int]:
    """Return where a row has a field of the left and of the right side."""
    return _AT[f"{SIDES[0]}_{field}"], _AT[f"{SIDES[1]}_{field}"]


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
        ("wanted", "<f8"),  # vertical force to act next [N]
        ("count", "<i8"),  # positions from which the velocity is computed [1]
        ("told", "<i8"),  # forces received [1]
        ("held", "<i8"),  # 0: nobody moves it, it is at rest at height 0
    ]
)
"""A device as the kernels see it."""


@kernel
def _live(body: Any, white: NDArray[np.float64], origin: float, force: tuple[float, float, float]) -> None:
    """Integrate a hand for some steps under a constant force."""
    hand, end, arm, cables, course = body[:5]
    if len(cables) == 0:
        swing(hand, arm, course, origin, force[0], force[1], force[2], white)
    else:
        swing_on_cables(hand, end, arm, cables, course, origin, force[0], force[1], force[2], white)


@kernel
def fill(body: Any, side: int, white: NDArray[np.float64], words: Any, numbers: Any) -> None:
    """Integrate from the last reading to that of this tick, and put the reading into the tick's row.

    Parameters
    ----------
    words : ndarray of int64, shape (n,)
        The row as words; its ``tick`` and ``time_ns`` are set, ``time_ns`` one tick after that of the row before.
    """
    hand, _, _, _, _, device, stamps, places, _ = body
    d = device[0]
    stamp_ns = words[_TIME] - LEAD_NS
    words[_LIVE[side]], words[_SEQ[side]], words[_STAMP[side]] = 1, words[_TICK], stamp_ns
    words[_GUARDS[side]], words[_LEAD[side]] = _ARMED, LEAD_NS
    numbers[_RENDERED[side]] = 0.0
    if d["held"] == 0:
        return
    origin = (stamp_ns - TICK_NS) * 1e-9
    _live(body, white[:_BEFORE], origin, (d["fx"], d["fy"], d["fz"]))
    fx, fy = drawn_in(d["k"], d["c"], d["x"], d["vx"]), drawn_in(d["k"], d["c"], d["y"], d["vy"])
    force = within(d["limit"], fx, fy, d["wanted"])
    d["fx"], d["fy"], d["fz"] = force
    _live(body, white[_BEFORE:], origin + _BEFORE * STEP, force)
    x, y, z = encoded(hand, 0.0, d["resolution"])
    count, vx, vy, vz = taken(stamps, places, d["count"], SLACK * d["resolution"], stamp_ns, (x, y, z))
    d["count"], d["x"], d["y"], d["vx"], d["vy"] = count, x, y, vx, vy
    numbers[_Z[side]], numbers[_VZ[side]], numbers[_X[side]], numbers[_Y[side]] = z, vz, x, y
    numbers[_RENDERED[side]], words[_LOOP[side]] = force[2], LEAD_NS
    if force[2] != d["wanted"]:
        words[_GUARDS[side]] = _ARMED | _CLAMPED


@kernel
def tell(body: Any, side: int, words: Any, numbers: Any) -> float:
    """Give a body the force of a tick; if the block has a force delay, an earlier tick's.

    Returns
    -------
    float
        Vertical force on the hand that acts next, zero unless a trial is running [N].
    """
    d, coming = body[5][0], body[8]
    place, size = d["told"], len(coming)
    coming[place % size] = numbers[_FORCE[side]]
    d["told"] = place + 1
    d["wanted"] = coming[(place + 1) % size] if is_active(words[_PHASE]) else 0.0
    return float(d["wanted"])


@kernel
def plan(bodies: Any, moves: Any) -> None:
    """Begin new movements of both hands.

    Parameters
    ----------
    bodies : tuple of tuple
        Parts of the left and of the right `Body`.
    moves : ndarray of netboard.participants.controller.MOVE, shape (n,)
        The movements.
    """
    for k in range(len(moves)):
        move = moves[k]
        hand, course = bodies[move["side"]][0], bodies[move["side"]][4]
        under_way = hand[0]["moves"]
        if under_way == CAPACITY:
            raise ValueError("a simulated hand has too many submovements under way")
        course[under_way, 0], course[under_way, 1] = move["start"], move["duration"]
        course[under_way, 2] = move["displacement"]
        hand[0]["moves"] = under_way + 1


class Body:
    """One hand on one device.

    Parameters
    ----------
    config : Config
        Rig and experiment; of the rig, the simulated device, the fixture and the largest force count.
    person : Participant or None
        The participant whose hand it is; None for a stylus that is held still at height 0.
    """

    def __init__(self, config: Config, side: Side, person: Participant | None, rng: np.random.Generator) -> None:
        refuse_flaws(config)
        own = resolved(config.virtual)
        self._place = SIDES.index(side)
        self._hand = hold(person or config.participant, config.virtual, rng)
        hand, device = self._hand, np.zeros(1, _DEVICE)
        device["k"], device["c"] = config.fixture.stiffness, config.fixture.damping
        device["limit"] = min(own.max_force, config.safety.max_force)
        device["resolution"], device["held"] = own.resolution, person is not None
        self._device = device[0]
        cables = np.zeros(0, CABLES) if hand.cables is None else hand.cables
        stamps, places = np.zeros(SAMPLES, np.int64), np.zeros((3, SAMPLES))
        coming = np.zeros(config.block.force_delay_ms + 1)
        self.parts = (hand.state, hand.end, hand.arm, cables, hand.course, device, stamps, places, coming)

    @property
    def wanted(self) -> float:
        """Vertical force on the hand that acts next [N]."""
        return float(self._device["wanted"])

    def warm(self) -> None:
        """Compile or load the kernels by running a tick of this body, which changes its state."""
        words = np.zeros(len(_AT), np.int64)
        self.fill(words)
        self.tell(words)

    def noise(self, ticks: int) -> NDArray[np.float64]:
        """Return the random drive of the tremor in the next ticks."""
        return self._hand.noise(ticks * STEPS)

    def fill(self, words: NDArray[np.int64]) -> None:
        """Advance by a millisecond, and put the stylus into a tick's row."""
        fill(self.parts, self._place, self.noise(1), words, words.view(np.float64))

    def tell(self, words: NDArray[np.int64]) -> float:
        """Take the force of a tick; return the vertical force that acts next [N]."""
        return tell(self.parts, self._place, words, words.view(np.float64))


def refuse_flaws(config: Config) -> None:
    """Refuse device faults that a rehearsal does not simulate."""
    virtual, own = config.virtual, resolved(config.virtual)
    flaws = {
        "thermal_time": own.thermal_time,
        "read_latency_ms": virtual.read_latency_ms,
        "write_latency_ms": virtual.write_latency_ms,
    }
    for key, value in flaws.items():
        if value > 0.0:
            raise ConfigError(
                f"[virtual] {key}: found {value:g}, expected 0: a rehearsal and a robot partner have motors that stay "
                "cool and devices that answer at once (only agents with virtual devices have the others)"
            )
