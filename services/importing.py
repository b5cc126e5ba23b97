"""Makes recordings of tables."""

import time
from collections.abc import Sequence
from pathlib import Path

from rich.console import Console

from netboard.config import Config
from netboard.foreign.importing import Wishes, import_table
from netboard.services.wording import telling


def main(tables: Sequence[Path], folder: Path, config: Config, wishes: Wishes) -> int:
    """Import one table after the other, and say what came of each.

    Parameters
    ----------
    tables : sequence of Path
        The files.
    folder : Path
        Where the recordings go.
    config : Config
        The experiment that they are of.
    wishes : Wishes
        How.

    Returns
    -------
    int
        Exit code.
    """
    console = Console(highlight=False, soft_wrap=True)
    for table in tables:
        with telling() as tell:
            found = import_table(table, folder, config, wishes, time.time_ns(), tell)
        console.print(f"{found.path}: {found.ticks} ticks, {found.what}", markup=False)
        for note in found.notes:
            console.print(f"  {note}", markup=False)
    return 0
