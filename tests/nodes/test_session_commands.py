"""Operators' commands in every phase of a session, and the transitions from block to block."""

from collections.abc import Callable, Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from fake_router import hello
from motion_rig import Peers
from stepped_session import SteppedSession

from netboard.base.clock import now_ns
from netboard.base.tables.experiment import MAX_TRIALS
from netboard.base.tables.questionnaires import UNANSWERED, Form, FormQuestion, packed
from netboard.base.tick import RENDERED, TICK_NS
from netboard.network.protocol.codec import decode, encode
from netboard.network.protocol.control import Status
from netboard.network.protocol.joining import Goodbye, Hello, Welcome
from netboard.network.protocol.messages import PROTOCOL_VERSION, Message
from netboard.network.protocol.motion import BackfillRequest, Force, Heartbeat
from netboard.network.protocol.records import BackfillRecord, EventRecord
from netboard.network.transport import channels, sockets
from netboard.nodes.agent.rendered_buffer import RenderedRing
from netboard.nodes.ports.control_port import MAX_PEERS
from netboard.nodes.ports.log_port import LogPort
from netboard.nodes.ports.peer import ProbedPeer
from netboard.nodes.server.block_changes import PAGE_TICKS
from netboard.nodes.server.record_keeping import BACKFILL_NS, BACKFILL_SILENCE_NS, FRAMES_AT_ONCE
from netboard.nodes.server.session import FEED_TICKS
from netboard.nodes.server.supervision import READY_TICKS
from netboard.stage.curtain import Pause
from netboard.task.journal.entries import AttemptEnded, EmergencyReleased, EmergencyStopped, read_lines
from netboard.task.trials.state_machine import Phase


@pytest.fixture
def automatic(tmp_path: Path, context: sockets.Context) -> Iterator[SteppedSession]:
    """A session whose blocks start by themselves."""
    stepped = SteppedSession(tmp_path, context, autostart=True)
    yield stepped
    stepped.close()


def test_block_that_starts_by_itself_waits_for_the_end_of_its_rest(automatic: SteppedSession) -> None:
    automatic.finish_block()
    automatic.tick(PAGE_TICKS + READY_TICKS)
    assert (automatic.block, automatic.phase) == (2, Phase.IDLE)
    assert automatic.state.missing == ("the end of the rest break",)
    automatic.state.rest_until_ns = 0
    automatic.tick(2 * READY_TICKS)
    assert automatic.phase != Phase.IDLE


def test_session_goes_on_without_the_answers_that_an_operator_skips(automatic: SteppedSession) -> None:
    automatic.finish_block()
    form = Form((packed("after", "effort", FormQuestion()),), wait=3600.0)
    automatic.state.forms.ask(replace(automatic.state.block.config, form=form))
    automatic.tick(PAGE_TICKS + READY_TICKS)
    assert automatic.block == 1, "it waits for the answers"
    assert automatic.do("skip_form") == (True, "the session goes on without answers from left and right")
    assert automatic.do("skip_form") == (False, "no questionnaire waits for answers")
    assert automatic.block == 2
    found = [event.details for event in automatic.events() if event.name == UNANSWERED]
    assert found == [{"station": side, "block": "1", "skipped_by": "console"} for side in ("left", "right")]


def test_pause_that_comes_with_a_fault_prevents_an_automatic_resume(automatic: SteppedSession) -> None:
    automatic.until(Phase.RUNNING)
    automatic.ask("pause")
    automatic.tick(found=0)
    assert (automatic.phase, automatic.replies) == (Phase.PAUSED, [])
    automatic.tick()
    assert automatic.replies == [("pause", True, "it is paused already, and waits for resume")]
    automatic.tick(2 * READY_TICKS)
    assert automatic.phase == Phase.PAUSED
    assert automatic.do("resume") == (True, "")
    assert automatic.phase == Phase.LEVELLING


def test_pause_after_the_last_trial_is_no_pause_in_the_next_block(stepped: SteppedSession) -> None:
    stepped.start()
    stepped.succeed()
    stepped.tick()
    stepped.until(Phase.RUNNING)
    assert stepped.do("pause_after_trial")[0]
    stepped.finish_block()
    assert stepped.state.operators.pending == ""
    stepped.tick(PAGE_TICKS)
    assert (stepped.block, stepped.do("start")) == (2, (True, ""))
    stepped.until(Phase.RUNNING)


