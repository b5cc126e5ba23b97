"""Options and arguments take numbers as people write them, in every command."""

from typing import Any

import pytest
import typer
from typer.testing import CliRunner

from netboard.base.errors import ConfigError
from netboard.services.cli import app
from netboard.services.numeric import numbers_of, numeric_parameters, read_strictly, whole_numbers_of

LITERALS = ("1_2", "١٢", "１２", "0x1")


def commands_in(command: Any) -> list[Any]:
    """Return a command and all commands in it."""
    return [command, *(deep for one in getattr(command, "commands", {}).values() for deep in commands_in(one))]


def test_no_option_of_any_command_takes_a_literal_of_python() -> None:
    root: Any = typer.main.get_command(app)
    read_strictly(root)
    found = [(command, *pair) for command in commands_in(root) for pair in numeric_parameters(command)]
    assert len(found) > 50
    for command, parameter, kind in found:
        for word in (*LITERALS, *(("inf", "-inf", "nan") if kind is float else ("1.0",))):
            with pytest.raises(typer.BadParameter, match=f'found "{word}", expected a (whole )?number'):
                parameter.process_value(typer.Context(command), word)


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
