"""The server's state of both agents, as rows of 64-bit words that compiled code reads and writes.

A row holds an agent's newest sample and the state of its link. All work of 1000 times a second (receiving samples,
filling the row of a tick, sending forces) is compiled here: in a loop that sleeps most of the time, Python code takes
four times as long as in a benchmark, because it finds cold caches.

Times in a sample are on the agent's clock, such as its `AGENT_STAMP`; `SERVER_STAMP` is the same in server time.
"""

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from netboard.base.compiled import Records, inlined, kernel
from netboard.base.config import SIDES
from netboard.base.safeguards import TRIP_CAUSES, Safeguard
from netboard.base.tables.scene import Physics
from netboard.base.tick import KNOWN_NS, TICK_WORDS
from netboard.network.protocol import fixed
from netboard.network.protocol.motion import Force, Heartbeat, Point, Stylus
from netboard.network.transport import fastpath, sockets
from netboard.nodes.ports.unregistered import UNREGISTERED, keep
from netboard.physics.arithmetic.trig import sincos
from netboard.stage.styluses import MAX_STYLUS_HEIGHT

MAX_STAMP_NS = 2**60
"""Stamps beyond this (36 years) are invalid; arithmetic with them could overflow 64 bits [ns]."""

MAX_SEQ = 2**60
"""Numbers of samples beyond this are invalid, for the same reason [1]."""

_LINK_FIELDS = (
    "arrived_ns",  # arrival of the newest sample [ns]
    "server_stamp_ns",  # its stamp in server time [ns]
    "lead_ns",  # time from its arrival to the deadline of its tick [ns]
    "gathered",  # safeguards of all samples since the last tick
    "fresh",  # 1: it arrived since the last tick
    "punctual",  # 1: the last tick had a fresh sample
    "taken",  # number of samples taken
    "missing",  # number of sequence numbers skipped
    "stale",  # number of samples rejected: repeated or overtaken
    "offset_ns",  # agent's clock minus the server's [ns]
    "clock_known",  # 1: that offset is known
    "tripped",  # safeguards of the last tick that are reported as events
    "transit_ns",  # half the shortest recent round trip: transit time [ns]
    "person",  # 1: its hand is a person's, who gets the forces
    "arm",  # 1: its device may be armed
)
"""Fields that the server adds to a sample: the state of the link."""

AGENT = np.dtype([*fixed.fields_of(Stylus), *((name, "<i8") for name in _LINK_FIELDS)])
"""The row of an agent. Every field is one word; those of the sample come first, in the order of `Stylus`."""

WORDS = len(AGENT.names or ())
SAMPLE_WORDS = WORDS - len(_LINK_FIELDS)
_WORD = {name: place for place, name in enumerate(AGENT.names or ())}

# Plain integers, which numba folds into the kernels below as constants.
SEQ, FORCE_TICK, FORCE_SENT, FORCE_RECEIVED, SENT = (
    _WORD[name] for name in ("seq", "force_tick", "force_sent_ns", "force_received_ns", "sent_ns")
)
ARRIVED, SERVER_STAMP, LEAD, GATHERED, FRESH, PUNCTUAL = (_WORD[name] for name in _LINK_FIELDS[:6])
TAKEN, MISSING, STALE, OFFSET, CLOCK_KNOWN, _TRIPPED, TRANSIT, PERSON, ARM = (_WORD[name] for name in _LINK_FIELDS[6:])
AGENT_STAMP, _Z, _VZ, SAFEGUARDS = (_WORD[name] for name in ("stamp_ns", "z", "vz", "safeguards"))
LOOP = _WORD["loop_ns"]
ARMED_BIT = int(Safeguard.ARMED)
_STOPPED_BIT = int(Safeguard.STOPPED)
_TRIP_BITS = sum(map(int, TRIP_CAUSES))

