"""Makes a whole recording of what a killed logger or a damaged disk left."""

from pathlib import Path

import typer

from netboard.recording.recovery import recover


def main(path: Path, output: Path | None = None) -> int:
    """Recover what is sound, and say what was lost.

    Parameters
    ----------
    path : Path
        The unfinished or damaged file; it is left as it is.
    output : Path or None
        The new file; None names it after the old one.

    Returns
    -------
    int
        Exit code.
    """
    report = recover(path, output)
    ticks = "no ticks" if report.first_tick is None else f"ticks {report.first_tick} to {report.last_tick}"
    missing = sum(gap.count for gap in report.missing)
    typer.echo(f"{report.output}: {ticks}, {missing} missing, {sum(report.messages.values())} messages")
    for gap in report.missing:
        typer.echo(f"  missing: {gap.count} ticks from {gap.first}")
    for damage in report.damage:
        typer.echo(f"  lost: {damage.length} bytes at {damage.offset}, {damage.reason}")
    if not report.has_config:
        typer.echo("  lost: the configuration")
    return 0
