"""Simulated dyads of known truth: a small run, in which the passive part cannot depend on what the force tells."""

from pathlib import Path

import pytest

from evidence.analysis import control_truth
from evidence.analysis.control_truth import CASES, job, study
from netboard.benchmarks.harness.running import Options, run


def test_blocks_of_a_dyad_differ_in_the_force_alone(tmp_path: Path) -> None:
    off, on = (job(CASES[1], 3, force, 5, tmp_path) for force in ("none", "full"))
    assert off.people == on.people
    assert (off.config.virtual.friction, off.config.participant.friction_skill) == (0.26, 0.0)
    assert (off.config.block.force, on.config.block.force) == ("none", "full")
    assert off.session != on.session


@pytest.mark.slow
def test_mechanics_leave_no_communicative_part(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(control_truth, "QUICK_DYADS", 2)
    monkeypatch.setattr(control_truth, "QUICK_TRIALS", 3)
    monkeypatch.setattr(control_truth, "CASES", (CASES[0], CASES[-1]))
    verdicts = run("controls", study, Options(tmp_path / "found", tmp_path / "found.json", quick=True))
    assert len(verdicts) == 3
    assert verdicts[0].holds, "the interval with all arms contains no effect"
    assert verdicts[2].holds, "trials with haptics off, and so the passive part, are the same"
