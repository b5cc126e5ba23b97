"""The socket parts of the evidence from fuzzing, with a thousand malformed messages for every socket."""

from pathlib import Path

import pytest

from evidence.faults.fuzz_peers import peer_parts
from evidence.faults.fuzz_server import server_parts
from netboard.benchmarks.harness.results import ResultPart

pytestmark = [pytest.mark.integration, pytest.mark.quiet, pytest.mark.slow, pytest.mark.timeout(240)]

MESSAGES = 1000
TIMING_CLAIM = "the trial goes on"
"""This claim depends on the load of the machine, so it is not asserted."""


def ignore_progress(text: str, share: float) -> None:
    """Discard a progress report."""


def failed_claims(parts: list[ResultPart]) -> list[str]:
    """Return the claims that do not hold, except the one about timing."""
    verdicts = [verdict for part in parts for verdict in part.verdicts]
    return [f"{v.claim}: {v.found}" for v in verdicts if not v.holds and v.claim != TIMING_CLAIM]


@pytest.mark.sampled(2, of="sessions in real time")
def test_malformed_messages_do_not_disturb_a_server_in_a_trial(tmp_path: Path) -> None:
    parts = list(server_parts(tmp_path / "server", MESSAGES, ignore_progress, quiet=0.5))
    assert failed_claims(parts) == []
    log = (tmp_path / "server" / "server.log").read_text(encoding="utf-8")
    assert all(line.isprintable() for line in log.splitlines())  # although some peer names are not printable
    sent = {row[0]: row[1] for row in parts[0].rows}
    assert set(sent) == {"motion", "log", "control", "view.left", "view.right"}
    assert all(int(number) >= MESSAGES - 5 for number in sent.values())


@pytest.mark.sampled(2, of="sessions in real time")
def test_malformed_messages_do_not_disturb_agents_displays_and_loggers(tmp_path: Path) -> None:
    parts = list(peer_parts(tmp_path / "peers", MESSAGES, ignore_progress))
    assert failed_claims(parts) == []
    assert all(int(row[1]) >= MESSAGES for row in parts[0].rows[:-1])
