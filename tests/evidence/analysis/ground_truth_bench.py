"""``make evidence ARGS=truth``: errors of the measures on synthetic trials with known values."""

from collections.abc import Iterator
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
from numpy.typing import NDArray

from evidence.analysis.ground_truth import Known, block
from netboard.analysis.extraction.recordings import Measured, measure
from netboard.analysis.extraction.settings import Readings
from netboard.analysis.extraction.study import study_of
from netboard.benchmarks.harness.results import Folder, ResultPart
from netboard.benchmarks.harness.running import Tell
from netboard.recording.export.runs import runs_of
from netboard.recording.files.offline_writer import BlockWriter

WHOLE, QUICK = (16, 12), (2, 6)
"""Number of blocks, and of trials in each [1]."""

IMPORTED = {"imported": "measured", "imported_from": "closed form"}

TOLERANCES = {"s": 0.0015, "m": 0.0005, "W": 0.001, "N2 s": 0.01, "1": 0.0}
"""Largest errors that count as exact, by unit; filters attenuate sinusoidal forces and powers [SI]."""

UNITS = {"entries": "1", "peaks": "1", "overshoots": "1", "overshoot": "m", "power": "W", "effort": "N2 s"}
"""Units of the measures other than times, by the last word of their names."""


def study(folder: Folder, tell: Tell, *, quick: bool) -> Iterator[ResultPart]:
    """Write recordings of synthetic trials, measure them as an analysis does, and compare."""
    blocks, trials = QUICK if quick else WHOLE
    known: list[Known] = []
    found: list[Measured] = []
    with TemporaryDirectory() as where:
        for seed in range(blocks):
            tell(f"block {seed + 1} of {blocks}", seed / blocks)
            more, one = measured_block(Path(where), trials, seed)
            known += more
            found.append(one)
    yield table(known, found)


def measured_block(folder: Path, trials: int, seed: int) -> tuple[list[Known], Measured]:
    """Write a block of synthetic trials as a recording, and measure it."""
    known, rows, config = block(trials, seed)
    writer = BlockWriter(folder, config, f"{seed:08x}".ljust(32, "0"), seed * 10**12, IMPORTED, int(rows["time_ns"][0]))
    writer.take(rows)
    writer.finish()
    return known, measure(runs_of([writer.path])[0], Readings())


def table(known: list[Known], found: list[Measured]) -> ResultPart:
    """Tabulate the errors of each measure."""
    counted = sum(len(study_of([one], Readings()).counted) for one in found)
    trials = {
        name: np.concatenate([one.trials[name] for one in found]) for name in (*known[0].values, "completion_source")
    }
    rows = [
        _row(name, np.array([one.values[name] for one in known]), trials[name], UNITS.get(name.rpartition("_")[2], "s"))
        for name in known[0].values
    ]
    clear = np.array([one.clear for one in known])
    peaks = np.array([one.values["peaks"] for one in known])
    rows.append(_row("peaks, none near the completion", peaks[clear], trials["peaks"][clear], "1"))
    rows += _movements(known, found)
    recorded = int((trials["completion_source"] == "recording").sum())
    return ResultPart(
        "truth",
        f"Measures of {len(known)} synthetic trials with known values; {counted} included, {recorded} of them with the "
        "completion time from the recording, because their hold is one sample short",
        "measure | unit | n | exact [%] | bias | largest error",
        rows,
    )


def _row(name: str, truth: NDArray[np.float64], found: NDArray[np.float64], unit: str) -> tuple[str | float, ...]:
    """Compare one measure; a value that only one of both has is an infinite error."""
    both = np.isfinite(truth) & np.isfinite(found)
    errors = np.where(both, found - truth, np.inf)
    errors[np.isnan(truth) & np.isnan(found)] = 0.0
    exact = np.abs(errors) <= TOLERANCES[unit] + 1e-9
    known = errors[np.isfinite(errors)]
    return name, unit, len(truth), 100.0 * float(exact.mean()), float(known.mean()), float(np.abs(known).max())


def _movements(known: list[Known], found: list[Measured]) -> Iterator[tuple[str | float, ...]]:
    """Compare the number, the onsets and the delays of the movements of the board."""
    counts: list[tuple[float, float]] = []
    onsets: list[tuple[float, float]] = []
    delays: list[tuple[float, float]] = []
    place = 0
    for one in found:
        turns = one.movements
        for number in one.trials["trial"]:
            of_trial = turns["trial"] == number
            truth = known[place]
            place += 1
            counts.append((len(truth.turns), int(of_trial.sum())))
            if len(truth.turns) == of_trial.sum():
                onsets += zip(truth.turns, turns["onset"][of_trial], strict=True)
                delays += [(truth.delay, value) for value in turns["own_delay_20"][of_trial]]
    for name, pairs, unit in (
        ("movements of the board", counts, "1"),
        ("onset of a movement", onsets, "s"),
        ("delay at 20 % of own peaks", delays, "s"),
    ):
        truth_, found_ = np.array(pairs, float).T
        yield _row(name, truth_, found_, unit)
