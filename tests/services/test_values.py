"""Options and arguments take numbers as people write them, and suggest the word that was meant, in every command."""

import re
from pathlib import Path
from typing import Any

import pytest
import typer
from typer.testing import CliRunner

from netboard.base.errors import ConfigError
from netboard.services.cli import app
from netboard.services.values import checked_parameters, numbers_of, read_strictly, whole_numbers_of

LITERALS = ("1_2", "١٢", "１２", "0x1")


def commands_in(command: Any) -> list[Any]:
    """Return a command and all commands in it."""
    return [command, *(deep for one in getattr(command, "commands", {}).values() for deep in commands_in(one))]


def test_no_option_of_any_command_takes_a_literal_of_python() -> None:
    root: Any = typer.main.get_command(app)
    read_strictly(root)
    found = [(command, *pair) for command in commands_in(root) for pair in checked_parameters(command)]
    assert len(found) > 80
    for command, parameter, _ in found:
        for word in (*LITERALS, "inf", "-inf", "nan"):
            with pytest.raises(typer.BadParameter, match=f'found "{word}", expected (a (whole )?number|one of )'):
                parameter.process_value(typer.Context(command), word)


@pytest.mark.parametrize(
    ("words", "meant"),
    [
        ("control strat", "start"),
        ("export a.mcap --to parquett", "parquet"),
        ("agent --side lefft", "left"),
        ("plan show papper", "paper"),
        ("chek", "check"),
        ("plan shw", "show"),
        ("plan show --dyds 3", "--dyads"),
        ("config check --set blok.trials=3", "block"),
        ("config check --set block.trails=3", "trials"),
        ("config check --set block.force=ful", "full"),
        ("config check --set agents.left.device=vitual", "virtual"),
        ("import a.csv --map lefty=z", "left_y"),
    ],
)
def test_unknown_word_is_answered_with_the_one_that_was_meant(words: str, meant: str, tmp_path: Path) -> None:
    (tmp_path / "a.csv").write_text("time,left_z,right_z,p\n0,0,0,0\n", encoding="utf-8")
    result = CliRunner().invoke(app, [str(tmp_path / word) if word == "a.csv" else word for word in words.split()])
    assert result.exit_code == 2
    printed = " ".join(result.stderr.replace("│", " ").replace("'", "").split()).casefold()
    assert re.search(rf"(did you mean|possible options:) .*{meant}\b", printed), printed


def test_command_line_reads_numbers_strictly() -> None:
    result = CliRunner().invoke(app, ["plan", "show", "paper", "--dyads", "1_2"])
    assert result.exit_code == 2
    assert 'found "1_2", expected a whole number' in " ".join(result.stderr.replace("│", " ").split())
    assert CliRunner().invoke(app, ["plan", "show", "paper", "--dyads", "2"]).exit_code == 0


def test_lists_of_numbers_are_read_strictly() -> None:
    assert numbers_of("--p0", ["0.1, -0.1", "2e-1"]) == (0.1, -0.1, 0.2)
    assert whole_numbers_of("--dyads", "8, 4,8", 2) == (4, 8)
    for words in (["1_2"], ["inf"], ["0.1,"]):
        with pytest.raises(ConfigError, match=r"--p0: found .*, expected numbers separated by commas"):
            numbers_of("--p0", words)
    for text in ("4,1_2", "4,٣", "1", ""):
        with pytest.raises(ConfigError, match=r"--dyads: found .*, expected whole numbers from 2, with commas"):
            whole_numbers_of("--dyads", text, 2)
