"""Answers of a replay to operators: the state of the recorded session at the current position.

Nothing is armed, no peer is waited for, and the peers are those of the replay itself.
"""

import uuid
from collections.abc import Iterator
from dataclasses import dataclass, field
from math import nan

import numpy as np

from netboard.base.clock import now_ns
from netboard.base.config import SIDES, Side
from netboard.base.safeguards import Safeguard
from netboard.base.tables.experiment import MAX_TRIALS, PERSON, STILL
from netboard.base.tick import LATE_NS
from netboard.network.protocol.control import (
    REPLAY_OF,
    DeviceStatus,
    DisplayStatus,
    Outcomes,
    StationStatus,
    Status,
    Trace,
)
from netboard.nodes.ports.control_port import ControlPort
from netboard.nodes.server.answers import (
    SAFEGUARD_TICKS,
    TRACE_EVERY,
    device_status,
    moved_by_server,
    plan_of,
    trace_of,
)
from netboard.nodes.server.attempts import MAX_ROWS
from netboard.recording.replay.commands import in_words
from netboard.recording.replay.loaded import LoadedRecording
from netboard.recording.replay.position import ReplayPosition
from netboard.stage.curtain import PHASE_NAMES
from netboard.task.trials.state_machine import BALL_FREE

TRACE_TICKS = 1000
"""Largest number of ticks before the current one in an answer [1]."""

_LIMITED = int(Safeguard.CLAMPED)


@dataclass
class ReplayState:
    """A recording and its playback."""

    recording: LoadedRecording
    playback: ReplayPosition
    # Id of this run; not that of the recording, because numbering restarts.
    session: str = field(default_factory=lambda: uuid.uuid4().hex)

    @property
    def index(self) -> int:
        """The row that is shown now [1]."""
        return self.recording.at(self.playback.at(now_ns() * 1e-9))


class ReplayAnswers:
    """Answers operators' questions about a replay."""

    def __init__(self, state: ReplayState, control: ControlPort) -> None:
        self._state, self._control = state, control
        self._late = np.cumsum(state.recording.ticks["late_ns"] > LATE_NS)

    def status(self) -> Status:
        """Return the status of the recorded session."""
        state, recording, now = self._state, self._state.recording, now_ns()
        index = state.index
        row, config, outcomes = recording.ticks[index], recording.config, recording.outcomes(index)
        return Status(
            session=state.session,
            tick=int(row["tick"]) + 1,
            phase=PHASE_NAMES[int(row["phase"])],
            trial=int(row["trial"]),
            trials=config.block.trials + int(row["extra"]),
            successes=int(row["successes"]),
            failures=int(row["failures"]),
            completions=tuple(one.completion for one in outcomes if one.outcome == "success")[-MAX_TRIALS:],
            late_ticks=int(self._late[index]),
            waiting_for=(),
            peers=self._control.peers,
            notice=f"{REPLAY_OF}{recording.name}: {in_words(state.playback, recording, now * 1e-9)}",
            links=tuple(self._control.links(now)),
            loops=(),
            **plan_of(config),
            opened=True,
            armed=False,
            commander="",
            rest=recording.rest(index) or 0.0,
            pending="",
            outcomes=len(outcomes),
            recordings=(),
            stations=tuple(self._station(side, index) for side in SIDES),
            refused=(),
            lost=(),
            repeats=(),
            devices=tuple(self._devices(index)),
            displays=tuple(DisplayStatus(*shown) for shown in self._control.platforms.items()),
            stand_ins=(),
            ahead=(),
        )

    def _devices(self, index: int) -> Iterator[DeviceStatus]:
        """Yield what each hand held in the recording."""
        recording = self._state.recording
        for side in SIDES:
            mover, details = getattr(recording.config.block, side), recording.device(side, index)
            if mover == STILL or (mover != PERSON and details is None):
                yield moved_by_server(side, mover)
            elif details is not None:
                yield device_status(side, details)

    def _station(self, side: Side, index: int) -> StationStatus:
        """Return the state of a station."""
        ticks = self._state.recording.ticks
        row = ticks[index]
        age = (int(row["time_ns"]) - int(row[f"{side}_stamp_ns"])) * 1e-9 if row[f"{side}_live"] else nan
        newest = ticks[f"{side}_safeguards"][max(index + 1 - SAFEGUARD_TICKS, 0) : index + 1]
        bits = int(np.bitwise_or.reduce(newest))
        attempt = ticks[self._begun(index) : index + 1]
        lost = int(np.count_nonzero(attempt[f"{side}_live"] == 0))
        limited = int(np.count_nonzero(attempt[f"{side}_safeguards"] & _LIMITED))
        return StationStatus(side, age, bits, float(row[f"{side}_rendered"]), lost, limited)

    def _begun(self, index: int) -> int:
        """Return the index of the row with which the current attempt began; that of the next row without an attempt."""
        ticks = self._state.recording.ticks
        if int(ticks["phase"][index]) not in BALL_FREE:
            return index + 1
        return max(int(np.searchsorted(ticks["tick"], ticks["tick"][index] - ticks["run_ticks"][index])), 0)

    def outcomes(self, first: int) -> Outcomes:
        """Return the outcomes so far, starting with attempt number `first`."""
        first = max(first, 0)
        known = self._state.recording.outcomes(self._state.index)
        return Outcomes(first, tuple(known[first:][:MAX_ROWS]))

    def trace(self, after: int) -> Trace:
        """Return the ticks after this one, up to the current one."""
        recording, index = self._state.recording, self._state.index
        rows = recording.ticks[max(index + 1 - TRACE_TICKS, 0) : index + 1]
        rows = rows[(rows["tick"] > after) & (rows["tick"] % TRACE_EVERY == 0)]
        return trace_of(rows, rows["tick"].tolist(), ball=recording.curtain.ball)
