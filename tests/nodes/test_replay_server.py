"""A recording served on real sockets: views, answers, and refusals."""

from collections.abc import Iterator
from contextlib import ExitStack
from dataclasses import replace

import numpy as np
import pytest

from made_recordings import CONFIG, loaded_recording, two_trials
from netboard.base.clock import now_ns
from netboard.base.config import SIDES, Side
from netboard.base.tables.rig import Network
from netboard.network.protocol.codec import decode, encode
from netboard.network.protocol.control import COMMANDS, REPLAY_COMMANDS, Reply, Status
from netboard.network.protocol.joining import Goodbye, Hello, Refusal, Welcome
from netboard.network.protocol.messages import PROTOCOL_VERSION, Message
from netboard.network.protocol.records import EventRecord, LogRequest
from netboard.network.transport import channels, poller, sockets
from netboard.network.transport.ports import free_port
from netboard.nodes.operator.operator import Operator
from netboard.nodes.replay.replay_server import MAX_CHARACTERS, ReplayServer
from netboard.stage.curtain import make_curtain, view_of
from netboard.stage.view import View

TRIES = 2000
ATTEMPT_ENDED = EventRecord(
    0, 4100, 0, "attempt_ended", {"trial": "1", "attempt": "1", "outcome": "success", "flags": "late"}
)
NOTE = EventRecord(1, 4200, 0, "command", {"name": "note", "argument": "x" * 60_000})


class Rig:
    """A paused replay with a client on each of its channels, all in one thread."""

    def __init__(self, stack: ExitStack) -> None:
        self.network = replace(Network(), port=free_port())
        self.context = stack.enter_context(sockets.open_context())
        self.recording = loaded_recording(two_trials(), ATTEMPT_ENDED, NOTE)
        self.server = ReplayServer(self.recording, self.network, self.context, None)
        where = channels.addresses(self.network)
        self.operator = Operator(self.network, self.context)
        self.stations = {
            side: sockets.view_subscriber(self.context, where.reach(channels.VIEW[side])) for side in SIDES
        }
        self.agent = sockets.motion_agent(self.context, where.reach(channels.MOTION), "agent.left@test")
        self.logger = sockets.log_client(self.context, where.reach(channels.LOG), "logger@test")
        self.display = sockets.control_client(self.context, where.reach(channels.CONTROL), "display.left@test")
        self.milliseconds = 0
        self.over = False
        self.status()

    def run_server(self) -> None:
        self.server.run_once(self.milliseconds)
        self.server.housekeeping()
        self.milliseconds += 1

    def leave(self) -> None:
        self.over = True
        self.server.leave()

    def status(self) -> Status:
        for _ in range(TRIES):
            self.run_server()
            if (status := self.operator.ask(0.002)) is not None:
                return status
        raise AssertionError("no status")

    def do(self, name: str, argument: str = "") -> Reply:
        number = self.operator.command(name, argument)
        for _ in range(TRIES):
            self.run_server()
            self.operator.attend(0.001)
            if (reply := self.operator.reply(number)) is not None:
                return reply
        raise AssertionError("no reply")

    def exchange(self, socket: sockets.Socket, *messages: Message) -> Message:
        """Send messages until an answer arrives, and return it."""
        for message in messages:
            sockets.send(socket, encode(message))
        for _ in range(TRIES):
            self.run_server()
            if poller.wait_readable(socket, 0.001) and (frame := sockets.receive(socket)) is not None:
                return decode(frame)
            for message in messages:
                sockets.send(socket, encode(message))
        raise AssertionError("no answer")

    def arrived(self, socket: sockets.Socket) -> Message:
        """Wait for a message that was sent."""
        while (frame := sockets.receive(socket)) is None:
            assert poller.wait_readable(socket, 30.0)
        return decode(frame)

    def view(self, side: Side) -> View:
        """A view sent after this call."""
        now = now_ns()
        while True:
            view = self.exchange(self.stations[side])
            assert isinstance(view, View)
            if view.sent_ns >= now:
                return view


@pytest.fixture
def rig() -> Iterator[Rig]:
    with ExitStack() as stack:
        created = Rig(stack)
        yield created
        if not created.over:
            created.leave()
        created.operator.leave()
        for socket in (*created.stations.values(), created.agent, created.logger, created.display):
            socket.close(linger=0)


def test_station_receives_only_what_its_participant_could_see(rig: Rig) -> None:
    curtain, rows = make_curtain(CONFIG), two_trials()
    for position in (0.2, 0.9, 2.0, 3.333, 4.0, 4.001, 7.5, 9.999):
        assert rig.do("seek", str(position)).accepted
        for side in SIDES:
            view = rig.view(side)
            row = rows[rows["tick"] == view.tick][0]
            assert view.tick == 100 + round(position * 1000)
            assert view == view_of(curtain, row, side, 3.0 if position >= 4.0 else None, view.sent_ns, view.seq)
            assert (view.left is None) == (side == "right")


