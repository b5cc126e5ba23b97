"""The quick study of the force conditions, in which all claims hold."""

import json
from pathlib import Path

import numpy as np
import pytest

from evidence.coupling import forces
from netboard.base.config import Config
from netboard.benchmarks.harness.running import Options, run
from netboard.benchmarks.recording.movement import FIRST_MOVEMENT, SECOND_MOVEMENT, RecordedMovement, record
from netboard.task.trials.state_machine import Cause


@pytest.mark.slow
def test_quick_study_writes_results_and_all_claims_hold(tmp_path: Path) -> None:
    run("forces", forces.study, Options(tmp_path / "found", tmp_path / "found.json", quick=True))
    found = json.loads((tmp_path / "found.json").read_text())
    (part,) = found["parts"]
    assert [row[0] for row in part["rows"]] == list(forces.CONDITIONS)
    assert all(verdict["holds"] for verdict in part["verdicts"])
    assert (tmp_path / "found" / "forces.png").stat().st_size > 10_000


@pytest.mark.slow
@pytest.mark.parametrize("movement", [FIRST_MOVEMENT, SECOND_MOVEMENT])
def test_hands_move_the_ball_smoothly_into_its_target(movement: RecordedMovement) -> None:
    rows = record(forces._config("full"), movement, forces.TICKS)
    assert (rows["event"] == Cause.HELD).any()
    for side in ("left", "right"):
        # The acceleration of a hand is at most half of gravity.
        assert np.abs(np.diff(rows[f"{side}_sent_vz"][forces.SETTLED :])).max() < 5e-3
        assert np.abs(rows[f"{side}_sent_z"]).max() < Config().task.stylus_range
