"""``netboard session rehearse`` plans and rehearses a dyad's blocks."""

import json

import pytest
from typer.testing import CliRunner

from netboard.services.cli import app


@pytest.mark.slow
def test_rehearse_runs_the_requested_blocks_and_trials() -> None:
    result = CliRunner().invoke(
        app, ["session", "rehearse", "paper", "--dyad", "2", "--blocks", "2", "--trials", "1", "--json"]
    )
    assert result.exit_code == 0, result.output
    report = json.loads(result.stdout)
    assert [block["successes"] for block in report["blocks"]] == [1, 1]
    assert report["ticks_per_second"] > 0


def test_rehearse_names_a_missing_study() -> None:
    result = CliRunner().invoke(app, ["session", "rehearse", "nowhere.toml", "--dyad", "1"])
    assert result.exit_code == 2
    assert "nowhere.toml" in result.output
