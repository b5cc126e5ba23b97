"""The trial state machine: transition table and inputs."""

from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from netboard.base.config import Config, parse
from netboard.base.tables.experiment import Block, Task
from netboard.base.tables.scene import Geometry
from netboard.task.trials.state_machine import (
    ACTION,
    BALL_FREE,
    HAS_EDGE,
    SUCCESSOR,
    TABLE,
    Action,
    Cause,
    Phase,
    first_target,
    is_active,
    is_level,
    pack_rules,
    sense,
    wished,
)

RULES = pack_rules(Task(), Geometry(), Block())[0]
RIGHT = 0.150


TIMED = pack_rules(Task(), Geometry(), Block(duration=2.0))[0]
LASTING = set(Phase) - {Phase.SUCCEEDED, Phase.FAILED, Phase.FINISHED}


def sensed(
    phase: Phase,
    p: float = 0.0,
    counted: int = 0,
    run_ticks: int = 0,
    trial: int = 1,
    extra: int = 0,
    block_ticks: int = 0,
    rules: Any = RULES,
) -> Cause:
    return Cause(sense(int(phase), p, RIGHT, counted, run_ticks, trial, extra, block_ticks, rules))


def test_every_phase_has_a_row_and_is_reachable_except_idle() -> None:
    assert set(TABLE) == set(Phase)
    reached = {then for phase, edges in TABLE.items() for then, _ in edges.values() if then is not phase}
    assert reached == set(Phase) - {Phase.IDLE}


def test_stop_ends_the_block_from_every_lasting_phase() -> None:
    assert all(TABLE[phase][Cause.STOP] == (Phase.FINISHED, Action.HALT) for phase in LASTING)


def test_recorded_codes_of_causes_and_phases_are_stable() -> None:
    assert [cause.value for cause in Cause] == list(range(18))
    assert (Cause.START, Cause.FAULT, Cause.REPEAT, Cause.VETO, Cause.SKIP) == (9, 14, 15, 16, 17)
    assert [phase.value for phase in Phase] == list(range(8))


def test_repeat_and_veto_change_the_block_length_but_not_the_phase() -> None:
    for phase in set(Phase) - {Phase.FINISHED}:
        assert TABLE[phase][Cause.REPEAT] == (phase, Action.EXTEND)
        assert TABLE[phase][Cause.VETO] == (phase, Action.SHORTEN)
    assert TABLE[Phase.FINISHED] == {Cause.REPEAT: (Phase.PAUSED, Action.REOPEN)}


def test_skip_advances_a_running_trial_and_keeps_a_pause() -> None:
    for phase in (Phase.LEVELLING, *BALL_FREE):
        assert TABLE[phase][Cause.SKIP] == (Phase.LEVELLING, Action.ADVANCE)
    assert TABLE[Phase.PAUSED][Cause.SKIP] == (Phase.PAUSED, Action.PASS)
    assert {phase for phase in Phase if Cause.SKIP in TABLE[phase]} == LASTING - {Phase.IDLE}


def test_skipping_the_last_trial_ends_the_block() -> None:
    for phase in LASTING - {Phase.IDLE}:
        assert TABLE[phase][Cause.LAST] == (Phase.FINISHED, Action.HALT)
    assert wished(int(Cause.SKIP), 59, 0, 10**9, RULES) == Cause.SKIP
    assert wished(int(Cause.SKIP), 60, 0, 0, RULES) == Cause.LAST
    assert wished(int(Cause.SKIP), 60, 1, 0, RULES) == Cause.SKIP
    assert wished(int(Cause.SKIP), 1, 0, 2000, TIMED) == Cause.LAST


@given(st.integers(-(2**62), 2**62))
def test_only_operator_commands_are_accepted_as_commands(command: int) -> None:
    commands = range(Cause.START, Cause.SKIP + 1)
    assert wished(command, 1, 0, 0, RULES) == (command if command in commands else Cause.NONE)


def test_fault_pauses_every_running_trial() -> None:
    for phase in (Phase.LEVELLING, *BALL_FREE):
        assert TABLE[phase][Cause.FAULT] == (Phase.PAUSED, Action.HALT)


def test_compiled_arrays_match_the_transition_table() -> None:
    for phase in Phase:
        for cause in Cause:
            then, does = TABLE[phase].get(cause, (phase, Action.NONE))
            assert (SUCCESSOR[phase, cause], ACTION[phase, cause]) == (then, does)
            assert HAS_EDGE[phase, cause] == (cause in TABLE[phase])


@given(st.lists(st.sampled_from(Cause), max_size=200))
def test_no_sequence_of_causes_leaves_the_transition_table(causes: list[Cause]) -> None:
    phase = Phase.IDLE
    succeeded = held = 0
    for cause in causes:
        before, phase = phase, Phase(int(SUCCESSOR[phase, cause]))
        assert phase is before or TABLE[before][cause][0] is phase
        held += before is Phase.HOLDING and cause is Cause.HELD
        succeeded += phase is Phase.SUCCEEDED and before is not phase
        assert before is not Phase.FINISHED or phase in (Phase.FINISHED, Phase.PAUSED)
    assert succeeded == held


