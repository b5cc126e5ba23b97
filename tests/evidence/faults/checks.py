"""Requirements after a fault: each check is a function of the evidence of any case, with its limits.

Times for which the machine suspended the agent are subtracted from measured times; they are gaps in the rows that the
agent wrote. An unexpected pause is excused for the same reason only: an agent or the server stalled shortly before.
"""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, TypeAlias

import numpy as np
from numpy.typing import NDArray

from evidence.faults.deferred import deferred
from evidence.faults.evidence import (
    DyadRecordings,
    Evidence,
    Fade,
    Pause,
    between,
    cuts_to_zero,
    fades,
    step_shares,
)
from netboard.base.config import SIDES, Side
from netboard.base.safeguards import Safeguard
from netboard.base.tick import TICK_NS
from netboard.benchmarks.harness.results import BenchVerdict
from netboard.nodes.ports import emergency
from netboard.recording.integrity.severity import Severity
from netboard.task.trials.state_machine import Phase

Check: TypeAlias = Callable[[Evidence], BenchVerdict]

STALE_NS = 8_000_000
"""Age above which a force that is not renewed is examined [ns]."""

EFFECT_NS = 2_000_000
"""Delay after the start of a fault until immediate effects are visible and messages in transit have arrived [ns]."""

FADE_TIME = 0.06
"""Longest time from the first decrease of a force to zero [s]."""

UNDISTURBED_NS = 300_000_000
"""Time without a pause that a trial must have run before a fault [ns]."""

EXCUSED_NS = 150_000_000
"""Longest time from a stall of a loop to a pause that is attributed to it [ns]."""

SLEW_DOWN_STEPS = 3
"""Steps in which the slew limit reduces the largest force to zero, after an agent was suspended [1]."""

STOP_LATENCY = 0.003
"""Longest latency of an emergency stop to the devices [s]."""

UNKNOWN_TICKS = 20
"""Most ticks after an interruption at which the rendered force may be unknown [1]."""

MAX_RECORD_DELAY = 6
"""Largest number of ticks from writing a force to the tick that records it; a sample is up to 3 ms old [1]."""

LATELY_NS = 1_000_000_000
_SEVERITIES = {Severity.SOUND: "complete", Severity.LOSS: "losses", Severity.DAMAGE: "damaged"}
TICK = TICK_NS * 1e-9


def fades_of(evidence: Evidence, side: Side) -> list[Fade]:
    """Return the periods in which a side's force was not renewed: by the fault, and later perhaps by the machine."""
    return [fade for trace in evidence.traces[side] for fade in fades(trace, STALE_NS)]


@dataclass(frozen=True)
class Falls:
    """Check that a stale force always begins to fall in time, and reaches zero in time after the fault."""

    sides: tuple[Side, ...]
    to_zero: bool

    def __call__(self, evidence: Evidence) -> BenchVerdict:
        """Return the result of the check."""
        stale = evidence.limits.stale_after_ms * 1e-3 + TICK
        claim = f"the force begins to fall within {stale * 1e3:g} ms of the last fresh one"
        claim += f" and is zero {FADE_TIME * 1e3:g} ms later" if self.to_zero else ""
        good, found = True, []
        for side in self.sides:
            fades_here = fades_of(evidence, side)
            if not fades_here:
                return BenchVerdict(claim, False, f"{side}: it was renewed all the time")
            good &= all(fade.held <= stale + fade.stalled for fade in fades_here)
            first, *more = fades_here
            gone = stale + FADE_TIME + first.stalled + _already_late(evidence, first)
            good &= not self.to_zero or first.zero <= gone
            found.append(f"{side} {first}" + (f" and {len(more)} times more" if more else ""))
        return BenchVerdict(claim, good, ", ".join(found))


def falls(*sides: Side, to_zero: bool = True) -> Falls:
    """Check that the force of these sides falls in time."""
    return Falls(sides, to_zero)


def _already_late(evidence: Evidence, fade: Fade) -> float:
    """Return the time from the last renewal of the force to the fault, if the machine was already late."""
    return max(0, evidence.window.start_ns + EFFECT_NS - fade.last_ns) * 1e-9


def largest_step(evidence: Evidence, cut: Side | None) -> float:
    """Return the largest change of a force, relative to the slew limit; on one side without its cuts to zero [1]."""
    slew = evidence.limits.max_slew
    shares = [
        step_shares(part, slew)
        for side in SIDES
        for trace in evidence.traces[side]
        for part in np.split(trace, cuts_to_zero(trace, slew) if side == cut else ())
    ]
    return max((float(share.max(initial=0.0)) for share in shares), default=0.0)


