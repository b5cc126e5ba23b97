"""Converts columns at ticks to rows of ticks, as measured or with board, ball and trials simulated from the hands.

Measured values are used unchanged; missing numbers are NaN, missing integers 0. An attempt extends between changes of
trial, attempt or free ball; its end gets the cause that its outcome names.
"""

from collections.abc import Iterator, Mapping
from itertools import pairwise
from typing import Any

import numpy as np
from numpy.typing import NDArray

from netboard.base.config import SIDES, Config
from netboard.base.errors import ConfigError
from netboard.base.nearest import one_of
from netboard.base.tick import START_NS, TICK, TICK_NS, TICK_SECONDS
from netboard.recording.importing.columns import OF_ATTEMPT
from netboard.recording.importing.resampling import Columns
from netboard.stage.stage import make_stage
from netboard.task.trials.state_machine import BALL_FREE, Cause, Phase

OUTCOMES = {
    "success": Cause.HELD,
    "fell": Cause.FELL,
    "timed_out": Cause.TIMED_OUT,
    "abort": Cause.ABORT,
    "skip": Cause.SKIP,
    "pause": Cause.PAUSE,
}
"""Cause of the end of an attempt, by outcome."""

PHASES = {phase.name.lower(): int(phase) for phase in Phase} | {str(int(phase)): int(phase) for phase in Phase}
"""Phases by name and by number."""

_TAKEN = ("left_x", "left_y", "right_x", "right_y", "z", "vz", "theta", "omega", "p", "vp")
_FORCES = ("left_force", "right_force", "left_coupling", "right_coupling")


def _samples(ticks: NDArray[np.int64], columns: Columns) -> NDArray[Any]:
    """Return rows with times and fresh samples of both styluses."""
    rows = np.zeros(ticks.size, TICK)
    rows["tick"] = ticks
    rows["time_ns"] = START_NS + ticks * TICK_NS
    for side in SIDES:
        rows[f"{side}_live"] = 1
        rows[f"{side}_seq"] = ticks
        rows[f"{side}_stamp_ns"] = rows["time_ns"]
        rows[f"{side}_sent_z"], rows[f"{side}_sent_vz"] = columns[f"{side}_z"], columns[f"{side}_vz"]
        for axis in ("x", "y"):
            rows[f"{side}_{axis}"] = columns.get(f"{side}_{axis}", np.nan)
    return rows


def simulated(ticks: NDArray[np.int64], columns: Columns, config: Config) -> NDArray[Any]:
    """Simulate the experiment from the hand movements, with the stage that the server uses.

    ``columns``: stylus heights and velocities and other known columns at these ticks [SI]. Returns every tick from
    first to last; gaps have no fresh samples, so the hands keep their position.
    """
    every = np.arange(ticks[0], ticks[-1] + 1)
    newest = np.searchsorted(ticks, every, "right") - 1
    rows = _samples(every, {name: values[newest] for name, values in columns.items()})
    stale = ticks[newest] != every
    for side in SIDES:
        rows[f"{side}_live"][stale] = 0
        rows[f"{side}_seq"] = newest
        rows[f"{side}_stamp_ns"] = START_NS + ticks[newest] * TICK_NS
    rows["command"][0] = Cause.START
    stage = make_stage(config)
    stage.advance(stage.initial(), rows, 0, len(rows))
    return rows


def measured(ticks: NDArray[np.int64], columns: Columns) -> NDArray[Any]:
    """Fill ticks with measured columns.

    ``columns``: known columns at the ticks, by the names in `netboard.recording.importing.columns.COLUMNS` [SI].
    """
    rows = _samples(ticks, columns)
    for name in (*_TAKEN, *_FORCES):
        rows[name] = columns.get(name, np.nan)
    for side in SIDES:
        rows[f"{side}_z"] = rows[f"{side}_used_z"] = rows[f"{side}_sent_z"]
        rows[f"{side}_used_vz"] = rows[f"{side}_seen_vz"] = rows[f"{side}_sent_vz"]
        rows[f"{side}_seen_ns"] = rows[f"{side}_stamp_ns"]
        for name in ("az", "used_az", "rendered"):
            rows[f"{side}_{name}"] = np.nan
    _number_attempts(rows, columns)
    _set_outcomes(rows, columns)
    return rows


