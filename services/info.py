"""What is in a recording, for people: where it comes from, trials, completion times, latencies, losses."""

from pathlib import Path

from rich.console import Console
from rich.table import Table

from netboard.config import parse
from netboard.recording.reader import Recording
from netboard.report.tables import summary_of, summary_tables


def main(path: Path) -> int:
    """Print what a recording amounts to.

    Parameters
    ----------
    path : Path
        The recording.

    Returns
    -------
    int
        Exit code.
    """
    console = Console(highlight=False)
    with Recording(path) as recording:
        console.print(provenance_table(recording))
        console.print(summary_tables(summary_of(recording)))
    return 0


def provenance_table(recording: Recording) -> Table:
    """Say where a recording comes from.

    Parameters
    ----------
    recording : Recording
        The recording.

    Returns
    -------
    Table
        For printing.
    """
    block = parse(recording.config_text, f"{recording.path} (its configuration)").block
    said = recording.metadata
    rows = {
        "file": f"{recording.path} ({recording.path.stat().st_size / 1e6:.1f} MB)",
        "session": f"{said.get('name', '?')}, dyad {said.get('dyad', '?')}, run {said.get('session', '?')}",
        "pilot": said.get("pilot", "?"),
        "recorded": said.get("opened_utc", "?"),
        "block": f"{block.configuration}, haptics {'on' if block.haptics else 'off'}, {block.trials} trials",
        "ended": recording.end.get("ended", "not known: the file was recovered"),
        "written by": f"netboard {said.get('netboard', '?')}, {said.get('python', '?')}, {said.get('platform', '?')}",
        "doctor": said.get("doctor", "?"),
        "configuration": said.get("config_sha256", "?"),
    }
    table = Table(title="Recording", title_justify="left", show_header=False)
    for name, value in rows.items():
        table.add_row(name, value)
    return table