@pytest.mark.parametrize(
    ("z", "theta_deg", "omega_deg", "level"),
    [
        (0.0, 0.0, 0.0, True),
        (0.010, 1.0, 1.0, True),
        (-0.010, -1.0, -1.0, True),
        (0.0101, 0.0, 0.0, False),
        (0.0, 1.01, 0.0, False),
        (0.0, 0.0, -1.01, False),
    ],
)
def test_board_is_level_only_within_all_three_limits(z: float, theta_deg: float, omega_deg: float, level: bool) -> None:
    assert is_level(z, np.radians(theta_deg), np.radians(omega_deg), RULES) == level


def test_ball_is_released_after_500_ms_of_level_board() -> None:
    assert sensed(Phase.LEVELLING, counted=499) is Cause.NONE
    assert sensed(Phase.LEVELLING, counted=500) is Cause.LEVEL


@pytest.mark.parametrize(("p", "cause"), [(0.1149, Cause.NONE), (0.1151, Cause.ENTERED), (0.1849, Cause.ENTERED)])
def test_ball_enters_the_target_when_its_centre_is_within_35_mm(p: float, cause: Cause) -> None:
    assert sensed(Phase.RUNNING, p) is cause


def test_hold_succeeds_after_1500_ms_without_leaving_the_target() -> None:
    assert sensed(Phase.HOLDING, RIGHT, counted=1499) is Cause.NONE
    assert sensed(Phase.HOLDING, RIGHT, counted=1500) is Cause.HELD
    assert sensed(Phase.HOLDING, RIGHT + 0.0351, counted=1500) is Cause.LEFT


@pytest.mark.parametrize("phase", BALL_FREE)
@pytest.mark.parametrize("side", [-1, 1])
def test_ball_falls_beyond_350_mm(phase: Phase, side: int) -> None:
    assert sensed(phase, side * 0.3501) is Cause.FELL
    assert sensed(Phase.RUNNING, side * 0.3499) is Cause.NONE


def test_time_limit_ends_a_running_trial_but_not_a_hold() -> None:
    limited = pack_rules(Task(time_limit=2.0), Geometry(), Block())[0]
    assert sensed(Phase.RUNNING, run_ticks=10**9) is Cause.NONE
    assert sensed(Phase.RUNNING, run_ticks=1999, rules=limited) is Cause.NONE
    assert sensed(Phase.RUNNING, run_ticks=2000, rules=limited) is Cause.TIMED_OUT
    assert sensed(Phase.HOLDING, RIGHT, run_ticks=2000, rules=limited) is Cause.NONE


def test_block_ends_after_its_last_trial() -> None:
    assert sensed(Phase.SUCCEEDED, trial=59) is Cause.NEXT
    assert sensed(Phase.SUCCEEDED, trial=60) is Cause.LAST
    assert sensed(Phase.SUCCEEDED, trial=60, extra=1) is Cause.NEXT
    assert sensed(Phase.SUCCEEDED, trial=61, extra=1) is Cause.LAST
    assert sensed(Phase.SUCCEEDED, trial=61, extra=0) is Cause.LAST
    assert sensed(Phase.FAILED, trial=60) is Cause.NEXT


def test_timed_block_ends_after_the_attempt_in_which_its_time_runs_out() -> None:
    for phase in (Phase.SUCCEEDED, Phase.FAILED):
        assert sensed(phase, block_ticks=1999, rules=TIMED) is Cause.NEXT
        assert sensed(phase, block_ticks=2000, rules=TIMED) is Cause.LAST
        assert sensed(phase, block_ticks=10**9) is Cause.NEXT
    for phase in (Phase.LEVELLING, Phase.RUNNING, Phase.HOLDING):
        assert sensed(phase, block_ticks=10**9, rules=TIMED) not in (Cause.NEXT, Cause.LAST)


def test_forces_are_active_only_during_a_trial() -> None:
    assert {phase for phase in Phase if is_active(int(phase))} == {
        Phase.LEVELLING,
        Phase.RUNNING,
        Phase.HOLDING,
        Phase.SUCCEEDED,
        Phase.FAILED,
    }


@pytest.mark.slow
def test_first_target_is_configured_or_drawn_from_the_seed() -> None:
    assert first_target(parse('[block]\nfirst_target = "left"')) == -1
    assert first_target(parse('[block]\nfirst_target = "right"')) == 1
    drawn = [first_target(parse(f"[block]\nseed = {seed}")) for seed in range(200)]
    assert drawn == [first_target(parse(f"[block]\nseed = {seed}")) for seed in range(200)]
    assert 70 <= drawn.count(1) <= 130
    assert first_target(Config()) in (-1, 1)
