"""What PROTOCOL.md and the how-to pages promise of commands, pauses, blocks and hands that are not a person's."""

from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from stepped_session import OPERATOR, STUDY, SteppedSession

from netboard.base.config import Config, parse
from netboard.network.protocol.control import Command
from netboard.network.transport import sockets
from netboard.nodes.ports import samples
from netboard.nodes.ports.control_port import CommandRequest
from netboard.nodes.ports.latency import LatencySupervisor
from netboard.nodes.server.block_changes import PAGE_TICKS
from netboard.participants.seat.block import Rehearsal
from netboard.task.trials.state_machine import Phase


@pytest.fixture
def automatic(tmp_path: Path, context: sockets.Context) -> Iterator[SteppedSession]:
    session = SteppedSession(tmp_path, context, autostart=True)
    while session.phase == Phase.IDLE:
        session.tick()
    yield session
    session.close()


def sample(state: Any, place: int, z: float, seq: int) -> None:
    """Let a side's agent have sent a sample."""
    agent = state.ports.motion._motion.agents[place].view(samples.AGENT)[0]
    now = state.clock.due_ns
    agent["seq"], agent["taken"], agent["z"], agent["fresh"] = seq, 5, z, 1
    agent["arrived_ns"] = agent["server_stamp_ns"] = agent["stamp_ns"] = now
    agent["safeguards"] = samples.ARMED_BIT


def run_with_samples(session: SteppedSession, count: int, left_z: float = 0.0, first: int = 0) -> None:
    state = session.state
    for _ in range(count):
        sample(state, 0, left_z, first + state.number)
        sample(state, 1, 0.0, first + state.number)
        session.session._tick(0)


def test_still_hand_is_at_height_0_whatever_device_is_connected(tmp_path: Path, context: sockets.Context) -> None:
    session = SteppedSession(tmp_path, context, study=STUDY + 'block.left = "still"\n')
    run_with_samples(session, 20, left_z=0.02)
    row = session.state.rows[session.state.number - 1].copy()
    session.close()
    assert (row["left_sent_z"], row["left_used_z"], row["left_x"]) == (0.0, 0.0, 0.0)


def test_softened_force_stays_softened_after_a_pause() -> None:
    supervisor = LatencySupervisor(parse("", "rig", ('network.delay_action="soften"',)))
    for _ in range(500):
        supervisor.poll([8_000_000, 1_000_000], haptics=True)
    softened = supervisor.gains[0]
    supervisor.poll([8_000_000, 1_000_000], haptics=False)
    supervisor.poll([8_000_000, 1_000_000], haptics=True)
    assert supervisor.gains[0] <= softened + 0.02


def test_latency_of_a_device_that_is_not_in_use_pauses_no_trial(tmp_path: Path, context: sockets.Context) -> None:
    study = STUDY + 'block.left = "still"\n'
    session = SteppedSession(tmp_path, context, 'network.delay_action="disarm"', study=study)
    session.state.ports.motion._motion.agents[0][samples.LOOP] = 9_000_000  # as its agent goes on reporting
    session.state.ports.motion._motion.agents[1][samples.LOOP] = 1_000_000
    session.start()
    session.tick(100)
    phase = session.phase
    session.close()
    assert phase != Phase.PAUSED


@pytest.mark.parametrize("stop", ["fault", "emergency"])
def test_pause_after_the_attempt_is_done_with_once_the_attempt_is_over(stepped: SteppedSession, stop: str) -> None:
    stepped.start()
    stepped.until(Phase.RUNNING)
    assert stepped.do("pause_after_trial")[0]
    if stop == "fault":
        stepped.tick(found=0)
    else:
        stepped.do("emergency_stop")
        stepped.tick(2)
        stepped.do("emergency_release")
    assert stepped.phase == Phase.PAUSED
    assert stepped.do("resume")[0]
    stepped.tick(2)
    assert stepped.phase == Phase.LEVELLING


def test_repeat_in_a_pause_does_not_prevent_the_automatic_resume(automatic: SteppedSession) -> None:
    automatic.succeed()
    automatic.until(Phase.RUNNING)
    automatic.tick(found=0)
    automatic.tick(3)
    assert automatic.phase == Phase.PAUSED
    assert automatic.do("repeat", "1")[0]
    automatic.tick(3000)
    assert automatic.phase != Phase.PAUSED


