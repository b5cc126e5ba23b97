"""The study of velocity estimators: known limits, linear systems against the estimators, and files."""

import json
from pathlib import Path

import numpy as np
import pytest

from evidence.stability.velocity import (
    IDEAL,
    RAMP,
    REACH,
    SLOW,
    TOUCH,
    Loop,
    errors_of,
    follow,
    largest_delay,
    largest_played,
    linear_estimator,
    radius_of,
    settles,
    study,
    time_of,
)
from netboard.benchmarks.harness.running import Options, run
from netboard.devices.contract.velocity import KINDS

BARE = Loop(0.045, 0.0, 200.0, 2.0)
LINEAR = sorted(set(KINDS) - {"adaptive"})


@pytest.mark.slow
@pytest.mark.parametrize("kind", LINEAR)
def test_linear_system_equals_the_estimator(kind: str) -> None:
    a, b, c, d = linear_estimator(kind)
    heights = 1e-3 * np.cumsum(np.random.default_rng(1).standard_normal(400))
    estimated = follow(KINDS[kind](TOUCH.resolution), heights)
    state, found = np.zeros(len(b)), []
    for z in heights:
        found.append(c @ state + d * z)
        state = a @ state + b * z
    assert np.array(found)[200:] == pytest.approx(estimated[200:], rel=1e-6, abs=1e-6)


def test_adaptive_estimator_is_not_linear() -> None:
    with pytest.raises(ValueError, match="not linear"):
        linear_estimator("adaptive")


LIMITS = [
    (Loop(0.045, 0.0, 200.0, 2.0), {IDEAL: 8, "difference": 7, "chai3d": 4}),
    (Loop(0.045, 0.1, 200.0, 2.0), {IDEAL: 8, "difference": 8, "chai3d": 4}),
    (Loop(0.045, 0.5, 200.0, 2.0), {IDEAL: 10, "difference": 9, "chai3d": 5}),
    (Loop(0.1, 0.5, 200.0, 2.0), {IDEAL: 11, "difference": 10, "chai3d": 8}),
    (Loop(0.2, 2.0, 200.0, 2.0), {IDEAL: 18, "difference": 18, "chai3d": 17}),
]
"""Known from an independent model of the same loops."""


@pytest.mark.parametrize(("loop", "limits"), LIMITS, ids=str)
def test_largest_stable_delays_equal_known_values(loop: Loop, limits: dict[str, int]) -> None:
    assert {kind: largest_delay(loop, kind) for kind in limits} == limits


@pytest.mark.parametrize("delay", [0, 1, 3, 8])
def test_largest_stable_stiffness_for_a_delay_equals_known_values(delay: int) -> None:
    known = {0: 4202.0, 1: 1373.0, 3: 569.0, 8: 214.0}[delay]
    assert radius_of(Loop(0.045, 0.1, known * 0.995, 2.0), IDEAL, delay) < 1.0
    assert radius_of(Loop(0.045, 0.1, known * 1.005, 2.0), IDEAL, delay) > 1.0


@pytest.mark.slow
def test_simulated_runs_agree_with_eigenvalues() -> None:
    assert largest_played(BARE, "chai3d", 3.0) == 4
    assert settles(BARE, "adaptive", 4, 2.0)
    assert not settles(BARE, "adaptive", 12, 2.0)


def test_errors_exclude_the_run_up() -> None:
    times, errors = errors_of("difference", RAMP, 3)
    assert errors.shape == (3, len(times))
    assert errors.mean() == pytest.approx(-0.5e-3, abs=0.1e-3)
    assert np.abs(errors_of("difference", SLOW, 2)[1]).max() > 0.04
    assert np.abs(errors_of("kalman", REACH, 2)[1]).max() < 0.03


def test_reach_has_the_right_distance_and_velocity() -> None:
    t = np.linspace(0.0, 0.7, 70_001)
    assert REACH.height(t)[-1] == pytest.approx(0.1)
    assert np.gradient(REACH.height(t), t) == pytest.approx(REACH.rate(t), abs=1e-4)


def test_update_duration_is_positive() -> None:
    assert time_of("difference", 1000) > 0.0


@pytest.mark.slow
def test_quick_study_writes_results_and_all_claims_hold(tmp_path: Path) -> None:
    run("velocity", study, Options(tmp_path / "found", tmp_path / "copy.json", quick=True))
    found = json.loads((tmp_path / "copy.json").read_text())
    assert [part["name"] for part in found["parts"]] == ["estimators", "delays"]
    assert all(verdict["holds"] for part in found["parts"] for verdict in part["verdicts"])
    assert (tmp_path / "found" / "velocity.png").exists()
