"""The short form of the fault benchmark: some cases on real processes, with all their checks.

Cases that do not need a site of their own are played in one, one after the other, with the agents' lines through
relays: so few processes are started.
"""

from dataclasses import replace
from pathlib import Path

import pytest

import daily
from netboard.benchmarks.faults.bench import play_all
from netboard.benchmarks.faults.case import RELAYED, Case
from netboard.benchmarks.faults.cases import choose

pytestmark = [pytest.mark.integration, pytest.mark.quiet, pytest.mark.slow, pytest.mark.timeout(900)]

WITH_RELAYS = (
    *("line-held-20ms", "line-held-200ms", "line-cut-20ms", "line-cut-5s", "delay-10ms", "agent-killed"),
    "agent-stopped-1s",
    *("other-version", "no-hello", "device-nan", "device-frozen", "device-jumps", "device-gone", "logger-killed"),
    "emergency-stop",
)
BY_THEMSELVES = ("server-stopped-1s", "server-killed", "directory-removed")
RELAYED_DAILY, BY_THEMSELVES_DAILY = 4, 1
"""Cases that are played in a day [1]."""


def all_hold(cases: list[Case], folder: Path) -> None:
    """Play cases once, and show what does not hold."""
    outcomes = list(play_all(cases, folder / "played", True, lambda _: None))
    assert [outcome.refusal for outcome in outcomes] == [""] * len(cases)
    failed = {
        outcome.case.name: [verdict for verdict in outcome.verdicts if not verdict.holds]
        for outcome in outcomes
        if not outcome.holds
    }
    assert failed == {}


def test_lines_agents_peers_and_devices_that_fail(tmp_path: Path) -> None:
    names = daily.some("faults", WITH_RELAYS, RELAYED_DAILY)
    all_hold([replace(case, setup=RELAYED) for case in choose(names, quick=True)], tmp_path)


def test_a_server_that_stands_still_or_is_killed_and_a_recording_that_is_deleted(tmp_path: Path) -> None:
    all_hold(choose(daily.some("faults by themselves", BY_THEMSELVES, BY_THEMSELVES_DAILY), quick=True), tmp_path)
