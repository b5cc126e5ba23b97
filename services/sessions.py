"""The catalogue of a folder of recordings, as a table grouped by session or as JSON."""

import json
from collections.abc import Iterable, Sequence
from dataclasses import asdict
from pathlib import Path

from rich.console import Console
from rich.progress import track
from rich.text import Text

from netboard.base.errors import RecordingError
from netboard.base.terminal import Cell, FittedTable, numbers
from netboard.recording.integrity.catalogue import (
    Entry,
    Filter,
    entry_of,
    files_in,
    in_order,
    with_check,
    with_trials,
)
from netboard.recording.integrity.severity import RESULTS, Severity

COLOURS = {RESULTS[Severity.SOUND]: "green", RESULTS[Severity.LOSS]: "yellow", RESULTS[Severity.DAMAGE]: "red"}
"""Colour of each result on a terminal."""


def main(folder: Path, wanted: Filter, *, full: bool = False, as_json: bool = False) -> int:
    """List the recordings of a folder."""
    if not folder.is_dir():
        raise RecordingError(f"{folder}: no such folder")
    console = Console(highlight=False)
    entries = [entry for entry in map(entry_of, files_in(folder)) if wanted.takes(entry)]
    entries = [_completed(entry, full) for entry in _tracked(entries)]
    entries = [entry for entry in entries if wanted.likes(entry)]
    if as_json:
        data = [asdict(entry) | {"path": str(entry.path)} for _, group in in_order(entries) for entry in group]
        console.file.write(json.dumps(data) + "\n")
    elif entries:
        console.print(table_of(entries, folder))
        console.print(in_total(entries), soft_wrap=True)
    else:
        console.print(f"{folder}: no recording that was asked for")
    return 0


def _tracked(entries: Sequence[Entry]) -> Iterable[Entry]:
    """Show the progress on a terminal."""
    console = Console(stderr=True)
    return track(entries, "recordings", console=console, transient=True, disable=not console.is_terminal)


def _completed(entry: Entry, full: bool) -> Entry:
    counted = with_trials(entry)
    return with_check(counted) if full else counted


def table_of(entries: Sequence[Entry], folder: Path) -> FittedTable:
    """Return a table of the files, grouped by session."""
    table = FittedTable(
        "block\ncondition", "file", *numbers("trials", "length\nsize", "lost"), "verdict", title=f"Sessions in {folder}"
    )
    for (dyad, session), group in in_order(entries):
        study = ", ".join(sorted({entry.study for entry in group if entry.study})) or "no study"
        pilot = ", pilot" if any(entry.pilot for entry in group) else ""
        day = min((entry.opened[:10] for entry in group if entry.opened), default="date not known")
        title = f"{dyad} {session}" if dyad else "not known whose"
        table.end_section()
        table.add_row(Text(title, "bold"), f"{day}, {study}{pilot}")
        for entry in group:
            table.add_row(*_row(entry, folder))
    return table


def _row(entry: Entry, folder: Path) -> list[Cell]:
    """Return the row of one file."""
    trials = f"{entry.done} of {entry.trials}" if entry.trials else f"{entry.done}"
    known = entry.kind in ("recording", "journal") and entry.verdict != RESULTS[Severity.DAMAGE]
    return [
        (f"{entry.block} of {entry.blocks}" if entry.blocks else entry.kind) + f"\n{entry.condition}",
        str(entry.path.relative_to(folder)),
        trials if known else "-",
        (f"{entry.duration / 60:.1f} min" if entry.duration is not None else "-") + f"\n{entry.size / 1e6:.1f} MB",
        str(entry.lost),
        Text(entry.verdict, COLOURS[entry.verdict]).append(f"\n{entry.why}" if entry.why else "", "default"),
    ]


def in_total(entries: Sequence[Entry]) -> str:
    """Return a summary of one line."""
    recordings = [entry for entry in entries if entry.kind != "journal"]
    counts = ", ".join(
        f"{count} {verdict}" for verdict in RESULTS if (count := sum(e.verdict == verdict for e in recordings))
    )
    hours, size = sum(e.duration or 0.0 for e in recordings) / 3600, sum(e.size for e in recordings) / 1e9
    sessions = len({(entry.dyad, entry.session) for entry in entries})
    return f"{sessions} sessions, {len(recordings)} files ({counts}), {hours:.2f} h, {size:.2f} GB"
