"""Recovers complete recordings from the files of a killed logger, a damaged disk or a server without a logger."""

from collections.abc import Iterator, Sequence
from pathlib import Path

import typer
from rich.console import Console
from rich.progress import track

from netboard.base.errors import ConfigError, NetboardError
from netboard.recording.recovery.recover import Report
from netboard.recording.recovery.spilled import recover_any

UNFINISHED = ("*.mcap.part", "*.spill")
"""Files in a folder that need recovery."""


def main(paths: Sequence[Path], output: Path | None = None) -> int:
    """Recover what is sound, and print what was lost.

    Parameters
    ----------
    paths : sequence of Path
        Unfinished or damaged files, and folders of such; they stay unchanged.
    output : Path or None
        The new file, if there is one old one; None names it after the old one.
    """
    files = list(_files(paths))
    if output is not None and len(files) != 1:
        raise ConfigError(f"--output names one file, and {len(files)} are to be recovered; leave it out")
    refused = 0
    for file in track(files, "recovering", console=Console(stderr=True), transient=True, disable=len(files) < 2):
        try:
            for report in recover_any(file, output):
                _say(report)
        except NetboardError as error:
            refused += 1
            typer.secho(f"netboard: {error}", err=True, fg=typer.colors.RED)
    return 1 if refused else 0


def _files(paths: Sequence[Path]) -> Iterator[Path]:
    """Yield every file, including those in the folders."""
    for path in paths:
        if not path.is_dir():
            yield path
            continue
        found = sorted(file for pattern in UNFINISHED for file in path.glob(pattern))
        if not found:
            typer.echo(f"{path}: nothing unfinished in it")
        yield from found


def _say(report: Report) -> None:
    """Print what was recovered, and what was not."""
    ticks = "no ticks" if report.first_tick is None else f"ticks {report.first_tick} to {report.last_tick}"
    missing = sum(gap.count for gap in report.missing)
    typer.echo(f"{report.output}: {ticks}, {missing} missing, {sum(report.messages.values())} messages")
    for gap in report.missing:
        typer.echo(f"  missing: {gap.count} ticks from {gap.first}")
    for damage in report.damage:
        typer.echo(f"  lost: {damage.length} bytes at {damage.offset}, {damage.reason}")
    if not report.has_config:
        typer.echo("  lost: the configuration")