# Words of the messages to agents: the first ones of each, then those of each kind.
_TO_TICK, _TO_SENT, _TO_SEQ = fixed.places_of(Force, "tick", "sent_ns", "stylus_seq")
_COMMANDED, _FORCE_LEAD = fixed.places_of(Force, "force", "lead_ns")
_END_STAMP, _END_Z, _END_VZ = fixed.places_of(Point, "stamp_ns", "z", "vz")
_STIFFNESS, _DAMPING, _POINT_LEAD = fixed.places_of(Point, "k", "c", "lead_ns")
_BEAT_LEAD, _MAY_ARM = fixed.places_of(Heartbeat, "lead_ns", "arm")

_COPIED = {
    "seq": "seq",
    "stamp_ns": "server_stamp_ns",
    "sent_z": "z",
    "sent_vz": "vz",
    "x": "x",
    "y": "y",
    "rendered": "rendered",
    "safeguards": "gathered",
    "buttons": "buttons",
    "loop_ns": "loop_ns",
    "lead_ns": "lead_ns",
}
"""Fields of a row, without their side, and the fields of the agent's row from which they are filled."""

_COPIED_FROM = np.array([_WORD[name] for name in _COPIED.values()])
_COPIED_TO = np.array([[TICK_WORDS[f"{side}_{name}"] for name in _COPIED] for side in SIDES])
_LIVE = np.array([TICK_WORDS[f"{side}_live"] for side in SIDES])
_RENDERED = np.array([TICK_WORDS[f"{side}_rendered"] for side in SIDES])
_ROW_FORCE = np.array([TICK_WORDS[f"{side}_force"] for side in SIDES])
_TICK, _TIME, _LATE = TICK_WORDS["tick"], TICK_WORDS["time_ns"], TICK_WORDS["late_ns"]
_BOARD_Z, _BOARD_VZ, _THETA, _OMEGA = (TICK_WORDS[name] for name in ("z", "vz", "theta", "omega"))

MAX_FRAMES = 64
"""Frames taken at once, so that no sender can hold up a tick [1]."""

MAX_LEAD_NS = 600_000
"""A sample that arrived longer before the deadline is followed by another one in time [ns]."""

POLL_TIMEOUT_NS = 40_000
"""Time for which the second sample of a tick is polled for; sleeping would take longer [ns]."""

MORE, OTHER, FAILED = 4, 8, 16
"""Bits that `drain` returns beside 1 and 2, the sides from which a sample has arrived."""

FRAMES = 32
"""Value that `drain` adds to its result for each frame taken."""

UNREGISTERED_BATCH = 8
"""Frames of unregistered peers taken at once while no sample is awaited [1]."""

LIVE, ARMED, STOPPED, TRIPPED = 1, 4, 16, 64
"""Bits that `fill` returns for the left side; the right side's are twice as large."""

BOTH = 3
"""Both sides: the sum of 1 for the left and 2 for the right one."""


class MotionChannel(NamedTuple):
    """The motion channel as compiled code sees it: the socket, both agents, and buffers."""

    fast: Any  # the socket: record of `netboard.network.transport.fastpath.FastPath`
    agents: Any  # the rows of both sides
    frame: Any  # bytes of the frame that arrived last
    sample: Any  # words of the sample that arrived last
    unregistered: Any  # frames of unregistered peers: record of `UNREGISTERED`
    sent: Any  # bytes of the frame that is sent
    words: Any  # its words


def motion_of(fast: Records) -> MotionChannel:
    """Return the motion channel of a socket, without agents."""
    agents = np.zeros((len(SIDES), WORDS), np.int64)
    for agent in agents:
        empty(agent)
    frame, sample = np.zeros(sockets.MAX_SAMPLE, np.uint8), np.zeros(SAMPLE_WORDS, np.int64)
    sent, words = np.zeros(fixed.POINT.size, np.uint8), np.zeros(len(fixed.POINT.markers), np.int64)  # the longest
    return MotionChannel(fast, agents, frame, sample, np.zeros(1, UNREGISTERED), sent, words)


@kernel
def empty(agent: NDArray[np.int64]) -> None:
    """Reset a row, for another agent or none."""
    for k in range(len(agent)):
        agent[k] = 0
    agent[SEQ] = -1


