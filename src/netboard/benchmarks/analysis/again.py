"""Recordings measured many times over: by other readings, or disturbed, each read from its file only once.

What a reading does not touch is not computed again: filters, movements of the board, marks of quality. With the base's
own readings the tables are the same as the base's, bit for bit.
"""

import zlib
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor, as_completed
from dataclasses import dataclass, replace
from multiprocessing import get_context

import numpy as np
from numpy.typing import NDArray
from scipy.signal import butter, filtfilt, sosfiltfilt

from netboard.analysis.extraction.details import MOVEMENTS, movements
from netboard.analysis.extraction.modern import MODERN
from netboard.analysis.extraction.paper import PAPER
from netboard.analysis.extraction.recordings import Measured, measure
from netboard.analysis.extraction.settings import Readings, measured_with
from netboard.analysis.extraction.tables import PLACE, Columns, Group, columns_of
from netboard.analysis.extraction.trials import RATE, Block, Take
from netboard.analysis.topics.delay import PERCENT
from netboard.analysis.topics.groups import CLASSES
from netboard.base.config import SIDES
from netboard.benchmarks.analysis.disturbances import Disturbance
from netboard.recording.export.runs import Run
from netboard.recording.files.reader import Recording

_SMOOTHNESS = tuple(group for group in MODERN if "sparc" in {field.name for field in group.fields})
_PLACES = {field.name for field in PLACE}
_NEEDED = tuple(
    field
    for field in MOVEMENTS
    if field.name in _PLACES or field.name == "cooperative" or "delay" in field.name or "truncated" in field.name
)
"""Columns of movements from which a study's delays are estimated."""


ORDERS = (2, 5, 10)
"""Filter orders of one pass [1]."""

CUTOFFS = (5.0, 20.0)
"""The paper's [Hz]."""


@dataclass(frozen=True, slots=True)
class Form:
    """A filter as a fraction of two polynomials.

    - `cutoff`: its cutoff [Hz].
    - `radius`: magnitude of its largest pole, as the polynomial has it: unstable above 1 [1].
    - `gain`: what it makes of a constant: 1 if it is right [1].
    - `error`: largest difference from the sections, on what was given [as given].
    """

    order: int
    cutoff: float
    radius: float
    gain: float
    error: float


@dataclass(frozen=True, slots=True)
class Wish:
    """The measurements wanted of one recording."""

    run: Run
    base: Readings
    others: tuple[Readings, ...] = ()
    disturbances: tuple[Disturbance, ...] = ()
    disturbed_by: tuple[Readings, ...] = ()


@dataclass(frozen=True, slots=True)
class Fulfilled:
    """A recording, measured.

    - `calm`, `disturbed`: measures of each attempt without and with each disturbance [SI].
    """

    base: Measured
    others: tuple[Measured, ...]
    calm: tuple[Columns, ...]
    disturbed: tuple[Columns, ...]
    forms: tuple[Form, ...]


def opened(run: Run, readings: Readings) -> Block:
    """Read a recording with everything that a reading may need."""
    everything = replace(readings, filters=replace(readings.filters, velocity="device"))
    with Recording(run.path) as recording:
        return Block.of(recording, run.config, everything).again(readings)


def again(base: Measured, takes: Sequence[Take], groups: tuple[Group, ...] = PAPER) -> Measured:
    """Measure the paper's measures again; take everything else from the base."""
    fields = tuple(field for group in groups for field in group.fields)
    rows = [{name: value for group in groups for name, value in group.measure(take).items()} for take in takes]
    turns = [
        {"recording": name, "trial": take.attempt.trial, "attempt": take.attempt.attempt} | dict(row)
        for name, take in zip(base.trials["recording"], takes, strict=True)
        for row in movements(take)
    ]
    return replace(base, trials=base.trials | columns_of(fields, rows), movements=columns_of(_NEEDED, turns))


def in_windows_of(takes: Sequence[Take], calm: Sequence[Take]) -> list[Take]:
    """See attempts in the windows of others, so that a disturbed completion time disturbs nothing else."""
    return [replace(one, trial=other.trial) for one, other in zip(takes, calm, strict=True)]


def of_attempts(measured: Measured) -> Columns:
    """Reduce measurements to one value per attempt."""
    trials, moves = measured.trials, measured.movements
    names = ("completion", "peaks", "braking_distance", "braking_velocity", "sparc", "ldlj")
    found: Columns = {name: trials[name].astype(np.float64) for name in names}
    time = np.sum([trials[name] for name in CLASSES], axis=0)
    for name in CLASSES:
        found[name] = np.divide(trials[name], time, out=np.full(len(time), np.nan), where=time > 0)
    places = {place: row for row, place in enumerate(zip(trials["trial"], trials["attempt"], strict=True))}
    whose = np.array([places[p] for p in zip(moves["trial"], moves["attempt"], strict=True)], np.int64)
    for percent in PERCENT:
        delay = np.abs(moves[f"delay_{percent}"])
        known = np.isfinite(delay)
        sums = np.bincount(whose[known], delay[known], len(time))
        counts = np.bincount(whose[known], minlength=len(time))
        found[f"delay_{percent}"] = np.divide(sums, counts, out=np.full(len(time), np.nan), where=counts > 0)
    found["movements"] = np.bincount(whose, minlength=len(time)).astype(np.float64)
    return found


