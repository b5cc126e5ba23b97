"""Imports tables as recordings: given tables one after the other, or those of a manifest, several at a time."""

import sys
import time
from collections import Counter
from collections.abc import Sequence
from pathlib import Path

from rich.console import Console

from netboard.analysis.extraction.workers import cores
from netboard.base.config import Config
from netboard.base.errors import ConfigError
from netboard.recording.importing.study_import import examine, run
from netboard.recording.importing.table_import import Wishes, import_table
from netboard.services.wording import telling


def main(tables: Sequence[Path], folder: Path, config: Config, wishes: Wishes) -> int:
    """Import one table after the other, and print the result of each."""
    console = Console(highlight=False, soft_wrap=True)
    for table in tables:
        with telling() as tell:
            found = import_table(table, folder, config, wishes, time.time_ns(), tell)
        console.print(f"{found.path}: {found.ticks} ticks, {found.what}", markup=False)
        for note in found.notes:
            console.print(f"  {note}", markup=False)
    return 0


def study(manifest: Path, folder: Path, workers: int | None) -> int:
    """Import the study of a manifest."""
    console = Console(highlight=False, soft_wrap=True)
    began = time.perf_counter()
    with telling() as tell:
        plan = examine(manifest, folder, tell)
        done, failed = run(plan, folder, workers or cores(), tell) if plan.jobs else ([], [])
    for found in done:
        console.print(f"{found.path}: {found.ticks} ticks, {found.what}", markup=False)
    for note, count in Counter(note for found in done for note in found.notes).items():
        console.print(f"  {note}" + f" ({count} recordings)" * (count > 1), markup=False)
    total = f"{len(done)} imported, {len(plan.there)} were there, {len(failed)} failed"
    console.print(f"{total}; {time.perf_counter() - began:.1f} s", markup=False)
    for line in failed:
        print(line, file=sys.stderr)  # noqa: T201
    return 1 if failed else 0


def one_way(tables: Sequence[Path] | None, manifest: Path | None, others: Sequence[str]) -> None:
    """Refuse tables beside a manifest, neither of them, and options for which a manifest has keys."""
    if bool(tables) == (manifest is not None):
        raise ConfigError("import: expected either TABLE... or --manifest")
    if manifest is not None and others:
        raise ConfigError(f"--manifest: found with {', '.join(others)}, expected those as keys of {manifest}")