@pytest.mark.slow
def test_paused_replay_repeats_its_view_with_new_numbers(rig: Rig) -> None:
    first, second = rig.view("left"), rig.view("left")
    assert second.seq > first.seq
    assert second.tick == first.tick


@pytest.mark.slow
def test_status_matches_the_recording_and_no_device_is_armed(rig: Rig) -> None:
    rig.do("seek", "4.05")
    status = rig.status()
    assert (status.tick, status.phase, status.trial, status.trials) == (4151, "levelling", 2, 6)
    assert (status.armed, status.opened, status.commander, status.waiting_for) == (False, True, "", ())
    assert status.peers == ("console",)
    assert status.notice.startswith("replay of made.mcap: paused at 0:04.")
    assert "x" * 50 in rig.do("seek", "4.2").reason
    assert [station.side for station in status.stations] == ["left", "right"]
    rig.do("seek", "7")
    left = rig.status().stations[0]
    assert np.isnan(left.age)
    assert left.lost_ticks == 1000, "no tick of this attempt had a sample"


@pytest.mark.slow
def test_seeking_back_clears_later_attempts_and_points_of_a_console(rig: Rig) -> None:
    operator = rig.operator
    rig.do("seek", "5")
    for _ in range(20):
        rig.status()
    assert [attempt[:4] for attempt in operator.attempts] == [(1, 1, 1, "success")]
    operator.poll()
    rig.status()
    for _ in range(TRIES):
        rig.run_server()
        operator.attend(0.001)
        if operator.points:
            break
    assert [point[0] for point in operator.points][-2:] == [5095, 5100]
    rig.do("seek", "2")
    rig.status()
    assert operator.attempts == []
    assert list(operator.points) == []


def test_live_commands_are_refused_with_a_reason(rig: Rig) -> None:
    for command in set(COMMANDS) - {*REPLAY_COMMANDS, "pause", "resume", "next", "end", "take"}:
        reply = rig.do(command)
        assert not reply.accepted
        assert reply.reason.startswith(f"cannot {command}: this is a replay of made.mcap; expected one of ")
    assert not rig.status().armed


def test_quoted_argument_is_truncated_to_fit_the_reply(rig: Rig) -> None:
    reply = rig.do("seek", "\U0001f600" * 2000)
    assert not reply.accepted
    assert len(reply.reason) == MAX_CHARACTERS


@pytest.mark.slow
def test_replay_commands_seek_step_play_and_end(rig: Rig) -> None:
    assert rig.do("seek", "trial 2").reason.startswith("paused at 0:04.0 of 0:10.0, 1 times real time, tick 4101")
    assert "tick 4106" in rig.do("step", "5").reason
    assert rig.do("take").accepted
    assert rig.do("play").reason.startswith("playing")
    assert rig.do("end").reason == "the replay ends"


def test_agents_and_loggers_are_refused(rig: Rig) -> None:
    agent = rig.exchange(rig.agent, Hello("agent", "left", PROTOCOL_VERSION, "lab:1", "1", {}))
    assert agent == Refusal("this is a replay of made.mcap: it has no forces, so no agent can connect")
    logger = rig.exchange(rig.logger, Hello("logger", "", PROTOCOL_VERSION, "lab:1", "1", {}), LogRequest(-1))
    assert logger == Refusal("this is a replay of made.mcap: it has no records for a logger")


def test_display_receives_the_recorded_configuration_and_goodbye(rig: Rig, monkeypatch: pytest.MonkeyPatch) -> None:
    welcome = rig.exchange(rig.display, Hello("display", "left", PROTOCOL_VERSION, "lab:1", "1", {}))
    assert isinstance(welcome, Welcome)
    assert welcome.config == rig.recording.text
    assert rig.status().peers == ("console", "display.left")
    sockets.send(rig.display, encode(Hello("display", "left", PROTOCOL_VERSION, "lab:1", "1", {})))

    def read(seconds: float) -> None:
        """Read as a display does while the server waits; libzmq drops what is unread when the connection ends."""
        while not isinstance(rig.arrived(rig.display), Goodbye):
            pass  # a welcome for each Hello sent until the first one came
        again = poller.wait_readable(rig.display, seconds)
        assert not again, "it is welcomed again, and shows that the connection is lost"

    with monkeypatch.context() as patches:
        patches.setattr("netboard.nodes.replay.replay_server.time.sleep", read)
        rig.leave()