@pytest.mark.parametrize("commands", [("stop_after_block", "stop"), ("stop", "stop_after_block")])
def test_session_ends_after_a_stopped_block_if_an_operator_has_asked_for_it(
    stepped: SteppedSession, commands: tuple[str, str]
) -> None:
    stepped.start()
    stepped.until(Phase.RUNNING)
    for command in commands:
        assert stepped.do(command)[0]
    assert (stepped.phase, stepped.state.end_requested) == (Phase.FINISHED, True)


def test_stopped_block_waits_for_the_operator(stepped: SteppedSession) -> None:
    stepped.start()
    stepped.until(Phase.RUNNING)
    assert stepped.do("stop") == (True, "")
    stepped.tick(2 * PAGE_TICKS)
    assert (stepped.block, stepped.phase, stepped.state.end_requested) == (1, Phase.FINISHED, False)
    assert stepped.do("next") == (True, "")
    stepped.tick()
    assert (stepped.block, stepped.phase) == (2, Phase.IDLE)


def test_refused_form_leaves_no_consent_behind(tmp_path: Path, context: sockets.Context) -> None:
    stepped = SteppedSession(tmp_path, context, pilot=False)
    (tmp_path / "D01_S01.journal.jsonl").touch()
    accepted, reason = stepped.do("open", '{"participant_a": "P07", "consent": true}')
    assert not accepted
    assert "already exists" in reason
    assert stepped.do("open", '{"name": "S02"}') == (
        False,
        "without the consent of both participants, only a pilot run is possible",
    )
    long = "n" * 81
    why = "the form: [session] name: found 81 characters, expected at most 80"
    assert stepped.do("open", f'{{"name": "{long}", "consent": true}}') == (False, why)
    assert stepped.do("open", '{"name": "S02", "consent": true}') == (True, "")
    session = stepped.state.block.config.session
    assert (session.name, session.participant_a, session.consent) == ("S02", "P01", True)
    stepped.close()


@pytest.mark.parametrize(("name", "found", "expected"), [("dyad", "D07", "D01"), ("study", "other", "small")])
def test_form_of_another_dyad_or_study_than_the_plan_is_refused(
    name: str, found: str, expected: str, tmp_path: Path, context: sockets.Context
) -> None:
    stepped = SteppedSession(tmp_path, context, pilot=False)
    why = f'the form: [session] {name}: found "{found}", expected "{expected}", whose plan this server runs'
    accepted, reason = stepped.do("open", f'{{"{name}": "{found}", "consent": true}}')
    assert (accepted, reason) == (False, f"{why} (--study small --dyad 1)")
    assert list(tmp_path.iterdir()) == []
    assert stepped.do("open", f'{{"{name}": "{expected}", "consent": true}}') == (True, "")
    stepped.close()


def test_form_with_other_participants_than_the_first_session_of_the_dyad_is_refused(
    tmp_path: Path, context: sockets.Context
) -> None:
    first = SteppedSession(tmp_path, context, pilot=False)
    assert first.do("open", '{"participant_a": "P07", "participant_b": "P08", "consent": true}') == (True, "")
    first.close()
    second = SteppedSession(tmp_path, context, "session.name=S02", pilot=False)
    accepted, reason = second.do("open", '{"participant_a": "P07", "participant_b": "P80", "consent": true}')
    assert not accepted
    assert reason.startswith("participants: P07 and P80, but P07 and P08 in session S01 of dyad D01")
    assert not (tmp_path / "D01_S02.journal.jsonl").exists()
    assert second.do("open", '{"participant_a": "P07", "participant_b": "P08", "consent": true}') == (True, "")
    second.close()


def test_second_session_with_another_plan_says_so(
    tmp_path: Path, context: sockets.Context, capsys: pytest.CaptureFixture[str]
) -> None:
    first = SteppedSession(tmp_path, context, pilot=False)
    first.do("open", '{"consent": true}')
    first.close()
    (tmp_path / "D01_S00.journal.jsonl").write_text("damaged")
    SteppedSession(tmp_path, context, "session.name=S02", pilot=False).close()
    assert capsys.readouterr().out == ""
    second = SteppedSession(tmp_path, context, "session.name=S02", "session.hand_b=left", pilot=False, autostart=True)
    said = "this is not the plan of session S01 of dyad D01: check --dyad"
    assert said in capsys.readouterr().out
    assert said in second.session._answers.status().notice
    assert second.do("open", '{"consent": true}') == (True, "")
    assert said in second.session._answers.status().notice
    second.succeed()
    assert said not in second.session._answers.status().notice
    second.close()


