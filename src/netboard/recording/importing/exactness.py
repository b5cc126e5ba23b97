"""Whether a table of ticks is that of a recording, to the bit: its ticks are computed again while they are read.

Another program that saved the table may have rounded its numbers or left rows out. A number that differs is said with
its place in the table, and the recording says so, too: it is imported, but not bit-exact.
"""

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from netboard.base.config import Config
from netboard.base.plural import plural
from netboard.recording.format.channels import NOT_EXACT
from netboard.recording.importing.tables import UNSAVED, Portion, read_ticks
from netboard.recording.integrity.verification import Verifier
from netboard.stage.stage import make_stage


class ExaminedTicks:
    """The ticks of an exported table, and what differs from a recording's.

    ``config``: configuration of the ticks, which ``source`` names; None if another program measured them, so that no
    stage can compute them again.
    """

    def __init__(self, path: Path, config: Config | None, source: str) -> None:
        self.path = path
        self._source = source
        self._verifier = None if config is None else Verifier(make_stage(config))
        self._difference: dict[str, str] = {}
        self._gaps: list[str] = []
        self._newest = -1
        self.count = 0

    def pieces(self) -> Iterator[NDArray[Any]]:
        """Yield the ticks in batches."""
        for rows, portion in read_ticks(self.path):
            self._note_gaps(rows["tick"], portion)
            if self._verifier is not None and not self._difference and not self._verifier.take(rows):
                self._note_difference(rows, portion)
            self.count += len(rows)
            yield rows

    def _note_gaps(self, ticks: NDArray[np.int64], portion: Portion) -> None:
        before = np.concatenate([[self._newest if self._newest >= 0 else ticks[0] - 1], ticks[:-1]])
        for place in np.flatnonzero(ticks - before > 1).tolist():
            self._gaps.append(f"{portion.at(place)}: tick {ticks[place]} follows {before[place]}")
        self._newest = int(ticks[-1])

    def _note_difference(self, rows: NDArray[Any], portion: Portion) -> None:
        assert self._verifier is not None
        found = self._verifier.result
        assert found.tick is not None
        place = int(np.searchsorted(rows["tick"], found.tick))
        self._difference = {
            "where": f"{portion.at(place)}, column {found.field}",
            "found": str(portion.cells[found.field][place]),
            "expected": repr(found.computed),
        }

    def remarks(self) -> Iterator[tuple[str, dict[str, str]]]:
        """Yield the log messages for the recording, after the last batch."""
        if self._difference:
            yield NOT_EXACT, self._difference

    def notes(self) -> Iterator[str]:
        """Yield what the user must know, after the last batch."""
        if self._difference:
            where, found, expected = self._difference.values()
            yield (
                f'not bit-exact: {where}: found "{found}", expected {expected}, as computed from the inputs in the '
                f"table and {self._source}; {UNSAVED}"
            )
        if self._gaps:
            yield (
                f"{plural(len(self._gaps), 'gap')} between ticks, the first at {self._gaps[0]}: the recording lost "
                "ticks there, or the table lost rows"
            )
