"""A live robot partner whose views are lost: the same bits again, finite and bounded movements, rest, and a return."""

from collections.abc import Callable
from dataclasses import replace
from math import inf, nan

import numpy as np
import pytest

from netboard.base.config import Config
from netboard.devices.simulated.partner import RobotPartner
from netboard.task.trials.state_machine import Phase
from netboard.testing.device import MS

TICKS, VIEW_EVERY = 4000, 9
REACH = 0.08
"""Largest height of a commanded equilibrium point: a little more than the range of the stylus [m]."""

Lost = Callable[[int], bool]

PATTERNS: dict[str, Lost] = {
    "every second view": lambda tick: tick // VIEW_EVERY % 2 == 1,
    "nine of ten": lambda tick: tick // VIEW_EVERY % 10 != 0,
    "a burst": lambda tick: 1000 <= tick < 2000,
    "all from the start": lambda tick: True,
    "all after a second": lambda tick: tick >= 1000,
}


def played(name: str, lost: Lost, spoilt: float = 0.0) -> tuple[np.ndarray, np.ndarray]:
    """Return heights of the stylus and of the equilibrium point at each tick, with a ball that swings on the board.

    ``spoilt``: in place of a lost view comes one with this height, unless it is 0.
    """
    config = Config()
    agent = replace(config.agents.right, device="partner", options={"partner": name})
    config = replace(config, agents=replace(config.agents, right=agent), block=replace(config.block, right=name))
    device = RobotPartner("right", config)
    device.open()
    device.play(*device.prepared(config))
    device.tell(1.0)
    holder, heights, targets = device._stylus.held.holder, [], []
    for tick in range(1, TICKS):
        if tick % VIEW_EVERY == 0:
            seen = holder.observation["seen"]
            if not lost(tick):
                time = 1e-3 * tick
                seen["phase"], seen["time"], seen["target"] = int(Phase.RUNNING), time, 0.15
                seen["z"], seen["theta"], seen["p"] = 0.0, 0.02 * np.sin(3.0 * time), 0.1 * np.sin(2.0 * time)
                seen["left"], seen["right"] = nan, 0.0
            elif spoilt:
                seen["time"], seen["z"], seen["p"] = 1e-3 * tick, spoilt, spoilt
        device.write(0.0, 0.0, 0.05 * np.sin(0.01 * tick))
        reading = device.read(tick * MS)
        device.live(tick * MS)
        assert np.isfinite(reading[1:7]).all()
        heights.append(reading.z)
        targets.append(float(holder.actions["target"][1, 2]))
    assert device.fault == ""
    device.close()
    return np.array(heights), np.array(targets)


@pytest.mark.parametrize("name", ["learned", "lqg"])
@pytest.mark.parametrize("pattern", PATTERNS.values(), ids=PATTERNS)
def test_lost_views_leave_the_partner_deterministic_and_bounded(name: str, pattern: Lost) -> None:
    heights, targets = played(name, pattern)
    again = played(name, pattern)
    assert (heights.tobytes(), targets.tobytes()) == (again[0].tobytes(), again[1].tobytes())
    assert np.isfinite(targets).all()
    assert np.abs(targets).max() <= REACH
    assert np.abs(np.diff(targets)).max() <= 1e-3, "at most 1 m/s"


@pytest.mark.parametrize("name", ["learned", "lqg"])
def test_partner_without_views_comes_to_rest_and_goes_on_with_the_next_one(name: str) -> None:
    _, whole = played(name, lambda tick: False)
    _, targets = played(name, PATTERNS["a burst"])
    moves = np.abs(np.diff(targets))
    assert moves[1:900].max() > 1e-6
    assert targets[:900].tobytes() == whole[:900].tobytes()
    assert moves[1700:1990].max() < 1e-7, "at rest before the views return"
    assert moves[2100:].max() > 1e-6


@pytest.mark.parametrize("name", ["learned", "lqg"])
@pytest.mark.parametrize("value", [nan, inf, 1e300])
def test_views_that_are_no_numbers_are_as_no_views(name: str, value: float) -> None:
    pattern = PATTERNS["a burst"]
    _, lost = played(name, pattern)
    _, spoilt = played(name, pattern, spoilt=value)
    assert spoilt.tobytes() == lost.tobytes()


@pytest.mark.parametrize("name", ["learned", "lqg"])
def test_partner_that_never_sees_a_view_does_not_move(name: str) -> None:
    _, targets = played(name, PATTERNS["all from the start"])
    assert np.ptp(targets[1:]) == 0.0