def test_no_backfill_is_requested_without_an_interruption(tmp_path: Path, context: sockets.Context) -> None:
    study = STUDY.replace("3 dyadic", "solo, dyadic") + '[kinds.solo]\nblock.left = "still"\n'
    session = SteppedSession(tmp_path, context, study=study)
    run_with_samples(session, 200, first=100_000)
    session.ask("next")
    run_with_samples(session, 200, first=100_000)
    backfiller = session.session.records._backfiller
    backfiller.poll(session.state.rows, session.state.number)
    gaps = list(backfiller._gaps["left"].open)
    session.close()
    assert not gaps


def test_rehearsal_that_takes_too_long_is_aborted_whatever_its_phase() -> None:
    config = Config()
    config = replace(config, block=replace(config.block, trials=3))
    people = {"A": config.participant, "B": config.participant}
    rows = np.concatenate([piece.copy() for piece in Rehearsal(config, people).pieces()])
    rehearsal = Rehearsal(config, people)
    rehearsal._last_tick = int(np.flatnonzero(rows["phase"] == Phase.SUCCEEDED)[0])
    for _ in rehearsal.pieces():
        pass
    assert rehearsal.summary().given_up


def test_note_before_the_form_is_in_the_journal(tmp_path: Path, context: sockets.Context) -> None:
    session = SteppedSession(tmp_path, context, pilot=False)
    session.tick(100)
    assert session.do("note", "early")[0]
    session.tick(1000)
    assert session.do("open", '{"consent": true}')[0]
    session.tick(2)
    session.close()
    journal = "".join(path.read_text() for path in tmp_path.rglob("*.jsonl"))
    assert "early" in journal


def test_no_block_begins_after_the_session_was_ended(stepped: SteppedSession) -> None:
    stepped.start()
    stepped.finish_block()
    stepped.tick(10)
    assert stepped.do("end")[0]
    stepped.session.records.backfilling = lambda now: True  # type: ignore[method-assign]
    stepped.session._end()
    stepped.tick(PAGE_TICKS)
    assert sum(event.name == "block_began" for event in stepped.events()) == 1


def test_next_is_refused_in_a_trial(stepped: SteppedSession) -> None:
    stepped.start()
    assert stepped.phase == Phase.LEVELLING
    assert not stepped.do("next")[0]


def test_pause_after_trial_is_accepted_in_the_tick_between_two_trials(stepped: SteppedSession) -> None:
    stepped.start()
    stepped.succeed()
    stepped.ask("pause_after_trial")
    stepped.tick(2)
    assert stepped.replies.pop()[:2] == ("pause_after_trial", True)


def test_operator_may_start_before_the_end_of_the_rest(automatic: SteppedSession) -> None:
    automatic.finish_block()
    automatic.tick(PAGE_TICKS + 5)
    assert (automatic.block, automatic.phase) == (2, Phase.IDLE)
    accepted, reason = automatic.do("start")
    assert accepted, reason


def test_console_that_was_silent_is_no_longer_the_commander(stepped: SteppedSession) -> None:
    assert stepped.do("arm")[0]
    control = stepped.state.ports.control
    control.is_present = lambda who: who != OPERATOR  # type: ignore[method-assign]
    stepped.tick(4000)
    control.is_present = lambda who: True  # type: ignore[method-assign]
    control.requests.append(CommandRequest(b"other", "other", Command("disarm", "", 1)))
    stepped.tick()
    assert stepped.replies.pop()[1]


def test_emergency_stop_before_a_block_disarms_at_once(stepped: SteppedSession) -> None:
    assert stepped.do("arm")[0]
    sent: list[bool] = []
    stepped.state.ports.motion.send_heartbeat = (  # type: ignore[method-assign]
        lambda tick, at_once=False, sides=(): sent.append(at_once or tick % 4 == 0)
    )
    while stepped.state.number % 4 != 1:
        stepped.tick()
    sent.clear()
    stepped.do("emergency_stop")
    assert True in sent
