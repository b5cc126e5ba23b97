"""All measures of rehearsed trials: agreement with the server, and invariances on real ticks."""

from dataclasses import replace
from functools import cache
from typing import Any

import numpy as np
import pytest

from netboard.analysis.measures.braking import first_braking
from netboard.analysis.measures.cooperation import contributions, delays
from netboard.analysis.measures.motion import Trial, find_completion, motion, placements
from netboard.analysis.measures.movements import classify, movement_times
from netboard.analysis.measures.peaks import velocity_peaks
from netboard.analysis.measures.segments import board_segments
from netboard.base.config import Config
from netboard.base.tables.simulated import Participant
from netboard.participants.seat.block import Rehearsal
from netboard.recording.format.summary import Attempt, find_attempts

pytestmark = pytest.mark.slow
TARGET = 0.15


@cache
def block(configuration: str) -> tuple[np.ndarray, tuple[Attempt, ...]]:
    config = replace(Config(), block=replace(Config().block, configuration=configuration, trials=6))
    rows = np.concatenate([p.copy() for p in Rehearsal(config, {"A": Participant(), "B": Participant()}).pieces()])
    return rows, find_attempts(rows)


def measures(rows: Any, attempts: tuple[Attempt, ...], side: float = 1, step: int = 1) -> dict[str, np.ndarray]:
    """All measures of every attempt; `side` -1 mirrors the experiment, `step` decimates the samples."""
    rate = 1000 / step
    left, right = ("left", "right") if side > 0 else ("right", "left")
    rows = rows[::step]
    p = side * rows["p"]
    found = motion(
        rate, rows[f"{left}_used_z"], rows[f"{right}_used_z"], side * rows["theta"], p, placed=placements(p, rate)
    )
    segments = board_segments(found.omega, found.theta, rate)
    table: dict[str, list[Any]] = {}
    for attempt in attempts:
        release, stop, target = -(-attempt.tick // step), -(-attempt.stop // step), side * attempt.target * TARGET
        completion = find_completion(p[release:stop], rate, target, hold=1.5 - 2 * (step - 1) / 1000)
        trial = Trial(release, stop, target, None if completion.sample is None else release + completion.sample)
        window, own = trial.window(), segments.of_trial(trial)
        moved = contributions(own, found.left_z, found.right_z)
        delay = delays(own, moved, found.left_vz, found.right_vz, rate)
        strategy = first_braking(segments, found.theta, found.p, found.vp, rate, trial)
        times = movement_times(classify(found.left_vz[window], found.right_vz[window]), rate)
        for name, value in {
            "completion": completion.time,
            "shares": times.shares,
            "segments": len(own),
            "cooperative": moved.cooperative.sum(),
            "delay": np.nanmean(delay.signed) if np.isfinite(delay.signed).any() else np.nan,
            "peaks": velocity_peaks(found.speed[window], least_prominence=0.005).count,
            "strategy": [strategy.distance, strategy.velocity, strategy.onset],
        }.items():
            table.setdefault(name, []).append(value)
    return {name: np.array(values) for name, values in table.items()}


@pytest.mark.parametrize("configuration", ["dyadic", "bimanual"])
def test_completion_is_the_servers_less_one_tick(configuration: str) -> None:
    rows, attempts = block(configuration)
    expected = [attempt.completion - 1e-3 for attempt in attempts]
    np.testing.assert_allclose(measures(rows, attempts)["completion"], expected, atol=1e-9)


def test_ball_is_placed_right_after_an_attempt() -> None:
    rows, attempts = block("dyadic")
    assert set(placements(rows["p"], 1000.0)) <= {attempt.stop + 1 for attempt in attempts}


@pytest.mark.evidence("properties", motion, board_segments, contributions, velocity_peaks, movement_times, of="mirror")
@pytest.mark.parametrize("configuration", ["dyadic", "bimanual"])
def test_measures_are_mirror_symmetric(configuration: str) -> None:
    rows, attempts = block(configuration)
    one, other = measures(rows, attempts), measures(rows, attempts, side=-1)
    np.testing.assert_allclose(other["delay"], -one["delay"], atol=1e-9)
    for name in one.keys() - {"delay"}:
        np.testing.assert_allclose(other[name], one[name], atol=1e-9, err_msg=name)


@pytest.mark.evidence("properties", motion, first_braking, of="rate")
@pytest.mark.parametrize("configuration", ["dyadic", "bimanual"])
def test_measures_hardly_depend_on_the_sampling_rate(configuration: str) -> None:
    rows, attempts = block(configuration)
    one, half = measures(rows, attempts), measures(rows, attempts, step=2)
    for name, tolerance in {"completion": 4e-3, "shares": 0.01, "peaks": 0, "strategy": 0.01}.items():
        np.testing.assert_allclose(half[name], one[name], atol=tolerance, err_msg=name)
    apart = np.abs(half["delay"] - one["delay"])  # a velocity that only touches a threshold may cross it much later
    assert np.sum(apart > 4e-3) <= 1
    assert np.nanmax(apart) < 0.02


def test_simulated_participants_perform_the_task_plausibly() -> None:
    """The ball is braked on its way to the target, and bimanual hands hardly ever move in the same direction."""
    found = {name: measures(*block(name)) for name in ("dyadic", "bimanual")}
    for table in found.values():
        done = np.isfinite(table["completion"])
        distance, velocity, onset = table["strategy"][done].T
        assert (distance > -0.05).all()
        assert (distance <= 0.301).all()
        assert (velocity > 0).all()
        assert (onset > 0.2).all()
        np.testing.assert_allclose(table["shares"].sum(axis=1), 1)
    np.testing.assert_array_less(found["bimanual"]["shares"][:, 1], 0.05)
