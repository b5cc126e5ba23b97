"""``netboard recover``: complete recordings from what a killed logger, a damaged disk or a server left."""

from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from netboard.base.errors import ConfigError, NetboardError
from netboard.base.plural import plural
from netboard.base.terminal.errors import print_error
from netboard.services.guard import OK, expected
from netboard.services.options import examples

if TYPE_CHECKING:
    from netboard.recording.recovery.recover import RecoveryReport

app = typer.Typer()


@app.command(epilog=examples("netboard recover recordings/S01.mcap.part", "netboard recover recordings"))
def recover(
    recordings: Annotated[
        list[Path],
        typer.Argument(
            metavar="FILE...",
            help="Unfinished (.mcap.part) or damaged recordings, a server's .spill files, or folders of these.",
        ),
    ],
    output: Annotated[
        Path | None, typer.Option("--output", "-o", metavar="FILE", help="The new file, if there is only one.")
    ] = None,
) -> None:
    """Recover unfinished or damaged recordings into new files; the originals stay unchanged."""
    from netboard.base.process.stopping import interrupted_by_stop_signals
    from netboard.base.terminal.bars import progress_bars
    from netboard.base.terminal.output import plain_console
    from netboard.recording.files.locate import each_once
    from netboard.recording.recovery.recover import is_whole, require_finished
    from netboard.recording.recovery.spilled import recover_any

    files = each_once(_files(recordings))
    if output is not None and len(files) != 1:
        raise ConfigError(f"--output: names one file, but found {len(files)} files to recover; leave it out")
    code = OK
    with interrupted_by_stop_signals(), progress_bars(plain_console(stderr=True), shown=len(files) > 1) as progress:
        for file in progress.track(files, description="recovering"):
            try:
                require_finished(file)
                if is_whole(file):
                    typer.echo(f"{file}: is complete and undamaged; no file was written")
                else:
                    _print_reports(file, recover_any(file, output))
            except NetboardError as error:
                words, wrong = expected(error)
                code = max(code, wrong)
                print_error(words)
    raise typer.Exit(code)


def _files(paths: Sequence[Path]) -> Iterator[Path]:
    """Yield every file, and those in the folders that need recovery."""
    from netboard.recording.files.locate import find_unfinished

    for path in paths:
        if not path.is_dir():
            yield path
            continue
        found = find_unfinished([path])
        if not found:
            typer.echo(
                f"{path}: nothing is left to recover in this folder; for a damaged recording, name the file. A server "
                "leaves its .spill in the folder in which it was started"
            )
        yield from found


def _print_reports(file: Path, reports: "Sequence[RecoveryReport]") -> None:
    """Print what was recovered from a file; if it has several recordings, also whose they are."""
    if len(reports) > 1:
        typer.echo(f"{file}: contains {len(reports)} recordings; each is now a file of its own")
    for report in reports:
        _print_report(report)
        if len(reports) > 1:
            typer.echo(f"  of: {report.whose}")


def _print_report(report: "RecoveryReport") -> None:
    """Print what was recovered, and what was not."""
    ticks = "no ticks" if report.first_tick is None else f"ticks {report.first_tick} to {report.last_tick}"
    missing = sum(gap.count for gap in report.missing)
    typer.echo(f"{report.output}: {ticks}, {missing} missing, {sum(report.messages.values())} messages")
    for gap in report.missing:
        typer.echo(f"  missing: {plural(gap.count, 'tick')} from {gap.first}")
    for damage in report.damage:
        typer.echo(f"  lost: {damage.length} bytes at {damage.offset}, {damage.reason}")
    for what in report.left_out:
        typer.echo(f"  left out: {what}")
    if not report.has_config:
        typer.echo("  lost: the configuration")
