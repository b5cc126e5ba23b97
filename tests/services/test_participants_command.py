"""The commands that fit and draw simulated participants."""

import json

from typer.testing import CliRunner

from netboard.analysis.cohort.posterior import read_posterior
from netboard.services.cli import app


def drawn(*arguments: str) -> dict[str, list[float]]:
    result = CliRunner().invoke(app, ["participants", "draw", "--json", *arguments])
    assert result.exit_code == 0, result.output
    values: dict[str, list[float]] = json.loads(result.output)
    return values


def test_drawn_participants_are_those_of_the_posterior_and_of_their_seeds() -> None:
    values, posterior = drawn("--number", "5", "--seed", "7"), read_posterior()
    assert tuple(values) == posterior.parameters
    people = list(zip(*values.values(), strict=True))
    assert len(people) == 5
    assert set(people) <= {tuple(draw) for draw in posterior.draws.tolist()}
    assert {name: own[:1] for name, own in drawn("--number", "1", "--seed", "9").items()} == {
        name: own[2:3] for name, own in values.items()
    }


def test_table_names_every_fitted_parameter() -> None:
    result = CliRunner().invoke(app, ["participants", "draw", "--number", "2"], env={"COLUMNS": "80"})
    assert result.exit_code == 0, result.output
    assert [name for name in read_posterior().parameters if name not in result.output] == []
    assert "seed 2" in result.output


def test_wrong_file_is_a_wrong_configuration() -> None:
    result = CliRunner().invoke(app, ["participants", "draw", "--posterior", "none.json"])
    assert result.exit_code == 2
    assert "none.json: no such file" in result.output