def succeeded(stepped: SteppedSession) -> None:
    stepped.succeed()


def failed(stepped: SteppedSession) -> None:
    stepped.until(Phase.RUNNING)
    stepped.state.stage["p"] = 1.0
    stepped.until(Phase.FAILED)


def running(stepped: SteppedSession) -> None:
    stepped.until(Phase.RUNNING)


@pytest.mark.parametrize("bring", [succeeded, failed])
def test_pause_in_the_tick_between_two_trials_waits_for_the_next_tick(
    stepped: SteppedSession, bring: Callable[[SteppedSession], None]
) -> None:
    stepped.start()
    bring(stepped)
    stepped.ask("pause")
    stepped.tick(2)
    assert (stepped.replies, stepped.phase) == ([("pause", True, "")], Phase.PAUSED)


@pytest.mark.parametrize("bring", [succeeded, failed, running])
def test_end_stops_the_block_in_every_phase(stepped: SteppedSession, bring: Callable[[SteppedSession], None]) -> None:
    stepped.start()
    bring(stepped)
    stepped.session._end()
    assert stepped.phase == Phase.FINISHED
    assert [event.name for event in stepped.events()][-3:] == ["stop", "attempt_ended", "session_ended"]
    assert stepped.state.attempts.finished[-1].outcome == "aborted"


AGENT = b"agent.left@1"


def test_session_that_was_never_opened_ends_cleanly(tmp_path: Path, context: sockets.Context) -> None:
    stepped = SteppedSession(tmp_path, context, pilot=False)
    stepped.tick(20)
    stepped.state.end_requested = True  # as Ctrl-C does; an operator's `end` likewise
    assert stepped.session._end()
    assert stepped.phase == Phase.FINISHED
    stepped.close()


def test_each_block_records_the_agents_that_are_there_as_it_begins(stepped: SteppedSession) -> None:
    """They joined in the recording of an earlier block, and each block has one of its own."""
    agent, said = stepped.state.ports.motion.agents["left"], hello("agent", "left")
    agent.hello = replace(said, details={"model": "Touch", "serial": "7", "side": "right"})
    stepped.session._blocks._begin_block()
    agent.hello = None
    began, present = stepped.events()[-2:]
    assert (began.name, began.tick) == ("block_began", present.tick)
    assert present.name == "agent_present"
    assert present.details == {"side": "left", "name": said.name, "model": "Touch", "serial": "7"}


class LeftAgent:
    """The left agent of a session, with its connection."""

    def __init__(self, stepped: SteppedSession, context: sockets.Context) -> None:
        address = channels.addresses(stepped.state.block.config.network).listen(channels.MOTION).address
        self.peers, self.motion = Peers(context, address), stepped.state.ports.motion
        self.received: list[Message] = []

    def join(self) -> None:
        """Say hello, and wait for the welcome."""
        self.received.clear()
        self.send(hello("agent", "left"))
        while not any(isinstance(message, Welcome) for message in self.received):
            self.read()

    def send(self, message: Message) -> None:
        """Send a message to the session."""
        self.peers.send_from(AGENT, message)

    def read(self) -> None:
        """Let the session take what has arrived, and take what it has sent."""
        self.motion.drain(now_ns, 0)
        self.motion.attend(now_ns(), 0)
        self.received += self.peers.received_by(AGENT)

    def close(self) -> None:
        """Disconnect."""
        self.peers.disconnect(AGENT)


@pytest.fixture
def left(stepped: SteppedSession, context: sockets.Context) -> Iterator[LeftAgent]:
    """The left agent of a session with a running trial."""
    stepped.start()
    stepped.until(Phase.RUNNING)
    agent = LeftAgent(stepped, context)
    agent.join()
    stepped.tick()  # compiling what sends the first force can take longer than an agent may be silent
    agent.join()
    yield agent
    agent.close()


