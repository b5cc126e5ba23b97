"""Several operators: whose commands are accepted, and their results."""

import json
from dataclasses import replace

import pytest
from hypothesis import given
from hypothesis import strategies as st

from netboard.base.errors import ConfigError
from netboard.base.tables.experiment import Session
from netboard.network.protocol.control import COMMANDS, REPLAY_COMMANDS
from netboard.nodes.server.operators import BEFORE_OPENING, CAUSES, OPEN_TO_ALL, Operators, Situation, form_of, note_of
from netboard.task.trials.state_machine import TABLE, Cause, Phase

A, B = b"console@1", b"console@2"
NOW = Situation(Phase.IDLE, (), last=False, plan=True)


def operators() -> Operators:
    return Operators(opened=True, armed=True)


def test_whoever_commands_first_is_the_commander_and_others_are_refused() -> None:
    one = operators()
    assert one.decide("start", A, "lab:1", NOW).cause is Cause.START
    refused = one.decide("start", B, "lab:2", NOW)
    assert (refused.accepted, refused.cause, refused.reason) == (
        False,
        Cause.NONE,
        "lab:1 commands; take over first (take)",
    )
    assert one.decide("take", B, "lab:2", NOW).accepted
    assert one.decide("start", B, "lab:2", NOW).accepted
    assert not one.decide("start", A, "lab:1", NOW).accepted


def test_what_cannot_be_done_now_is_refused_with_what_can() -> None:
    one = operators()
    paused = replace(NOW, phase=Phase.PAUSED)
    assert one.decide("start", A, "lab:1", paused).reason.startswith("cannot start while paused; possible now: resume")
    assert (
        one.decide("resume", A, "lab:1", NOW).reason
        == "cannot resume while idle; possible now: start, stop, repeat, veto"
    )
    for phase in Phase:
        now = replace(NOW, phase=phase)
        for command in CAUSES:
            decision = operators().decide(command, A, "lab:1", now)
            if not decision.accepted:
                for name in decision.reason.partition("possible now: ")[2].split(", "):
                    assert name == "nothing" or operators().decide(name, A, "lab:1", now).accepted


@pytest.mark.parametrize("command", ["emergency_stop", "note"])
def test_anybody_may_stop_everything_and_leave_a_note(command: str) -> None:
    one = operators()
    one.decide("take", A, "lab:1", NOW)
    assert one.decide(command, B, "lab:2", NOW).accepted
    assert one.commander == A


def test_a_commander_who_has_left_makes_room() -> None:
    one = operators()
    one.decide("take", A, "lab:1", NOW)
    one.leave()
    assert one.decide("pause", B, "lab:2", replace(NOW, phase=Phase.RUNNING)).cause is Cause.PAUSE


def test_before_the_form_is_complete_no_block_begins() -> None:
    one = Operators(opened=False, armed=True)
    decision = one.decide("start", A, "lab:1", NOW)
    assert (decision.accepted, decision.reason) == (False, "the session is not open: fill in its form first (open)")
    assert all(one.decide(name, A, "lab:1", NOW).accepted for name in BEFORE_OPENING)
    one.opened = True
    assert one.decide("open", A, "lab:1", NOW).reason == "the session is open already"


def test_nothing_starts_without_the_peers_or_while_devices_are_not_armed() -> None:
    one = operators()
    missing = replace(NOW, missing=("the left agent", "the logger"))
    assert one.decide("start", A, "lab:1", missing).reason == "cannot start without the left agent, the logger"
    assert one.decide("disarm", A, "lab:1", NOW).accepted
    assert one.decide("start", A, "lab:1", NOW).reason == "cannot start: the devices are not armed (arm)"
    assert one.decide("arm", A, "lab:1", NOW).accepted
    assert one.decide("start", A, "lab:1", NOW).cause is Cause.START


