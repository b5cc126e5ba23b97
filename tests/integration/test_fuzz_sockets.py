"""A thousand malformed messages for every socket of every process: the parts of ``netboard bench fuzz``."""

from pathlib import Path

import pytest

from netboard.benchmarks.faults.fuzz_peers import peer_parts
from netboard.benchmarks.faults.fuzz_server import server_parts
from netboard.benchmarks.harness.results import Part

pytestmark = [pytest.mark.integration, pytest.mark.quiet, pytest.mark.slow, pytest.mark.timeout(240)]

MESSAGES = 1000
UNDISTURBED = "the trial goes on"
"""On a machine that is busy with other things, that is a matter of luck."""


def quietly(text: str, share: float) -> None:
    """Nobody looks."""


def broken(parts: list[Part]) -> list[str]:
    """What does not hold."""
    verdicts = [verdict for part in parts for verdict in part.verdicts]
    return [f"{v.claim}: {v.found}" for v in verdicts if not v.holds and v.claim != UNDISTURBED]


@pytest.mark.daily(3, of="sessions in real time")
def test_malformed_messages_do_nothing_to_a_server_in_a_trial(tmp_path: Path) -> None:
    parts = list(server_parts(tmp_path / "server", MESSAGES, quietly, quiet=0.5))
    assert broken(parts) == []
    said = (tmp_path / "server" / "server.log").read_text(encoding="utf-8")
    assert all(line.isprintable() for line in said.splitlines())  # whatever strangers call themselves
    sent = {row[0]: row[1] for row in parts[0].rows}
    assert set(sent) == {"motion", "log", "control", "view.left", "view.right"}
    assert all(int(number) >= MESSAGES - 5 for number in sent.values())


@pytest.mark.daily(3, of="sessions in real time")
def test_malformed_messages_do_nothing_to_agents_displays_and_loggers(tmp_path: Path) -> None:
    parts = list(peer_parts(tmp_path / "peers", MESSAGES, quietly))
    assert broken(parts) == []
    assert all(int(row[1]) >= MESSAGES for row in parts[0].rows[:-1])
