"""Evidence for the checks: what a recording holds, and one pass through its ticks for all checks that need each.

The result is small for a recording of any length: gaps and jumps, the first and last rows of attempts, and the result
of the verification.
"""

import time
from collections.abc import Iterable
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from netboard.base.config import Config
from netboard.base.tables.experiment import Block
from netboard.base.tick import TICK, TICK_NS
from netboard.network.protocol.records import ClockRecord, EventRecord
from netboard.recording.files.reader import Recording
from netboard.recording.format.summary import Attempt, Gap, find_attempts
from netboard.recording.integrity.verification import Verification, Verifier
from netboard.stage.stage import Stage
from netboard.task.trials.quality import Verdict
from netboard.task.trials.state_machine import Phase, is_active

MAX_KEPT = 1000
"""Limit of gaps, jumps and wrong numbers that are kept; further ones are only counted [1]."""

ACTIVE = np.array([bool(is_active(int(phase))) for phase in Phase])
"""Whether a trial is running, for each phase."""


@dataclass
class Walk:
    """Results of the pass."""

    count: int = 0
    first: NDArray[Any] = field(default_factory=lambda: np.empty(0, TICK))
    last: NDArray[Any] = field(default_factory=lambda: np.empty(0, TICK))
    gaps: list[Gap] = field(default_factory=list)
    missing: int = 0
    # Ticks whose time does not follow the previous one by one tick, and the excess [1, ns].
    jumps: list[tuple[int, int]] = field(default_factory=list)
    active_ns: tuple[int, int] | None = None  # server time of the first and the last tick during trials [ns]
    force_where_none: int = 0  # ticks with a commanded force although the condition has none
    # Rows at which a field of the trial changes, and the rows before them.
    turns: list[NDArray[Any]] = field(default_factory=list)
    verification: Verification | None = None
    computing: float = 0.0  # computing time of the verification [s]

    def attempts(self) -> tuple[Attempt, ...]:
        """Return every attempt at a trial, in order."""
        return find_attempts(np.concatenate(self.turns) if self.turns else np.empty(0, TICK))


@dataclass(frozen=True, slots=True)
class Examined:
    """What the checks examine."""

    recording: Recording
    seen: Walk
    parsed: Config | None  # the configuration of the recording; None if it cannot be read
    events: tuple[EventRecord, ...]
    probes: tuple[ClockRecord, ...]
    remarks: tuple[EventRecord, ...]
    verdicts: tuple[Verdict, ...]  # of the attempts; none if the configuration cannot be read

    @property
    def config(self) -> Config:
        """The configuration; a check without ``needs_config`` must not read it."""
        if self.parsed is None:
            raise ValueError("the configuration cannot be read, and this check is not registered with needs_config")
        return self.parsed

    @property
    def is_imported(self) -> bool:
        """Whether the ticks come from a table that another program measured."""
        return _is_imported(self.recording)

    @property
    def is_played(self) -> bool:
        """Whether the rules of the trial state machine and the plan apply."""
        return is_played(self.recording)

    @property
    def excuses_gaps(self) -> bool:
        """Whether ticks may be missing without a note: counterfactual recordings, recovered ones with damage."""
        return "what_if" in self.recording.metadata or bool(self.recording.recovery.get("damage"))


def is_played(recording: Recording) -> bool:
    """Return whether trials were run by a server or a rehearsal, not imported and not computed as a counterfactual."""
    return not _is_imported(recording) and "what_if" not in recording.metadata


def _is_imported(recording: Recording) -> bool:
    return recording.metadata.get("imported") == "measured"


def walk(portions: Iterable[NDArray[Any]], block: Block | None, stage: Stage | None = None) -> Walk:
    """Pass through the ticks.

    ``block``: configuration of the block, which states where forces are off; None if it is lost. ``stage``: stage of
    the recording's configuration: recompute every tick and compare it bit for bit.
    """
    seen = Walk()
    verifier = None if stage is None else Verifier(stage)
    for rows in portions:
        if not len(rows):
            continue
        _check_sequence(seen, rows)
        _check_forces(seen, rows, block)
        if verifier is not None:
            began = time.perf_counter()
            verifier.take(rows)
            seen.computing += time.perf_counter() - began
        seen.count += len(rows)
        seen.first = seen.first if len(seen.first) else rows[:1].copy()
        seen.last = rows[-1:].copy()
    if seen.count:
        seen.turns.append(seen.last)
    seen.verification = None if verifier is None else verifier.result
    return seen


def _check_sequence(seen: Walk, rows: NDArray[Any]) -> None:
    """Check numbers and times, and keep the rows at which a field of the trial changes."""
    joined = np.concatenate([_slim(seen.last), _slim(rows)])
    numbers, steps = joined["tick"], np.diff(joined["tick"])
    gaps = np.flatnonzero(steps > 1)
    seen.missing += int(np.sum(steps[gaps] - 1))
    seen.gaps += [Gap(int(numbers[k]) + 1, int(steps[k]) - 1) for k in gaps[: MAX_KEPT - len(seen.gaps)]]
    more_ns = np.diff(joined["time_ns"]) - steps * TICK_NS
    jumped = np.flatnonzero(more_ns)[: MAX_KEPT - len(seen.jumps)]
    seen.jumps += [(int(numbers[k + 1]), int(more_ns[k])) for k in jumped]
    changes = (steps != 1) | (joined["event"][:-1] != 0)
    for name in ("phase", "trial", "attempt"):
        changes |= np.diff(joined[name]) != 0
    at = np.flatnonzero(changes)
    kept = np.union1d(at, at + 1) - len(seen.last)
    if not len(seen.last):
        seen.turns.append(rows[:1].copy())
    elif len(kept) and kept[0] < 0:  # the change is between the batches
        seen.turns.append(seen.last)
    seen.turns.append(rows[kept[kept >= 0]])


_SLIM = ["tick", "time_ns", "event", "phase", "trial", "attempt"]


def _slim(rows: NDArray[Any]) -> NDArray[Any]:
    """Copy the few columns that are checked."""
    slim = np.empty(len(rows), [(name, "<i8") for name in _SLIM])
    for name in _SLIM:
        slim[name] = rows[name]
    return slim


def _check_forces(seen: Walk, rows: NDArray[Any], block: Block | None) -> None:
    """Check the forces, and note when trials run."""
    active = ACTIVE[np.clip(rows["phase"], 0, len(Phase) - 1)]
    where = np.flatnonzero(active)
    if len(where):
        begin = int(rows["time_ns"][where[0]]) if seen.active_ns is None else seen.active_ns[0]
        seen.active_ns = begin, int(rows["time_ns"][where[-1]])
    if block is not None:
        with np.errstate(invalid="ignore"):
            forces = np.fmax(np.abs(rows["left_force"]), np.abs(rows["right_force"]))
        none = np.isin(rows["trial"], block.catch) if block.force != "none" else np.ones(len(rows), bool)
        seen.force_where_none += int(np.count_nonzero(forces[none | ~active]))
