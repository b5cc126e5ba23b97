"""What the launcher shows: one badge, a row for each process, what to do next, and notices. Pure: no Qt, no clock."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from enum import Enum

from netboard.network.protocol.control import Status
from netboard.network.protocol.station import ProcessStatus
from netboard.nodes.ports.emergency import AWAITING_RELEASE
from netboard.nodes.ports.waiting import in_words
from netboard.windows.operator.words import Tone, TonedText

FADE_S = 8.0
"""Time for which a success is shown; a refusal stays until it is read [s]."""

WITH_FINDINGS = 3
"""Exit code of a check that has found something to know, such as losses that the recording lists [1]."""

SILENT_S = 3.0
"""Silence of a server after which the launcher says so [s]."""


class LaunchStage(Enum):
    """How far a session is."""

    IDLE = "nothing runs"
    PREPARING = "preparing"
    RUNNING = "running"
    STOPPING = "stopping"


@dataclass(frozen=True, slots=True)
class LaunchFacts:
    """Everything that the window shows."""

    stage: LaunchStage = LaunchStage.IDLE
    problem: str = ""  # what is wrong with the choice; empty if it can be started
    places: Mapping[str, str] = field(default_factory=dict)  # the machine of each process
    tasks: Mapping[str, str] = field(default_factory=dict)  # likewise of tasks, which end by themselves
    processes: Mapping[str, ProcessStatus] = field(default_factory=dict)
    broken: frozenset[str] = frozenset()
    troubles: Mapping[str, str] = field(default_factory=dict)  # why a machine does not answer
    status: Status | None = None
    silence: float = float("inf")  # time since the last status [s]
    on_disk: int = 0  # size of the files of this session [bytes]


@dataclass(frozen=True, slots=True)
class ProcessRow:
    """A row of the table of processes."""

    name: str
    machine: str
    state: TonedText
    detail: str
    runs: bool


def badge(facts: LaunchFacts) -> TonedText:
    """Return the one state of everything; a fault hides what is fine."""
    if facts.stage is LaunchStage.STOPPING:
        left = sum(row.runs for row in rows(facts))
        return TonedText(f"STOPPING: {left} still running", Tone.WATCH)
    if facts.stage is LaunchStage.PREPARING:
        return TonedText("PREPARING", Tone.WATCH)
    if facts.stage is LaunchStage.IDLE:
        return TonedText("NOT READY", Tone.WATCH) if facts.problem else TonedText("READY TO START", Tone.PLAIN)
    if facts.status is not None and AWAITING_RELEASE in facts.status.waiting_for:
        return TonedText("EMERGENCY STOP", Tone.BAD)
    if facts.broken:
        return TonedText(f"FAILED: {in_words(sorted(facts.broken))}", Tone.BAD)
    if any(facts.troubles.values()):
        return TonedText("A STATION DOES NOT ANSWER", Tone.BAD)
    if facts.status is None:
        return TonedText("STARTING", Tone.WATCH)
    if facts.silence > SILENT_S:
        return TonedText("NO REPLY FROM THE SERVER", Tone.BAD)
    if not facts.status.opened:
        return TonedText("WAITING FOR THE FORM", Tone.WATCH)
    if facts.status.phase == "idle":
        waiting = facts.status.waiting_for
        return TonedText("WAITING", Tone.WATCH) if waiting else TonedText("READY FOR THE BLOCK", Tone.GOOD)
    words = {"paused": ("PAUSED", Tone.WATCH), "finished": ("BLOCK FINISHED", Tone.GOOD)}
    return TonedText(*words.get(facts.status.phase, ("TRIAL RUNNING", Tone.GOOD)))


def advice(facts: LaunchFacts) -> str:
    """Return what to do next, in one line."""
    trouble = next((words for words in facts.troubles.values() if words), "")
    if facts.stage is LaunchStage.IDLE:
        return facts.problem or "F2 creates what is missing and starts everything."
    if facts.stage is LaunchStage.PREPARING:
        return "Creating keys, folders and compiled code (see the log); then the session starts."
    if facts.stage is LaunchStage.STOPPING:
        return "Agents, displays and console first, then the server, then the logger."
    if facts.broken:
        return f"Select the {min(facts.broken)}, read its log, then start it again with Enter."
    if trouble:
        return trouble
    if facts.status is None:
        return "The server prepares every block."
    if not facts.status.opened:
        return "Fill in the session's form in the console (F3 there)."
    if facts.status.waiting_for:
        return f"Waiting for {in_words(facts.status.waiting_for)}."
    return "Arm and start blocks in the console."


def session_line(facts: LaunchFacts) -> str:
    """Return where the session is, and what is on disk."""
    on_disk = f"{bytes_in_words(facts.on_disk)} on disk"
    if facts.status is None:
        return on_disk
    status = facts.status
    return f"{status.name} {status.dyad}, block {status.block} of {status.blocks}, trial {status.trial}; {on_disk}"


def rows(facts: LaunchFacts) -> list[ProcessRow]:
    """Return a row for each process of the session, and each task."""
    return [_row(facts, name, machine) for name, machine in {**facts.places, **facts.tasks}.items()]


def _row(facts: LaunchFacts, name: str, machine: str) -> ProcessRow:
    status = facts.processes.get(name)
    if status is None:
        trouble = facts.troubles.get(machine, "")
        return ProcessRow(name, machine, TonedText("not reached" if trouble else "not started", Tone.QUIET), "", False)
    detail = f"{status.seconds:.0f} s, log {bytes_in_words(status.log_bytes)}"
    if facts.troubles.get(machine):
        return ProcessRow(name, machine, TonedText(f"last seen {status.phase}", Tone.WATCH), detail, True)
    if status.phase == "running":
        return ProcessRow(name, machine, TonedText("running", Tone.GOOD), detail, True)
    if status.phase == "stopping":
        return ProcessRow(name, machine, TonedText("stopping", Tone.WATCH), detail, True)
    if status.phase == "stopped" or not status.code:
        words = "stopped" if status.phase == "stopped" else "done"
        return ProcessRow(name, machine, TonedText(words, Tone.QUIET), detail, False)
    if status.code == WITH_FINDINGS and name in facts.tasks:
        return ProcessRow(name, machine, TonedText("done, read its log", Tone.WATCH), detail, False)
    words = f"killed by signal {-status.code}" if status.code < 0 else f"failed, exit code {status.code}"
    return ProcessRow(name, machine, TonedText(words, Tone.BAD), detail, False)


def bytes_in_words(size: int) -> str:
    """Return a size for people."""
    for factor, unit in ((1e9, "GB"), (1e6, "MB"), (1e3, "kB")):
        if size >= factor:
            return f"{size / factor:.1f} {unit}"
    return f"{size} bytes"


def edited_while_running(before: str, now: str, name: str) -> str:
    """Return what to know if the study's text is not the one that the session started with; empty if it is."""
    if before == now:
        return ""
    return (
        f"{name} was changed. The running session keeps the study that it started with; the next session takes the new "
        "one. A session that began before can be resumed only with the old text."
    )


# --- notices -----------------------------------------------------------------------------------------------------


@dataclass(frozen=True, slots=True)
class Notice:
    """A result of something that the operator did, or a fault."""

    words: str
    stays: bool  # until it is read
    at: float  # time [s]


class Notices:
    """Notices, the newest last: successes fade, refusals and faults stay until they are read. No pop-up is needed."""

    def __init__(self) -> None:
        self._all: list[Notice] = []

    def add(self, words: str, at: float, *, stays: bool) -> None:
        """Add a notice, in place of an equal one."""
        self._all = [notice for notice in self._all if notice.words != words]
        self._all.append(Notice(words, stays, at))

    def visible(self, now: float) -> list[Notice]:
        """Return what is shown at a time [s]."""
        self._all = [notice for notice in self._all if notice.stays or now - notice.at < FADE_S]
        return self._all

    def read(self) -> None:
        """Remove the oldest notice that stays."""
        first = next((notice for notice in self._all if notice.stays), None)
        if first is not None:
            self._all.remove(first)