@kernel
def take(agent: NDArray[np.int64], sample: NDArray[np.int64], now_ns: int, due_ns: int) -> bool:
    """Take a sample if it is the newest; return False if it is older, or (not counted) its numbers are invalid."""
    seq, newest = sample[SEQ], agent[SEQ]
    if seq > MAX_SEQ:
        return False
    for k in (AGENT_STAMP, FORCE_SENT, FORCE_RECEIVED, SENT):
        if not -MAX_STAMP_NS <= sample[k] <= MAX_STAMP_NS:
            return False
    if seq <= newest:
        agent[STALE] += 1
        return False
    if agent[TAKEN] > 0:  # what came before the agent was registered is not missing
        agent[MISSING] += seq - newest - 1
    for k in range(SAMPLE_WORDS):
        agent[k] = sample[k]
    agent[TAKEN] += 1
    agent[ARRIVED] = now_ns
    agent[SERVER_STAMP] = agent[AGENT_STAMP] - agent[OFFSET] if agent[CLOCK_KNOWN] else now_ns
    agent[LEAD] = due_ns - now_ns
    agent[GATHERED] |= agent[SAFEGUARDS]
    agent[FRESH] = 1
    return True


@kernel
def take_frame(
    agent: NDArray[np.int64], frame: NDArray[np.uint8], sample: NDArray[np.int64], now_ns: int, due_ns: int
) -> int:
    """Take a fixed-form sample; return -1 if the frame is anything else, else whether the sample was taken."""
    if not fixed.read(frame, fixed.STYLUS, sample):
        return -1
    return 1 if take(agent, sample, now_ns, due_ns) else 0


@kernel
def awaited(agents: NDArray[np.int64]) -> bool:
    """Return whether a sample is still expected, so that a tick should wait for its deadline.

    It is if a side that was on time at the last tick has not sent one yet, or if no side has. A sample that
    arrived long before the deadline just missed the tick before, and the next one will come in time: a tick that did
    not wait for it would just miss that one too, and so on.
    """
    fresh = 0
    for place in range(2):
        came = agents[place, FRESH] and agents[place, LEAD] <= MAX_LEAD_NS
        fresh += came
        if agents[place, PUNCTUAL] and not came:
            return True
    return fresh == 0


@kernel
def drain(motion: MotionChannel, due_ns: int, eager: bool, most: int) -> int:
    """Take the samples that have arrived, at most ``most`` frames; if ``eager``, only until a tick can begin.

    Each sample gets its own arrival time, because one that arrives during the call must not seem to arrive before it
    was sent. Frames of unregistered peers are kept for later.

    Returns 1 and 2 for a sample taken from the left and right side, `MORE` if there may be more to take, `OTHER` if the
    last frame is a registered agent's but no fixed-form sample, `FAILED`, and `FRAMES` for each frame.
    """
    fast, agents = motion.fast, motion.agents
    found = frames = from_unregistered = give_up_ns = 0
    while frames < most and (from_unregistered < UNREGISTERED_BATCH or awaited(agents)):
        place = fastpath.receive(fast, motion.frame)
        if place == fastpath.NOTHING:
            if fastpath.now_ns(fast) < give_up_ns:
                continue
            return found + frames * FRAMES
        if place == fastpath.FAILED:
            return found + frames * FRAMES + FAILED
        frames += 1
        now_ns = fastpath.now_ns(fast)
        if place < 0:
            keep(motion.unregistered, fast, motion.frame, now_ns)
            from_unregistered += 1
            continue
        frame = motion.frame[: fast[0]["size"]]
        taken = take_frame(agents[place], frame, motion.sample, now_ns, due_ns)
        if taken < 0:
            return found + frames * FRAMES + OTHER
        found |= taken << place
        if eager and not awaited(agents):
            break
        if eager and give_up_ns == 0:
            give_up_ns = now_ns + POLL_TIMEOUT_NS
    return found + frames * FRAMES + MORE


