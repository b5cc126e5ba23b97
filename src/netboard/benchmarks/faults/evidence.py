"""Measurements of a fault, from the forces written to the devices and the recordings: arrays in, numbers out.

The trace of a device has a row for each written force (`netboard.benchmarks.faults.devices.TRACE`), independent of the
network. Consecutive renewed forces always differ, because a hand is never at rest to the last bit; equal forces have
not been renewed. So the time of the last renewed force follows from the trace alone.

All times are of the monotonic clock of the one machine.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import Any

import numpy as np
from numpy.typing import NDArray

from netboard.base.tick import TICK_NS
from netboard.devices.safety.chain import MAX_STEP_NS
from netboard.network.protocol.records import EventRecord
from netboard.task.trials.state_machine import Cause, Phase

HELD_UP_NS = 20_000_000
"""Shortest stall of a 1 kHz loop that counts as a suspension [ns]."""


SOON_NS = 1_000_000_000
"""Longest time from the last renewal to zero force; a later zero means that the force was renewed meanwhile [ns]."""


@dataclass(frozen=True, slots=True)
class Fade:
    """Course of the vertical force while it was not renewed.

    - `last_ns`: time of the last renewed force at the device [ns].
    - `force`: that force [N].
    - `held`: delay until it was written for the last time [s].
    - `begun`: delay until another force was written; NaN without one [s].
    - `zero`: delay until the force was zero; NaN if it was not soon [s].
    - `held_up`: duration for which the machine suspended the agent meanwhile [s].
    """

    last_ns: int
    force: float
    held: float
    begun: float
    zero: float
    held_up: float

    def __str__(self) -> str:
        words = f"{self.force:.2f} N falls after {self.begun * 1e3:.1f} ms"
        words += f", zero after {self.zero * 1e3:.1f} ms" if self.zero == self.zero else ", not zero soon"
        return words + (f" (the agent was held up for {self.held_up * 1e3:.1f} ms)" if self.held_up else "")


def fades(trace: NDArray[Any], longer_ns: int) -> list[Fade]:
    """Return all periods in which the vertical force was not renewed.

    - `longer_ns`: minimum duration until another force [ns].
    """
    forces, times = trace["fz"], trace["time_ns"]
    found = []
    for first, stop in _runs(forces):
        if forces[first] == 0.0 or times[min(stop, times.size - 1)] - times[first] <= longer_ns:
            continue
        last = int(times[first])
        after = forces[stop:]
        zeros = np.flatnonzero(after == 0.0)
        begun = (int(times[stop]) - last) * 1e-9 if after.size else float("nan")
        gone = zeros.size > 0 and int(times[stop + zeros[0]]) - last < SOON_NS
        zero = (int(times[stop + zeros[0]]) - last) * 1e-9 if gone else float("nan")
        until = stop + int(zeros[0]) if gone else min(stop, forces.size - 1)
        gaps = np.diff(times[first : until + 1])
        held_up = float(np.sum(gaps[gaps > MAX_STEP_NS] - TICK_NS)) * 1e-9
        found.append(Fade(last, float(forces[first]), (int(times[stop - 1]) - last) * 1e-9, begun, zero, held_up))
    return found


def _runs(values: NDArray[np.float64]) -> Iterator[tuple[int, int]]:
    """Yield runs of equal values as (first, one after the last)."""
    bounds = np.concatenate([[0], 1 + np.flatnonzero(values[1:] != values[:-1]), [values.size]])
    yield from pairwise(bounds.tolist())


@dataclass(frozen=True, slots=True)
class Step:
    """A change of force from one row to the next.

    - `at_ns`: time [ns].
    - `size`: norm over the three axes [N].
    """

    at_ns: int
    size: float
    share: float


def largest_step(trace: NDArray[Any], slew: float) -> Step:
    """Return the change of force that is largest relative to the slew limit.

    The chain limits a force some time before it is written, but after the one before it was. So the time step of the
    chain is at most that from two rows before, and at most `MAX_STEP_NS`.
    """
    if trace.size < 3:
        return Step(0, 0.0, 0.0)
    force = np.stack([trace["fx"], trace["fy"], trace["fz"]])
    sizes = np.sqrt(np.sum(np.diff(force, axis=1)[:, 1:] ** 2, axis=0))
    times = trace["time_ns"]
    allowed = slew * 1e-9 * np.minimum(times[2:] - times[:-2], MAX_STEP_NS)
    shares = sizes / allowed
    worst = int(np.argmax(shares))
    return Step(int(times[worst + 2]), float(sizes[worst]), float(shares[worst]))


def steps_to_nothing(trace: NDArray[Any], slew: float) -> list[Step]:
    """Return where the force was cut to zero faster than the slew limit, as the safety chain does after a fault."""
    force = np.stack([trace["fx"], trace["fy"], trace["fz"]], axis=1)
    cut = np.flatnonzero(np.all(force[1:] == 0.0, axis=1) & np.any(force[:-1] != 0.0, axis=1)) + 1
    found = (largest_step(trace[max(0, row - 2) : row + 1], slew) for row in cut.tolist())
    return [step for step in found if step.share > 1.0]


def without_cut(trace: NDArray[Any], slew: float) -> list[NDArray[Any]]:
    """Split a trace where the force was cut to zero."""
    times = [step.at_ns for step in steps_to_nothing(trace, slew)]
    return np.split(trace, np.searchsorted(trace["time_ns"], times).tolist())


def pauses_between(times_ns: NDArray[np.int64], longer_ns: int = HELD_UP_NS) -> NDArray[np.int64]:
    """Return the stalls of a loop that exceed a duration."""
    rows = np.flatnonzero(np.diff(times_ns) > longer_ns)
    return np.stack([times_ns[rows], times_ns[rows + 1]], axis=1)


@dataclass(frozen=True, slots=True)
class Pause:
    """A pause of a trial, caused by a fault.

    - `at_ns`: time [ns].
    """

    at_ns: int
    why: str
    trial: int
    attempt: int
    again: tuple[int, int] | None

    @property
    def repeated(self) -> bool:
        """Whether the same trial came next, as a new attempt."""
        return self.again == (self.trial, self.attempt + 1)


def pauses(ticks: NDArray[Any], events: Sequence[EventRecord]) -> list[Pause]:
    """Return the pauses of one session that were caused by faults."""
    told = [(event.tick, event.details.get("notice", "")) for event in events if event.name == Cause.FAULT.name.lower()]
    found = []
    for row in np.flatnonzero(ticks["event"] == Cause.FAULT).tolist():
        tick = int(ticks["tick"][row])
        _, notice = min(told, key=lambda event: abs(event[0] - tick), default=(tick, ""))
        later = np.flatnonzero(ticks["phase"][row + 1 :] == Phase.LEVELLING)
        again = None
        if later.size:
            then = ticks[row + 1 + int(later[0])]
            again = int(then["trial"]), int(then["attempt"])
        found.append(
            Pause(int(ticks["time_ns"][row]), notice, int(ticks["trial"][row]), int(ticks["attempt"][row]), again)
        )
    return found


def between(trace: NDArray[Any], start_ns: int, stop_ns: int) -> NDArray[Any]:
    """Return the rows of an array with ``time_ns`` that lie in a time window."""
    first, stop = np.searchsorted(trace["time_ns"], (start_ns, stop_ns))
    return trace[int(first) : int(stop)]