def test_session_ends_with_a_heartbeat_that_commands_no_force(stepped: SteppedSession, left: LeftAgent) -> None:
    stepped.session._end()
    while not isinstance(left.received[-1], Goodbye):
        left.received += left.peers.received_by(AGENT)
    force, heartbeat = left.received[-3:-1]
    assert isinstance(force, Force)
    assert isinstance(heartbeat, Heartbeat)
    assert heartbeat.tick > force.tick
    assert not heartbeat.arm


@pytest.fixture
def after_a_cut(stepped: SteppedSession) -> SteppedSession:
    """A session whose left agent, with a known clock, has not yet sent what it rendered during an interruption."""
    stepped.state.ports.motion.knows_clock = lambda side: side == "left"  # type: ignore[method-assign]
    stepped.session.records._backfiller._gaps["left"].open.append(BackfillRequest(0, 100))
    return stepped


def test_session_ends_after_the_agent_has_sent_what_it_rendered_during_a_cut(
    after_a_cut: SteppedSession, left: LeftAgent
) -> None:
    ring = RenderedRing()
    for seq in range(100):
        ring.add(seq, seq * TICK_NS, 0.01 * seq, 0)
    while not after_a_cut.session._end():
        left.read()
        for message in left.received:
            if isinstance(message, BackfillRequest):
                left.send(ring.answer(message))
        left.received.clear()
    records = after_a_cut.records()
    backfilled = b"".join(record.rows for record in records if isinstance(record, BackfillRecord))
    np.testing.assert_array_equal(np.frombuffer(backfilled, RENDERED)["rendered"], 0.01 * np.arange(100))
    last = records[-1]
    assert isinstance(last, EventRecord)
    assert last.name == "session_ended"


@pytest.mark.parametrize("limit", ["began", "heard"])
def test_session_ends_without_a_silent_agent(after_a_cut: SteppedSession, left: LeftAgent, limit: str) -> None:
    session = after_a_cut.session
    assert not session._end()
    longest = {"began": BACKFILL_NS, "heard": BACKFILL_SILENCE_NS}
    setattr(session.records, f"_backfill_{limit}_ns", now_ns() - longest[limit])
    assert session._end()
    assert session.records.ending


def test_status_of_a_long_block_with_many_peers_fits_its_message(stepped: SteppedSession) -> None:
    stepped.state.attempts.completions = [float(k) for k in range(MAX_TRIALS + 300)]
    for role, side, most in (("display", "left", MAX_PEERS), ("console", "", MAX_PEERS), ("listener", "", 12)):
        for number in range(most):
            introduction = Hello(role, side, PROTOCOL_VERSION, "\U0001f40c" * 1000, "1" * 1000, {})
            name = f"{role} {number}".encode()
            stepped.state.ports.control._peers[name] = ProbedPeer(introduction, now_ns())
    stepped.state.ports.control.refusals._count.totals.update({f"{'x' * 8000}{number}": 1 for number in range(8)})
    said = decode(encode(stepped.session._answers.status()))
    assert isinstance(said, Status)
    assert said.completions[-1] == MAX_TRIALS + 299
    assert len(said.completions) == MAX_TRIALS
    assert len(said.links) == 2 * MAX_PEERS + 12


def test_status_before_a_trial_gives_the_reason_of_a_logger_that_left(stepped: SteppedSession) -> None:
    log, reason = stepped.state.ports.log, "the logger has left: /data: only 4 MB free"
    log._leave_reason = "/data: only 4 MB free"
    log.trouble = reason
    stepped.state.supervisor.notice = "waiting for the logger"
    assert stepped.session._answers.status().notice == f"waiting for the logger; {reason}"
    stepped.state.supervisor.notice = f"paused: {reason}"
    assert stepped.session._answers.status().notice == f"paused: {reason}"


def test_frames_of_two_displays_at_the_highest_rate_are_recorded_as_fast_as_they_are_painted() -> None:
    assert FRAMES_AT_ONCE * 1000 / FEED_TICKS > 2 * 240


TROUBLES: dict[str, Callable[[SteppedSession], object]] = {
    "the operator has disarmed": lambda stepped: stepped.do("disarm"),
    "emergency stop": lambda stepped: stepped.do("emergency_stop"),
    "the server stalled": lambda stepped: setattr(stepped.state.clock, "gap", "the server stalled for 30 ms"),
    "too late": lambda stepped: setattr(stepped.state.block.latency, "trouble", "forces come too late"),
    "the log": lambda stepped: setattr(stepped.state.ports.log, "trouble", "the log is full"),
}


