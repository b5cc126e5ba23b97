"""``netboard sessions``: the catalogue of a folder of recordings, grouped by session."""

import json
from dataclasses import asdict
from datetime import datetime
from pathlib import Path
from typing import Annotated

import typer

from netboard.base.errors import NoRecording
from netboard.services.loading import load
from netboard.services.options import examples

app = typer.Typer()


@app.command(
    epilog=examples(
        "netboard sessions",
        "netboard sessions recordings/ --dyad D03 --no-pilot",
        "netboard sessions --study paper --since 2026-01-31 --check --verdict damaged",
    )
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
    pilot: Annotated[bool | None, typer.Option("--pilot/--no-pilot", help="Only pilots, or only real runs.")] = None,
    full: Annotated[
        bool, typer.Option("--check", help="Run the full integrity check on each file (netboard check).")
    ] = False,
    as_json: Annotated[bool, typer.Option("--json", help="Print one JSON array.")] = False,
) -> None:
    """List the recordings in a folder: participants, trials, losses, and the result of the integrity check."""
    from netboard.base.terminal.bars import progress_bars
    from netboard.base.terminal.errors import harmless
    from netboard.base.terminal.output import plain_console
    from netboard.recording.files.copies import repeats_among
    from netboard.recording.integrity import catalogue
    from netboard.recording.integrity.report_text import QUICK, sessions_in_total, sessions_table

    place = Path(load(None).recording.directory) if folder is None else folder
    if not place.is_dir():
        raise NoRecording(f"{place}: no such folder")
    wanted = catalogue.Filter(dyad, study, verdict, None if since is None else since.date(), pilot)
    files = catalogue.files_in(place)
    everything = [catalogue.entry_of(file) for file in files]
    repeats = repeats_among(entry.path for entry in everything if entry.kind == "recording")
    found = [entry for entry in everything if wanted.matches(entry)]
    entries = []
    screen = plain_console(stderr=True)
    with progress_bars(screen) as progress:
        for entry in progress.track(found, description="recordings"):
            counted = catalogue.with_trials(entry)
            entries.append(catalogue.with_check(counted) if full else counted)
    entries = [entry for entry in catalogue.with_repeats(entries, repeats) if wanted.matches_result(entry)]
    console = plain_console()
    if as_json:
        groups = catalogue.in_order(entries)
        own = {"quick": not full}  # results
        data = [asdict(entry) | own | {"path": str(entry.path)} for _, group in groups for entry in group]
        typer.echo(json.dumps(data))
    elif entries:
        console.print(sessions_table(entries, place, "" if full else QUICK))
        console.print(sessions_in_total(entries), soft_wrap=True)
    else:
        console.print(f"{place}: no {'matching ' if files else ''}recording", soft_wrap=True)
    for repeat in (*repeats.copies, *repeats.conflicts):
        (screen if as_json else console).print(harmless(str(repeat)), soft_wrap=True, style="yellow")
