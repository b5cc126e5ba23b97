"""Where a replay is, and what happened when. Pure: time is an argument.

A `Playback` is a frozen value: the position in the recording that holds at one moment of the wall clock, and the speed
from there. Every key of the player makes a new one.
"""

from bisect import bisect_left, bisect_right
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from netboard.experiment.machine import Cause

SPEEDS = (0.1, 0.25, 0.5, 1.0, 2.0, 4.0, 8.0, 16.0)
"""Speeds to choose from, in seconds of the recording per second [1]."""


@dataclass(frozen=True, slots=True)
class Playback:
    """A replay at one moment.

    Attributes
    ----------
    length : float
        Length of the recording [s].
    position : float
        Position in the recording [s].
    since : float
        Moment at which it was there, on any steady clock [s].
    speed : float
        Seconds of the recording per second [1].
    playing : bool
        Whether it goes on.
    """

    length: float
    position: float = 0.0
    since: float = 0.0
    speed: float = 1.0
    playing: bool = False

    def at(self, now: float) -> float:
        """Position at a moment.

        Parameters
        ----------
        now : float
            The moment [s].

        Returns
        -------
        float
            Position in the recording, never outside it [s].
        """
        moved = (now - self.since) * self.speed if self.playing else 0.0
        return min(max(self.position + moved, 0.0), self.length)

    def now(self, now: float) -> "Playback":
        """Hold the replay at a moment, from which it goes on unless it is at the end.

        Parameters
        ----------
        now : float
            The moment [s].
        """
        position = self.at(now)
        return replace(self, position=position, since=now, playing=self.playing and position < self.length)

    def toggle(self, now: float) -> "Playback":
        """Play or pause; at the end, play from the start.

        Parameters
        ----------
        now : float
            The moment [s].
        """
        here = self.now(now)
        if not here.playing and here.position >= here.length:
            here = replace(here, position=0.0)
        return replace(here, playing=not here.playing)

    def seek(self, now: float, position: float) -> "Playback":
        """Go to a position.

        Parameters
        ----------
        now : float
            The moment [s].
        position : float
            Where to; kept inside the recording [s].
        """
        return replace(self.now(now), position=min(max(position, 0.0), self.length), playing=self.playing)

    def step(self, now: float, by: float) -> "Playback":
        """Go forward or back.

        Parameters
        ----------
        now : float
            The moment [s].
        by : float
            How far, negative for back [s].
        """
        return self.seek(now, self.at(now) + by)

    def faster(self, now: float, steps: int) -> "Playback":
        """Take another of the `SPEEDS`.

        Parameters
        ----------
        now : float
            The moment [s].
        steps : int
            How many speeds up, negative for down [1].
        """
        rank = bisect_right(SPEEDS, self.speed) - 1 if steps > 0 else bisect_left(SPEEDS, self.speed)
        return replace(self.now(now), speed=SPEEDS[min(max(rank + steps, 0), len(SPEEDS) - 1)])


@dataclass(frozen=True, slots=True)
class Mark:
    """Something worth seeing on the time line.

    Attributes
    ----------
    time : float
        When, from the start of the recording [s].
    kind : str
        ``release``, ``success``, ``failure`` or ``stop``.
    label : str
        A word for people.
    """

    time: float
    kind: str
    label: str


_KINDS: dict[int, str] = {
    Cause.LEVEL: "release",
    Cause.HELD: "success",
    Cause.FELL: "failure",
    Cause.TIMED_OUT: "failure",
    Cause.ABORT: "stop",
    Cause.PAUSE: "stop",
    Cause.STOP: "stop",
    Cause.FAULT: "stop",
}


def seconds(ticks: NDArray[Any]) -> NDArray[np.float64]:
    """Time of each tick from the start of the recording.

    Parameters
    ----------
    ticks : ndarray of netboard.tick.TICK, shape (n,)
        The recorded ticks.

    Returns
    -------
    ndarray, shape (n,)
        Times [s].
    """
    return np.asarray((ticks["time_ns"] - ticks["time_ns"][0]) * 1e-9, dtype=np.float64)


def marks(ticks: NDArray[Any]) -> tuple[Mark, ...]:
    """Events of a recording that are worth a mark.

    Parameters
    ----------
    ticks : ndarray of netboard.tick.TICK, shape (n,)
        The recorded ticks.

    Returns
    -------
    tuple of Mark
        In order of time.
    """
    times = seconds(ticks)
    found = []
    for i in np.flatnonzero(ticks["event"]):
        cause = int(ticks["event"][i])
        if cause in _KINDS:
            found.append(Mark(float(times[i]), _KINDS[cause], f"{Cause(cause).name.lower()} {int(ticks['trial'][i])}"))
    return tuple(found)


def best_so_far(ticks: NDArray[Any]) -> NDArray[np.float64]:
    """Best completion time up to each tick.

    Parameters
    ----------
    ticks : ndarray of netboard.tick.TICK, shape (n,)
        The recorded ticks.

    Returns
    -------
    ndarray, shape (n,)
        Completion times; infinite before the first success [s].
    """
    completed = np.where(ticks["completion"] > 0, ticks["completion"], np.inf)
    return np.asarray(np.minimum.accumulate(completed), dtype=np.float64)


def begin(ticks: NDArray[Any]) -> float:
    """Where a replay begins: when the block starts, for nothing happens before.

    Parameters
    ----------
    ticks : ndarray of netboard.tick.TICK, shape (n,)
        The recorded ticks.

    Returns
    -------
    float
        Time from the start of the recording; 0 if the recording began later than the block [s].
    """
    started = np.flatnonzero(ticks["event"] == Cause.START)
    return float(seconds(ticks)[started[0]]) if len(started) else 0.0


def clock(position: float) -> str:
    """Write a position as people read it.

    Parameters
    ----------
    position : float
        From the start [s].

    Returns
    -------
    str
        Minutes, seconds and tenths.
    """
    tenths = round(position * 10)
    return f"{tenths // 600}:{tenths // 10 % 60:02d}.{tenths % 10}"
