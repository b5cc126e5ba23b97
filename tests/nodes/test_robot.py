"""A robot partner fills its part of a tick's row as an agent would."""

from dataclasses import replace

import numpy as np
import pytest

from netboard.base.config import Config
from netboard.base.errors import ConfigError
from netboard.base.tick import TICK, TICK_NS
from netboard.nodes.server.robot import Robot
from netboard.stage.stage import make_stage
from netboard.task.trials.state_machine import Cause, Phase

T0 = 5_000_000_000


def config(left: str, right: str, trials: int = 2) -> Config:
    default = Config()
    return replace(default, block=replace(default.block, left=left, right=right, trials=trials))


def play(settings: Config, max_ticks: int = 60_000) -> np.ndarray:
    """Play a block as the server does, tick by tick on a ring of rows."""
    robots = [Robot(settings, "left"), Robot(settings, "right")]
    stage = make_stage(settings)
    state, rows, recorded = stage.initial(), np.zeros(64, TICK), np.zeros(max_ticks, TICK)
    words = rows.view(np.int64).reshape(len(rows), -1)
    for tick in range(max_ticks):
        row = words[tick % 64]
        rows[tick % 64]["command"] = Cause.START if tick == 100 else Cause.NONE
        for robot in robots:
            robot.fill(row, tick, T0 + tick * TICK_NS)
        stage.advance(state, rows, tick)
        for robot in robots:
            robot.take(row)
        recorded[tick] = rows[tick % 64]
        if state["phase"][0] == Phase.FINISHED:
            break
    return recorded[: tick + 1]


@pytest.mark.slow
def test_two_robots_complete_the_task_together() -> None:
    rows = play(config("robot", "robot"))
    assert (rows["event"] == Cause.HELD).sum() == 2
    for side in ("left", "right"):
        assert (rows[f"{side}_live"] == 1).all()
        assert (rows[f"{side}_seq"] == rows["tick"]).all()
        assert (rows[f"{side}_stamp_ns"] < rows["time_ns"]).all()
        assert np.ptp(rows[f"{side}_sent_z"]) > 0.002
    assert not np.array_equal(rows["left_sent_z"], -rows["right_sent_z"])


@pytest.mark.slow
def test_robot_is_deterministic_and_differs_between_blocks() -> None:
    settings = config("robot", "robot", trials=1)
    first = play(settings)
    assert first.tobytes() == play(settings).tobytes()
    other = replace(settings, block=replace(settings.block, number=2, blocks=2))
    assert first.tobytes() != play(other).tobytes()


@pytest.mark.slow
def test_fixed_hand_is_live_and_at_rest() -> None:
    rows = play(config("still", "robot"), max_ticks=3000)
    assert (rows["left_live"] == 1).all()
    assert (rows["left_stamp_ns"] < rows["time_ns"]).all()
    for name in ("left_sent_z", "left_sent_vz", "left_x", "left_y", "left_rendered"):
        assert not rows[name].any()
    assert rows["right_sent_z"].any()


@pytest.mark.slow
def test_robot_renders_no_force_without_haptic_feedback() -> None:
    settings = config("robot", "robot", trials=1)
    rows = play(replace(settings, block=replace(settings.block, force="none")))
    assert not rows["left_rendered"].any()
    assert (rows["event"] == Cause.HELD).sum() == 1


def test_robot_refuses_a_mover_that_it_does_not_know() -> None:
    with pytest.raises(ConfigError, match="no robot partner 'mirror'; it has: robot"):
        Robot(config("person", "mirror"), "right")
