"""A server's session of a small study whose ticks a test runs one by one, without a network or a clock."""

from pathlib import Path

from netboard.base.config import parse
from netboard.network.protocol.codec import decode
from netboard.network.protocol.control import Command
from netboard.network.protocol.messages import Message
from netboard.network.protocol.records import EventRecord
from netboard.network.transport import sockets
from netboard.network.transport.ports import free_port
from netboard.nodes.ports.control_port import CommandRequest
from netboard.nodes.server.planned import Planned, StudySession
from netboard.nodes.server.server_runs import ALL_FINE
from netboard.nodes.server.session import DyadSession
from netboard.task.studies.study import parse_study
from netboard.task.trials.state_machine import Phase

STUDY = """
name = "small"
block.trials = 2
[orders]
main = "3 dyadic"
[kinds.dyadic]
block.rest = 30.0
"""

SETTINGS = (
    *("task.level_time=0.01", "task.hold_time=0.01", "network.require_logger=false", "network.log_spill_mb=0.0"),
    "quality.excluded_share=1.0",  # the samples are never fresh
)

MAX_TICKS = 5000
"""Ticks within which anything that a test waits for must have happened [1]."""

OPERATOR = b"console"


class SteppedSession:
    """A session whose ticks find the samples of two armed devices, which do not move."""

    def __init__(
        self,
        folder: Path,
        context: sockets.Context,
        *settings: str,
        autostart: bool = False,
        pilot: bool = True,
        study: str = STUDY,
    ) -> None:
        own = (
            f"network.port={free_port()}",
            f"recording.directory={folder}",
            f"session.pilot={str(pilot).lower()}",
            "session.participant_a=P01",
            "session.participant_b=P02",
        )
        config = parse("", "rig", (*own, *SETTINGS, *settings))
        self.planned = Planned(config, parse_study(study), StudySession("small", 1))
        self.session = DyadSession(*self.planned.begin(), context, None, autostart=autostart)
        self.state = self.session._state
        self.state.ports.motion.find_missing = lambda now_ns, needed: []  # type: ignore[method-assign]
        self.state.ports.control.is_present = lambda who: True  # type: ignore[method-assign]
        self.replies: list[tuple[str, bool, str]] = []
        self.late_ns = 0  # by which every tick is late [ns]
        self.state.ports.control.reply = self._reply  # type: ignore[method-assign]
        self.session.begin(10**12, {})

    def _reply(self, request: CommandRequest, accepted: bool, reason: str) -> None:
        self.replies.append((request.command.name, accepted, reason))

    @property
    def phase(self) -> Phase:
        """Phase of the trial."""
        return self.state.phase

    @property
    def block(self) -> int:
        """Number of the block."""
        return self.state.block.config.block.number

    def tick(self, count: int = 1, found: int = ALL_FINE) -> None:
        """Run ticks; ``found``: what their samples tell."""
        for _ in range(count):
            self.state.rows["command"] = 0  # as the samples of a tick clear its row
            self.state.rows["late_ns"] = self.late_ns
            self.session._tick(self.late_ns, found)

    def ask(self, command: str, argument: str = "") -> None:
        """Let an operator send a command, which the next tick takes."""
        self.state.ports.control.requests.append(CommandRequest(OPERATOR, "console", Command(command, argument, 1)))

    def do(self, command: str, argument: str = "") -> tuple[bool, str]:
        """Let an operator send a command, and return the reply: whether it was accepted, and the reason."""
        self.ask(command, argument)
        self.tick()
        name, accepted, reason = self.replies.pop()
        assert name == command
        return accepted, reason

    def start(self) -> None:
        """Arm the devices and start the block."""
        assert self.do("arm")[0]
        assert self.do("start")[0]

    def until(self, phase: Phase) -> None:
        """Run ticks until the trial is in a phase."""
        for _ in range(MAX_TICKS):
            if self.phase == phase:
                return
            self.tick()
        raise AssertionError(f"never {phase.name.lower()}")

    def succeed(self) -> None:
        """Bring the ball into the target, and hold it there until the tick in which the trial has succeeded."""
        self.until(Phase.RUNNING)
        stage = self.state.stage[0]
        for _ in range(MAX_TICKS):
            stage["p"], stage["vp"] = stage["target"] * self.state.block.config.geometry.target_distance, 0.0
            self.tick()
            if self.phase == Phase.SUCCEEDED:
                return
        raise AssertionError("never succeeded")

    def finish_block(self) -> None:
        """Succeed in all trials of the block."""
        while self.phase != Phase.FINISHED:
            self.succeed()
            self.tick()

    def records(self) -> list[Message]:
        """Return the records so far."""
        ring = self.state.ports.log.ring
        return [decode(frame) for frame in ring.batch(ring.first, ring.next, 2**30).records]

    def events(self) -> list[EventRecord]:
        """Return the events so far."""
        return [record for record in self.records() if isinstance(record, EventRecord)]

    def close(self) -> None:
        """Close the sockets and the journal."""
        if not self.session.records.ending:
            self.session.records.end()
        self.session.records.close()
        self.state.ports.log.close()
