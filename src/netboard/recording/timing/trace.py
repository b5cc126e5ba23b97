"""The trace of a recording: distributions of its times, and its episodes of stutter by cause, as tables and JSON."""

from collections.abc import Iterator
from dataclasses import asdict, dataclass
from math import isnan
from typing import Any

import numpy as np

from netboard.base.config import SIDES
from netboard.base.plural import plural
from netboard.base.terminal.output import FittedTable, numbers
from netboard.base.tick import TICK_NS
from netboard.recording.format.summary import DurationSpread, find_gaps, or_null, spread
from netboard.recording.timing.causes import CAUSES, StutterCause
from netboard.recording.timing.evidence import EpisodeEvidence, episodes
from netboard.recording.timing.stamps import UNKNOWN, Stamps

MS = 1e-6
"""Milliseconds in a nanosecond."""

GUIDE = "docs/how-to/real-time.md"


@dataclass(frozen=True, slots=True)
class Episode:
    """An episode of stutter and its cause."""

    cause: StutterCause
    evidence: EpisodeEvidence
    tick: int  # first tick that stutters
    ticks: int  # ticks from the first one that stutters to the last one
    time: float  # deadline of the first one since the first tick of the recording [s]
    trial: int  # number of the trial if the episode touches a running one, otherwise 0


@dataclass(frozen=True, slots=True)
class TimingTrace:
    """What a recording shows of its timing."""

    stamps: Stamps
    limit_ns: int
    spreads: dict[str, DurationSpread]
    episodes: tuple[Episode, ...]
    unrecorded: int  # ticks that are missing in the recording

    @property
    def missed(self) -> int:
        """Ticks that began too late, with those that the server skipped [1]."""
        late = int(np.count_nonzero(self.stamps.late_ns > self.limit_ns))
        return late + int(self.stamps.moved_ns.sum()) // TICK_NS

    @property
    def worst(self) -> tuple[Episode, ...]:
        """Episodes, those in trials first, then by size."""
        return tuple(sorted(self.episodes, key=lambda one: (not one.trial, -one.evidence.size_ns)))


def trace(stamps: Stamps, limit_ns: int) -> TimingTrace:
    """Trace a session. ``limit_ns``: a tick that begins later than this stutters [ns]."""
    found = tuple(_episode(stamps, one) for one in episodes(stamps, limit_ns))
    missing = sum(gap.count for gap in find_gaps(stamps.tick))
    return TimingTrace(stamps, limit_ns, dict(_spreads(stamps)), found, missing)


def _episode(stamps: Stamps, evidence: EpisodeEvidence) -> Episode:
    rows = slice(evidence.first, evidence.last + 1)
    playing = stamps.in_trial[rows]
    return Episode(
        cause=next(cause for cause in CAUSES if cause.holds(evidence)),
        evidence=evidence,
        tick=int(stamps.tick[evidence.first]),
        ticks=evidence.last - evidence.first + 1,
        time=float(stamps.due_ns[evidence.first] - stamps.due_ns[0]) * 1e-9,
        trial=int(stamps.trial[rows][np.argmax(playing)]) if playing.any() else 0,
    )


def _spreads(stamps: Stamps) -> Iterator[tuple[str, DurationSpread]]:
    """Yield the distributions of the times that make up a tick."""
    yield "tick begins after its deadline", spread(stamps.late_ns)
    for name in SIDES:
        side = stamps.sides[name]
        known = side.rendered_ns != UNKNOWN
        yield f"{name}: stylus read later than due", spread(side.excess_ns[side.fresh])
        yield f"{name}: read to arrival", spread((side.arrived_ns - side.read_ns)[side.fresh])
        yield f"{name}: arrival to tick", spread((stamps.began_ns - side.arrived_ns)[side.fresh])
        yield f"{name}: tick to rendered force", spread((side.rendered_ns - stamps.began_ns)[known])
        yield f"{name}: sample to force", spread(side.loop_ns[side.loop_ns > 0])


def spreads_table(found: TimingTrace) -> FittedTable:
    """Return the distributions of all times."""
    table = FittedTable("", *numbers("50 %", "99 %", "99.9 %", "largest"), title="Timing [ms]")
    for name, one in found.spreads.items():
        values = (one.p50, one.p99, one.p999, one.largest)
        table.add_row(name, *("-" if isnan(value) else f"{value * 1e3:.3f}" for value in values))
    return table


