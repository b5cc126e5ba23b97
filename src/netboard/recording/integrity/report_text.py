"""Results of integrity checks: lines for a terminal, and values for JSON."""

from collections.abc import Sequence
from dataclasses import asdict
from typing import Any

from rich.markup import escape

from netboard.base.tick import TICK_SECONDS
from netboard.recording.integrity.severity import RESULTS, Report, Severity

COLOURS = {Severity.SOUND: "green", Severity.LOSS: "yellow", Severity.DAMAGE: "red"}
"""Colour of each severity on a terminal."""


def in_words(report: Report, whole: bool) -> str:
    """Return the result of a check and its evidence."""
    lines = [f"{escape(str(report.path))}: [{COLOURS[report.severity]}]{report.result}[/], {report.ticks} ticks"]
    for finding in report.findings:
        if whole or finding.severity != Severity.SOUND:
            colour = COLOURS[finding.severity]
            lines.append(f"  [{colour}]{finding.part:13}[/] {escape(finding.text)}")
    return "\n".join(lines)


def in_total(reports: Sequence[Report], took: float) -> str:
    """Return a summary of two lines: results and speed."""
    counts = ", ".join(
        f"{count} {RESULTS[grade]}" for grade in Severity if (count := sum(r.severity == grade for r in reports))
    )
    ticks = sum(report.ticks for report in reports)
    words = f"{len(reports)} recordings: {counts}; {ticks} ticks in {took:.1f} s, {_times(ticks, took)}"
    again, computing = _computed(reports)
    if again:
        words += f"\n{again} ticks computed again in {computing:.2f} s, {_times(again, computing)}"
    return words


def _times(ticks: int, took: float) -> str:
    """Return how many times faster than real time something was."""
    return f"{ticks * TICK_SECONDS / took:.0f} x real time"


def _computed(reports: Sequence[Report]) -> tuple[int, float]:
    """Return the number of recomputed ticks, and the time that took [s]."""
    again = sum(report.replay.checked for report in reports if report.replay is not None)
    return again, sum(report.computing for report in reports)


def as_data(reports: Sequence[Report], took: float) -> dict[str, Any]:
    """Return the reports for JSON."""
    again, computing = _computed(reports)
    return {
        "verdict": RESULTS[max(report.severity for report in reports)],
        "recordings": [
            {
                "path": str(report.path),
                "verdict": report.result,
                "ticks": report.ticks,
                "findings": [
                    {"part": one.part, "grade": one.severity.name.lower(), "text": one.text} for one in report.findings
                ],
                "replay": None if report.replay is None else _plain(asdict(report.replay)),
            }
            for report in reports
        ],
        "seconds": took,
        "ticks_computed": again,
        "computing_seconds": computing,
    }


def _plain(replay: dict[str, Any]) -> dict[str, Any]:
    """Convert numpy's numbers and non-finite numbers to what JSON knows."""
    return {
        "identical": replay["tick"] is None,
        **{
            name: value if isinstance(value, int | str | None) else repr(float(value)) for name, value in replay.items()
        },
    }
