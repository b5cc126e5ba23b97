"""Episodes of stutter, and what the stamps show of each: the evidence from which `causes` names the cause.

A tick stutters if it began too late, if a side had no new sample for it, or if it closed a loop that took a tick longer
than usual. Ticks that stutter in the same way within `JOIN_TICKS` of each other are one episode. A deadline miss makes
samples miss their tick, and both make loops long, so an episode takes in what follows it within `AFTER_TICKS`. The
first deadline miss of an episode shows its cause; without one, the missing sample does, or the longest part of a loop.

An agent makes up for missed milliseconds at once, and the newest sample wins, so the stamps in the ticks hide a stall
of an agent that has caught up. What the agent reports later (`/backfill`) shows it, for interruptions beyond 3 ms.
"""

from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, field, replace
from typing import Literal

import numpy as np

from netboard.base.config import SIDES, Side
from netboard.base.tick import TICK_NS
from netboard.network.protocol.records import (
    AGENT_JOINED,
    AGENT_PRESENT,
    BLOCK_BEGAN,
    DISPLAY_PRESENT,
    STAND_IN_CONFIRMED,
)
from netboard.recording.timing.stamps import UNKNOWN, Mask, SideStamps, Stamps, Times

JOIN_TICKS = 2
"""Ticks in order between two that stutter, at most, for both to belong to one episode [1]."""

AFTER_TICKS = 4
"""Ticks after an episode whose missing samples and long loops are its consequence [1]."""

AWAY_TICKS = 100
"""Ticks without a new sample after which an agent counts as away [1]."""

SECOND_NS, TOLERANCE_NS = 1_000_000_000, 50_000_000
"""Period of the kernel's real-time throttle, and how exactly stalls must keep it [ns]."""

MIN_EXCESS_NS = TICK_NS // 4
"""Smallest excess over an agent's interval that counts as a stall of the agent [ns]."""

LONG_AGO = 2**31
"""Ticks since an event that is not recorded [1]."""

LOADS = {BLOCK_BEGAN: 0, AGENT_JOINED: 20}
"""Events with which agents load a block, and how many ticks later than that they are recorded, at most [1]."""

_NOT_CAUSES = frozenset(
    {"stood_still", BLOCK_BEGAN, AGENT_PRESENT, DISPLAY_PRESENT, STAND_IN_CONFIRMED, "session_started"}
)

AgentState = Literal["late", "on time", "unknown"]
Part = Literal["up", "wait", "back", ""]


@dataclass(frozen=True, slots=True)
class EpisodeEvidence:
    """What the stamps show of an episode; times that do not apply are 0."""

    first: int  # row of the first tick that stutters
    last: int  # row of the last one
    is_late: bool = False
    late_ns: int = 0  # largest lateness of a tick, with the deadlines that the server moved
    agents: Mapping[Side, AgentState] = field(default_factory=dict)  # whether agents sampled on time meanwhile
    repeats_each_second: bool = False
    events: tuple[str, ...] = ()  # recorded by the server between the last tick in time and the first late one
    load_age: int = LONG_AGO  # ticks since a block began, or an agent joined
    away: bool = False
    missing: Side | None = None  # the side whose sample was missing, the one that was later
    out_of_step: bool = False  # it missed its tick by less than the usual lead of samples
    both_missing: bool = False  # the other side's sample was missing too, for at least half as long
    missing_ns: int = 0  # how much later than usual its next sample arrived
    read_late_ns: int = 0  # how much of that was read late
    loop: Side | None = None  # the side with the longest loop
    loop_ns: int = 0
    longest_part: Part = ""  # part of that loop that was longest beyond the usual

    @property
    def side(self) -> str:
        """Side that the episode concerns; empty for both."""
        return "" if self.is_late or self.both_missing else self.missing or self.loop or ""

    @property
    def size_ns(self) -> int:
        """How bad it was: lateness of the tick or of the sample, or the latency of the loop [ns]."""
        return self.late_ns if self.is_late else self.missing_ns if self.missing else self.loop_ns


@dataclass(frozen=True, slots=True)
class TypicalTimes:
    """Medians of one side [ns]."""

    early_ns: float
    up_ns: float
    wait_ns: float
    back_ns: float
    loop_ns: float


