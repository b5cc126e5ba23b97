"""What a simulated participant sees is what the display at its station shows."""

from dataclasses import replace
from math import isnan

import numpy as np
import pytest

from netboard.base.config import Config, Side
from netboard.base.tick import TICK
from netboard.participants.policy import SEEN
from netboard.stage.curtain import AWAY, NO_PHASE, glimpse, make_curtain, view_of
from netboard.task.trials.state_machine import Phase


@pytest.mark.parametrize("station", ["left", "right"])
@pytest.mark.parametrize("block", [{}, {"configuration": "bimanual"}, {"left": "still"}, {"right": "robot"}])
@pytest.mark.parametrize("balls", [0, 1])
def test_simulated_participant_sees_what_its_display_shows(station: Side, block: dict[str, str], balls: int) -> None:
    config = Config()
    config = replace(config, block=replace(config.block, **block), physics=replace(config.physics, balls=balls))
    curtain = make_curtain(config)
    row, shown = np.zeros(1, TICK), np.zeros(1, SEEN)
    for phase in Phase:
        row["phase"], row["target"], row["z"], row["theta"], row["p"] = phase, 1, 0.01, 0.02, 0.03
        row["left_used_z"], row["right_used_z"] = 0.04, 0.05
        view = view_of(curtain, row[0], station, None, 7)
        glimpse(curtain.stations[station][0], row.view(np.int64), row.view(np.float64), 2.5, shown[0])
        seen = shown[0]
        assert seen["time"] == 2.5
        assert seen["phase"] == (NO_PHASE if view.phase == AWAY else phase)
        for name in ("z", "theta", "p", "target", "left", "right"):
            expected = getattr(view, name)
            assert isnan(seen[name]) if expected is None else seen[name] == expected
