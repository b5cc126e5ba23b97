"""Mean paths, computed by hand: mirrored trials, means of dyads, quantiles of trials, and ranges."""

import numpy as np
import pandas as pd
import pytest

from made_modern import Path, modern_study, with_paths, without_paths
from made_study import Block
from netboard.analysis.extraction.study import StudyData
from netboard.analysis.topics.paths import MeanPath, mean_paths


def course_of(study: StudyData, quantity: str) -> MeanPath:
    (only,) = [one for one in mean_paths(study).parts if one.quantity == quantity]
    return only


def straight(trial: pd.Series) -> Path:
    """The ball moves to the target at 0.1 m/s times the trial's number; the near hand goes down, the far hand up."""
    time = 0.02 * np.arange(round(trial["duration"] / 0.02))
    down, up = -0.01 * trial["trial"] * time, 0.02 * trial["trial"] * time
    right = trial["target"] > 0
    return {
        "p": trial["target"] * 0.1 * trial["trial"] * time,
        "left_z": up if right else down,
        "right_z": down if right else up,
        "left_vz": time,
        "right_vz": time,
    }


def study_of(*numbers: int, duration: float = 2.0) -> StudyData:
    """Dyads with these numbers of trials, whose targets alternate between the sides."""
    blocks = [
        Block(
            f"D{k:02}",
            f"D{k:02}",
            "dyadic",
            "full",
            [{"target": (-1) ** trial, "duration": duration, "completion": duration - 1.5} for trial in range(number)],
        )
        for k, number in enumerate(numbers, start=1)
    ]
    return with_paths(modern_study(blocks), straight)


def test_mean_path_averages_mirrored_trials_then_dyads() -> None:
    study = study_of(3, 1)
    ball, near, far = (course_of(study, name) for name in ("ball", "near", "far"))
    assert len(ball.time) == 100
    assert ball.dyads == ("D01", "D02")
    np.testing.assert_allclose(ball.each, [0.2 * ball.time, 0.1 * ball.time], atol=1e-12)
    np.testing.assert_allclose(ball.mean, 0.15 * ball.time, atol=1e-12)
    np.testing.assert_allclose(near.mean, -0.015 * ball.time, atol=1e-12)
    np.testing.assert_allclose(far.mean, 0.03 * ball.time, atol=1e-12)
    assert ball.trials == 4


def test_bands_are_quantiles_over_all_trials() -> None:
    ball = course_of(study_of(11), "ball")
    np.testing.assert_allclose(ball.low, 0.2 * ball.time, atol=1e-12)
    np.testing.assert_allclose(ball.high, 1.0 * ball.time, atol=1e-12)


def test_mean_path_ends_when_fewer_than_nine_of_ten_trials_remain() -> None:
    study = study_of(10)
    durations = np.linspace(1.0, 1.9, 10)
    study = with_paths(
        modern_study([Block("D01", "D01", "dyadic", "full", [{"duration": one} for one in durations])]), straight
    )
    ball = course_of(study, "ball")
    assert ball.time[-1] == pytest.approx(np.quantile(durations, 0.1), abs=0.041)
    assert np.isfinite(ball.mean).all()


def test_reported_positions_are_points_of_the_mean_path() -> None:
    rows = {(row.quantity, row.group): row for row in mean_paths(study_of(1, 3)).results}
    row = rows["ball along the board", "dyadic, haptics on, 1.5 s"]
    assert row.value == pytest.approx(0.225)
    assert (row.n, row.of, row.unit) == (2, "dyad", "m")


def test_study_without_paths_or_trials_has_no_mean_path() -> None:
    assert mean_paths(without_paths(study_of(2))).parts == ()
    assert mean_paths(modern_study([Block("D01", "D01", "dyadic", "full", [])])).parts == ()
