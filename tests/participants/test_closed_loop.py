"""Simulated participants, hands, devices, safety chain and stage together complete the task at human speed."""

import numpy as np
import pytest
from closed_loop import BlockResult, play, with_block

from netboard.base.config import Config
from netboard.base.safeguards import Safeguard

CONDITIONS = [("dyadic", True), ("dyadic", False), ("bimanual", True), ("bimanual", False)]


def play_block(
    configuration: str, haptics: bool, seed: int = 1, trials: int = 6, max_seconds: float = 150.0
) -> BlockResult:
    return play(with_block(Config(), configuration, haptics, trials, seed), max_seconds)


@pytest.mark.slow
@pytest.mark.parametrize(("configuration", "haptics"), CONDITIONS)
@pytest.mark.sampled(2)
def test_six_trials_are_completed_at_human_speed(configuration: str, haptics: bool) -> None:
    result = play_block(configuration, haptics)
    assert len(result.completions) == 6
    assert result.failures <= 6
    assert 1.2 < np.mean(result.completions) < 10.0
    assert result.lateral < 0.01


@pytest.mark.slow
def test_force_is_rendered_only_with_haptic_feedback_on() -> None:
    with_haptics, without_haptics = play_block("dyadic", True, trials=1), play_block("dyadic", False, trials=1)
    assert np.abs(with_haptics.rows["left_force"]).max() > 0.1
    assert not without_haptics.rows["left_force"].any()
    assert with_haptics.safeguards & Safeguard.ARMED
    assert not with_haptics.safeguards & (Safeguard.STALE | Safeguard.NOT_FINITE | Safeguard.TOO_FAST)


@pytest.mark.slow
def test_same_seed_gives_the_same_block() -> None:
    one, two = play_block("dyadic", True, trials=1), play_block("dyadic", True, trials=1)
    assert one.rows.tobytes() == two.rows.tobytes()