@deferred
def within_slew_limit(evidence: Evidence, cut: Side | None = None) -> BenchVerdict:
    """Check that no force exceeds the slew limit; on one side a fault may cut it to zero."""
    slew = evidence.limits.max_slew
    claim = f"no step of the force is larger than {slew:g} N/s allow"
    worst = largest_step(evidence, cut)
    cuts = sum(cuts_to_zero(trace, slew).size for trace in evidence.traces[cut]) if cut else 0
    found = f"at most {worst:.2f} of it" + (f", cut to zero at once {cuts} times" if cut else "")
    return BenchVerdict(claim + (", except to nothing" if cut else ""), worst <= 1.0 + 1e-9, found)


@deferred
def paused(evidence: Evidence, *reasons: str) -> BenchVerdict:
    """Check that the trial is paused, that the reason is recorded, and that the trial is repeated."""
    claim = f"the trial is paused ({' or '.join(reasons)}), marked and repeated"
    mine = [pause for pause in evidence.pauses if any(reason in pause.reason for reason in reasons)]
    if not mine:
        return BenchVerdict(claim, False, f"pauses: {_described(evidence.pauses)}")
    repeated = all(pause.repeated for pause in evidence.pauses if pause.next_attempt is not None)
    resumed = mine[-1].next_attempt is not None or evidence.pauses[-1].next_attempt is not None
    return BenchVerdict(claim, repeated and resumed, _described(evidence.pauses))


def continues(evidence: Evidence) -> BenchVerdict:
    """Check that no trial is paused, except by the machine itself."""
    return _undisturbed("the trial goes on", evidence.pauses, evidence.window_stalls)


@deferred
def may_pause(evidence: Evidence, *reasons: str) -> BenchVerdict:
    """Check that the trial goes on, or is paused for one of these reasons and repeated."""
    if not [pause for pause in evidence.pauses if any(reason in pause.reason for reason in reasons)]:
        return continues(evidence)
    return paused(*reasons)(evidence)


def no_force_in_pauses(evidence: Evidence) -> BenchVerdict:
    """Check that no vertical force is rendered from shortly after a pause until the trial resumes."""
    claim = "while the trial is paused no hand is given a vertical force"
    late = evidence.limits.stale_after_ms * 1e-3 + TICK + FADE_TIME
    ticks = evidence.ticks
    largest, checked = 0.0, 0
    for pause in evidence.pauses:
        later = ticks[ticks["time_ns"] > pause.at_ns]
        resumed = later["time_ns"][later["phase"] != Phase.PAUSED]
        from_ns = pause.at_ns + round(late * 1e9)
        to_ns = int(resumed[0]) - 2 * TICK_NS if resumed.size else evidence.window.stop_ns  # recorded a tick later
        for trace in (trace for side in SIDES for trace in evidence.traces[side]):
            rows = between(trace, from_ns, to_ns)[SLEW_DOWN_STEPS:]
            checked += rows.size
            largest = max(largest, float(np.max(np.abs(rows["fz"]), initial=0.0)))
    return BenchVerdict(claim, largest == 0.0, f"at most {largest:.3g} N in {checked} forces")


def ticks_accounted(evidence: Evidence) -> BenchVerdict:
    """Check that the recordings account for every tick: recorded, or listed as lost with its cause."""
    return _accounted(evidence.rig)


def nothing_lost(evidence: Evidence) -> BenchVerdict:
    """Check that no tick is lost."""
    lost = evidence.rig.lost_ticks
    return BenchVerdict("no tick is lost", lost == 0 and _accounted(evidence.rig).holds, f"{lost} lost")


def _accounted(dyad: DyadRecordings) -> BenchVerdict:
    claim = "every tick is recorded, or listed as lost with its cause"
    accounts = dyad.accounts
    unexplained = [stretch for one in accounts for stretch in (*one.unexplained, *one.unexplained_records)]
    found = f"{dyad.ticks.size} ticks in {sum(len(one.parts) for one in accounts)} parts, {dyad.lost_ticks} lost"
    causes = sorted({stretch.cause for one in accounts for stretch in one.lost})
    found += f" ({'; '.join(causes)})" if causes else ""
    found += f", unexplained: {unexplained}" if unexplained else ""
    return BenchVerdict(claim, bool(accounts) and all(one.sound for one in accounts), found)


