"""Status lamps of a session: state, severity, and what to do. Pure: no Qt, no clock.

A lamp shows its level as colour, sign and text, because not everybody can tell the colours apart; its tip says what is
wrong and what to do. The limits come from the configuration: those at which an attempt is flagged or a device disarmed.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from enum import IntEnum
from math import isfinite

from netboard.base.config import Config
from netboard.network.protocol.control import REPLAY_OF, RecordingStatus, Status
from netboard.nodes.ports.emergency import AWAITING_RELEASE
from netboard.recording.format.disk import SLOW_SYNC_S, STALLED_SYNC_S
from netboard.windows.operator.changes import LATELY, RecentCounts

ACTIVE = ("levelling", "running", "holding", "succeeded", "failed")
"""Phases in which a block is running."""

OVER = "over"
"""Phase that only the console knows: the server has ended."""

SILENT = 0.75
"""Timeout after which the server counts as silent [s]."""

MINUTES_BAD, MINUTES_WATCH = 5.0, 30.0
BYTES_BAD, BYTES_WATCH = 10**9, 5 * 10**9
"""Free disk space below which the lamp turns to this level [min, bytes]."""

REFERENCE_TICKS = 10_000
"""Attempt length for which limits that are shares are converted to ticks [1]."""


class LampLevel(IntEnum):
    """Severity of a lamp."""

    OFF = 0
    GOOD = 1
    WATCH = 2
    BAD = 3


@dataclass(frozen=True, slots=True)
class Lamp:
    """State of one lamp."""

    name: str
    level: LampLevel
    words: str
    tip: str  # what is wrong and what to do; if all is well, what the lamp shows


LampState = tuple[LampLevel, str, str]
"""Level, words and tip of a lamp."""


@dataclass(frozen=True, slots=True)
class Limits:
    """Limits at which lamps change their level."""

    sample_age: float  # age above which a sample is stale [s]
    clock_bound: float  # largest uncertainty of the clock offset with which a device is armed [s]
    late_ticks: int
    lost_ticks: int  # most ticks of an attempt without a fresh sample
    clipped_ticks: int  # most ticks of an attempt with a force at its limit
    version: str


def limits_of(config: Config, version: str) -> Limits:
    """Return the limits of a configuration."""
    network, quality = config.network, config.quality
    return Limits(
        network.sample_timeout_ms * 1e-3,
        network.clock_bound_ms * 1e-3,
        quality.late_ticks,
        round(quality.lost_share * REFERENCE_TICKS),
        round(quality.clipped_share * REFERENCE_TICKS),
        version,
    )


def session_lamps(status: Status | None, silence: float, recent: RecentCounts, limits: Limits) -> tuple[Lamp, ...]:
    """Return the lamps of the session, always in the same order; `silence` is the time since the last status [s]."""
    server, *names = SESSION_LAMPS
    tip = "Known once the server answers."
    if status is not None and replayed(status):
        tip = "This is a replay: nothing is recorded and no device renders a force."
    readings: tuple[LampState, ...] = ((LampLevel.OFF, "", tip),) * len(names)
    if live := status is not None and not replayed(status):
        readings = (
            _recording(status),
            _disk(status, recent.minutes),
            _late(status, recent.late_ticks, limits),
            _forces(status),
            _form(status),
        )
    lamps = tuple(Lamp(name, *reading) for name, reading in zip(names, readings, strict=True))
    lamps = faded(lamps) if live and silence > SILENT else lamps
    return (Lamp(server, *_server(status, silence, recent.refused)), *lamps)


SESSION_LAMPS = ("Server", "Recording", "Disk", "Deadline misses", "Forces", "Session")
"""Names of the session's lamps."""


def recorded(status: Status) -> bool:
    """Return whether a logger is writing to disk."""
    return any(recording.age <= STALLED_SYNC_S for recording in status.recordings)


def replayed(status: Status) -> bool:
    """Return whether the server replays a recording."""
    return status.notice.startswith(REPLAY_OF)


def faded(lamps: Sequence[Lamp]) -> tuple[Lamp, ...]:
    """Return lamps as out of date: their last text in brackets, level off."""
    return tuple(
        replace(
            lamp,
            level=LampLevel.OFF,
            words=lamp.words and f"({lamp.words})",
            tip="State before the connection was lost.",
        )
        for lamp in lamps
    )


def ended(status: Status, silence: float, goodbye: bool) -> Status:
    """Return the status in the phase `OVER` if the server has said goodbye, or is silent after the last block."""
    done = silence > SILENT and status.phase == "finished" and status.block >= status.blocks
    return replace(status, phase=OVER, waiting_for=()) if goodbye or done else status


def _server(status: Status | None, silence: float, refused: Sequence[str]) -> LampState:
    if status is not None and status.phase == OVER:
        return LampLevel.OFF, "ended", "The server has ended the session."
    if not isfinite(silence):
        return LampLevel.BAD, "not found", "No server answers. Check that it is running and that the address is right."
    if silence > SILENT:
        tip = "The forces fade out at the devices. Check the server and the cable; the console reconnects by itself."
        return LampLevel.BAD, f"SILENT {silence:.0f} s", tip
    if refused:
        return LampLevel.WATCH, "refuses a peer", f"The server refuses a process: {refused[0]}."
    return LampLevel.GOOD, "connected", "The server answers."


