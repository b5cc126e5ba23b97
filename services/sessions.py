"""``netboard sessions``: the catalogue of a folder of recordings, grouped by session."""

import json
from collections.abc import Sequence
from dataclasses import asdict
from datetime import datetime
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from netboard.base.errors import RecordingError
from netboard.services.options import RECORDINGS, examples, load

if TYPE_CHECKING:
    from netboard.base.terminal import Cell, FittedTable
    from netboard.recording.integrity.catalogue import Entry

app = typer.Typer()


@app.command(
    rich_help_panel=RECORDINGS,
    epilog=examples(
        "netboard sessions",
        "netboard sessions recordings/ --dyad D03 --no-pilot",
        "netboard sessions --study paper --since 2026-01-31 --check --verdict damaged",
    ),
)
def sessions(
    folder: Annotated[
        Path | None, typer.Argument(metavar="[DIR]", help="Folder; default: the one of the configuration.")
    ] = None,
    dyad: Annotated[str | None, typer.Option(help="Only this dyad, for example D03.")] = None,
    study: Annotated[str | None, typer.Option(help="Only this study.")] = None,
    since: Annotated[datetime | None, typer.Option(formats=["%Y-%m-%d"], help="Only from this day (UTC) on.")] = None,
    verdict: Annotated[
        str | None, typer.Option(help="Only this result: complete, 'complete with listed losses' or damaged.")
    ] = None,
    pilot: Annotated[bool | None, typer.Option("--pilot/--no-pilot", help="Only pilot runs, or only real.")] = None,
    full: Annotated[
        bool, typer.Option("--check", help="Run the full integrity check on each file (netboard check).")
    ] = False,
    as_json: Annotated[bool, typer.Option("--json", help="Print one JSON array.")] = False,
) -> None:
    """List the recordings in a folder: participants, trials, losses, and the result of the integrity check."""
    from rich.console import Console

    from netboard.base.bars import progress_bars
    from netboard.recording.integrity import catalogue

    place = Path(load(None).recording.directory) if folder is None else folder
    if not place.is_dir():
        raise RecordingError(f"{place}: no such folder")
    wanted = catalogue.Filter(dyad, study, verdict, None if since is None else since.date(), pilot)
    found = [entry for entry in map(catalogue.entry_of, catalogue.files_in(place)) if wanted.takes(entry)]
    entries = []
    with progress_bars(Console(stderr=True)) as progress:
        for entry in progress.track(found, description="recordings"):
            counted = catalogue.with_trials(entry)
            entries.append(catalogue.with_check(counted) if full else counted)
    entries = [entry for entry in entries if wanted.likes(entry)]
    console = Console(highlight=False)
    if as_json:
        groups = catalogue.in_order(entries)
        typer.echo(json.dumps([asdict(entry) | {"path": str(entry.path)} for _, group in groups for entry in group]))
    elif entries:
        console.print(table_of(entries, place))
        console.print(in_total(entries), soft_wrap=True)
    else:
        console.print(f"{place}: no matching recording")


def table_of(entries: Sequence["Entry"], folder: Path) -> "FittedTable":
    """Return a table of the files, grouped by session."""
    from rich.text import Text

    from netboard.base.terminal import FittedTable, numbers
    from netboard.recording.integrity.catalogue import in_order

    table = FittedTable(
        "block\ncondition", "file", *numbers("trials", "length\nsize", "lost"), "verdict", title=f"Sessions in {folder}"
    )
    for (dyad, session), group in in_order(entries):
        study = ", ".join(sorted({entry.study for entry in group if entry.study})) or "no study"
        pilot = ", pilot" if any(entry.pilot for entry in group) else ""
        day = min((entry.opened[:10] for entry in group if entry.opened), default="date unknown")
        table.end_section()
        table.add_row(Text(f"{dyad} {session}" if dyad else "unknown dyad", "bold"), f"{day}, {study}{pilot}")
        for entry in group:
            table.add_row(*_row(entry, folder))
    return table


def _row(entry: "Entry", folder: Path) -> list["Cell"]:
    """Return the row of one file."""
    from rich.text import Text

    from netboard.recording.integrity.report_text import COLOURS
    from netboard.recording.integrity.severity import RESULTS, Severity

    trials = f"{entry.done} of {entry.trials}" if entry.trials else f"{entry.done}"
    known = entry.kind in ("recording", "journal") and entry.verdict != RESULTS[Severity.DAMAGE]
    colour = COLOURS[Severity(RESULTS.index(entry.verdict))]
    return [
        (f"{entry.block} of {entry.blocks}" if entry.blocks else entry.kind) + f"\n{entry.condition}",
        str(entry.path.relative_to(folder)),
        trials if known else "-",
        (f"{entry.duration / 60:.1f} min" if entry.duration is not None else "-") + f"\n{entry.size / 1e6:.1f} MB",
        str(entry.lost),
        Text(entry.verdict, colour).append(f"\n{entry.why}" if entry.why else "", "default"),
    ]


def in_total(entries: Sequence["Entry"]) -> str:
    """Return a summary of one line."""
    from netboard.recording.integrity.severity import RESULTS

    recordings = [entry for entry in entries if entry.kind != "journal"]
    counts = ", ".join(
        f"{count} {verdict}" for verdict in RESULTS if (count := sum(e.verdict == verdict for e in recordings))
    )
    hours, size = sum(e.duration or 0.0 for e in recordings) / 3600, sum(e.size for e in recordings) / 1e9
    sessions = len({(entry.dyad, entry.session) for entry in entries})
    return f"{sessions} sessions, {len(recordings)} files ({counts}), {hours:.2f} h, {size:.2f} GB"
