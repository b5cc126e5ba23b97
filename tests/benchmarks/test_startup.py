"""The benchmark of start-up: programs run to their end, and a session whose processes are waited for."""

from pathlib import Path

import pytest

from netboard.base.errors import NetboardError
from netboard.benchmarks.loop import startup
from netboard.benchmarks.loop.startup import BARE, CLI, TYPER, Start


def test_program_that_fails_is_an_error_with_its_words():
    with pytest.raises(NetboardError, match=r"(?s)ended with exit code 2: .*No such command"):
        startup._run((*CLI, "demp"), {})


def test_ratios_are_to_the_baselines_of_the_same_run():
    times = {BARE: Start(0.1, 0.05), TYPER: Start(0.3, 0.2), "netboard --help": Start(1.0, 0.6)}
    row = startup._commands(times).rows[-1]
    assert row == ("netboard --help", 1.0, 0.6, pytest.approx(12), pytest.approx(3))


def test_row_of_a_process_has_both_states_of_the_cache():
    starts = {startup.EMPTY: {"server": Start(20.0, 30.0)}, startup.FILLED: {"server": Start(3.0, 2.0)}}
    part = startup._caches("session", "Processes", starts, bare=1.0)
    assert part.rows == [("server", 20.0, 30.0, 3.0, 2.0, 2.0)]


@pytest.mark.slow
@pytest.mark.integration
def test_every_process_of_a_session_is_waited_for(tmp_path: Path):
    pytest.importorskip("PySide6.QtWidgets", reason="Qt's libraries cannot be loaded here", exc_type=ImportError)
    found = startup._session(tmp_path / "session", {})
    assert list(found) == ["server", "logger", "agent.left", "agent.right", "display.left"]
    assert all(start.cpu > 0.0 and start.elapsed > 0.0 for start in found.values())
