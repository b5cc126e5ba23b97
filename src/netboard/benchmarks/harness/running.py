"""Running a benchmark: it describes the machine, then shows and writes each part as soon as it is computed.

The file is complete after each part, so an interrupted benchmark leaves the parts that it has computed.
"""

import shutil
from collections.abc import Callable, Iterable, Mapping
from pathlib import Path
from typing import Any, Protocol

from rich.console import Console

from netboard.base.bars import progress_bars
from netboard.benchmarks.harness.machine import describe
from netboard.benchmarks.harness.results import Folder, Part, Verdict, new_folder, show

Tell = Callable[[str, float], object]
"""Callback for progress: the current step, and the share done [1]."""

WIDTH = 160
"""Minimum width of tables [characters]."""


class Study(Protocol):
    """A study, which yields its parts one by one and may save files in the folder of its results."""

    def __call__(self, folder: Folder, tell: Tell, *, quick: bool) -> Iterable[Part]:
        """Yield the parts, of the short form if `quick`."""


def run_named(
    name: str, study: Study, output: Path | None, json: Path | None, *, quick: bool, force: bool
) -> list[Verdict]:
    """Run a study as a command does; return every checked claim: one that fails is a result, not an error."""
    folder = Folder(output or new_folder(f"bench-{name}"), force=force)
    return run(folder, {"study": name, "quick": quick}, lambda tell: study(folder, tell, quick=quick), json)


def run(
    folder: Folder,
    settings: Mapping[str, Any],
    study: Callable[[Tell], Iterable[Part]],
    json: Path | None = None,
    *,
    lines: Iterable[str] = (),
    bar: bool = True,
) -> list[Verdict]:
    """Run a study: describe the machine, show and write each part, copy the JSON file, and return the claims.

    - `settings`: head of the results: ``study``, its name, and how it was run; it is read again for each part.
    - `lines`: further lines below the description of the machine.
    - `bar`: show progress as a bar; else as lines, for studies that measure in this process, which redrawing would
      disturb.
    """
    console = Console(highlight=False, markup=False)
    console.width = max(console.width, WIDTH)
    for line in (*describe().lines(), *lines):
        console.print(line)
    parts: list[Part] = []
    with progress_bars(Console(stderr=True), shown=bar) as progress:
        task = progress.add_task("getting ready", total=1.0)

        def tell(text: str, share: float) -> None:
            if bar:
                progress.update(task, description=text, completed=share)
            else:
                console.print(text)

        for part in study(tell):
            parts.append(part)
            if part.on_screen:
                show(console, part)
            folder.write(parts, settings)
    if json is not None:
        shutil.copyfile(folder.path / "results.json", json)
    verdicts = [verdict for part in parts for verdict in part.verdicts]
    console.print(f"{sum(one.holds for one in verdicts)} of {len(verdicts)} verdicts hold; results in {folder.path}")
    return verdicts
