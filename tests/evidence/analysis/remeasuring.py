"""Measurement of a recording with several settings and with added disturbances; its file is read only once.

Filtered signals, movements of the board and quality flags are computed again only if a setting affects them. With the
default settings the tables equal those of the analysis bit for bit.
"""

import zlib
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import as_completed
from dataclasses import dataclass, replace

import numpy as np

from evidence.analysis.disturbances import Disturbance
from evidence.analysis.filter_forms import Form, compare_forms
from netboard.analysis.extraction.attempts import MODERN, PAPER
from netboard.analysis.extraction.details import MOVEMENTS, THRESHOLDS, movements
from netboard.analysis.extraction.recordings import Measured, measure
from netboard.analysis.extraction.settings import Readings, measured_with
from netboard.analysis.extraction.tables import PLACE, Columns, Group, columns_of
from netboard.analysis.extraction.trials import AttemptData, BlockData
from netboard.analysis.topics.groups import CLASSES
from netboard.base.config import SIDES
from netboard.benchmarks.harness.processes import fresh_processes
from netboard.recording.export.runs import Run
from netboard.recording.files.reader import Recording

_SMOOTHNESS = tuple(group for group in MODERN if "sparc" in {field.name for field in group.fields})
_PLACES = {field.name for field in PLACE}
_DELAY_FIELDS = tuple(
    field
    for field in MOVEMENTS
    if field.name in _PLACES or field.name == "cooperative" or "delay" in field.name or "truncated" in field.name
)
"""Columns of movements from which the delays of a study are estimated."""


@dataclass(frozen=True, slots=True)
class Request:
    """The measurements that are wanted of one recording.

    - `base`: the default settings.
    - `others`: further settings.
    - `disturbances`, `disturbed_by`: disturbances, and the settings for each.
    """

    run: Run
    base: Readings
    others: tuple[Readings, ...] = ()
    disturbances: tuple[Disturbance, ...] = ()
    disturbed_by: tuple[Readings, ...] = ()


@dataclass(frozen=True, slots=True)
class Remeasured:
    """The measurements of one recording.

    - `others`: with each of the further settings.
    - `undisturbed`, `disturbed`: values of each attempt without and with each disturbance [SI].
    """

    base: Measured
    others: dict[Readings, Measured]
    undisturbed: tuple[Columns, ...]
    disturbed: tuple[Columns, ...]
    forms: tuple[Form, ...]


def read_block(run: Run, readings: Readings) -> BlockData:
    """Read a recording with all columns that any setting needs."""
    everything = replace(readings, filters=replace(readings.filters, velocity="device"))
    with Recording(run.path) as recording:
        return BlockData.of(recording, run.config, everything).again(readings)


def update_measures(base: Measured, takes: Sequence[AttemptData], groups: tuple[Group, ...] = PAPER) -> Measured:
    """Replace the paper's measures by those of other takes, and copy all else from `base`."""
    fields = tuple(field for group in groups for field in group.fields)
    rows = [{name: value for group in groups for name, value in group.of(take).items()} for take in takes]
    moves = movements(base.blocks["recording"][0], takes)
    delays = {field.name: moves[field.name] for field in _DELAY_FIELDS}
    return replace(base, trials=base.trials | columns_of(fields, rows), movements=delays)


def attempt_values(measured: Measured) -> Columns:
    """Reduce measurements to one value per attempt."""
    trials, moves = measured.trials, measured.movements
    names = ("completion", "peaks", "braking_distance", "braking_velocity", "sparc", "ldlj")
    found: Columns = {name: trials[name].astype(np.float64) for name in names}
    time = np.sum([trials[name] for name in CLASSES], axis=0)
    for name in CLASSES:
        found[name] = np.divide(trials[name], time, out=np.full(len(time), np.nan), where=time > 0)
    rows = {place: row for row, place in enumerate(zip(trials["trial"], trials["attempt"], strict=True))}
    row_of = np.array([rows[place] for place in zip(moves["trial"], moves["attempt"], strict=True)], np.int64)
    for percent in THRESHOLDS:
        delay = np.abs(moves[f"delay_{percent}"])
        known = np.isfinite(delay)
        sums = np.bincount(row_of[known], delay[known], len(time))
        counts = np.bincount(row_of[known], minlength=len(time))
        found[f"delay_{percent}"] = np.divide(sums, counts, out=np.full(len(time), np.nan), where=counts > 0)
    found["movements"] = np.bincount(row_of, minlength=len(time)).astype(np.float64)
    return found


def remeasure(request: Request) -> Remeasured:
    """Measure one recording."""
    whole = measure(request.run, request.base)
    base = replace(whole, paths={name: values[:0].copy() for name, values in whole.paths.items()})
    block = read_block(request.run, request.base)
    others: dict[Readings, Measured] = {}
    seen = block
    # Those with equal filters one after the other, because they share the filtered signals.
    for readings in sorted(request.others, key=lambda one: (one.filters != request.base.filters, repr(one))):
        if measured_with(readings) == measured_with(request.base):
            others[readings] = base
        else:
            seen = seen.again(readings)
            others[readings] = update_measures(base, list(seen.takes()))
    undisturbed, disturbed = _disturbed(request, base, block)
    forms = compare_forms(block.raw("p"), block.placed) if request.disturbances else ()
    return Remeasured(base, others, undisturbed, disturbed, forms)


def _disturbed(request: Request, base: Measured, block: BlockData) -> tuple[tuple[Columns, ...], tuple[Columns, ...]]:
    groups = (*PAPER, *_SMOOTHNESS)
    references: dict[Readings, tuple[BlockData, list[AttemptData], Columns]] = {}
    undisturbed, disturbed = [], []
    for number, (disturbance, readings) in enumerate(zip(request.disturbances, request.disturbed_by, strict=True)):
        if readings not in references:
            seen = block.again(readings)
            takes = list(seen.takes())
            references[readings] = seen, takes, attempt_values(update_measures(base, takes, groups))
        seen, takes, values = references[readings]
        generator = np.random.default_rng([zlib.crc32(request.run.path.stem.encode()), number])
        changed = seen.again(readings, **disturbance.change(disturbable_columns(seen), generator))
        # In the window of the undisturbed attempt: a disturbed completion time must not change other values.
        pairs = zip(changed.takes(), takes, strict=True)
        windowed = [replace(take, trial=reference.trial) for take, reference in pairs]
        undisturbed.append(values)
        disturbed.append(attempt_values(update_measures(base, windowed, groups)))
    return tuple(undisturbed), tuple(disturbed)


def disturbable_columns(block: BlockData) -> Columns:
    """Return the recorded columns that a disturbance may change."""
    names = ("theta", "p", *(f"{side}_used_{what}" for side in SIDES for what in ("z", "vz")))
    return {name: block.raw(name) for name in names}


def remeasure_all(requests: Sequence[Request], workers: int, progress: Callable[[int], object]) -> Iterator[Remeasured]:
    """Measure recordings in parallel; `progress` is called with the number of finished ones."""
    if workers == 1:
        for done, request in enumerate(requests, start=1):
            yield remeasure(request)
            progress(done)
        return
    with fresh_processes(workers) as pool:
        answers = [pool.submit(remeasure, request) for request in requests]
        for done, _ in enumerate(as_completed(answers), start=1):
            progress(done)
        yield from (answer.result() for answer in answers)