def grouped(found: TimingTrace) -> Iterator[tuple[StutterCause, str, list[Episode]]]:
    """Yield the episodes by cause and side, in the order of the causes."""
    for cause in CAUSES:
        by_cause = [one for one in found.episodes if one.cause is cause]
        for side in sorted({one.evidence.side for one in by_cause}):
            yield cause, side, [one for one in by_cause if one.evidence.side == side]


def causes_table(found: TimingTrace) -> FittedTable:
    """Return how often each cause made the session stutter."""
    late = f"{found.missed} of {found.stamps.tick.size} ticks began more than {found.limit_ns * MS:g} ms late"
    gaps = f"; {plural(found.unrecorded, 'tick is', 'ticks are')} not in the recording" if found.unrecorded else ""
    heads = numbers("episodes", "in trials", "ticks", "worst [ms]", "at tick")
    table = FittedTable("cause", "side", *heads, title=f"Stutter: {late}{gaps}")
    for cause, side, group in grouped(found):
        worst = max(group, key=lambda one: one.evidence.size_ns)
        table.add_row(
            cause.title,
            side or "both",
            str(len(group)),
            str(sum(one.trial > 0 for one in group)),
            str(sum(one.ticks for one in group)),
            f"{worst.evidence.size_ns * MS:.3f}",
            str(worst.tick),
        )
    return table


def advice(found: TimingTrace) -> list[str]:
    """Return one sentence for each cause that occurred."""
    causes = [cause for cause in CAUSES if any(one.cause is cause for one in found.episodes)]
    if not causes:
        return ["no episode of stutter"]
    return [*(f"{cause.title}: {cause.advice}" for cause in causes), f"More in {GUIDE}."]


def worst_table(found: TimingTrace, most: int) -> FittedTable:
    """Return the worst episodes."""
    heads = numbers("tick", "time [s]", "trial", "ticks", "size [ms]")
    table = FittedTable(*heads, "cause", "side", "what the stamps show", title="Worst episodes, those in trials first")
    for one in found.worst[:most]:
        evidence = one.evidence
        size = f"{evidence.size_ns * MS:.3f}"
        head = (str(one.tick), f"{one.time:.3f}", str(one.trial or "-"), str(one.ticks), size)
        table.add_row(*head, one.cause.title, evidence.side or "both", shown(evidence))
    return table


def shown(evidence: EpisodeEvidence) -> str:
    """Return the evidence in words."""
    if evidence.away:
        return f"no new sample for {evidence.missing_ns * MS:.0f} ms"
    if evidence.is_late:
        agents = [f"{side} agent {state}" for side, state in evidence.agents.items()]
        return ", ".join(agents + [f"event {name}" for name in evidence.events])
    if evidence.missing:
        late, read = evidence.missing_ns * MS, evidence.read_late_ns * MS
        return f"a sample arrived up to {late:.3f} ms late, read {max(read, 0.0):.3f} ms late"
    part = {"up": "the way to the server", "wait": "the wait for the tick", "back": "the way back", "": "unknown"}
    return f"loop of {evidence.loop_ns * MS:.3f} ms, longest: {part[evidence.longest_part]}"


def as_data(found: TimingTrace, name: str) -> dict[str, Any]:
    """Return the trace for JSON, in SI units."""
    return {
        "recording": name,
        "ticks": int(found.stamps.tick.size),
        "unrecorded": found.unrecorded,
        "limit": found.limit_ns * 1e-9,
        "missed": found.missed,
        "missed_per_100000": found.missed * 1e5 / found.stamps.tick.size,
        "times": {what: {k: or_null(v) for k, v in asdict(one).items()} for what, one in found.spreads.items()},
        "episodes": [_as_data(one) for one in found.episodes],
        "advice": {cause.name: cause.advice for cause, _, _ in grouped(found)},
    }


def _as_data(one: Episode) -> dict[str, Any]:
    evidence = one.evidence
    return {
        "cause": one.cause.name,
        "side": evidence.side,
        "tick": one.tick,
        "ticks": one.ticks,
        "time": one.time,
        "trial": one.trial,
        "size": evidence.size_ns * 1e-9,
        "read_late": evidence.read_late_ns * 1e-9,
        "agents": dict(evidence.agents),
        "events": list(evidence.events),
    }


def row_of(found: TimingTrace, tick: int) -> int:
    """Return the row of a tick, or of the next recorded one."""
    return min(int(np.searchsorted(found.stamps.tick, tick)), found.stamps.tick.size - 1)
