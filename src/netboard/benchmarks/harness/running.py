"""Running a benchmark: it describes the machine, then shows and writes each part as soon as it is computed.

The file is complete after each part, so an interrupted benchmark leaves the parts that it has computed.
"""

import shutil
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from time import perf_counter
from typing import Any, Protocol

from netboard.base.terminal.bars import progress_bars
from netboard.base.terminal.output import plain_console
from netboard.benchmarks.harness.machine import describe
from netboard.benchmarks.harness.results import BenchVerdict, Folder, ResultPart, new_folder, show

Tell = Callable[[str, float], object]
"""Callback for progress: the current step, and the share done [1]."""


def no_progress(text: str, share: float) -> None:
    """Ignore progress."""


Clock = Callable[[], float]
"""`time.perf_counter`, or `time.process_time` for the processor time of all threads, which a busy machine adds less to
[s]."""


def timed(run: Callable[[], object], clock: Clock = perf_counter) -> float:
    """Return the duration of a call [s]."""
    start = clock()
    run()
    return clock() - start


SLICE = 0.004
"""Minimum duration of a turn; a fast solver runs several times in it [s]."""


def in_turns(
    runs: Sequence[Callable[[], object]], repeats: int, budget: float, clock: Clock = perf_counter
) -> list[list[float]]:
    """Time runs, each once before any is timed again."""
    times: list[list[float]] = [[] for _ in runs]
    for turn in range(repeats):
        for one, taken in zip(runs, times, strict=True):
            if turn == 0 or sum(taken) < budget:
                taken.append(timed(one, clock))
                in_slice = taken[-1]
                while in_slice < SLICE:
                    taken.append(timed(one, clock))
                    in_slice += taken[-1]
    return times


WIDTH = 160
"""Minimum width of tables [characters]."""


class BenchStudy(Protocol):
    """A study, which yields its parts one by one and may save files in the folder of its results."""

    def __call__(self, folder: Folder, tell: Tell, *, quick: bool) -> Iterable[ResultPart]:
        """Yield the parts, of the short form if `quick`."""


@dataclass(frozen=True)
class Options:
    """Options of every benchmark.

    - `output`: folder of the results; None for a new one, named after the benchmark.
    - `json`: a file to which the JSON file of the results is copied.
    """

    output: Path | None = None
    json: Path | None = None
    quick: bool = False
    force: bool = False

    def folder(self, name: str) -> Folder:
        """Return the folder of the results of a benchmark."""
        return Folder(self.output or new_folder(f"bench-{name}"), force=self.force)


def run(
    name: str,
    study: BenchStudy,
    options: Options,
    settings: Mapping[str, Any] | None = None,
    *,
    lines: Iterable[str] = (),
    bar: bool = True,
) -> list[BenchVerdict]:
    """Run a study: describe the machine, show and write each part, and copy the JSON file.

    Return every checked claim: one that fails is a result, not an error.

    - `settings`: how it was run, for the head of the results.
    - `lines`: further lines below the description of the machine.
    - `bar`: show progress as a bar; else as lines, for studies that measure in this process, which redrawing would
      disturb.
    """
    folder = options.folder(name)
    console = plain_console()
    console.width = max(console.width, WIDTH)
    for line in (*describe().lines(), *lines):
        console.print(line)
    parts: list[ResultPart] = []
    with progress_bars(plain_console(stderr=True), shown=bar) as progress:
        task = progress.add_task("starting", total=1.0)

        def tell(text: str, share: float) -> None:
            if bar:
                progress.update(task, description=text, completed=share)
            else:
                console.print(text)

        for part in study(folder, tell, quick=options.quick):
            parts.append(part)
            if part.on_screen:
                show(console, part)
            folder.write(parts, {"study": name, "quick": options.quick, **(settings or {})})
    if options.json is not None:
        shutil.copyfile(folder.path / "results.json", options.json)
    verdicts = [verdict for part in parts for verdict in part.verdicts]
    console.print(f"{sum(one.holds for one in verdicts)} of {len(verdicts)} verdicts hold; results in {folder.path}")
    return verdicts
