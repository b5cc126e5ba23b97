"""Causes of a stutter: each is one entry here, with what shows it in the stamps, and what to do about it.

The first cause in `CAUSES` whose rule holds is the cause of an episode. The rules compare stamps only, so they say
*where* time was lost: in the server, in an agent, or between them. They do not say which other program ran meanwhile;
the scheduler's trace does (`netboard.recording.timing.scheduler`).
"""

from collections.abc import Callable
from dataclasses import dataclass

from netboard.base.tick import TICK_NS
from netboard.recording.timing.evidence import EpisodeEvidence

BLOCK_TICKS = 50
"""Ticks after the begin of a block, or after an agent has joined, in which it may still be loaded [1]."""

MAX_EVENT_NS = 100 * TICK_NS
"""Stall beyond which an event is not its cause: no event takes that long [ns]."""

THROTTLED_NS = (30_000_000, 70_000_000)
"""Length of a stall by the kernel's real-time throttle, 50 ms by default, with some tolerance [ns]."""


@dataclass(frozen=True, slots=True)
class StutterCause:
    """A cause of stutter."""

    name: str
    title: str
    advice: str
    holds: Callable[[EpisodeEvidence], bool]


def _throttled(evidence: EpisodeEvidence) -> bool:
    low, high = THROTTLED_NS
    return evidence.is_late and low <= evidence.late_ns <= high and evidence.repeats_each_second


def _agent(evidence: EpisodeEvidence) -> bool:
    return evidence.missing is not None and evidence.read_late_ns * 2 >= evidence.missing_ns


CAUSES = (
    StutterCause(
        "away",
        "agent away",
        "Look at agent_left, agent_joined and the agent's log: it was stopped, lost its device, or its connection.",
        lambda evidence: evidence.away,
    ),
    StutterCause(
        "block",
        "block began or agent joined",
        "Server and agents load the block in its first ticks; that does no harm unless a trial was running.",
        lambda evidence: evidence.load_age <= BLOCK_TICKS,
    ),
    StutterCause(
        "throttle",
        "real-time throttle",
        "Real-time processes use all of a core for a second: give each loop a core of its own, or run fewer of them.",
        _throttled,
    ),
    StutterCause(
        "machine",
        "whole machine stood still",
        "Server and agents stalled together: look for a virtual machine, power saving, or firmware interrupts (SMI).",
        lambda evidence: evidence.is_late and set(evidence.agents.values()) & {"late", "on time"} == {"late"},
    ),
    StutterCause(
        "shared",
        "server and one agent together",
        "They share a machine or a core: name a core for each loop (realtime.server_cpus, realtime.agent_cpus).",
        lambda evidence: evidence.is_late and "late" in evidence.agents.values(),
    ),
    StutterCause(
        "event",
        "server busy with an event",
        "The server handled the named event first; if the same event always delays a tick, please report it.",
        lambda evidence: evidence.is_late and evidence.late_ns < MAX_EVENT_NS and bool(evidence.events),
    ),
    StutterCause(
        "server",
        "server late alone",
        "Another program ran on the server's core: permit real-time scheduling, isolate that core.",
        lambda evidence: evidence.is_late and "on time" in evidence.agents.values(),
    ),
    StutterCause(
        "short",
        "late, too short to tell",
        "No agent was due meanwhile, so the stamps cannot tell server and machine apart: treat it as a late server.",
        lambda evidence: evidence.is_late,
    ),
    StutterCause(
        "phase",
        "agent out of step",
        "Its samples arrive just after a tick, as after a stall or a connection; it corrects 5 us in each tick.",
        lambda evidence: evidence.out_of_step or evidence.longest_part == "wait",
    ),
    StutterCause(
        "agents",
        "both agents stalled",
        "The agents share a core, or a machine: name a core for each loop (realtime.server_cpus, realtime.agent_cpus).",
        lambda evidence: evidence.both_missing and _agent(evidence),
    ),
    StutterCause(
        "agent",
        "agent stalled",
        "The stylus was read late: permit real-time scheduling for the agent, and look at the device's driver.",
        _agent,
    ),
    StutterCause(
        "network",
        "samples late on the way",
        "Read on time, arrived late: use a dedicated wired network without interrupt coalescing (ethtool rx-usecs 0).",
        lambda evidence: evidence.missing is not None or evidence.longest_part == "up",
    ),
    StutterCause(
        "return",
        "force late on its way back",
        "The tick was on time and the force was not: the way to the agent, or the agent, stalled after it was sent.",
        lambda evidence: True,
    ),
)
"""All causes, in the order in which they are tried; the last one holds always."""
