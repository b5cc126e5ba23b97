"""Errors quote files and names without harm to the terminal."""

from pathlib import Path

import pytest
from typer.testing import CliRunner

from netboard.base.terminal.errors import MOST, harmless
from netboard.services.cli import app


def test_lines_have_no_control_characters_and_are_not_long() -> None:
    text = harmless("a\x1b[2Jb\x00\nsecond\udc80")
    assert text == "a\\x1b[2Jb\\x00\nsecond\\udc80"
    long = harmless("x" * 100_000)
    assert len(long) < MOST + 50
    assert "(99000 characters)" in long


@pytest.mark.parametrize("cell", ["9" * 6000, "\x00", "[" * 5000])
def test_error_about_a_cell_is_a_short_line(cell: str, tmp_path: Path) -> None:
    file = tmp_path / "hands.csv"
    rows = "".join(f"{k / 100},0,0,{cell if k == 4 else 0},0\n" for k in range(9))
    file.write_text("t,z_left,v_left,z_right,v_right\n" + rows)
    result = CliRunner().invoke(app, ["simulate", "-i", str(file), "-o", str(tmp_path / "out.csv")])
    assert result.exit_code == 2
    assert "line 6, column z_right: found" in result.stderr
    assert all(line.isprintable() and len(line) < 2 * MOST for line in result.stderr.splitlines())
