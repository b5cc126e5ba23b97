"""The demonstration on one machine, without its processes."""

import subprocess
import sys
from pathlib import Path

import pytest

from netboard.base.config import parse
from netboard.nodes.operator import demo


@pytest.mark.parametrize(("session", "listed"), [("0123456789abcdef", ["S01_D01_x_01234567.mcap.part"]), ("", [])])
def test_failed_demo_lists_only_its_own_unfinished_recordings(
    session: str, listed: list[str], tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    for name in ("S01_D01_x_01234567.mcap.part", "S02_D09_y_fedcba98.mcap.part"):
        (tmp_path / name).touch()
    monkeypatch.setattr(demo, "play", lambda *given: (session, False))
    assert demo.run(parse("", "test", [f"recording.directory={tmp_path}"]), displays=False) == 1
    output = capsys.readouterr().out
    assert [line.split()[2].rstrip(";") for line in output.splitlines() if line.startswith("unfinished")] == [
        str(tmp_path / name) for name in listed
    ]


def test_reserved_ports_end_with_the_process_without_a_warning() -> None:
    script = "from netboard.network.transport.ports import free_port; free_port()"
    ended = subprocess.run([sys.executable, "-W", "always", "-c", script], capture_output=True, text=True, check=True)
    assert ended.stderr == ""