@kernel
def fill(
    row: NDArray[np.int64], agents: NDArray[np.int64], number: int, due_ns: int, late_ns: int, timeout_ns: int
) -> int:
    """Begin the row of a tick with the newest samples; return which sides are live, armed, stopped or newly tripped.

    The rendered force is NaN where the newest sample is too old or too new to be valid.

    Returns the sum of `LIVE`, `ARMED`, `STOPPED` and `TRIPPED` for the left side, and twice that for the right one.
    """
    for k in range(len(row)):
        row[k] = 0
    row[_TICK], row[_TIME], row[_LATE] = number, due_ns, late_ns
    found = 0
    values, numbers = agents.view(np.float64), row.view(np.float64)
    for place in range(2):
        agent = agents[place]
        for k in range(len(_COPIED_FROM)):
            row[_COPIED_TO[place, k]] = agent[_COPIED_FROM[k]]
        possible = abs(values[place, _Z]) <= MAX_STYLUS_HEIGHT and np.isfinite(values[place, _VZ])
        # A sample that was held up on the way arrives now with an old stamp; one from the future has a wrong clock.
        in_time = due_ns - agent[ARRIVED] < timeout_ns and abs(due_ns - agent[SERVER_STAMP]) < timeout_ns
        if agent[TAKEN] > 0 and possible and in_time:
            row[_LIVE[place]] = 1
            found |= LIVE << place
        old = due_ns - agent[SERVER_STAMP] - agent[TRANSIT] > KNOWN_NS or abs(due_ns - agent[ARRIVED]) > KNOWN_NS
        if agent[TAKEN] == 0 or not in_time or old:
            numbers[_RENDERED[place]] = np.nan
        if agent[SAFEGUARDS] & ARMED_BIT:
            found |= ARMED << place
        # Of all samples since the last tick: only one of them may report the stop.
        if agent[GATHERED] & _STOPPED_BIT:
            found |= STOPPED << place
        trips = agent[GATHERED] & _TRIP_BITS
        if trips & ~agent[_TRIPPED]:
            found |= TRIPPED << place
        # Without a new sample nothing was gathered; to store that would report the same trip again.
        if agent[FRESH]:
            agent[_TRIPPED] = trips
        agent[PUNCTUAL], agent[FRESH], agent[GATHERED] = agent[FRESH], 0, 0
    return found


def leave_out(row: NDArray[np.int64], place: int) -> None:
    """Clear what `fill` has written of a side whose connected device is not in use."""
    row[_COPIED_TO[place]] = 0


@kernel
def write_force(
    words: NDArray[np.int64],
    row: NDArray[np.int64],
    commanded: NDArray[np.int64],
    agents: NDArray[np.int64],
    gains: NDArray[np.float64],
    place: int,
    now_ns: int,
) -> None:
    """Fill in one side's `Force` of a tick.

    ``commanded``: words of the row with the commanded force (`netboard.stage.stage.Stage.commanded_row`).
    """
    words[_TO_TICK], words[_TO_SENT], words[_TO_SEQ] = row[_TICK], now_ns, agents[place, SEQ]
    words.view(np.float64)[_COMMANDED] = commanded.view(np.float64)[_ROW_FORCE[place]] * gains[place]
    words[_FORCE_LEAD] = agents[place, LEAD]


@kernel
def write_point(
    words: NDArray[np.int64],
    row: NDArray[np.int64],
    agents: NDArray[np.int64],
    gains: NDArray[np.float64],
    place: int,
    ends: NDArray[np.float64],
    now_ns: int,
) -> None:
    """Fill in one side's `Point` of a tick: position and velocity of its end of the board after the tick.

    ``ends``: for each side: board's centre to control point, + = right; stiffness and damping of the virtual coupling
    [SI].
    """
    values, numbers = row.view(np.float64), words.view(np.float64)
    s, c = sincos(values[_THETA])
    words[_TO_TICK], words[_TO_SENT], words[_TO_SEQ] = row[_TICK], now_ns, agents[place, SEQ]
    words[_END_STAMP] = row[_TIME] + agents[place, OFFSET] if agents[place, CLOCK_KNOWN] else 0
    numbers[_END_Z] = values[_BOARD_Z] + ends[place, 0] * s
    numbers[_END_VZ] = values[_BOARD_VZ] + ends[place, 0] * values[_OMEGA] * c
    numbers[_STIFFNESS], numbers[_DAMPING] = ends[place, 1] * gains[place], ends[place, 2] * gains[place]
    words[_POINT_LEAD] = agents[place, LEAD]


