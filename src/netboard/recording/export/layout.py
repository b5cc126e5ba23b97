"""File layout of tabular exports: one file of ticks per recording, and one file per short table over all recordings.

The data dictionary lies beside them, and the configuration of each recording in ``configurations``.
"""

from collections.abc import Callable, Iterator, Sequence
from contextlib import AbstractContextManager, ExitStack
from pathlib import Path

from netboard.recording.export.dictionary import write_dictionary
from netboard.recording.export.formats import Progress
from netboard.recording.export.tables import TICKS, Rows, Subject, Table, small_tables
from netboard.recording.files.reader import Recording

Sheet = Callable[[Rows], None]
"""Callback that writes the next rows of a table."""

OpenSheet = Callable[[Path, Table], AbstractContextManager[Sheet]]
"""Function that opens a new file for a table."""


def subjects(recordings: Sequence[Path], folder: Path) -> Iterator[Subject]:
    """Open the recordings one by one and write their configurations.

    Parameters
    ----------
    folder : Path
        Folder of the export; configurations go to its subfolder ``configurations``.
    """
    texts = folder / "configurations"
    texts.mkdir()
    for path in recordings:
        with Recording(path) as recording:
            subject = Subject(recording)
            (texts / f"{subject.name}.toml").write_text(recording.config_text, encoding="utf-8")
            yield subject


def tick_portions(subject: Subject, progress: Progress) -> Iterator[Rows]:
    """Yield the ticks of a recording in batches and report progress."""
    done = 0
    progress(subject.name, done, subject.ticks)
    for rows in TICKS.portions(subject):
        yield rows
        done += len(rows["tick"])
        progress(subject.name, done, subject.ticks)


def write_sheets(
    recordings: Sequence[Path], folder: Path, progress: Progress, open_sheet: OpenSheet, ending: str
) -> None:
    """Write all tables of the recordings."""
    places = f"ticks/RECORDING{ending}: the ticks of each recording; NAME{ending}: another table, of all recordings"
    tables = small_tables(recordings)
    write_dictionary(folder, (TICKS, *tables), places)
    (folder / "ticks").mkdir()
    with ExitStack() as stack:
        small = {table: stack.enter_context(open_sheet(folder / f"{table.name}{ending}", table)) for table in tables}
        for subject in subjects(recordings, folder):
            with open_sheet(folder / "ticks" / f"{subject.name}{ending}", TICKS) as put:
                for rows in tick_portions(subject, progress):
                    put(rows)
            for table, put in small.items():
                for rows in table.portions(subject):
                    put(rows)
