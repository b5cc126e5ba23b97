"""Several operators: whose commands are accepted, and their results."""

import ast
import inspect
import json
from dataclasses import replace

import pytest
from hypothesis import given
from hypothesis import strategies as st

from netboard.base.errors import ConfigError
from netboard.base.tables.experiment import Session
from netboard.network.protocol.control import COMMANDS, REPLAY_COMMANDS, SESSION_COMMANDS, Command
from netboard.nodes.ports import emergency
from netboard.nodes.ports.control_port import CommandRequest
from netboard.nodes.server import operator_requests
from netboard.nodes.server import operators as operators_module
from netboard.nodes.server.operators import BEFORE_OPENING, CAUSES, OPEN_TO_ALL, Operators, Situation, form_of, note_of
from netboard.task.trials.state_machine import TABLE, Cause, Phase
from netboard.windows.operator.commands import FOR_EVERY_CONSOLE

A, B = b"console@1", b"console@2"
NOW = Situation(Phase.IDLE, (), last=False, plan=True)


def by(who: bytes, command: str, *, late: bool = False) -> CommandRequest:
    return CommandRequest(who, {A: "lab:1", B: "lab:2"}[who], Command(command, "", 1), late)


def operators() -> Operators:
    return Operators(opened=True, armed=True)


def test_first_operator_to_command_is_the_commander() -> None:
    ops = operators()
    assert ops.decide(by(A, "start"), NOW).cause is Cause.START
    refused = ops.decide(by(B, "start"), NOW)
    assert (refused.accepted, refused.cause, refused.reason) == (
        False,
        Cause.NONE,
        "lab:1 is in command; take over first (take)",
    )
    assert ops.decide(by(B, "take"), NOW).accepted
    assert ops.decide(by(B, "start"), NOW).accepted
    assert not ops.decide(by(A, "start"), NOW).accepted


def test_late_command_is_refused_unless_it_only_stops_forces_or_is_a_note() -> None:
    running = replace(NOW, phase=Phase.RUNNING)
    accepted = {
        command for command in SESSION_COMMANDS if operators().decide(by(A, command, late=True), running).accepted
    }
    assert accepted == {emergency.STOP, "note", "pause", "disarm"}
    late = operators().decide(by(A, "resume", late=True), replace(NOW, phase=Phase.PAUSED))
    assert (late.cause, late.reason) == (
        Cause.NONE,
        "the connection was interrupted, and resume may be out of date: send it again",
    )


def test_refused_command_lists_the_commands_possible_now() -> None:
    ops = operators()
    paused = replace(NOW, phase=Phase.PAUSED)
    assert ops.decide(by(A, "start"), paused).reason.startswith("cannot start during a pause; possible now: resume")
    assert (
        ops.decide(by(A, "resume"), NOW).reason
        == "cannot resume before the block; possible now: start, stop, repeat, repeat_lost, veto"
    )
    for phase in Phase:
        now = replace(NOW, phase=phase)
        for command in CAUSES:
            decision = operators().decide(by(A, command), now)
            if not decision.accepted:
                for name in decision.reason.partition("possible now: ")[2].split(", "):
                    assert name == "nothing" or operators().decide(by(A, name), now).accepted


@pytest.mark.parametrize("command", ["emergency_stop", "note"])
def test_every_operator_may_stop_and_add_notes(command: str) -> None:
    ops = operators()
    ops.decide(by(A, "take"), NOW)
    assert ops.decide(by(B, command), NOW).accepted
    assert ops.commander == A


def test_another_operator_may_command_after_the_commander_leaves() -> None:
    ops = operators()
    ops.decide(by(A, "take"), NOW)
    ops.leave()
    assert ops.decide(by(B, "pause"), replace(NOW, phase=Phase.RUNNING)).cause is Cause.PAUSE


def test_start_is_refused_until_the_session_form_is_complete() -> None:
    ops = Operators(opened=False, armed=True)
    decision = ops.decide(by(A, "start"), NOW)
    assert (decision.accepted, decision.reason) == (False, "the session is not open: fill in its form first (open)")
    assert all(ops.decide(by(A, name), NOW).accepted for name in BEFORE_OPENING)
    ops.opened = True
    assert ops.decide(by(A, "open"), NOW).reason == "the session is open already"


def test_start_is_refused_with_missing_peers_or_disarmed_devices() -> None:
    ops = operators()
    missing = replace(NOW, missing=("the left agent", "the logger"))
    assert ops.decide(by(A, "start"), missing).reason == "cannot start: waiting for the left agent and the logger"
    assert ops.decide(by(A, "disarm"), NOW).accepted
    assert ops.decide(by(A, "start"), NOW).reason == "cannot start: the devices are not armed (arm)"
    assert ops.decide(by(A, "arm"), NOW).accepted
    assert ops.decide(by(A, "start"), NOW).cause is Cause.START