@pytest.mark.parametrize("named", TROUBLES)
def test_any_trouble_pauses_a_trial_with_haptic_feedback_at_the_next_tick(
    tmp_path: Path, context: sockets.Context, monkeypatch: pytest.MonkeyPatch, named: str
) -> None:
    """Even though all samples are in order: a force waits for nothing that is not due."""
    monkeypatch.setattr(LogPort, "loggers", 1)
    stepped = SteppedSession(tmp_path, context, "network.require_logger=true")
    stepped.start()
    stepped.until(Phase.RUNNING)
    stepped.tick()
    assert stepped.state.felt
    assert stepped.session._can_run_in_one_call
    TROUBLES[named](stepped)
    assert not stepped.session._can_run_in_one_call
    stepped.tick()
    assert stepped.phase == Phase.PAUSED
    assert named in stepped.state.supervisor.notice
    stepped.close()


def test_device_replaced_in_a_trial_is_recorded_and_awaits_the_operator(automatic: SteppedSession) -> None:
    state, seen = automatic.state, []
    state.note = lambda name, details: seen.append((name, details))  # type: ignore[method-assign]

    def join(phase: Phase, name: str, serial: str) -> None:
        state._phase_word[0] = phase
        details = {"side": "left", "name": name, "device": "virtual", "model": "virtual Touch", "serial": serial}
        state.ports.motion.news.append(("agent_joined", details))
        automatic.session.records.keep(now_ns())
        state._phase_word[0] = Phase.IDLE

    join(Phase.IDLE, "a:1", "1")
    join(Phase.IDLE, "a:1", "2")
    join(Phase.PAUSED, "a:2", "2")  # the agent was restarted
    assert not state.supervisor._replaced
    join(Phase.PAUSED, "a:2", "3")
    assert state.supervisor._replaced == "the left device was replaced by another one"
    join(Phase.PAUSED, "b:1", "3")
    whole, state.block = state.block, replace(state.block, moved=("right",))
    join(Phase.PAUSED, "b:1", "4")  # at the side of a hand that is held still, where it has no force
    state.block = whole
    assert [details for name, details in seen if name == "device_replaced"] == [
        {"side": "left", "before": "virtual virtual Touch 2 at a", "now": "virtual virtual Touch 3 at a"},
        {"side": "left", "before": "virtual virtual Touch 3 at a", "now": "virtual virtual Touch 3 at b"},
    ]


def test_block_does_not_start_by_itself_after_an_emergency_stop(automatic: SteppedSession) -> None:
    assert automatic.do("emergency_stop")[0]
    automatic.tick(2 * READY_TICKS)
    assert automatic.do("emergency_release")[0]
    automatic.tick(3 * READY_TICKS)
    assert automatic.phase == Phase.IDLE
    assert automatic.state.supervisor.notice == "ready to start after the emergency stop"
    assert automatic.do("start") == (True, "")
    automatic.finish_block()
    automatic.tick(PAGE_TICKS)
    automatic.state.rest_until_ns = 0
    automatic.tick(2 * READY_TICKS)
    assert (automatic.block, automatic.phase) == (2, Phase.RUNNING)


def test_devices_cannot_be_armed_during_an_emergency_stop(stepped: SteppedSession) -> None:
    """Otherwise the release would arm devices that were disarmed before the stop."""
    assert stepped.do("emergency_stop")[0]
    why = "cannot arm during an emergency stop: release it first (emergency_release)"
    assert stepped.do("arm") == (False, why)
    assert stepped.do("emergency_release")[0]
    assert not stepped.state.ports.motion.may_arm
    assert stepped.do("arm")[0]
    assert stepped.state.ports.motion.may_arm


@pytest.mark.parametrize("command", ["skip", "abort", "start", "stop", "emergency_release", "arm", "next"])
def test_command_with_words_that_mean_nothing_is_refused(stepped: SteppedSession, command: str) -> None:
    """``skip 6`` would otherwise skip the trial that runs, which is another one."""
    stepped.start()
    stepped.until(Phase.RUNNING)
    assert stepped.do(command, "6") == (False, f"{command} has no argument; found '6'")
    stepped.tick(2)
    assert stepped.phase == Phase.RUNNING


