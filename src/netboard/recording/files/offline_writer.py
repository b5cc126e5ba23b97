"""Writes a simulated block as a recording with the channels, events and metadata of a live one.

Streams that need a network are missing: clock probes, display frames and peer events. The ``session_started`` event and
the metadata record both carry ``rehearsed``, so that a simulated block cannot be mistaken for human data.
"""

from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from netboard.base.config import Config, resolve
from netboard.base.tick import START_NS, TICK_SECONDS
from netboard.network.protocol.joining import Welcome
from netboard.network.protocol.messages import PROTOCOL_VERSION
from netboard.network.protocol.records import EventRecord
from netboard.recording.files.provenance import provenance
from netboard.recording.files.writer import RecordingWriter
from netboard.stage.curtain import PHASE_NAMES
from netboard.stage.perturbing import PERTURBATION, begins_perturbation, perturbation_of
from netboard.task.studies.factors import TrialDetails
from netboard.task.trials.state_machine import HAS_EDGE, TABLE, Cause, Phase

REHEARSED = {"rehearsed": "true"}
"""Details that mark a recording of simulated participants."""

TARGET_SIDES = {-1: "left", 0: "unknown", 1: "right"}
"""Words for the ``target`` of a tick."""


class BlockWriter:
    """Writer of the recording of one simulated block.

    ``utc_ns``, ``start_ns``: wall-clock and server time of the first tick [ns]. ``origin``: how the block was made, for
    the metadata and the first event.
    """

    def __init__(
        self,
        folder: Path,
        config: Config,
        session: str,
        utc_ns: int,
        origin: Mapping[str, str] = REHEARSED,
        start_ns: int = START_NS,
    ) -> None:
        text = resolve(config)
        self.path = folder / recording_name(config, session)
        welcome = Welcome(session, PROTOCOL_VERSION, start_ns, text)
        metadata = provenance(welcome, config, 1, utc_ns, start_ns) | dict(origin)
        self._config, self._details = config, TrialDetails(config)
        self._log_time_minus_server = utc_ns - start_ns
        self._writer = RecordingWriter(self.path, metadata, text, config.recording, utc_ns, repeatable=True)
        self._events = self._records = 0
        self._time_ns = start_ns
        self._write_event(0, start_ns, "session_started", {"session": session, **origin})

    def take(self, rows: NDArray[Any]) -> None:
        """Write the next ticks and the events in them."""
        noted = np.flatnonzero(is_edge(rows) | begins_perturbation(rows, self._config))
        *ended, rest = np.split(rows, noted + 1)
        for part in ended:
            self._write_ticks(part)
            row = part[-1]
            for name, details in events_of(row, self._config):
                more = self._details.of(int(row["trial"]))
                self._write_event(int(row["tick"]), self._time_ns, name, details | more)
        if len(rest):
            self._write_ticks(rest)

    def finish(self) -> None:
        """Complete the recording and give it its final name."""
        self._write_event(-1, self._time_ns, "session_ended", {"late_ticks": "0"})
        self._writer.finish(self._time_ns + self._log_time_minus_server)

    def remark(self, name: str, details: dict[str, str]) -> None:
        """Write a log message."""
        self._writer.remark(name, details, self._time_ns + self._log_time_minus_server)

    def abandon(self) -> None:
        """Delete the unfinished file."""
        self._writer.abandon()

    def _write_event(self, tick: int, time_ns: int, name: str, details: dict[str, str]) -> None:
        event = EventRecord(self._events, tick, time_ns, name, details)
        self._writer.write(event, self._records, self._time_ns + self._log_time_minus_server)
        self._events += 1
        self._records += 1

    def _write_ticks(self, rows: NDArray[Any]) -> None:
        self._writer.write_ticks(rows, self._records, rows["time_ns"] + self._log_time_minus_server)
        self._time_ns = int(rows["time_ns"][-1])
        self._records += len(rows)


def recording_name(config: Config, session: str) -> str:
    """Return the file name of a block's recording."""
    who = config.session
    return f"{who.name}_{who.dyad}_block{config.block.number:02d}_{session[:8]}.mcap"


def is_edge(rows: NDArray[Any]) -> NDArray[np.bool_]:
    """Return a mask of the ticks whose event is a transition of the trial state machine."""
    phases, causes = HAS_EDGE.shape
    phase, cause = rows["phase"], rows["event"]
    known = (phase >= 0) & (phase < phases) & (cause > 0) & (cause < causes)
    known[known] = HAS_EDGE[phase[known], cause[known]]
    return np.asarray(known)


def events_of(row: np.void, config: Config) -> Iterator[tuple[str, dict[str, str]]]:
    """Yield names and details of the events in a tick."""
    if begins_perturbation(row, config):
        yield PERTURBATION, perturbation_of(row, config)
    if is_edge(np.array([row])).any():
        yield event_of(row)


def event_of(row: np.void) -> tuple[str, dict[str, str]]:
    """Return the name and details of the event in a tick, as a live session records it."""
    phase, cause = Phase(int(row["phase"])), Cause(int(row["event"]))
    details = {
        "from": PHASE_NAMES[phase],
        "to": PHASE_NAMES[TABLE[phase][cause][0]],
        "trial": str(row["trial"]),
        "attempt": str(row["attempt"]),
        "target": TARGET_SIDES[int(np.sign(row["target"]))],
    }
    if cause == Cause.HELD:
        details["completion"] = repr(float(row["mark_ticks"]) * TICK_SECONDS)
    return cause.name.lower(), details