@deferred
def recorded(evidence: Evidence, name: str, *words: str) -> BenchVerdict:
    """Check that an event is recorded with these words in its details."""
    claim = f"recorded: {name}" + (f" ({', '.join(words)})" if words else "")
    texts = [" ".join(event.details.values()) for event in evidence.events if event.name == name]
    good = any(all(word in text for word in words) for text in texts)
    return BenchVerdict(claim, good, f"{len(texts)} times" + (f": {texts[-1]}" if texts else ""))


@deferred
def no_force_if_failing(evidence: Evidence, side: Side, *, to_the_end: bool) -> BenchVerdict:
    """Check that no force was written to a device that returned invalid readings, or did not answer.

    The first force may be the write by which the agent detects that its device does not answer.
    """
    trace = evidence.traces[side][0]
    failing = np.flatnonzero(np.isnan(trace["z"]))
    if to_the_end and failing.size:
        failing = np.arange(failing[0], trace.size)
    rows = trace[failing[1:] if failing.size > 1 else failing]
    largest = float(np.max(np.abs([rows["fx"], rows["fy"], rows["fz"]]), initial=0.0))
    found = f"at most {largest:.3g} N in {rows.size} writes"
    return BenchVerdict(f"the {side} device is handed no force while it fails", rows.size > 0 and largest == 0.0, found)


def emergency_stopped(evidence: Evidence) -> BenchVerdict:
    """Check that an emergency stop reaches both devices with the next tick, and holds until it is released."""
    events = {event.name: event.time_ns for event in evidence.events}
    claim = "both forces go to zero by the slew limit from the next tick on, and stay there until released"
    if not {emergency.STOP, emergency.RELEASE} <= set(events):
        return BenchVerdict(claim, False, "no stop and release are recorded")
    way_down = evidence.limits.max_force / evidence.limits.max_slew
    good, found = True, []
    for side in SIDES:
        trace = between(evidence.traces[side][0], events[emergency.STOP], events[emergency.RELEASE])
        felt = trace["time_ns"][np.any([trace[axis] != 0.0 for axis in ("fx", "fy", "fz")], axis=0)]
        last = (int(felt[-1]) - events[emergency.STOP]) * 1e-9 if felt.size else 0.0
        good &= last <= way_down + STOP_LATENCY
        found.append(f"{side} zero {last * 1e3:.1f} ms after the stop")
    return BenchVerdict(claim, good, ", ".join(found))


@deferred
def safeguard_reported(evidence: Evidence, side: Side, guard: Safeguard) -> BenchVerdict:
    """Check that an agent has reported the action of its safety chain."""
    ticks = int(np.count_nonzero(evidence.ticks[f"{side}_safeguards"] & guard.value))
    name = str(guard.name).lower().replace("_", " ")
    return BenchVerdict(f"the {side} agent reports: {name}", ticks > 0, f"in {ticks} ticks")


@deferred
def rendered_known(evidence: Evidence, side: Side) -> BenchVerdict:
    """Check that the recorded force is that written to the device, and unknown at a few ticks only."""
    claim = f"the {side} force is recorded as the device was handed it, and unknown in {UNKNOWN_TICKS} ticks at most"
    recorded_forces = evidence.ticks[f"{side}_rendered"]
    known = ~np.isnan(recorded_forces)
    handed = np.sort(np.concatenate(evidence.traces[side]), order="time_ns")
    times = evidence.ticks["time_ns"][known]
    differing = ~_was_handed(handed, times, recorded_forces[known])
    count = int(np.count_nonzero(~known))
    found = f"{int(np.count_nonzero(differing))} of {times.size} ticks hold another force, {count} are unknown"
    return BenchVerdict(claim, times.size > 0 and not differing.any() and count <= UNKNOWN_TICKS, found)


def _was_handed(handed: NDArray[Any], times: NDArray[np.int64], forces: NDArray[np.float64]) -> NDArray[np.bool_]:
    """Return whether forces were written to a device just before these times, or were its last ones."""
    newest = np.searchsorted(handed["time_ns"], times + TICK_NS, side="right") - 1
    found, in_force, back = np.zeros(times.size, bool), np.ones(times.size, bool), 0
    while in_force.any():  # an agent that stalled catches up in a burst of any length
        place = np.maximum(newest - back, 0)
        later = handed["time_ns"][np.minimum(place + 1, handed.size - 1)]
        in_force = (newest >= back) & ((later > times - MAX_RECORD_DELAY * TICK_NS) | (place == handed.size - 1))
        found |= in_force & (handed["fz"][place] == forces)
        back += 1
    return found


