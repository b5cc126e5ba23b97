"""Runs the integrity check on recordings, one after the other: a result for each, and the speed of recomputation."""

import json
import time
from collections.abc import Iterator, Sequence
from dataclasses import asdict
from pathlib import Path
from typing import Any

from rich.console import Console
from rich.markup import escape
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeElapsedColumn

from netboard.base.errors import RecordingError
from netboard.base.tick import TICK_SECONDS
from netboard.recording.integrity.checking import check
from netboard.recording.integrity.severity import EXIT_CODES, RESULTS, Report, Severity

COLOURS = {Severity.SOUND: "green", Severity.LOSS: "yellow", Severity.DAMAGE: "red"}
"""Colour of each severity on a terminal."""

ENDINGS = (".mcap", ".part", ".spill")
"""Endings of the names of recordings, finished or not."""


def main(paths: Sequence[Path], *, replay: bool = False, as_json: bool = False) -> int:
    """Check recordings.

    Returns
    -------
    int
        Exit code, by the worst result: 0 complete, 3 complete with listed losses, 1 damaged.
    """
    files = [*recordings_in(paths)]
    console = Console(highlight=False)
    reports: list[Report] = []
    began = time.perf_counter()
    with bars() as progress:
        task = progress.add_task("recordings", total=len(files), ticks="")
        read = 0

        def tell(more: int) -> None:
            nonlocal read
            read += more
            progress.update(task, ticks=f"{read} ticks")

        for file in files:
            reports.append(check(file, replay, tell))
            progress.advance(task)
    took = time.perf_counter() - began
    if as_json:
        console.file.write(json.dumps(as_data(reports, took)) + "\n")
    else:
        for report in reports:
            console.print(in_words(report, whole=len(files) == 1), soft_wrap=True)
        console.print(in_total(reports, took), soft_wrap=True)
    return EXIT_CODES[max(report.severity for report in reports)]


def recordings_in(paths: Sequence[Path]) -> Iterator[Path]:
    """Yield the files, and the recordings in folders, in order of their names."""
    for path in paths:
        if path.is_dir():
            found = sorted(file for file in path.rglob("*") if file.suffix in ENDINGS and file.is_file())
            if not found:
                raise RecordingError(f"{path}: no recording in this folder (.mcap, .mcap.part, .spill)")
            yield from found
        elif path.is_file():
            yield path
        else:
            raise RecordingError(f"{path}: no such file or folder")


def bars() -> Progress:
    """Make a progress bar for a terminal, separate from the output."""
    columns = (TextColumn("{task.description}"), BarColumn(), MofNCompleteColumn(), TextColumn("{task.fields[ticks]}"))
    return Progress(*columns, TimeElapsedColumn(), console=Console(stderr=True, highlight=False), transient=True)


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
        f"{count} {RESULTS[severity]}"
        for severity in Severity
        if (count := sum(r.severity == severity for r in reports))
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
