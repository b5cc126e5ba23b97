"""``netboard check``: the integrity check of recordings."""

import json
import time
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Annotated

import typer

from netboard.base.errors import NoRecording
from netboard.services.options import examples

app = typer.Typer()

ENDINGS = (".mcap", ".mcap.part", ".spill")
"""Endings of the names of recordings, finished or not."""


@app.command(
    epilog=examples(
        "netboard check recordings/S01.mcap", "netboard check recordings/ --verify", "netboard check S01.mcap --json"
    )
)
def check(
    recordings: Annotated[
        list[Path],
        typer.Argument(metavar="RECORDING...", help="Recordings, finished or not, or folders of recordings."),
    ],
    verify: Annotated[
        bool, typer.Option("--verify", help="Also recompute every tick, which must give the same bits.")
    ] = False,
    as_json: Annotated[bool, typer.Option("--json", help="Print one JSON object.")] = False,
) -> None:
    """Check the integrity of recordings: checksums, numbering, times, clocks, trials, plan, journal.

    Each file has one result. Exit code: 0 all complete, 3 some complete with listed losses, 1 some damaged.
    """
    from rich.progress import MofNCompleteColumn

    from netboard.base.terminal.bars import progress_bars
    from netboard.base.terminal.output import plain_console
    from netboard.recording.files.copies import repeats_among
    from netboard.recording.files.locate import each_once
    from netboard.recording.integrity.checking import check as check_file
    from netboard.recording.integrity.report_text import as_data, in_total, in_words, with_conflicts
    from netboard.recording.integrity.severity import EXIT_CODES, CheckReport

    files = each_once(recordings_in(recordings))
    console = plain_console()
    reports: list[CheckReport] = []
    began = time.perf_counter()
    screen = plain_console(stderr=True)
    with progress_bars(screen, MofNCompleteColumn(), "{task.fields[ticks]}") as progress:
        task = progress.add_task("recordings", total=len(files), ticks="")
        read = 0

        def tell(more: int) -> None:
            nonlocal read
            read += more
            progress.update(task, ticks=f"{read} ticks")

        for file in files:
            reports.append(check_file(file, verify, tell))
            progress.advance(task)
    repeats = repeats_among(file for file in files if file.suffix == ".mcap")
    reports = [with_conflicts(report, repeats.conflicts) for report in reports]
    took = time.perf_counter() - began
    if as_json:
        typer.echo(json.dumps(as_data(reports, took, repeats)))
    else:
        for report in reports:
            console.print(in_words(report, whole=len(files) == 1), soft_wrap=True)
        console.print(in_total(reports, took), soft_wrap=True)
    for copy in repeats.copies:
        (screen if as_json else console).print(str(copy), soft_wrap=True, style="yellow")
    raise typer.Exit(EXIT_CODES[max(report.severity for report in reports)])


def recordings_in(paths: Sequence[Path]) -> Iterator[Path]:
    """Yield the files, and the recordings in folders, sorted by name."""
    from netboard.recording.files.locate import files_below

    for path in paths:
        if path.is_dir():
            found = files_below(path, ENDINGS)
            if not found:
                raise NoRecording(f"{path}: no recording in this folder ({', '.join(ENDINGS)})")
            yield from found
        elif path.is_file():
            yield path
        else:
            raise NoRecording(f"{path}: no such file or folder")
