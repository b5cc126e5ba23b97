"""The supervision of a block: start, pause and resume."""

from itertools import count, islice

import pytest

from netboard.nodes.server.supervision import PERSISTENT_TICKS, READY_TICKS, Supervisor
from netboard.task.trials.state_machine import STAGE_FAULT, Cause, Phase

ALL_THERE: tuple[str, ...] = ()
TICKS = count()


def wait(watch: Supervisor, phase: Phase, ticks: int, missing: tuple[str, ...] = ALL_THERE, trouble: str = "") -> Cause:
    """The last of so many commands, asserting that those before were none."""
    first = next(TICKS)
    causes = [watch.command(tick, phase, missing, trouble) for tick in [first, *islice(TICKS, ticks - 1)]]
    assert not any(causes[:-1])
    return causes[-1]


def test_a_block_starts_by_itself_once_all_have_been_there_for_half_a_second() -> None:
    watch = Supervisor(autostart=True)
    assert wait(watch, Phase.IDLE, 10_000, ("the logger",)) is Cause.NONE
    assert watch.notice == "waiting for the logger"
    assert wait(watch, Phase.IDLE, READY_TICKS - 1) is Cause.NONE
    assert wait(watch, Phase.IDLE, 1, ("the logger",)) is Cause.NONE
    assert wait(watch, Phase.IDLE, READY_TICKS + 1) is Cause.START
    assert watch.notice == ""


def test_without_autostart_it_waits_for_the_operator() -> None:
    assert wait(Supervisor(autostart=False), Phase.IDLE, 10 * READY_TICKS) is Cause.NONE


def test_what_an_operator_was_refused_is_to_be_read_until_something_is_obeyed() -> None:
    watch = Supervisor(autostart=False)
    wait(watch, Phase.IDLE, 1, ("the left agent",))
    watch.refused("cannot start without the left agent")
    assert watch.command(next(TICKS), Phase.IDLE, ("the left agent",), "") is Cause.NONE
    assert watch.notice == "cannot start without the left agent"
    watch.command_carried_out()
    assert watch.notice == ""


def test_a_refusal_is_shown_no_longer_than_its_reason_holds() -> None:
    watch = Supervisor(autostart=False)
    wait(watch, Phase.IDLE, 1, ("the left agent",))
    watch.refused("cannot start without the left agent")
    wait(watch, Phase.IDLE, 1, ("the right agent",))
    assert watch.notice == "waiting for the right agent"
    wait(watch, Phase.IDLE, 1)
    assert watch.notice == ""


def test_in_a_pause_the_reason_that_holds_now_is_shown() -> None:
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


def test_a_fault_of_the_stage_itself_is_shown_too() -> None:
    watch = Supervisor(autostart=True)
    watch.faulted(STAGE_FAULT)
    assert watch.notice == f"paused: {STAGE_FAULT}"
    assert wait(watch, Phase.PAUSED, 10 * READY_TICKS) is Cause.NONE
    assert watch.notice == f"ready to resume (paused: {STAGE_FAULT})"


@pytest.mark.parametrize("phase", [Phase.LEVELLING, Phase.RUNNING, Phase.HOLDING])
def test_trouble_pauses_a_trial_at_once(phase: Phase) -> None:
    watch = Supervisor(autostart=True)
    assert watch.command(next(TICKS), phase, ALL_THERE, "no sample from the left agent") is Cause.FAULT
    assert watch.notice == "paused: no sample from the left agent"


@pytest.mark.parametrize("phase", [Phase.IDLE, Phase.PAUSED, Phase.FINISHED])
def test_trouble_changes_nothing_where_no_trial_is_going_on(phase: Phase) -> None:
    assert Supervisor(autostart=True).command(next(TICKS), phase, ALL_THERE, "no sample") is Cause.NONE


def test_after_a_fault_it_goes_on_by_itself_only_with_autostart() -> None:
    for autostart, cause in ((True, Cause.RESUME), (False, Cause.NONE)):
        watch = Supervisor(autostart)
        watch.command(next(TICKS), Phase.RUNNING, ALL_THERE, "no sample")
        wait(watch, Phase.PAUSED, 50, ALL_THERE, "no sample")
        assert wait(watch, Phase.PAUSED, READY_TICKS + 1) is cause


def test_what_the_operator_has_paused_only_the_operator_resumes() -> None:
    watch = Supervisor(autostart=True)
    assert watch.command(next(TICKS), Phase.RUNNING, ALL_THERE, "") is Cause.NONE
    assert wait(watch, Phase.PAUSED, 10 * READY_TICKS) is Cause.NONE


def test_after_an_emergency_only_the_operator_resumes() -> None:
    watch = Supervisor(autostart=True)
    watch.command(next(TICKS), Phase.RUNNING, ALL_THERE, "emergency stop by an operator")
    watch.await_operator()
    assert wait(watch, Phase.PAUSED, 10 * READY_TICKS) is Cause.NONE
