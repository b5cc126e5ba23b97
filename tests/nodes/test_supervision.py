"""The supervision of a block: start, pause and resume."""

from itertools import count, islice

import pytest

from netboard.nodes.server.supervision import PERSISTENT_TICKS, READY_TICKS, Supervisor
from netboard.task.trials.state_machine import STAGE_FAULT, Cause, Phase

ALL_THERE: tuple[str, ...] = ()
TICKS = count()


def wait(watch: Supervisor, phase: Phase, ticks: int, missing: tuple[str, ...] = ALL_THERE, trouble: str = "") -> Cause:
    """Run a number of ticks and return the last command; all before it must be none."""
    first = next(TICKS)
    causes = [watch.command(tick, phase, missing, trouble) for tick in [first, *islice(TICKS, ticks - 1)]]
    assert not any(causes[:-1])
    return causes[-1]


def test_autostart_starts_the_block_after_all_peers_were_ready() -> None:
    watch = Supervisor(autostart=True)
    assert wait(watch, Phase.IDLE, 10_000, ("the logger",)) is Cause.NONE
    assert watch.notice == "waiting for the logger"
    assert wait(watch, Phase.IDLE, READY_TICKS - 1) is Cause.NONE
    assert wait(watch, Phase.IDLE, 1, ("the logger",)) is Cause.NONE
    assert wait(watch, Phase.IDLE, READY_TICKS + 1) is Cause.START
    assert watch.notice == ""


def test_block_waits_for_the_operator_without_autostart() -> None:
    assert wait(Supervisor(autostart=False), Phase.IDLE, 10 * READY_TICKS) is Cause.NONE


def test_refusal_is_shown_until_the_next_accepted_command() -> None:
    watch = Supervisor(autostart=False)
    wait(watch, Phase.IDLE, 1, ("the left agent",))
    watch.refused("cannot start without the left agent")
    assert watch.command(next(TICKS), Phase.IDLE, ("the left agent",), "") is Cause.NONE
    assert watch.notice == "cannot start without the left agent"
    watch.command_carried_out()
    assert watch.notice == ""


def test_refusal_is_cleared_when_its_reason_changes() -> None:
    watch = Supervisor(autostart=False)
    wait(watch, Phase.IDLE, 1, ("the left agent",))
    watch.refused("cannot start without the left agent")
    wait(watch, Phase.IDLE, 1, ("the right agent",))
    assert watch.notice == "waiting for the right agent"
    wait(watch, Phase.IDLE, 1)
    assert watch.notice == ""


def test_paused_notice_shows_the_current_reason() -> None:
    watch = Supervisor(autostart=False)
    lost, stopped = "no sample from the left agent", "emergency stop at the left device"
    watch.command(next(TICKS), Phase.RUNNING, ALL_THERE, lost)
    assert watch.notice == f"paused: {lost}"
    wait(watch, Phase.PAUSED, PERSISTENT_TICKS + 1, ALL_THERE, stopped)
    assert watch.notice == f"paused: {stopped}"
    watch.await_operator()
    wait(watch, Phase.PAUSED, 5, ALL_THERE, "the left device is not armed")
    wait(watch, Phase.PAUSED, 1, ("the logger",))
    assert watch.notice == "paused: waiting for the logger"
    wait(watch, Phase.PAUSED, 1)
    assert watch.notice == f"ready to resume (paused: {stopped})"
    watch.command_carried_out()
    assert wait(watch, Phase.PAUSED, 1) is Cause.NONE
    assert watch.notice == ""


def test_stage_fault_is_shown_and_waits_for_the_operator() -> None:
    watch = Supervisor(autostart=True)
    watch.faulted(STAGE_FAULT)
    assert watch.notice == f"paused: {STAGE_FAULT}"
    assert wait(watch, Phase.PAUSED, 10 * READY_TICKS) is Cause.NONE
    assert watch.notice == f"ready to resume (paused: {STAGE_FAULT})"


@pytest.mark.parametrize("phase", [Phase.LEVELLING, Phase.RUNNING, Phase.HOLDING])
def test_trouble_pauses_a_running_trial_at_once(phase: Phase) -> None:
    watch = Supervisor(autostart=True)
    assert watch.command(next(TICKS), phase, ALL_THERE, "no sample from the left agent") is Cause.FAULT
    assert watch.notice == "paused: no sample from the left agent"


@pytest.mark.parametrize("phase", [Phase.IDLE, Phase.PAUSED, Phase.FINISHED])
def test_trouble_is_ignored_outside_a_trial(phase: Phase) -> None:
    assert Supervisor(autostart=True).command(next(TICKS), phase, ALL_THERE, "no sample") is Cause.NONE


def test_trial_resumes_after_a_fault_only_with_autostart() -> None:
    for autostart, cause in ((True, Cause.RESUME), (False, Cause.NONE)):
        watch = Supervisor(autostart)
        watch.command(next(TICKS), Phase.RUNNING, ALL_THERE, "no sample")
        wait(watch, Phase.PAUSED, 50, ALL_THERE, "no sample")
        assert wait(watch, Phase.PAUSED, READY_TICKS + 1) is cause


def test_pause_by_the_operator_is_not_resumed_automatically() -> None:
    watch = Supervisor(autostart=True)
    assert watch.command(next(TICKS), Phase.RUNNING, ALL_THERE, "") is Cause.NONE
    assert wait(watch, Phase.PAUSED, 10 * READY_TICKS) is Cause.NONE


def test_emergency_stop_is_not_resumed_automatically() -> None:
    watch = Supervisor(autostart=True)
    watch.command(next(TICKS), Phase.RUNNING, ALL_THERE, "emergency stop by an operator")
    watch.await_operator()
    assert wait(watch, Phase.PAUSED, 10 * READY_TICKS) is Cause.NONE