def fulfil(wish: Wish) -> Fulfilled:
    """Measure one recording."""
    whole = measure(wish.run, wish.base)
    base = replace(whole, paths={name: values[:0].copy() for name, values in whole.paths.items()})
    block = opened(wish.run, wish.base)
    others: dict[int, Measured] = {}
    seen = block
    for number in _in_order(wish):
        if measured_with(wish.others[number]) == measured_with(wish.base):
            others[number] = base
        else:
            seen = seen.again(wish.others[number])
            others[number] = again(base, list(seen.takes()))
    calm, disturbed = _disturbed(wish, base, block) if wish.disturbances else ((), ())
    forms = compared(block.raw("p"), block.placed) if wish.disturbances else ()
    return Fulfilled(base, tuple(others[number] for number in range(len(others))), calm, disturbed, forms)


def _disturbed(wish: Wish, base: Measured, block: Block) -> tuple[tuple[Columns, ...], tuple[Columns, ...]]:
    """Measure without each disturbance and with it."""
    groups = (*PAPER, *_SMOOTHNESS)
    still: dict[str, tuple[Block, list[Take], Columns]] = {}
    calm, disturbed = [], []
    for number, (disturbance, readings) in enumerate(zip(wish.disturbances, wish.disturbed_by, strict=True)):
        if repr(readings) not in still:
            seen = block.again(readings)
            takes = list(seen.takes())
            still[repr(readings)] = seen, takes, of_attempts(again(base, takes, groups))
        seen, takes, values = still[repr(readings)]
        generator = np.random.default_rng([zlib.crc32(wish.run.path.stem.encode()), number])
        shaken = seen.again(readings, **disturbance.change(recorded(seen), generator))
        calm.append(values)
        disturbed.append(of_attempts(again(base, in_windows_of(list(shaken.takes()), takes), groups)))
    return tuple(calm), tuple(disturbed)


def _in_order(wish: Wish) -> list[int]:
    """Order readings so that those with equal filters are adjacent, those with the base's filters first."""

    def place(number: int) -> tuple[bool, str, str]:
        readings = wish.others[number]
        return readings.filters != wish.base.filters, repr(readings.filters), repr(readings.segments)

    return sorted(range(len(wish.others)), key=place)


def recorded(block: Block) -> Columns:
    """Return the columns that a disturbance may change."""
    names = ("theta", "p", *(f"{side}_used_{what}" for side in SIDES for what in ("z", "vz")))
    return {name: block.raw(name) for name in names}


def fulfil_all(
    wishes: Sequence[Wish], workers: int, tell: Callable[[int], object] = lambda done: None
) -> Iterator[Fulfilled]:
    """Measure recordings in parallel, each in its own process."""
    if workers == 1:
        for done, wish in enumerate(wishes, start=1):
            yield fulfil(wish)
            tell(done)
        return
    with ProcessPoolExecutor(workers, get_context("spawn")) as pool:
        asked = [pool.submit(fulfil, wish) for wish in wishes]
        for done, _ in enumerate(as_completed(asked), start=1):
            tell(done)
        yield from (answer.result() for answer in asked)


# --- why filters are second-order sections always: the same ones as a fraction of two polynomials ---------------------


def compared(values: NDArray[np.float64], breaks: NDArray[np.int64]) -> tuple[Form, ...]:
    """Compare both forms on the longest piece of a signal."""
    bounds = np.concatenate([[0], breaks, [values.size]])
    longest = int(np.argmax(np.diff(bounds)))
    return tuple(_forms(values[bounds[longest] : bounds[longest + 1]]))


def _forms(piece: NDArray[np.float64]) -> Iterator[Form]:
    """Yield each order and cutoff."""
    for order in ORDERS:
        for cutoff in CUTOFFS:
            above, below = butter(order, cutoff, fs=RATE)
            sections = butter(order, cutoff, fs=RATE, output="sos")
            pad = min(round(RATE), piece.size - 1)
            right = sosfiltfilt(sections, piece, padlen=pad)
            with np.errstate(over="ignore", invalid="ignore"):  # an unstable filter leaves the range of numbers
                error = np.abs(filtfilt(above, below, piece, padlen=pad) - right).max(initial=0.0)
            radius = float(np.abs(np.roots(below)).max())
            yield Form(order, cutoff, radius, float(above.sum() / below.sum()), float(error))
