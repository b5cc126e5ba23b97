"""The trial machine: its table, and what it senses."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from netboard.config import Block, Config, Geometry, Task, parse
from netboard.experiment.machine import (
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
)

RULES = pack_rules(Task(), Geometry(), Block())[0]
RIGHT = 0.150


def sensed(phase: Phase, p: float = 0.0, counted: int = 0, run_ticks: int = 0, successes: int = 0) -> Cause:
    return Cause(sense(int(phase), p, RIGHT, counted, run_ticks, successes, RULES))


def test_every_phase_has_a_row_and_every_phase_but_the_first_is_reached() -> None:
    assert set(TABLE) == set(Phase)
    assert {then for edges in TABLE.values() for then, _ in edges.values()} == set(Phase) - {Phase.IDLE}


def test_the_block_can_be_left_from_everywhere_that_lasts() -> None:
    lasting = set(Phase) - {Phase.SUCCEEDED, Phase.FAILED, Phase.FINISHED}
    assert all(TABLE[phase][Cause.STOP] == (Phase.FINISHED, Action.HALT) for phase in lasting)


def test_a_fault_fixes_the_ball_wherever_a_trial_is_going_on() -> None:
    for phase in (Phase.LEVELLING, *BALL_FREE):
        assert TABLE[phase][Cause.FAULT] == (Phase.PAUSED, Action.HALT)


def test_the_arrays_say_what_the_table_says() -> None:
    for phase in Phase:
        for cause in Cause:
            then, does = TABLE[phase].get(cause, (phase, Action.NONE))
            assert (SUCCESSOR[phase, cause], ACTION[phase, cause]) == (then, does)
            assert HAS_EDGE[phase, cause] == (cause in TABLE[phase])


@given(st.lists(st.sampled_from(Cause), max_size=200))
def test_no_sequence_of_causes_leaves_the_table(causes: list[Cause]) -> None:
    phase = Phase.IDLE
    succeeded = held = 0
    for cause in causes:
        before, phase = phase, Phase(int(SUCCESSOR[phase, cause]))
        assert phase is before or TABLE[before][cause][0] is phase
        held += before is Phase.HOLDING and cause is Cause.HELD
        succeeded += phase is Phase.SUCCEEDED and before is not phase
        assert before is not Phase.FINISHED or phase is Phase.FINISHED
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
def test_level_means_within_all_three_limits(z: float, theta_deg: float, omega_deg: float, level: bool) -> None:
    assert is_level(z, np.radians(theta_deg), np.radians(omega_deg), RULES) == level


def test_the_ball_is_released_after_half_a_second_of_level_board() -> None:
    assert sensed(Phase.LEVELLING, counted=499) is Cause.NONE
    assert sensed(Phase.LEVELLING, counted=500) is Cause.LEVEL


@pytest.mark.parametrize(("p", "cause"), [(0.1149, Cause.NONE), (0.1151, Cause.ENTERED), (0.1849, Cause.ENTERED)])
def test_the_balls_centre_enters_a_target_of_70_mm(p: float, cause: Cause) -> None:
    assert sensed(Phase.RUNNING, p) is cause


def test_the_hold_takes_one_and_a_half_seconds_without_a_break() -> None:
    assert sensed(Phase.HOLDING, RIGHT, counted=1499) is Cause.NONE
    assert sensed(Phase.HOLDING, RIGHT, counted=1500) is Cause.HELD
    assert sensed(Phase.HOLDING, RIGHT + 0.0351, counted=1500) is Cause.LEFT


@pytest.mark.parametrize("phase", BALL_FREE)
@pytest.mark.parametrize("side", [-1, 1])
def test_the_ball_falls_beyond_350_mm(phase: Phase, side: int) -> None:
    assert sensed(phase, side * 0.3501) is Cause.FELL
    assert sensed(Phase.RUNNING, side * 0.3499) is Cause.NONE


def test_a_time_limit_ends_a_trial_only_where_there_is_one_and_not_in_the_target() -> None:
    limited = pack_rules(Task(time_limit=2.0), Geometry(), Block())[0]
    assert sensed(Phase.RUNNING, run_ticks=10**9) is Cause.NONE
    assert sense(int(Phase.RUNNING), 0.0, RIGHT, 0, 1999, 0, limited) == Cause.NONE
    assert sense(int(Phase.RUNNING), 0.0, RIGHT, 0, 2000, 0, limited) == Cause.TIMED_OUT
    assert sense(int(Phase.HOLDING), RIGHT, RIGHT, 0, 2000, 0, limited) == Cause.NONE


def test_the_block_ends_with_the_last_of_its_successes() -> None:
    assert sensed(Phase.SUCCEEDED, successes=59) is Cause.NEXT
    assert sensed(Phase.SUCCEEDED, successes=60) is Cause.LAST


def test_forces_are_felt_only_while_a_trial_is_going_on() -> None:
    assert {phase for phase in Phase if is_active(int(phase))} == {
        Phase.LEVELLING,
        Phase.RUNNING,
        Phase.HOLDING,
        Phase.SUCCEEDED,
        Phase.FAILED,
    }


def test_the_first_target_is_as_told_or_drawn_from_the_seed() -> None:
    assert first_target(parse('[block]\nfirst_target = "left"')) == -1
    assert first_target(parse('[block]\nfirst_target = "right"')) == 1
    drawn = [first_target(parse(f"[block]\nseed = {seed}")) for seed in range(200)]
    assert drawn == [first_target(parse(f"[block]\nseed = {seed}")) for seed in range(200)]
    assert 70 <= drawn.count(1) <= 130
    assert first_target(Config()) in (-1, 1)