def _recording(status: Status) -> LampState:
    if not status.recordings:
        tip = "Nothing is recorded. Start a logger: netboard logger"
        return LampLevel.BAD, "NO LOGGER", tip
    begun = _begun(status)
    if not begun:
        level = LampLevel.WATCH if status.opened else LampLevel.GOOD
        return level, "ready", "A logger is connected. It starts a file when the session is opened."
    file, age, written, _ = min(begun, key=lambda recording: recording.age)
    tip = f"{file}, {size(written)}. Records reach the disk within {age:.1f} s; a power cut loses at most that much."
    if age > STALLED_SYNC_S:
        return LampLevel.BAD, f"STALLED {age:.0f} s", f"{tip} Check the logger and its disk."
    if age > SLOW_SYNC_S:
        return LampLevel.WATCH, f"SLOW {age:.1f} s", f"{tip} The logger's disk is slow: record to a local one."
    all_fresh = all(recording.age <= STALLED_SYNC_S for recording in status.recordings)
    return LampLevel.GOOD if all_fresh else LampLevel.WATCH, f"\u25cf {size(written)}", tip


def _begun(status: Status) -> list[RecordingStatus]:
    """List the recordings of loggers that have begun a file."""
    return [recording for recording in status.recordings if recording.file]


def _disk(status: Status, minutes: float) -> LampState:
    begun = _begun(status)
    if not begun:
        return LampLevel.OFF, "", "Known once a logger has started a file."
    free = min(recording.free_bytes for recording in begun)
    words = size(free) if not isfinite(minutes) else f"{duration(minutes)}, {size(free)}"
    tip = "Recording time and free space that are left on the logger's disk."
    if minutes < MINUTES_BAD or free < BYTES_BAD:
        return LampLevel.BAD, words, f"{tip} Stop after this block (F12) and free some space."
    if minutes < MINUTES_WATCH or free < BYTES_WATCH:
        return LampLevel.WATCH, words, f"{tip} Free some space before the next session."
    return LampLevel.GOOD, words, tip


def _late(status: Status, recently: int, limits: Limits) -> LampState:
    tip = f"Ticks over half a millisecond late: {recently} in the last {LATELY:g} s, {status.late_ticks} in total."
    if recently > limits.late_ticks:
        worry = f"A trial with more than {limits.late_ticks} is flagged. Close other programs on the server's computer."
        return LampLevel.BAD, f"{_short(recently)} in {LATELY:g} s", f"{tip} {worry}"
    if recently:
        return LampLevel.WATCH, f"{_short(recently)} in {LATELY:g} s", tip
    return LampLevel.GOOD, f"{_short(status.late_ticks)} in total", tip


def _short(count: int) -> str:
    """Return a count that fits into a lamp; the tip has all its digits."""
    if count < 10_000:
        return str(count)
    return f"{count // 1000}k" if count < 1_000_000 else f"{count / 1e6:.0f}M"


def _forces(status: Status) -> LampState:
    if AWAITING_RELEASE in status.waiting_for:
        return LampLevel.BAD, "STOPPED", "All forces are zero until the emergency stop is released."
    if status.armed and status.phase in ACTIVE:
        return LampLevel.GOOD, "allowed", "Devices may render forces."
    if status.armed:
        return LampLevel.OFF, "none now", "The devices are armed. They render forces in a trial only, and none runs."
    return LampLevel.OFF, "disarmed", "No device renders a force until you arm (F1)."


def _form(status: Status) -> LampState:
    if not status.opened:
        return LampLevel.WATCH, "not opened", "Fill in the session form (F3) before a block can start."
    if not status.consent and not status.pilot:
        return LampLevel.BAD, "NO CONSENT", "No consent was entered: end the session (Ctrl+E)."
    if status.real and (stand_ins := [one.words for one in status.stand_ins]):
        return LampLevel.WATCH, "stand-ins", f"This session is real, with stand-ins: {', '.join(stand_ins)}."
    words = "pilot" if status.pilot else "consent given"
    return LampLevel.GOOD, words, f"Session {status.name} of dyad {status.dyad}."


# --- alarm --------------------------------------------------------------------------------------------------------


def alarm(status: Status | None, silence: float, recent: RecentCounts, unconfirmed: bool) -> str:
    """Return the alarm to write across the window; empty if there is none.

    `unconfirmed`: the server has failed to confirm an emergency stop in time.
    """
    if unconfirmed and not (status is not None and replayed(status)):
        return "STOP NOT CONFIRMED: LET GO OF THE STYLUSES"
    if status is None:
        return ""
    active = status.phase in ACTIVE and not replayed(status)
    if silence > SILENT and status.phase != OVER:
        return f"NO REPLY FROM THE SERVER FOR {silence:.0f} s" + (": let go of the styluses" if active else "")
    if active and not recorded(status):
        return "RUNNING BUT NOT RECORDING: pause now (F5), then check the logger"
    if AWAITING_RELEASE in status.waiting_for:
        return "EMERGENCY STOP: all forces are zero. Release: Ctrl+R twice"
    if active and recent.minutes < MINUTES_BAD:
        return f"DISK FULL IN {recent.minutes:.0f} MINUTES: stop after this block (F12)"
    return ""


def milliseconds(seconds: float) -> str:
    """Format a short time in milliseconds."""
    ms = seconds * 1e3
    if not isfinite(ms):
        return "?"
    return f"{ms:.2f} ms" if ms < 10 else f"{ms:.0f} ms"


def duration(minutes: float) -> str:
    """Format a long time in minutes or hours."""
    return f"{minutes:.0f} min" if minutes < 120 else f"{minutes / 60:.0f} h"


def size(count: int) -> str:
    """Format a size in bytes as MB or GB."""
    return f"{count / 1e9:.1f} GB" if count >= 10**9 else f"{count / 1e6:.1f} MB"
