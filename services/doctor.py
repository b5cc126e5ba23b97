"""Checks whether this machine is fit for a session, and writes a report for the recordings."""

from pathlib import Path

from rich.console import Console
from rich.progress import BarColumn, Progress, TextColumn, TimeElapsedColumn

from netboard.base.config import Config
from netboard.devices.setup.words import findings_table
from netboard.nodes.doctor.report import QUICK, THOROUGH, examine
from netboard.recording.files.provenance import doctor_report_path

console = Console(highlight=False)


def main(config: Config, *, quick: bool = False, json: Path | None = None) -> int:
    """Examine this machine."""
    columns = (TextColumn("{task.description:20}"), BarColumn(), TimeElapsedColumn())
    with Progress(*columns, console=console, transient=True) as progress:
        task = progress.add_task("", total=1.0)
        report = examine(
            config,
            QUICK if quick else THOROUGH,
            lambda what, done: progress.update(task, description=what, completed=done),
        )
    console.print(findings_table("This machine", report.findings))
    console.print(report.summary)
    for path in filter(None, (doctor_report_path(), json)):
        report.save(path)
        console.print(f"report  {path}")
    return 0 if report.fit else 1
