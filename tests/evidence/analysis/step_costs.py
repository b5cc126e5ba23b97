"""Where the processor time of a first analysis goes: the steps of measuring a recording, and results and figures."""

import cProfile
import pstats
from collections.abc import Callable, Sequence
from itertools import pairwise
from pathlib import Path
from tempfile import TemporaryDirectory
from time import process_time
from typing import Any

from evidence.analysis.costs import tables_of
from netboard.analysis.extraction import recordings as extraction
from netboard.analysis.extraction.controls import controls
from netboard.analysis.extraction.details import movements
from netboard.analysis.extraction.settings import Readings
from netboard.analysis.extraction.trials import BlockData
from netboard.benchmarks.harness.results import ResultPart
from netboard.recording.export.runs import identified, runs_of
from netboard.recording.files.reader import Recording

MOST = 4
"""Most recordings that are profiled, evenly spaced over all of them [1]."""

STEPS: dict[str, tuple[Callable[..., Any], ...]] = {
    "open, read the index": (Recording.__init__,),
    "read ticks, judge attempts": (extraction._read,),
    "attempts, events": (BlockData.of.__func__, identified),  # type: ignore[attr-defined]
    "filter": (vars(BlockData)["whole"].func, vars(BlockData)["forces"].func),
    "measures of attempts (with the filter of forces)": (extraction.attempt_row,),
    "movements of the board": (movements,),
    "controls": (controls,),
}
"""The functions of each step; a step may contain another one where its name says so."""


def steps_part(recordings: Sequence[Path]) -> ResultPart:
    """Profile the measurement of some recordings after a first one, which loads kernels and libraries."""
    runs = runs_of(recordings)
    runs = runs[:: max(1, -(-len(runs) // MOST))]
    extraction.measure(runs[0], Readings())
    start = process_time()
    for run in runs:
        extraction.measure(run, Readings())
    plain = (process_time() - start) / len(runs)
    profile = cProfile.Profile(process_time)
    profile.enable()
    for run in runs:
        extraction.measure(run, Readings())
    profile.disable()
    found: dict[Any, Any] = pstats.Stats(profile).stats  # type: ignore[attr-defined]
    whole = _cumulative(found, extraction.measure)
    part = ResultPart(
        "steps",
        f"Processor time of measuring a recording, without a cache: mean of {len(runs)} recordings",
        "step | ms | share [%]",
    )
    for name, functions in STEPS.items():
        share = sum(_cumulative(found, function) for function in functions) / whole
        part.add(name, 1e3 * plain * share, 100.0 * share)
    part.add("whole recording", 1e3 * plain, 100.0)
    return part


def tasks_part(recordings: Sequence[Path], cache: Path) -> ResultPart:
    """Measure the results and figures of a study with cached tables, task by task."""
    from netboard.analysis.topics.everything import drawn, primary_figure, results_in, study_tasks
    from netboard.analysis.topics.testing import families

    part = ResultPart(
        "tasks",
        "Processor time of results and figures, in one process",
        "task | results [s] | figures, as SVG [s] | PNG, PDF [s]",
    )
    with TemporaryDirectory() as paths:
        study = tables_of(recordings, 1, cache, Path(paths))[1]
        primary_figure(study)  # loads libraries
        for task in study_tasks():
            at = [process_time()]
            for topic in task.topics:
                results_in(study, topic)
            at.append(process_time())
            figures = [drawn(study, draw) for draw in task.draws]
            at.append(process_time())
            for figure in figures:
                figure.written()
            at.append(process_time())
            part.add(task.name, *(after - before for before, after in pairwise(at)))
        start = process_time()
        results_in(study, families)
        part.add("families of tests", process_time() - start, 0.0, 0.0)
    return part


def _cumulative(found: dict[Any, Any], function: Callable[..., Any]) -> float:
    """Return the time in a function and in all that it calls [s]."""
    code = function.__code__
    return float(found.get((code.co_filename, code.co_firstlineno, code.co_name), (0,) * 4)[3])
