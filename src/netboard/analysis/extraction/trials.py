"""One recording as input of the measures: filtered as the settings say, and cut into its attempts.

Samples are numbered from the recording's first tick. Short gaps of missing ticks are bridged, as the settings say;
longer ones remain NaN, and nothing is computed across them. Only the needed columns are read.
"""

from collections.abc import Iterator, Mapping, Sequence
from copy import copy
from dataclasses import dataclass, replace
from functools import cached_property
from math import isnan, nan
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from netboard.analysis.extraction.devices import Held, mechanics_of
from netboard.analysis.extraction.settings import Readings
from netboard.analysis.measures.motion import (
    Completion,
    FilteredMotion,
    Trial,
    Window,
    find_completion,
    motion,
    placements,
)
from netboard.analysis.measures.segments import Segments, board_segments
from netboard.analysis.measures.signals import LowPass, bridge, by_number, ticks_of
from netboard.base.config import SIDES, Config, Side
from netboard.base.errors import RecordingError
from netboard.base.tick import TICK_SECONDS
from netboard.recording.files.reader import Recording
from netboard.recording.format.summary import Attempt, from_release, with_emergency_stops

RATE = 1 / TICK_SECONDS
"""Sampling rate [Hz]."""

UNRELEASED = "unreleased"
"""Mark of an attempt whose release is not in the recording, so that its times are not known."""

PLACES = ("theta", "p", "left_used_z", "right_used_z")
"""Columns of the ticks that all measures need."""

FORCES = ("left_coupling", "right_coupling")
"""Columns of the ticks that the measures of forces need."""

_RATES = ("left_used_vz", "right_used_vz")
_COUNTS = ("tick", "run_ticks")
PERTURBED = "perturbation"
"""Column with the force of a perturbation, which blocks without perturbation trials need not have."""

_FILTERED = ("_seen", "placed", "fast", "slow", "whole", "forces", "_segments")


def columns_for(config: Config, readings: Readings) -> tuple[str, ...]:
    """Return the tick columns that a `BlockData` needs."""
    perturbed = (PERTURBED,) if config.perturbation.trials else ()
    return (*_COUNTS, *PLACES, *FORCES, *perturbed, *(_RATES if readings.filters.velocity == "device" else ()))


