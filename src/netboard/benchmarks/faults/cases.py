"""The table of all faults."""

from collections.abc import Sequence

from netboard.base.errors import ConfigError
from netboard.benchmarks.faults.attack_cases import ATTACKS
from netboard.benchmarks.faults.case import Case
from netboard.benchmarks.faults.link_cases import LINKS
from netboard.benchmarks.faults.other_cases import DEVICES, MACHINES, PEERS
from netboard.benchmarks.faults.process_cases import PROCESSES

CASES: tuple[Case, ...] = (*PROCESSES, *LINKS, *PEERS, *DEVICES, *MACHINES, *ATTACKS)
"""All fault cases."""

QUICK = (
    *("agent-killed", "no-hello", "device-jumps"),
    *("line-held-200ms", "line-cut-20ms"),
    "server-killed",
    "logger-killed",
)
"""Cases of the short form: processes, links, peers and devices, in few sites, because starting them takes most of the
time."""


def choose(names: Sequence[str], *, quick: bool) -> list[Case]:
    """Find cases by name."""
    there = {case.name: case for case in CASES}
    if unknown := [name for name in names if name not in there]:
        raise ConfigError(f"--case {unknown[0]}: there is no such case; netboard bench faults --list shows all")
    return [there[name] for name in names] or [case for case in CASES if case.name in QUICK or not quick]
