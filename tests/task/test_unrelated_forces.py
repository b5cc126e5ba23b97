"""The unrelated force condition: which recorded forces are used, and when they are rendered."""

from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from netboard.base.errors import ConfigError
from netboard.base.tick import STATE, TICK
from netboard.task.trials.state_machine import Cause, Phase
from netboard.task.trials.unrelated import unrelated_of

LONG, SHORT = 40, 25


def attempt(first: int, ticks: int, target: int, force: float, event: Cause = Cause.HELD) -> NDArray[Any]:
    """Ten ticks of a level board, then a ball that rolls; the right hand feels twice what the left one does."""
    rows = np.zeros(10 + ticks, TICK)
    rows["tick"] = first + np.arange(10 + ticks)
    rows["phase"][:10], rows["phase"][10:] = Phase.LEVELLING, Phase.HOLDING
    rows["run_ticks"][:10], rows["run_ticks"][10:] = 77, np.arange(ticks)
    rows["target"], rows["event"][-1] = target, event
    rows["left_force"] = force + rows["run_ticks"]
    rows["right_force"] = 2 * rows["left_force"]
    return rows


RECORDED = np.concatenate(
    [
        attempt(0, 30, 1, 1.0, Cause.FELL),
        attempt(40, LONG, 1, 1000.0),
        attempt(90, SHORT, -1, 2000.0),
    ]
)


def state(trial: int = 1, target: int = 1, phase: Phase = Phase.RUNNING, run_ticks: int = 0) -> Any:
    made = np.zeros(1, STATE)
    made["trial"], made["target"], made["phase"], made["run_ticks"] = trial, target, phase, run_ticks
    return made[0]


def test_forces_of_successful_attempts_run_from_release_to_end() -> None:
    found = unrelated_of(RECORDED, "a.mcap")
    assert [len(forces) for forces in found.trials] == [LONG, SHORT]
    assert [found.at(state(run_ticks=k))[0] for k in (0, 1, LONG - 1)] == [1000.0, 1001.0, 1000.0 + LONG - 1]


def test_first_force_is_held_before_release_and_last_force_after_the_end() -> None:
    found = unrelated_of(RECORDED, "a.mcap")
    assert found.at(state(phase=Phase.LEVELLING, run_ticks=30)) == (1000.0, 2000.0)
    assert found.at(state(run_ticks=10**6))[0] == 1000.0 + LONG - 1


def test_trials_cycle_through_recorded_trials_and_swap_hands_with_the_target() -> None:
    found = unrelated_of(RECORDED, "a.mcap")
    assert found.at(state(trial=1, target=1)) == (1000.0, 2000.0)
    assert found.at(state(trial=1, target=-1)) == (2000.0, 1000.0)
    assert found.at(state(trial=2, target=-1)) == (2000.0, 4000.0)
    assert found.at(state(trial=2, target=1)) == (4000.0, 2000.0)
    assert found.at(state(trial=3, target=1)) == (1000.0, 2000.0)


@pytest.mark.parametrize("missing", [slice(60, 61), slice(0, 52)])
def test_attempt_with_missing_ticks_is_left_out(missing: slice) -> None:
    assert [len(forces) for forces in unrelated_of(np.delete(RECORDED, missing), "a.mcap").trials] == [SHORT]


def test_recording_without_forces_or_success_is_refused() -> None:
    without_forces = RECORDED.copy()
    without_forces["left_force"] = without_forces["right_force"] = 0.0
    for ticks in (without_forces, RECORDED[:40], RECORDED[:0]):
        with pytest.raises(ConfigError, match=r"a\.mcap: found no successful trial"):
            unrelated_of(ticks, "a.mcap")
