"""``netboard info``: summary of a recording."""

import typer

from netboard.services.options import RecordingFile, examples

app = typer.Typer()


@app.command(epilog=examples("netboard info recordings/S01.mcap"))
def info(recording: RecordingFile) -> None:
    """Summarise a recording: provenance, trials, completion times, latencies, losses."""
    from netboard.base.terminal.output import plain_console
    from netboard.recording.files.reader import Recording
    from netboard.recording.integrity.quality_check import judged
    from netboard.recording.replay.text import (
        account_table,
        provenance_table,
        quality_table,
        summary_of,
        summary_tables,
    )

    console = plain_console()
    with Recording(recording) as opened:
        console.print(provenance_table(opened))
        verdicts = judged(opened)
        console.print(summary_tables(summary_of(opened), opened, verdicts))
        console.print(quality_table(verdicts))
    console.print(account_table(recording))
