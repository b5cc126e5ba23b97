"""``netboard session rehearse`` plans a dyad's blocks and does them."""

import json

import pytest
from typer.testing import CliRunner

from netboard.config import Config
from netboard.services.cli import app
from netboard.services.session import blocks_of


def test_blocks_are_those_of_the_dyad_s_plan() -> None:
    blocks = blocks_of(Config(), "paper", 1, 3)
    assert [block.block.number for block in blocks] == list(range(1, 19))
    assert {block.session.dyad for block in blocks} == {"D03"}
    assert {block.session.study for block in blocks} == {"paper"}
    assert len({block.block.seed for block in blocks}) == 18


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
