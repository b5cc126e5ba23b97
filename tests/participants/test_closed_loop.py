"""Participants, hands, devices, safety chain and stage together complete the task at human speed."""

import numpy as np
import pytest
from closed_loop import Played, play, with_block

from netboard.base.config import Config
from netboard.network.protocol.motion import Safeguard

CONDITIONS = [("dyadic", True), ("dyadic", False), ("bimanual", True), ("bimanual", False)]


def block(configuration: str, haptics: bool, seed: int = 1, trials: int = 6, most_seconds: float = 150.0) -> Played:
    return play(with_block(Config(), configuration, haptics, trials, seed), most_seconds)


@pytest.mark.slow
@pytest.mark.parametrize(("configuration", "haptics"), CONDITIONS)
@pytest.mark.daily(2)
def test_six_trials_are_done_at_human_speed(configuration: str, haptics: bool) -> None:
    played = block(configuration, haptics)
    assert len(played.completions) == 6
    assert played.failures <= 6
    assert 1.2 < np.mean(played.completions) < 10.0
    assert played.lateral < 0.01


@pytest.mark.slow
def test_hands_feel_the_board_where_they_shall_and_nowhere_else() -> None:
    felt, unfelt = block("dyadic", True, trials=1), block("dyadic", False, trials=1)
    assert np.abs(felt.rows["left_force"]).max() > 0.1
    assert not unfelt.rows["left_force"].any()
    assert felt.safeguards & Safeguard.ARMED
    assert not felt.safeguards & (Safeguard.STALE | Safeguard.NOT_FINITE | Safeguard.TOO_FAST)


@pytest.mark.slow
def test_the_same_seed_plays_the_same_block() -> None:
    one, two = block("dyadic", True, trials=1), block("dyadic", True, trials=1)
    assert one.rows.tobytes() == two.rows.tobytes()
