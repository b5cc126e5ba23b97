"""The command of the evidence lists its items, and runs each with the options of a benchmark."""

import json
from importlib.util import find_spec
from pathlib import Path

import pytest
import typer.main
from typer.testing import CliRunner

from evidence.__main__ import PLAIN, app

ITEMS = sorted(typer.main.get_command(app).commands)  # type: ignore[attr-defined]


def test_items_are_listed() -> None:
    result = CliRunner().invoke(app, [])
    assert [name for name in ITEMS if f" {name} " not in result.output] == []


@pytest.mark.parametrize("name", ITEMS)
def test_every_item_has_help_with_an_example(name: str) -> None:
    result = CliRunner().invoke(app, [name, "--help"], env={"COLUMNS": "200"})
    assert result.exit_code == 0
    assert f'make evidence ARGS="{name}' in result.output
    assert all(option in result.output for option in ("--output", "--quick", "--force", "--json"))


def test_every_plain_item_has_its_module() -> None:
    assert [module for module, _ in PLAIN.values() if find_spec(f"evidence.{module}") is None] == []


@pytest.mark.slow
def test_item_writes_its_results(tmp_path: Path) -> None:
    result = CliRunner().invoke(app, ["truth", "--quick", "-o", str(tmp_path / "truth")])
    assert result.exit_code == 0, result.output
    results = json.loads((tmp_path / "truth" / "results.json").read_text(encoding="utf-8"))
    assert (results["study"], results["quick"]) == ("truth", True)


def test_existing_folder_is_refused(tmp_path: Path) -> None:
    result = CliRunner().invoke(app, ["truth", "--quick", "-o", str(tmp_path)])
    assert result.exit_code == 2
    assert "--force" in result.output