def test_a_pause_after_the_trial_is_due_when_it_is_over_and_can_be_taken_back() -> None:
    one, running = operators(), replace(NOW, phase=Phase.RUNNING)
    assert one.decide("pause_after_trial", A, "lab:1", running).reason == "paused after this trial"
    assert one.pending == "pause after this trial"
    assert one.due(Phase.HOLDING) is Cause.NONE
    assert one.due(Phase.LEVELLING) is Cause.PAUSE
    assert one.due(Phase.LEVELLING) is Cause.NONE
    one.decide("pause_after_trial", A, "lab:1", running)
    assert one.decide("pause_after_trial", A, "lab:1", running).reason == "taken back"
    assert one.due(Phase.LEVELLING) is Cause.NONE
    levelling = replace(NOW, phase=Phase.LEVELLING)
    assert one.decide("pause_after_trial", A, "lab:1", levelling).cause is Cause.PAUSE


@pytest.mark.parametrize("command", REPLAY_COMMANDS)
def test_what_only_a_replay_can_do_is_refused_in_words_and_makes_nobody_the_commander(command: str) -> None:
    one = operators()
    decision = one.decide(command, A, "lab:1", NOW)
    assert (decision.accepted, decision.cause) == (False, Cause.NONE)
    assert decision.reason == f"cannot {command}: this is a live session, not a replay"
    assert one.commander == b""


def test_blocks_are_given_up_and_sessions_ended_only_where_there_is_a_plan() -> None:
    one = operators()
    for command in ("next", "stop_after_block"):
        assert not one.decide(command, A, "lab:1", replace(NOW, plan=False)).accepted
    assert one.decide("stop_after_block", A, "lab:1", NOW).accepted
    assert one.end_after
    assert one.decide("next", A, "lab:1", replace(NOW, last=True)).reason.endswith("this is the last one")
    for phase in (Phase.HOLDING, Phase.SUCCEEDED, Phase.FAILED):
        assert one.decide("next", A, "lab:1", replace(NOW, phase=phase)).reason.endswith("pause first")
    assert one.decide("next", A, "lab:1", replace(NOW, phase=Phase.FINISHED)).accepted


@pytest.mark.slow
@given(
    commands=st.lists(
        st.tuples(st.sampled_from(COMMANDS), st.sampled_from([A, B]), st.sampled_from(Phase)), max_size=30
    )
)
def test_no_command_is_accepted_that_the_table_has_no_edge_for(commands: list[tuple[str, bytes, Phase]]) -> None:
    one = operators()
    for command, who, phase in commands:
        decision = one.decide(command, who, who.decode(), replace(NOW, phase=phase))
        assert not decision.cause or (decision.accepted and decision.cause in TABLE[phase])
        assert decision.accepted or decision.reason
        if command not in OPEN_TO_ALL and decision.accepted:
            assert one.commander == who
        if command in CAUSES and decision.accepted:
            assert decision.cause is CAUSES[command]


def test_a_form_is_checked_like_the_configuration() -> None:
    told = {"participant_a": "P07", "participant_b": "P08", "seat_a": "right", "consent": True}
    form = form_of(json.dumps(told), Session(dyad="D03"))
    assert (form.participant_a, form.seat_a, form.dyad, form.consent) == ("P07", "right", "D03", True)


@pytest.mark.parametrize(
    ("text", "problem"),
    [
        ("{}", "consent"),
        ("[1]", "expected a JSON object"),
        ("{", "not JSON"),
        ('{"pilot": true, "name": "a b"}', "name"),
        ('{"pilot": true, "participant": "P1"}', "participant: unknown key"),
    ],
)
def test_a_form_that_will_not_do_is_refused_in_words(text: str, problem: str) -> None:
    with pytest.raises(ConfigError, match=problem):
        form_of(text, Session())


def test_a_note_has_the_tick_at_which_its_writing_began() -> None:
    assert note_of('{"text": "sneezed", "tick": 1234}', 9) == ("sneezed", 1234)
    assert note_of("sneezed", 9) == ("sneezed", 9)
    with pytest.raises(ConfigError):
        note_of('{"text": 1}', 9)


def test_brackets_in_brackets_without_end_are_no_form_and_no_end_of_the_server() -> None:
    with pytest.raises(ConfigError, match="the note is not JSON"):
        note_of('{"text":' + "[" * 7000, 5)