def spread_over_attempts(samples: Columns) -> Columns:
    """Give every sample of an attempt its outcome and completion time, as ticks take only some of the samples.

    ``samples``: known columns at the samples, by name [SI].
    """
    given = {name: samples[name].copy() for name in OF_ATTEMPT if name in samples}
    if not given:
        return samples
    rows = np.zeros(next(iter(given.values())).size, TICK)
    _number_attempts(rows, samples)
    for here in _attempts_in(rows):
        for values in given.values():
            here_given = np.isfinite(values[here]) if values.dtype.kind == "f" else values[here] != ""
            if here_given.any():
                values[here] = values[here][here_given][-1]
    return {**samples, **given}


def _number_attempts(rows: NDArray[Any], columns: Columns) -> None:
    """Set phases, trials, attempts and targets."""
    if "phase" in columns:
        rows["phase"] = [_known("phase", word or "idle", PHASES) for word in columns["phase"]]
    else:
        rows["phase"] = np.where(columns.get("trial", rows["trial"]) > 0, Phase.RUNNING, Phase.IDLE)
    free = np.isin(rows["phase"], BALL_FREE)
    if "trial" in columns:
        rows["trial"] = columns["trial"]
    else:  # without a trial column, each release starts a new trial
        rows["trial"] = np.cumsum(np.diff(free.astype(np.int64), prepend=0) == 1)
    rows["attempt"] = columns.get("attempt", rows["trial"] > 0)
    rows["target"] = columns.get("target", 0)


def _known(column: str, word: str, words: Mapping[str, Any]) -> Any:
    if word.lower() not in words:
        raise ConfigError(f'column {column}: found "{word}", expected {one_of(word, words)}')
    return words[word.lower()]


def _set_outcomes(rows: NDArray[Any], columns: Columns) -> None:
    """Set the end of each attempt, its times, and the counts of the block."""
    for here in _attempts_in(rows):
        _finish_attempt(rows, columns, here)
    causes, after = rows["event"], np.zeros(rows.size, np.int64)
    for name, ends in (("successes", (Cause.HELD,)), ("failures", (Cause.FELL, Cause.TIMED_OUT))):
        after[1:] = np.cumsum(np.isin(causes, ends))[:-1]
        rows[name] = after


def _attempts_in(rows: NDArray[Any]) -> Iterator[slice]:
    """Yield the rows of each attempt."""
    free = np.isin(rows["phase"], BALL_FREE)
    keys = np.stack([free.astype(np.int64), rows["trial"], rows["attempt"]])
    cuts = (np.flatnonzero(np.any(np.diff(keys) != 0, axis=0)) + 1).tolist()
    for first, stop in pairwise([0, *cuts, rows.size]):
        if free[first]:
            yield slice(first, stop)


def _finish_attempt(rows: NDArray[Any], columns: Columns, here: slice) -> None:
    """Set times and events of one attempt, and the completion time for the rows after it."""
    attempt = rows[here]
    attempt["run_ticks"] = attempt["tick"] - attempt["tick"][0]
    for name, before, then in (("ENTERED", Phase.RUNNING, Phase.HOLDING), ("LEFT", Phase.HOLDING, Phase.RUNNING)):
        turns = np.flatnonzero((attempt["phase"][:-1] == before) & (attempt["phase"][1:] == then))
        attempt["event"][turns] = Cause[name]
    words = [word for word in columns["outcome"][here] if word] if "outcome" in columns else []
    cause = _known("outcome", words[-1], OUTCOMES) if words else Cause.NONE
    attempt["event"][-1] = cause
    if cause != Cause.HELD:
        return
    mark = _completion_ticks(attempt, columns.get("completion", np.empty(0))[here])
    if attempt["phase"][-1] != Phase.HOLDING:
        attempt["phase"][-1] = Phase.HOLDING
        attempt["event"][-2:-1] = Cause.ENTERED
    attempt["mark_ticks"][attempt["phase"] == Phase.HOLDING] = mark
    rows["completion"][here.stop :] = mark * TICK_SECONDS


def _completion_ticks(attempt: NDArray[Any], given: NDArray[np.float64]) -> int:
    """Return a completion time: the given one, else up to the last target entry, else up to the end [1]."""
    known = given[np.isfinite(given)]
    if known.size:
        return round(float(known[-1]) / TICK_SECONDS)
    entries = np.flatnonzero(attempt["event"] == Cause.ENTERED)
    last = attempt["tick"][entries[-1]] if entries.size else attempt["tick"][-1]
    return int(last - attempt["tick"][0]) + 1
