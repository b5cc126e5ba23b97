"""Where a replay is: a position that goes on with time. Pure: time is an argument.

A `Playback` is a frozen value: the position in the recording that holds at one moment of a steady clock, and how it
goes on from there. Every key and every command makes a new one. What there is at a position is known elsewhere
(`netboard.recording.replay.loaded`).
"""

from bisect import bisect_left, bisect_right
from dataclasses import dataclass, replace

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
    loop : (float, float) or None
        From the second position it goes on at the first; one that is beyond goes on to the end [s].
    """

    length: float
    position: float = 0.0
    since: float = 0.0
    speed: float = 1.0
    playing: bool = False
    loop: tuple[float, float] | None = None

    def at(self, now: float) -> float:
        """Position at a moment."""
        moved = (now - self.since) * self.speed if self.playing else 0.0
        return self._inside(self._looped(self.position + moved))

    def _looped(self, position: float) -> float:
        """Where a way leads that has come to a position without a loop."""
        if self.loop is None or not self.playing:
            return position
        begin, end = self.loop
        if self.position >= end or position < end:
            return position
        again = begin + (position - end) % (end - begin)
        return again if again < end else begin

    def _inside(self, position: float) -> float:
        return min(max(position, 0.0), self.length)

    def now(self, now: float) -> "Playback":
        """Hold the replay at a moment, from which it goes on unless it is at the end."""
        position = self.at(now)
        return replace(self, position=position, since=now, playing=self.playing and position < self.length)

    def play(self, now: float) -> "Playback":
        """Go on; at the end, from the start, or from that of the loop."""
        here = self.now(now)
        if here.position >= here.length:
            here = replace(here, position=0.0 if here.loop is None else here.loop[0])
        return replace(here, playing=True)

    def pause(self, now: float) -> "Playback":
        """Stand still."""
        return replace(self.now(now), playing=False)

    def toggle(self, now: float) -> "Playback":
        """Play or pause."""
        return self.pause(now) if self.now(now).playing else self.play(now)

    def seek(self, now: float, position: float) -> "Playback":
        """Go to a position; whether it plays stays as it is."""
        return replace(self.now(now), position=self._inside(position), playing=self.playing)

    def move(self, now: float, by: float) -> "Playback":
        """Go forward or back."""
        return self.seek(now, self.at(now) + by)

    def pace(self, now: float, speed: float) -> "Playback":
        """Take a speed."""
        return replace(self.now(now), speed=speed)

    def faster(self, now: float, steps: int) -> "Playback":
        """Take another of the `SPEEDS`."""
        rank = bisect_right(SPEEDS, self.speed) - 1 if steps > 0 else bisect_left(SPEEDS, self.speed)
        return self.pace(now, SPEEDS[min(max(rank + steps, 0), len(SPEEDS) - 1)])

    def repeat(self, now: float, loop: tuple[float, float] | None) -> "Playback":
        """Play one part again and again, or no more."""
        if loop is not None:
            loop = self._inside(loop[0]), self._inside(loop[1])
            if not loop[0] < loop[1]:
                raise ValueError("a loop needs some length")
        return replace(self.now(now), loop=loop)


def clock(position: float) -> str:
    """Write a position as people read it."""
    tenths = round(position * 10)
    return f"{tenths // 600}:{tenths // 10 % 60:02d}.{tenths % 10}"