@pytest.mark.parametrize("command", ["emergency_stop", "pause", "disarm"])
def test_command_that_stops_forces_acts_whatever_follows_it(stepped: SteppedSession, command: str) -> None:
    stepped.start()
    stepped.until(Phase.RUNNING)
    assert stepped.do(command, "please")[0]
    stepped.tick()
    assert stepped.phase == Phase.PAUSED


def test_release_without_an_emergency_stop_delays_nothing(automatic: SteppedSession) -> None:
    assert automatic.do("emergency_release") == (True, "there is no emergency stop to release")
    automatic.tick(2 * READY_TICKS)
    assert automatic.phase != Phase.IDLE


def test_last_trial_of_a_block_can_be_repeated_while_it_runs(stepped: SteppedSession) -> None:
    stepped.start()
    stepped.succeed()
    stepped.tick()
    accepted, reason = stepped.do("repeat", "2")
    assert (accepted, reason) == (False, "trial 2 cannot be repeated: trials 1 to 1 are done in this block")
    stepped.until(Phase.RUNNING)
    assert stepped.do("repeat", "2") == (True, "trial 2 is repeated at the end of the block")
    stepped.succeed()
    stepped.tick()
    assert stepped.phase == Phase.LEVELLING
    stepped.finish_block()
    assert [(row[1], row[6]) for row in stepped.state.attempts.finished] == [(1, 0), (2, 0), (3, 2)]
    assert stepped.do("repeat") == (True, "trial 3 is repeated at the end of the block")
    assert stepped.phase == Phase.PAUSED


def test_refused_command_changes_no_operators_notice(stepped: SteppedSession) -> None:
    stepped.tick()
    before = stepped.session._answers.status().notice
    assert not stepped.do("resume")[0]
    stepped.tick()
    assert stepped.session._answers.status().notice == before


def test_pause_and_emergency_stop_are_told_to_operators_and_participants(stepped: SteppedSession) -> None:
    stepped.start()
    stepped.until(Phase.RUNNING)
    assert stepped.state.view_notice == Pause.NONE
    stepped.do("pause")
    assert stepped.state.supervisor.notice == "paused by the operator (console)"
    assert stepped.state.view_notice == Pause.OPERATOR
    stepped.do("resume")
    stepped.until(Phase.RUNNING)
    assert stepped.do("pause_after_trial")[0]
    stepped.succeed()
    stepped.until(Phase.PAUSED)
    assert stepped.state.supervisor.notice == "paused by the operator (console)"
    stepped.do("resume")
    stepped.until(Phase.RUNNING)
    stepped.do("emergency_stop")
    stepped.until(Phase.PAUSED)
    assert stepped.state.view_notice == Pause.STOP
    stepped.do("emergency_release")
    assert stepped.state.supervisor.notice == "paused: emergency stop by an operator"
    assert stepped.state.view_notice == Pause.STOP


def test_emergency_stop_has_its_own_outcome_and_journal_entries(tmp_path: Path, context: sockets.Context) -> None:
    stepped = SteppedSession(tmp_path, context)
    stepped.start()
    stepped.until(Phase.RUNNING)
    stepped.do("emergency_stop")
    stepped.until(Phase.PAUSED)
    stepped.do("emergency_release")
    assert [one.outcome for one in stepped.state.attempts.finished] == ["emergency_stop"]
    stepped.close()
    _, entries, *_ = read_lines(stepped.planned.path.read_bytes(), "journal")
    assert [entry.outcome for entry in entries if isinstance(entry, AttemptEnded)] == ["emergency_stop"]
    assert [entry.reason for entry in entries if isinstance(entry, EmergencyStopped)] == [
        "emergency stop by an operator"
    ]
    assert len([entry for entry in entries if isinstance(entry, EmergencyReleased)]) == 1


def test_devices_are_disarmed_after_the_last_block(stepped: SteppedSession) -> None:
    for block in (1, 2, 3):
        stepped.start()
        stepped.finish_block()
        assert stepped.state.operators.armed == (block < 3)
        stepped.tick(PAGE_TICKS + 1)
    assert not stepped.state.ports.motion.may_arm
    stepped.state.missing = ("the left device to be armed",)
    assert stepped.session._answers.status().waiting_for == ()
