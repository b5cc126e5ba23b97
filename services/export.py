"""``netboard export``: recordings in the formats of other tools."""

from pathlib import Path
from typing import Annotated

import typer

from netboard.base.plural import plural
from netboard.recording.export.formats import names
from netboard.services.options import NewFolder, Recordings, examples

app = typer.Typer()


@app.command(epilog=examples("netboard export S01.mcap --to csv", "netboard export recordings/ --to parquet -o study"))
def export(
    recordings: Recordings,
    to: Annotated[str, typer.Option(metavar="FORMAT", help=f"One of {', '.join(names())}.")],
    output: NewFolder = None,
) -> None:
    """Export recordings to the formats of other tools."""
    from netboard.base.process.stopping import interrupted_by_stop_signals
    from netboard.base.terminal.bars import telling
    from netboard.recording.export import formats
    from netboard.recording.files.copies import each_recording_once
    from netboard.recording.files.locate import UNFINISHED, find_recordings, find_unfinished

    found, copies = each_recording_once(find_recordings(recordings))
    folder = output or Path(f"{recordings[0].resolve().stem}_{to}")
    with interrupted_by_stop_signals(), telling() as tell:
        formats.export(found, to, folder, tell)
    files = [path for path in folder.rglob("*") if path.is_file()]
    size = sum(path.stat().st_size for path in files) / 1e6
    typer.echo(f"{folder}: {plural(len(files), 'file')} of {plural(len(found), 'recording')}, {size:.1f} MB")
    for copy in copies:
        typer.echo(f"left out: {copy}", err=True)
    for part in find_unfinished(recordings):
        typer.echo(f"left out: {part} {UNFINISHED}", err=True)
