"""The short form of the study of force conditions, in which all claims hold."""

import json
from pathlib import Path

import numpy as np
import pytest

from netboard.base.config import Config
from netboard.benchmarks.coupling import forces
from netboard.benchmarks.harness.running import run_named
from netboard.task.trials.state_machine import Cause


@pytest.mark.slow
def test_the_short_form_writes_its_results_and_every_verdict_holds(tmp_path: Path) -> None:
    run_named("forces", forces.study, tmp_path / "found", tmp_path / "found.json", quick=True, force=False)
    found = json.loads((tmp_path / "found.json").read_text())
    (part,) = found["parts"]
    assert [row[0] for row in part["rows"]] == list(forces.CONDITIONS)
    assert all(verdict["holds"] for verdict in part["verdicts"])
    assert (tmp_path / "found" / "forces.png").stat().st_size > 10_000


@pytest.mark.slow
@pytest.mark.parametrize("movement", [forces.MINE, forces.OTHERS])
def test_the_hands_carry_the_ball_into_its_target_smoothly(movement: forces.Movement) -> None:
    rows = forces.record(forces._config("full"), movement, forces.TICKS)
    assert (rows["event"] == Cause.HELD).any()
    for side in ("left", "right"):
        # Each millisecond the rate changes by what half a gravity would change it by, at the most.
        assert np.abs(np.diff(rows[f"{side}_sent_vz"][forces.SETTLED :])).max() < 5e-3
        assert np.abs(rows[f"{side}_sent_z"]).max() < Config().task.stylus_range
