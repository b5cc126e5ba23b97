"""The supervision of a block: start, pause and resume."""

from itertools import count, islice

import pytest

from netboard.nodes.server.supervision import PERSISTENT_TICKS, READY_TICKS, TrialSupervisor
from netboard.stage.curtain import Pause
from netboard.task.trials.state_machine import STAGE_FAULT, Cause, Phase

NOTHING_MISSING: tuple[str, ...] = ()
TICKS = count()


def wait(
    supervisor: TrialSupervisor, phase: Phase, ticks: int, missing: tuple[str, ...] = NOTHING_MISSING, trouble: str = ""
) -> Cause:
    """Run a number of ticks and return the last command; all before it must be none."""
    first = next(TICKS)
    causes = [supervisor.command(tick, phase, missing, trouble) for tick in [first, *islice(TICKS, ticks - 1)]]
    assert not any(causes[:-1])
    return causes[-1]


def test_autostart_starts_the_block_after_all_peers_were_ready() -> None:
    supervisor = TrialSupervisor(autostart=True)
    assert wait(supervisor, Phase.IDLE, 10_000, ("the logger",)) is Cause.NONE
    assert supervisor.notice == "waiting for the logger"
    assert wait(supervisor, Phase.IDLE, READY_TICKS - 1) is Cause.NONE
    assert wait(supervisor, Phase.IDLE, 1, ("the logger",)) is Cause.NONE
    assert wait(supervisor, Phase.IDLE, READY_TICKS + 1) is Cause.START
    assert supervisor.notice == ""


def test_block_waits_for_the_operator_without_autostart() -> None:
    assert wait(TrialSupervisor(autostart=False), Phase.IDLE, 10 * READY_TICKS) is Cause.NONE


def test_paused_notice_shows_the_current_reason() -> None:
    supervisor = TrialSupervisor(autostart=False)
    lost, stopped = "no sample from the left agent", "emergency stop at the left device"
    supervisor.command(next(TICKS), Phase.RUNNING, NOTHING_MISSING, lost)
    assert supervisor.notice == f"paused: {lost}"
    wait(supervisor, Phase.PAUSED, PERSISTENT_TICKS + 1, NOTHING_MISSING, stopped)
    assert supervisor.notice == f"paused: {stopped}"
    supervisor.await_operator()
    wait(supervisor, Phase.PAUSED, 5, NOTHING_MISSING, "the left device is not armed")
    wait(supervisor, Phase.PAUSED, 1, ("the logger",))
    assert supervisor.notice == f"paused: {stopped}; waiting for the logger"
    wait(supervisor, Phase.PAUSED, 1)
    assert supervisor.notice == f"paused: {stopped}"
    supervisor.command_carried_out(Cause.RESUME)
    assert wait(supervisor, Phase.PAUSED, 1) is Cause.NONE
    assert supervisor.notice == ""


def test_stage_fault_is_shown_and_waits_for_the_operator() -> None:
    supervisor = TrialSupervisor(autostart=True)
    supervisor.paused_by(STAGE_FAULT)
    assert supervisor.notice == f"paused: {STAGE_FAULT}"
    assert wait(supervisor, Phase.PAUSED, 10 * READY_TICKS) is Cause.NONE
    assert supervisor.notice == f"paused: {STAGE_FAULT}"


@pytest.mark.parametrize("phase", [Phase.LEVELLING, Phase.RUNNING, Phase.HOLDING])
def test_trouble_pauses_a_running_trial_at_once(phase: Phase) -> None:
    supervisor = TrialSupervisor(autostart=True)
    assert supervisor.command(next(TICKS), phase, NOTHING_MISSING, "no sample from the left agent") is Cause.FAULT
    assert supervisor.notice == "paused: no sample from the left agent"


@pytest.mark.parametrize("phase", [Phase.IDLE, Phase.PAUSED, Phase.FINISHED])
def test_trouble_is_ignored_outside_a_trial(phase: Phase) -> None:
    assert TrialSupervisor(autostart=True).command(next(TICKS), phase, NOTHING_MISSING, "no sample") is Cause.NONE


def test_trial_resumes_after_a_fault_only_with_autostart() -> None:
    for autostart, cause in ((True, Cause.RESUME), (False, Cause.NONE)):
        supervisor = TrialSupervisor(autostart)
        supervisor.command(next(TICKS), Phase.RUNNING, NOTHING_MISSING, "no sample")
        wait(supervisor, Phase.PAUSED, 50, NOTHING_MISSING, "no sample")
        assert wait(supervisor, Phase.PAUSED, READY_TICKS + 1) is cause


def test_pause_by_the_operator_is_not_resumed_automatically() -> None:
    supervisor = TrialSupervisor(autostart=True)
    assert supervisor.command(next(TICKS), Phase.RUNNING, NOTHING_MISSING, "") is Cause.NONE
    assert wait(supervisor, Phase.PAUSED, 10 * READY_TICKS) is Cause.NONE


def test_pause_of_an_operator_names_the_operator() -> None:
    supervisor = TrialSupervisor(autostart=True)
    supervisor.command_carried_out(Cause.PAUSE)
    supervisor.paused_by_operator("lab0:812")
    assert wait(supervisor, Phase.PAUSED, 10 * READY_TICKS) is Cause.NONE
    assert (supervisor.notice, supervisor.pause) == ("paused by the operator (lab0:812)", Pause.OPERATOR)
    wait(supervisor, Phase.PAUSED, 1, ("the left agent", "the right agent"))
    assert supervisor.notice == "paused by the operator (lab0:812); waiting for both agents"


def test_block_that_is_reopened_waits_for_the_operator_unless_it_starts_by_itself() -> None:
    for autostart, cause in ((True, Cause.RESUME), (False, Cause.NONE)):
        supervisor = TrialSupervisor(autostart)
        supervisor.reopened()
        assert (supervisor.notice, supervisor.pause) == (
            "paused: lost trials of this block are repeated",
            Pause.REPEATS,
        )
        assert wait(supervisor, Phase.PAUSED, READY_TICKS + 1) is cause


def test_emergency_stop_is_not_resumed_automatically() -> None:
    supervisor = TrialSupervisor(autostart=True)
    supervisor.command(next(TICKS), Phase.RUNNING, NOTHING_MISSING, "emergency stop by an operator")
    supervisor.stop_released()
    assert wait(supervisor, Phase.PAUSED, 10 * READY_TICKS) is Cause.NONE


def test_trial_is_not_resumed_automatically_with_another_device() -> None:
    supervisor = TrialSupervisor(autostart=True)
    supervisor.device_replaced("left")
    supervisor.command(next(TICKS), Phase.RUNNING, NOTHING_MISSING, "no sample from the left agent")
    wait(supervisor, Phase.PAUSED, PERSISTENT_TICKS + 1, NOTHING_MISSING, "the left device is not armed")
    assert wait(supervisor, Phase.PAUSED, 10 * READY_TICKS) is Cause.NONE
    assert supervisor.notice == "paused: the left device was replaced by another one"
    assert wait(supervisor, Phase.IDLE, 10 * READY_TICKS) is Cause.NONE  # replaced after the last trial of a block
    assert supervisor.notice == "ready to start: the left device was replaced by another one"
    supervisor.command_carried_out(Cause.RESUME)
    supervisor.command(next(TICKS), Phase.RUNNING, NOTHING_MISSING, "no sample from the left agent")
    assert wait(supervisor, Phase.PAUSED, READY_TICKS + 1) is Cause.RESUME
