"""``netboard session rehearse`` plans and rehearses a dyad's blocks."""

import json

import pytest
from typer.testing import CliRunner

from netboard.services.cli import app


@pytest.mark.slow
def test_the_command_does_what_it_is_told() -> None:
    done = CliRunner().invoke(
        app, ["session", "rehearse", "paper", "--dyad", "2", "--blocks", "2", "--trials", "1", "--json"]
    )
    assert done.exit_code == 0, done.output
    told = json.loads(done.stdout)
    assert [block["successes"] for block in told["blocks"]] == [1, 1]
    assert told["ticks_per_second"] > 0


def test_a_study_that_is_not_there_is_named() -> None:
    done = CliRunner().invoke(app, ["session", "rehearse", "nowhere.toml", "--dyad", "1"])
    assert done.exit_code == 2
    assert "nowhere.toml" in done.output