def usual(stamps: Stamps, side: SideStamps) -> TypicalTimes:
    """Return the medians of the times of a side."""
    known = side.rendered_ns != UNKNOWN
    began_ns = stamps.began_ns
    times = {
        "early_ns": (stamps.due_ns - stamps.moved_ns - side.arrived_ns)[side.fresh],
        "up_ns": (side.arrived_ns - side.read_ns)[side.fresh],
        "wait_ns": (began_ns - side.arrived_ns)[side.fresh],
        "back_ns": (side.rendered_ns - began_ns)[known],
        "loop_ns": side.loop_ns[side.loop_ns > 0],
    }
    return TypicalTimes(**{name: float(np.median(each)) if each.size else 0.0 for name, each in times.items()})


def episodes(stamps: Stamps, limit_ns: int) -> list[EpisodeEvidence]:
    """Return all episodes in order. ``limit_ns``: a tick that begins later than this stutters [ns]."""
    found: list[EpisodeEvidence] = []
    late = stamps.late_ns > limit_ns
    medians = {side: usual(stamps, stamps.sides[side]) for side in SIDES}
    stale = {side: _stale(stamps, stamps.sides[side]) for side in SIDES}
    slow = {side: stamps.sides[side].loop_ns > medians[side].loop_ns + TICK_NS for side in SIDES}
    for side in SIDES:
        long = [(first, last) for first, last in runs(stale[side], 0) if last - first >= AWAY_TICKS]
        for first, last in long:
            found.append(EpisodeEvidence(first, last, away=True, missing=side, missing_ns=(last - first + 1) * TICK_NS))
            _clear((stale[side], slow[side]), first, last)
    stalls_ns = stamps.due_ns[late & (stamps.moved_ns > 0)]
    for first, last in runs(late, JOIN_TICKS):
        found.append(_late(stamps, first, last, stalls_ns))
        _clear((*stale.values(), *slow.values()), first, last)
    for first, last in runs(stale["left"] | stale["right"], JOIN_TICKS):
        found.append(_missing(stamps, first, last, stale, medians))
        _clear(slow.values(), first, last)
    for first, last in runs(slow["left"] | slow["right"], JOIN_TICKS):
        found.append(_slow(stamps, first, last, slow, medians))
    ages = _load_ages(stamps)
    return sorted((replace(one, load_age=int(ages[one.first])) for one in found), key=lambda one: one.first)


def _clear(masks: Iterable[Mask], first: int, last: int) -> None:
    """Remove the consequences of an episode from masks: what stutters just before and shortly after it."""
    for mask in masks:
        mask[max(first - 1, 0) : last + 1 + AFTER_TICKS] = False


def _load_ages(stamps: Stamps) -> Times:
    """Return the ticks since a block began or an agent joined, at every tick; many before the first time."""
    loads = [event.tick - LOADS[event.name] for event in stamps.events if event.name in LOADS]
    begins = np.sort(np.array([-LONG_AGO, *loads]))
    ages: Times = stamps.tick - begins[np.searchsorted(begins, stamps.tick, side="right") - 1]
    return ages


def _stale(stamps: Stamps, side: SideStamps) -> Mask:
    """Return the ticks that had no new sample of a side although its agent was there.

    Without the last ones, if the recording does not show when the next sample came.
    """
    stale = (side.seq >= 0) & ~side.fresh & stamps.follows
    rest = int(np.argmax(side.fresh[::-1]))
    if rest < AWAY_TICKS:
        stale[stale.size - rest :] = False
    return stale


def runs(mask: Mask, join: int) -> Iterator[tuple[int, int]]:
    """Yield first and last index of the runs in a mask; runs at most `join` apart are one."""
    where = np.flatnonzero(mask)
    if where.size:
        cuts = np.flatnonzero(np.diff(where) > join + 1)
        firsts, lasts = where[np.append(0, cuts + 1)], where[np.append(cuts, where.size - 1)]
        yield from zip(firsts.tolist(), lasts.tolist(), strict=True)