class BlockData:
    """A recording, or a rehearsed block, in memory; columns [SI] are not copied, and lack forces not needed.

    It has all attempts, in order, and the mechanics of the devices at each side, if known.
    """

    def __init__(
        self,
        config: Config,
        readings: Readings,
        columns: Mapping[str, NDArray[Any]],
        attempts: Sequence[Attempt],
        mechanics: Mapping[Side, Held],
    ) -> None:
        self.config, self.readings = config, readings
        self.attempts, self.mechanics = tuple(attempts), mechanics
        names, ticks = columns_for(config, readings), columns["tick"]
        self.first = int(ticks[0])
        whole = int(ticks[-1]) + 1 - self.first
        self.missing = whole - ticks.size
        self._columns = {
            name: by_number(ticks, columns[name]) if self.missing else np.asarray(columns[name])
            for name in names
            if name in columns and name not in (*_COUNTS, PERTURBED)
        }
        acts = columns.get(PERTURBED, np.zeros(0)) != 0.0
        self._onsets = ticks[np.flatnonzero(acts[1:] & ~acts[:-1]) + 1]  # of perturbations

    @classmethod
    def of(
        cls, recording: Recording, config: Config, readings: Readings, columns: Mapping[str, NDArray[Any]] | None = None
    ) -> "BlockData":
        """Return an open recording, read here and not needed afterwards; columns already read are not copied."""
        if not recording.counts["/ticks"]:
            raise RecordingError(f"{recording.path}: contains no ticks and cannot be analysed; leave it out")
        if config.physics.balls == 0:
            raise RecordingError(f"{recording.path}: its scene has no ball, so it contains no trials; leave it out")
        columns = recording.columns(*columns_for(config, readings)) if columns is None else columns
        attempts = with_emergency_stops(recording.attempts(), recording.events())
        attempts = from_release(attempts, columns["tick"], columns["run_ticks"])
        return cls(config, readings, columns, attempts, mechanics_of(config, recording))

    def again(self, readings: Readings, **columns: NDArray[np.float64]) -> "BlockData":
        """Return the same recording with other settings or columns; unchanged signals are not filtered again."""
        if readings.filters.velocity == "device" and _RATES[0] not in self._columns:
            raise ValueError("the devices' velocities were not read: open the recording with filters.velocity=device")
        other = copy(self)
        other.readings, other._columns = readings, self._columns | columns
        if columns:  # The recorded completion times do not belong to the new columns.
            other.attempts = tuple(replace(attempt, completion=nan) for attempt in self.attempts)
        if columns or readings.filters != self.readings.filters:
            stale: tuple[str, ...] = _FILTERED
        else:
            stale = ("_segments",) if readings.segments != self.readings.segments else ()
        for name in stale:
            other.__dict__.pop(name, None)
        return other

    def perturbed_at(self, attempt: Attempt) -> float:
        """Return the onset of the perturbation after the release of an attempt; NaN if none came [s]."""
        if not self._onsets.size:
            return nan
        within = self._onsets[(self._onsets >= attempt.tick) & (self._onsets < attempt.stop)]
        return (int(within[0]) - attempt.tick) / RATE if within.size else nan

    def push_onset(self, attempt: Attempt) -> float:
        """Return when a perturbation began after the release of an attempt, or would have begun without one [s].

        NaN if it never does, and in a block without perturbation trials.
        """
        table, began = self.config.perturbation, self.perturbed_at(attempt)
        if not table.trials or table.force_in(attempt.trial) != 0.0:
            return began
        if table.onset == "time":
            return table.time if table.time * RATE < attempt.stop - attempt.tick else nan
        passed = self.raw("p")[attempt.tick - self.first : attempt.stop - self.first] * attempt.target >= table.position
        return int(np.argmax(passed)) / RATE if passed.any() else nan

    @property
    def samples(self) -> int:
        """Number of samples, including missing ones [1]."""
        return self.raw("p").size

    def raw(self, name: str) -> NDArray[np.float64]:
        """Return a recorded column with short gaps bridged, shape (n,) [SI]."""
        return self._seen[name]

    @cached_property
    def _seen(self) -> dict[str, NDArray[np.float64]]:
        """Columns with short gaps bridged."""
        longest = self.readings.filters.bridge
        return {name: bridge(values, RATE, longest) if longest else values for name, values in self._columns.items()}

    @cached_property
    def placed(self) -> NDArray[np.int64]:
        """First samples after the ball was repositioned or stopped in place, shape (k,) [1]."""
        ends = [attempt.stop + 1 - self.first for attempt in self.attempts]
        return np.union1d(placements(self.raw("p"), RATE), np.array(ends, np.int64))

    @cached_property
    def fast(self) -> LowPass:
        """Filter for all force and kinematic data."""
        return self._low_pass(self.readings.filters.fast)

    @cached_property
    def slow(self) -> LowPass:
        """Filter for the board's angular velocity and the ball's speed."""
        return self._low_pass(self.readings.filters.slow)

    def _low_pass(self, cutoff: float) -> LowPass:
        how = self.readings.filters
        return LowPass(cutoff, how.order, how.order_of, how.cutoff_of, how.padding, how.pad)

    def filtered(self, part: slice) -> FilteredMotion:
        """Filter a part of the recording."""
        how = self.readings.filters
        theta, p, left, right = (self.raw(name)[part] for name in PLACES)
        rates = [self.raw(name)[part] for name in _RATES] if how.velocity == "device" else (None, None)
        placed = self.placed[(self.placed > part.start) & (self.placed < part.stop)] - part.start
        return motion(
            RATE,
            left,
            right,
            theta,
            p,
            left_vz=rates[0],
            right_vz=rates[1],
            placed=placed,
            fast=self.fast,
            slow=self.slow,
            speed=how.speed,
        )

    @cached_property
    def whole(self) -> FilteredMotion:
        """The whole recording, filtered."""
        return self.filtered(slice(0, self.samples))

    @cached_property
    def forces(self) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Filtered forces of the left and the right hand on the board, shape (n,) each [N]."""
        left, right = self.fast.together([self.raw(name) for name in FORCES], RATE, [(), ()])
        return left, right

    def segments(self, filtered: FilteredMotion) -> Segments:
        """Return the movements of the board."""
        how = self.readings.segments
        return board_segments(
            filtered.omega,
            filtered.theta,
            RATE,
            turning=how.turning,
            angle=how.angle,
            least_rate=float(np.radians(how.least_rate_deg)),
            shortest=how.shortest,
            least_angle=float(np.radians(how.least_angle_deg)),
        )

    @cached_property
    def _segments(self) -> Segments:
        return self.segments(self.whole)

    def unmeasured(self, attempt: Attempt) -> str:
        """Return the outcome of an attempt that did not end by the task, or `UNRELEASED`; empty if it is measured."""
        if attempt.outcome not in ("success", "fell", "timed_out"):
            return attempt.outcome
        return UNRELEASED if attempt.tick < self.first else ""

    def takes(self) -> Iterator["AttemptData"]:
        """Yield the measured attempts, in order."""
        for attempt in self.attempts:
            if not self.unmeasured(attempt):
                yield self._take(attempt)

    def _take(self, attempt: Attempt) -> "AttemptData":
        """Return an attempt, cut out of the recording."""
        release, stop = attempt.tick - self.first, attempt.stop - self.first
        how, sizes = self.readings, self.config.geometry
        target = attempt.target * sizes.target_distance
        completion, source = self._completion(attempt, self.raw("p")[release:stop], target)
        done = None if completion.sample is None else release + completion.sample
        trial, part = Trial(release, stop, target, done), slice(0, self.samples)
        filtered, segments = self.whole, self._segments
        if how.filters.unit == "trial":
            part = slice(release, stop)
            trial = Trial(0, stop - release, target, completion.sample)
            filtered = self.filtered(part)
            segments = self.segments(filtered)
        elif how.segments.ends == "trial":
            segments = _shifted(self.segments(_cut(filtered, trial.window("whole"))), release)
        return AttemptData(self, attempt, part, trial, filtered, segments, completion.time, completion.entries, source)

    def _completion(self, attempt: Attempt, p: NDArray[np.float64], target: float) -> tuple[Completion, str]:
        """Find the completion of a success from the ball's samples, or else from the recording.

        The server judges the ball's centre, so the recording has no hold of the whole ball.
        """
        inside, sizes = self.readings.completion.inside, self.config.geometry
        found = find_completion(
            p,
            RATE,
            target,
            inside=inside,
            half_width=sizes.target_width / 2,
            radius=sizes.ball_radius,
            hold=self.config.task.hold_time,
        )
        if attempt.outcome != "success":
            return Completion(nan, None, found.entries), ""
        if found.sample is not None:
            return found, "samples"
        if inside != "centre" or isnan(attempt.completion):
            return found, ""
        sample = min(ticks_of(attempt.completion, RATE), p.size)
        return Completion(sample / RATE, sample, found.entries), "recording"


@dataclass(frozen=True)
class AttemptData:
    """An attempt, with its position in the recording, and its completion time; NaN without one [s].

    Its `source` is the ``samples`` of the ball, or the ``recording`` if they show no hold; empty without one. `changed`
    is the change of the hands' forces on the board in a control, shape (2, n) over `part` [N].
    """

    block: BlockData
    attempt: Attempt
    part: slice
    trial: Trial
    motion: FilteredMotion
    segments: Segments
    completion: float
    entries: float
    source: str
    changed: NDArray[np.float64] | None = None

    def raw(self, name: str) -> NDArray[np.float64]:
        """Return a column of `part` with short gaps bridged, shape (n,) [SI]."""
        return self.block.raw(name)[self.part]

    def force(self, side: Literal["left", "right"], window: slice) -> NDArray[np.float64]:
        """Return the filtered force of a hand on the board [N]."""
        place = SIDES.index(side)
        recorded = self.block.forces[place][self.part][window]
        return recorded if self.changed is None else recorded + self.changed[place][window]

    def knows(self, window: Window) -> bool:
        """Return whether the end of a window is known.

        For a success without a completion time the window to completion has no known end: its samples show no hold
        under these settings, and the recording has no time either.
        """
        return window == "whole" or self.trial.completion is not None or self.attempt.outcome != "success"

    def within(self, start: int, stop: int) -> "AttemptData":
        """Return these samples of it, with the movements of the board in them."""
        done, motion = self.trial.completion, _cut(self.motion, slice(start, stop))
        return replace(
            self,
            part=slice(self.part.start + start, self.part.start + stop),
            trial=Trial(
                self.trial.release - start,
                min(self.trial.stop, stop) - start,
                self.trial.target,
                None if done is None else min(done, stop) - start,
            ),
            motion=motion,
            segments=self.block.segments(motion),
            changed=None if self.changed is None else self.changed[:, start:stop],
        )

    @cached_property
    def own_segments(self) -> Segments:
        """Movements of the board that begin in the attempt."""
        return self.segments.of_trial(self.trial)


def _cut(recording: FilteredMotion, inside: slice) -> FilteredMotion:
    arrays = {name: getattr(recording, name)[inside] for name in FilteredMotion.__slots__ if name != "rate"}
    return FilteredMotion(rate=recording.rate, **arrays)


def _shifted(segments: Segments, by: int) -> Segments:
    """Return movements with sample numbers from an earlier start."""
    return Segments(segments.first + by, segments.stop + by, segments.angle, segments.cut)
