"""How tables lie in an export: a file of ticks for each recording, one of each short table over all of them.

Beside them are the data dictionary, and in ``configurations`` the configuration of each recording.
"""

from collections.abc import Callable, Iterator, Sequence
from contextlib import AbstractContextManager, ExitStack
from pathlib import Path

from netboard.recording.export.dictionary import write_dictionary
from netboard.recording.export.formats import Progress
from netboard.recording.export.tables import TICKS, Rows, Subject, Table, small_tables
from netboard.recording.files.reader import Recording

Sheet = Callable[[Rows], None]
"""Takes the next rows of a table that is being written."""

OpenSheet = Callable[[Path, Table], AbstractContextManager[Sheet]]
"""Begins a new file with a table in it."""


def subjects(recordings: Sequence[Path], folder: Path) -> Iterator[Subject]:
    """Open one recording after the other, and write its configuration.

    Parameters
    ----------
    folder : Path
        Where the export is written; configurations go to ``configurations`` in it.
    """
    texts = folder / "configurations"
    texts.mkdir()
    for path in recordings:
        with Recording(path) as recording:
            subject = Subject(recording)
            (texts / f"{subject.name}.toml").write_text(recording.config_text, encoding="utf-8")
            yield subject


def tick_portions(subject: Subject, progress: Progress) -> Iterator[Rows]:
    """Yield the rows of the ticks of a recording, and tell how far it is."""
    done = 0
    progress(subject.name, done, subject.ticks)
    for rows in TICKS.portions(subject):
        yield rows
        done += len(rows["tick"])
        progress(subject.name, done, subject.ticks)


def write_sheets(
    recordings: Sequence[Path], folder: Path, progress: Progress, open_sheet: OpenSheet, ending: str
) -> None:
    """Write all tables of recordings."""
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