@deferred
def frames_shown(evidence: Evidence, station: Side) -> BenchVerdict:
    """Check that a display shows frames at the end."""
    painted = evidence.rig.painted_ns[station]
    stop = evidence.window.stop_ns
    count = int(np.count_nonzero((painted > stop - LATELY_NS) & (painted < stop)))
    return BenchVerdict(f"the {station} display shows frames again", count > 0, f"{count} in the last second")


@deferred
def fact_contains(evidence: Evidence, fact: str, wanted: str) -> BenchVerdict:
    """Check that a fact noted during the fault contains the expected text."""
    found = evidence.window.facts.get(fact, "nothing")
    return BenchVerdict(f"{fact}: {wanted}", wanted in found, found)


def recovered(evidence: Evidence) -> BenchVerdict:
    """Check that the fault was injected as intended and that everything recovered."""
    return BenchVerdict("a trial is on again", not evidence.window.trouble, evidence.window.trouble or "it is")


def no_damage(evidence: Evidence) -> BenchVerdict:
    """Check that `netboard check` calls no recording damaged: missing ticks are listed."""
    claim = "netboard check calls no recording damaged"
    damage = [
        f"{report.path.name}: {finding.text}"
        for report in evidence.reports
        for finding in report.findings
        if finding.severity == Severity.DAMAGE
    ]
    return BenchVerdict(claim, not damage, "; ".join(damage) or f"netboard check: {verdict_of(evidence)}")


def verdict_of(evidence: Evidence) -> str:
    """Return the worst result of `netboard check` on the recordings, in one word."""
    return _SEVERITIES[max((report.severity for report in evidence.reports), default=Severity.SOUND)]


def neighbour_unaffected(evidence: Evidence) -> BenchVerdict:
    """Check that the fault leaves the other dyad unaffected: no pause, no lost tick, no added latency."""
    claim = "the other dyad does not notice"
    other, window = evidence.neighbour, evidence.window
    if other is None:
        return BenchVerdict(claim, True, "there is none")
    mine = [pause for pause in other.pauses if window.start_ns <= pause.at_ns < window.stop_ns]
    calm = _undisturbed(claim, mine, evidence.window_stalls)
    now = (other.ticks["time_ns"] >= window.start_ns) & (other.ticks["time_ns"] < window.stop_ns)
    sound = _accounted(other)
    found = f"ticks late by {_late(other.ticks[now])}, at all times {_late(other.ticks)}; {calm.found}"
    return BenchVerdict(claim, calm.holds and sound.holds, found if sound.holds else f"{found}; {sound.found}")


def _late(ticks: NDArray[Any]) -> str:
    """Return the median and 99th percentile of tick lateness, in words."""
    if not ticks.size:
        return "nothing"
    half, most = np.percentile(ticks["late_ns"], (50, 99)) * 1e-6
    return f"{half:.2f} / {most:.2f} ms (p50 / p99)"


def disturbed(evidence: Evidence) -> str:
    """Return why the machine itself had paused the trial just before the fault, or an empty string.

    Other pauses are not excused; they are checked with the rest.
    """
    start_ns = evidence.window.start_ns
    just_before = [pause for pause in evidence.rig.pauses if start_ns - UNDISTURBED_NS <= pause.at_ns < start_ns]
    return next((pause.reason for pause in just_before if _excused(pause, evidence.stalls)), "")


def _undisturbed(claim: str, found: list[Pause], stalls: NDArray[np.int64]) -> BenchVerdict:
    excused = [pause for pause in found if _excused(pause, stalls)]
    text = f"pauses: {_described(found)}" + (f", {len(excused)} of them the machine's fault" if excused else "")
    return BenchVerdict(claim, len(excused) == len(found), text)


def _excused(pause: Pause, stalls: NDArray[np.int64]) -> bool:
    """Return whether the machine, not the fault, may have caused a pause."""
    return "stalled" in pause.reason or agent_stalled(pause, stalls)


def agent_stalled(pause: Pause, stalls: NDArray[np.int64]) -> bool:
    """Return whether the machine suspended an agent shortly before a pause."""
    started, ended = stalls[:, 0], stalls[:, 1]
    return bool(np.any((started < pause.at_ns) & (pause.at_ns < ended + EXCUSED_NS)))


def _described(found: list[Pause]) -> str:
    if not found:
        return "none"
    return "; ".join(f"trial {p.trial}.{p.attempt} {p.reason}" for p in found)
