"""The quick form of the fault benchmark: some cases on real processes, with all their checks.

Cases that do not need their own set-up run one after the other in a shared one, with the agents connected through
relays, so that few processes are started.
"""

from dataclasses import replace
from pathlib import Path

import pytest

import sampling
from evidence.faults.bench import choose, run_all
from evidence.faults.cases import RELAYED, Case

pytestmark = [pytest.mark.integration, pytest.mark.quiet, pytest.mark.slow, pytest.mark.timeout(900)]

WITH_RELAYS = (
    *("line-held-20ms", "line-held-200ms", "line-cut-20ms", "line-cut-5s", "delay-10ms", "agent-killed"),
    "agent-stopped-1s",
    *("other-version", "no-hello", "device-nan", "device-frozen", "device-jumps", "device-gone", "logger-killed"),
    "emergency-stop",
)
STANDALONE = ("server-stopped-1s", "server-killed", "directory-removed")
RELAYED_COUNT, STANDALONE_COUNT = 3, 1
"""Number of cases that `make test` runs [1]."""


def check_cases(cases: list[Case], folder: Path) -> None:
    """Run cases once, and fail with the checks that do not hold."""
    outcomes = list(run_all(cases, folder / "played", True, lambda _: None))
    assert [outcome.refusal for outcome in outcomes] == [""] * len(cases)
    failed = {
        outcome.case.name: [verdict for verdict in outcome.verdicts if not verdict.holds]
        for outcome in outcomes
        if not outcome.holds
    }
    assert failed == {}


def test_faults_of_links_agents_peers_and_devices_are_handled(tmp_path: Path) -> None:
    names = sampling.some("faults", WITH_RELAYS, RELAYED_COUNT)
    check_cases([replace(case, setup=RELAYED) for case in choose(names, quick=True)], tmp_path)


def test_stopped_or_killed_server_and_deleted_recording_are_handled(tmp_path: Path) -> None:
    check_cases(choose(sampling.some("faults by themselves", STANDALONE, STANDALONE_COUNT), quick=True), tmp_path)