def _late(stamps: Stamps, first: int, last: int, stalls_ns: Times) -> EpisodeEvidence:
    """Return the evidence of an episode of deadline misses."""
    began_ns, due_ns = stamps.began_ns, stamps.due_ns[first] - stamps.moved_ns[first]
    size_ns = int(stamps.late_ns[first : last + 1].max())
    before_ns = max(began_ns[max(first - 1, 0)], due_ns - TICK_NS)
    distance_ns = np.abs(stalls_ns - stamps.due_ns[first])
    return EpisodeEvidence(
        first,
        last,
        is_late=True,
        late_ns=size_ns,
        agents={side: _agent(stamps.sides[side], first, last, due_ns, int(began_ns[first])) for side in SIDES},
        repeats_each_second=bool(np.any(np.abs(distance_ns - SECOND_NS) < TOLERANCE_NS)),
        events=tuple(
            event.name
            for event in stamps.events
            if before_ns < event.time_ns <= began_ns[first] and event.name not in _NOT_CAUSES
        ),
    )


def _agent(side: SideStamps, first: int, last: int, due_ns: int, began_ns: int) -> AgentState:
    """Return whether an agent sampled on time while the server was late."""
    if first == 0 or side.seq[first - 1] < 0:
        return "unknown"
    excess_ns = int(side.excess_ns[first : last + AFTER_TICKS].max())
    if excess_ns > max(MIN_EXCESS_NS, (began_ns - due_ns) // 3):
        return "late"
    next_ns = side.read_ns[first - 1] + TICK_NS
    was_due = next_ns + max(0, -(-(due_ns - next_ns) // TICK_NS)) * TICK_NS < began_ns
    return "on time" if was_due else "unknown"


def _missing(
    stamps: Stamps, first: int, last: int, stale: Mapping[Side, Mask], medians: Mapping[Side, TypicalTimes]
) -> EpisodeEvidence:
    """Return the evidence of an episode with missing samples: of the side that was later."""
    found: list[tuple[int, int, Side]] = []
    for name in SIDES:
        side = stamps.sides[name]
        for begin, end in runs(stale[name][first : last + 1], 0):
            before, after = first + begin - 1, min(first + end + 1, side.seq.size - 1)
            if side.seq[after] <= side.seq[before]:
                return EpisodeEvidence(first, last, away=True, missing=name, missing_ns=(end - begin + 1) * TICK_NS)
            expected_ns = side.read_ns[before] + TICK_NS + medians[name].up_ns
            total_ns = int(side.arrived_ns[after] - expected_ns)
            found.append((total_ns, side.late_reading(before, after), name))
    total_ns, read_ns, name = max(found)
    both = any(other != name and 2 * other_ns >= total_ns for other_ns, _, other in found)
    return EpisodeEvidence(
        first,
        last,
        missing=name,
        both_missing=both,
        out_of_step=total_ns < medians[name].early_ns,
        missing_ns=max(total_ns, 0),
        read_late_ns=read_ns,
    )


def _slow(
    stamps: Stamps, first: int, last: int, slow: Mapping[Side, Mask], medians: Mapping[Side, TypicalTimes]
) -> EpisodeEvidence:
    """Return the evidence of an episode with long loops only."""
    rows = slice(first, last + 1)
    name = max(SIDES, key=lambda side: int(np.where(slow[side][rows], stamps.sides[side].loop_ns[rows], 0).max()))
    side, typical = stamps.sides[name], medians[name]
    reported_at = first + int(np.argmax(np.where(slow[name][rows], side.loop_ns[rows], 0)))
    sample = max(reported_at - 1, 0)
    while sample > 0 and not side.fresh[sample]:
        sample -= 1
    parts: dict[Part, float] = {"back": float(side.loop_ns[reported_at]) - typical.loop_ns}
    if side.rendered_ns[sample] != UNKNOWN:
        began_ns = stamps.began_ns[sample]
        parts = {
            "up": side.arrived_ns[sample] - side.read_ns[sample] - typical.up_ns,
            "wait": began_ns - side.arrived_ns[sample] - typical.wait_ns,
            "back": side.rendered_ns[sample] - began_ns - typical.back_ns,
        }
    longest = max(parts, key=lambda part: parts[part])
    return EpisodeEvidence(first, last, loop=name, loop_ns=int(side.loop_ns[reported_at]), longest_part=longest)