@kernel
def _has_person(fast: Records, agents: NDArray[np.int64], place: int) -> bool:
    """Return whether an agent is connected at a side whose hand is a person's."""
    return bool(fast[0]["name_sizes"][place] and agents[place, PERSON])


@inlined
def _send(motion: MotionChannel, form: fixed.FixedForm, place: int) -> int:
    """Send an agent the message in ``motion.words``."""
    frame = motion.sent[: form.size]
    fixed.write(frame, form, motion.words)
    return fastpath.send_to(motion.fast, place, frame)


@kernel
def send_forces(
    motion: MotionChannel, row: NDArray[np.int64], commanded: NDArray[np.int64], gains: NDArray[np.float64]
) -> int:
    """Send each connected side with a person its `Force` of a tick; the side that goes first alternates.

    ``commanded``: words of the row with the commanded force (`netboard.stage.stage.Stage.commanded_row`). Returns
    `netboard.network.transport.fastpath.FAILED` if the socket is unusable; a peer that does not take its force is no
    failure.
    """
    fast, agents, words = motion.fast, motion.agents, motion.words
    # ZeroMQ's thread takes the core at each send, so the second force leaves later: neither hand is always second.
    first = row[_TICK] & 1
    for turn in range(2):
        place = first ^ turn
        if not _has_person(fast, agents, place):
            continue
        write_force(words, row, commanded, agents, gains, place, fastpath.now_ns(fast))
        if _send(motion, fixed.FORCE, place) == fastpath.FAILED:
            return fastpath.FAILED
    return fastpath.SENT


@kernel
def send_points(
    motion: MotionChannel, row: NDArray[np.int64], gains: NDArray[np.float64], ends: NDArray[np.float64]
) -> int:
    """Send each live side its `Point` of a tick, as `send_forces` sends forces.

    A side without a valid sample gets nothing: its agent lets the force fade.

    ``ends``: for each side: board's centre to control point, + = right; stiffness and damping of the virtual coupling
    [SI]. Returns `netboard.network.transport.fastpath.FAILED` if the socket is unusable; a peer that does not take its
    point is no failure.
    """
    fast, agents, words = motion.fast, motion.agents, motion.words
    first = row[_TICK] & 1
    for turn in range(2):
        place = first ^ turn
        if not _has_person(fast, agents, place) or row[_LIVE[place]] == 0:
            continue
        write_point(words, row, agents, gains, place, ends, fastpath.now_ns(fast))
        if _send(motion, fixed.POINT, place) == fastpath.FAILED:
            return fastpath.FAILED
    return fastpath.SENT


@kernel
def send_heartbeats(motion: MotionChannel, tick: int, sides: int) -> int:
    """Send some connected sides a `Heartbeat`, which commands no force.

    ``sides``: the sum of 1 for the left and 2 for the right side. Returns `netboard.network.transport.fastpath.FAILED`
    if the socket is unusable; a peer that does not take its heartbeat is no failure.
    """
    fast, agents, words = motion.fast, motion.agents, motion.words
    for place in range(2):
        if fast[0]["name_sizes"][place] == 0 or not sides >> place & 1:
            continue
        words[_TO_TICK], words[_TO_SENT], words[_TO_SEQ] = tick, fastpath.now_ns(fast), agents[place, SEQ]
        words[_BEAT_LEAD], words[_MAY_ARM] = agents[place, LEAD], agents[place, ARM]
        if _send(motion, fixed.HEARTBEAT, place) == fastpath.FAILED:
            return fastpath.FAILED
    return fastpath.SENT


def ends_of(physics: Physics) -> Any:
    """Return the control points, stiffness and damping of the couplings, for `send_points`."""
    ends = np.zeros((2, 3))
    for end, side, arm in zip(ends, SIDES, (-physics.l, physics.l), strict=True):
        end[:] = (arm, physics.k_h, physics.c_h) if physics.coupling in (side, "both") else (arm, 0.0, 0.0)
    return ends
