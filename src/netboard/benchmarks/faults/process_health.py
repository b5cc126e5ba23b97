"""Checks on the processes of a test: that they run, and that their memory does not grow."""

from netboard.base.errors import NetboardError
from netboard.base.process import resident_memory
from netboard.benchmarks.faults.rigs import Rig
from netboard.benchmarks.harness.results import Part, Value, Verdict

MAX_GROWTH = 32e6
"""Largest growth of a process's resident memory [bytes]."""


def require_running(rig: Rig) -> None:
    """Raise an error if a process of a rig has ended."""
    for name, process in rig.running.items():
        if (code := process.poll()) is not None:
            raise NetboardError(f"the {name} ended with exit code {code}:\n{rig.said(name)[-2000:]}")


def memory(rig: Rig) -> dict[str, float]:
    """Return the resident memory of each process of a rig [bytes]."""
    return {name: resident_memory(process.pid) for name, process in rig.running.items()}


def memory_part(name: str, title: str, before: dict[str, float], after: dict[str, float]) -> Part:
    """Tabulate the memory of the processes before and after a test."""
    rows: list[tuple[Value, ...]] = [
        (process, before[process] * 1e-6, after[process] * 1e-6, (after[process] - before[process]) * 1e-6)
        for process in before
    ]
    most = max(after[process] - before[process] for process in before)
    return Part(
        name,
        title,
        ("process", "before [MB]", "after [MB]", "growth [MB]"),
        rows,
        [
            Verdict(
                f"no process grows by more than {MAX_GROWTH * 1e-6:g} MB",
                not most > MAX_GROWTH,
                f"growth of at most {most * 1e-6:.1f} MB",
            )
        ],
    )
