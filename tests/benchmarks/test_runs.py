"""The catalogue of all methods for offline runs: each does what it says, in one shape."""

from typing import Any

import numpy as np
import pytest
from independent import solution, waving
from trajectories import drive, scene_of

from netboard.benchmarks.physics.runs import OFFLINE, Offline

START = (0.002, 0.01, 0.05, 0.2, 0.03, 0.02)
LEVEL = (0.002, 0.01, 0.0, 0.0, 0.03, 0.02)
DURATION = 0.08


@pytest.mark.slow
@pytest.mark.parametrize("method", OFFLINE, ids=lambda method: method.name)
@pytest.mark.daily(3)
def test_a_run_ends_where_it_should(method: Offline) -> None:
    scene, start = scene_of(), START
    if not method.suits(scene.parts):
        scene, start = scene_of(board="level"), LEVEL
    assert method.suits(scene.parts)
    h = DURATION / (16 if method.order >= 8 else 160)
    n = round(DURATION / h)
    times = method.times(n, h)
    hands = np.apply_along_axis(lambda t: drive(waving(float(t[0])), scene.record), -1, times[..., np.newaxis])
    run = method.prepare(start, hands, h, scene.parts, scene.packed, 4)
    expected = solution(start, waving, np.linspace(0.0, DURATION, n // 4 + 1), scene.physics)
    error = np.abs(run() - expected)[:, ::2].max()
    assert error < {1: 1e-2, 2: 1e-4, 4: 1e-6}.get(method.order, 1e-8)
    assert np.abs(run() - expected)[:, ::2].max() == error


def test_the_names_are_different() -> None:
    assert len({method.name for method in OFFLINE}) == len(OFFLINE)


def test_what_a_method_cannot_run_it_says() -> None:
    named: dict[str, Any] = {method.name: method for method in OFFLINE}
    assert not named["exact"].suits(scene_of().parts)
    assert not named["etd_ab6"].suits(scene_of(ball_stop=0.3).parts)
    assert named["collocation8"].suits(scene_of(ball_stop=0.3).parts)


@pytest.mark.parametrize("method", OFFLINE, ids=lambda method: method.name)
def test_the_times_lie_in_the_steps(method: Offline) -> None:
    times = method.times(3, 0.1)
    assert times.shape == ((4,) if method.chained else (3, len(method.nodes)))
    assert times.min() >= 0.0
    assert times.max() <= 0.3 + 1e-15