def test_pause_after_trial_takes_effect_at_its_end_and_can_be_cancelled() -> None:
    ops, running = operators(), replace(NOW, phase=Phase.RUNNING)
    assert ops.decide(by(A, "pause_after_trial"), running).reason == "paused after this trial"
    assert ops.pending == "pause after this trial"
    assert ops.due(Phase.HOLDING) is Cause.NONE
    assert ops.due(Phase.LEVELLING) is Cause.PAUSE
    assert ops.due(Phase.LEVELLING) is Cause.NONE
    ops.decide(by(A, "pause_after_trial"), running)
    assert ops.decide(by(A, "pause_after_trial"), running).reason == "no pause after this trial"
    assert ops.due(Phase.LEVELLING) is Cause.NONE
    levelling = replace(NOW, phase=Phase.LEVELLING)
    assert ops.decide(by(A, "pause_after_trial"), levelling).cause is Cause.PAUSE


@pytest.mark.parametrize("command", REPLAY_COMMANDS)
def test_replay_commands_are_refused_in_a_live_session(command: str) -> None:
    ops = operators()
    decision = ops.decide(by(A, command), NOW)
    assert (decision.accepted, decision.cause) == (False, Cause.NONE)
    assert decision.reason == f"cannot {command}: this is a live session, not a replay"
    assert ops.commander == b""


@pytest.mark.parametrize("command", SESSION_COMMANDS)
def test_every_command_is_named_where_it_is_carried_out(command: str) -> None:
    """A command that no branch names would be accepted, and nothing would happen."""
    trees = [ast.parse(inspect.getsource(module)) for module in (operators_module, operator_requests)]
    named = {node.value for tree in trees for node in ast.walk(tree) if isinstance(node, ast.Constant)}
    assert command in named | {emergency.STOP, emergency.RELEASE}, (
        "the server accepts it and does nothing: decide on it in nodes/server/operators.py, and carry it out in "
        "nodes/server/operator_requests.py"
    )


def test_console_offers_to_everyone_what_the_server_takes_from_everyone() -> None:
    assert set(FOR_EVERY_CONSOLE) == set(OPEN_TO_ALL)


def test_next_and_stop_after_block_require_a_plan() -> None:
    ops = operators()
    for command in ("next", "stop_after_block"):
        assert not ops.decide(by(A, command), replace(NOW, plan=False)).accepted
    assert ops.decide(by(A, "stop_after_block"), NOW).accepted
    assert ops.end_after
    assert ops.decide(by(A, "next"), replace(NOW, last=True)).reason.endswith("this is the last one")
    for phase in (Phase.HOLDING, Phase.SUCCEEDED, Phase.FAILED):
        assert ops.decide(by(A, "next"), replace(NOW, phase=phase)).reason.endswith("pause first")
    assert ops.decide(by(A, "next"), replace(NOW, phase=Phase.FINISHED)).accepted


@pytest.mark.slow
@given(
    commands=st.lists(
        st.tuples(st.sampled_from(COMMANDS), st.sampled_from([A, B]), st.sampled_from(Phase)), max_size=30
    )
)
def test_accepted_commands_have_an_edge_in_the_transition_table(commands: list[tuple[str, bytes, Phase]]) -> None:
    ops = operators()
    for command, peer, phase in commands:
        decision = ops.decide(by(peer, command), replace(NOW, phase=phase))
        assert not decision.cause or (decision.accepted and decision.cause in TABLE[phase])
        assert decision.accepted or decision.reason
        if command not in OPEN_TO_ALL and decision.accepted:
            assert ops.commander == peer
        if command in CAUSES and decision.accepted:
            paused_already = command == "pause" and phase == Phase.PAUSED
            assert decision.cause is (Cause.NONE if paused_already else CAUSES[command])


def test_form_is_converted_to_a_session() -> None:
    fields = {"participant_a": "P07", "participant_b": "P08", "seat_a": "right", "consent": True}
    form = form_of(json.dumps(fields), Session(dyad="D03"))
    assert (form.participant_a, form.seat_a, form.dyad, form.consent) == ("P07", "right", "D03", True)


@pytest.mark.parametrize(
    ("text", "problem"),
    [
        ("{}", "consent"),
        ("[1]", "expected a JSON object"),
        ("{", "not JSON"),
        ('{"pilot": true, "name": "a b"}', "name"),
        ('{"pilot": true, "participant": "P1"}', "participant: unknown key"),
        (r'{"pilot": true, "study": "\ud800"}', "surrogates not allowed"),
    ],
)
def test_invalid_form_is_refused_with_its_problem(text: str, problem: str) -> None:
    with pytest.raises(ConfigError, match=problem):
        form_of(text, Session())


def test_note_has_the_tick_at_which_typing_began() -> None:
    assert note_of('{"text": "sneezed", "tick": 1234}', 9) == ("sneezed", 1234)
    assert note_of("sneezed", 9) == ("sneezed", 9)


@pytest.mark.parametrize("note", ["", " ", '{"text": " ", "tick": 7}', "{}"])
def test_empty_note_is_refused(note: str) -> None:
    with pytest.raises(ConfigError, match="the note"):
        note_of(note, 9)


@pytest.mark.parametrize(
    "note",
    ['{"text": 1}', '{"text": "", "tick": true}', '{"text": "", "tick": -1}', f'{{"text": "", "tick": {10**30}}}'],
)
def test_note_that_the_journal_could_not_read_again_is_refused(note: str) -> None:
    with pytest.raises(ConfigError):
        note_of(note, 9)


def test_deeply_nested_note_is_refused() -> None:
    with pytest.raises(ConfigError, match="the note is not JSON"):
        note_of('{"text":' + "[" * 7000, 5)
