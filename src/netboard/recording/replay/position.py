"""Position of a replay, which advances with time. Pure: time is an argument.

A `ReplayPosition` is an immutable value: the position in the recording at one time of a monotonic clock, and how it
continues from there. Every key and every command makes a new one. `netboard.recording.replay.loaded` has the content
at a position.
"""

from bisect import bisect_left, bisect_right
from dataclasses import dataclass, replace

from netboard.base.errors import ConfigError

SPEEDS = (0.1, 0.25, 0.5, 1.0, 2.0, 4.0, 8.0, 16.0)
"""Available speeds, in seconds of the recording per second [1]."""


def require_inside(at: float | None, length: float, name: str) -> None:
    """Refuse to begin beyond the end of what is replayed [s]."""
    if at is not None and at > length:
        raise ConfigError(f"--at: found {at:.12g}, expected at most {length:.3f} s, the length of {name}")


@dataclass(frozen=True, slots=True)
class ReplayPosition:
    """State of a replay at one time."""

    length: float  # length of the recording [s]
    position: float = 0.0  # position in the recording [s]
    since: float = 0.0  # time at which the position was valid, on any monotonic clock [s]
    speed: float = 1.0
    playing: bool = False
    # Loop limits: on reaching the second position the replay jumps to the first; from beyond, it continues to the end
    # [s].
    loop: tuple[float, float] | None = None

    def at(self, now: float) -> float:
        """Return the position at a time [s]."""
        moved = (now - self.since) * self.speed if self.playing else 0.0
        return self._inside(self._looped(self.position + moved))

    def _looped(self, position: float) -> float:
        if self.loop is None or not self.playing:
            return position
        begin, end = self.loop
        if self.position >= end or position < end:
            return position
        again = begin + (position - end) % (end - begin)
        return again if again < end else begin

    def _inside(self, position: float) -> float:
        return min(max(position, 0.0), self.length)

    def now(self, now: float) -> "ReplayPosition":
        """Return the state at a time; at the end, the replay stops."""
        position = self.at(now)
        return replace(self, position=position, since=now, playing=self.playing and position < self.length)

    def play(self, now: float) -> "ReplayPosition":
        """Play; from the end, restart at the beginning or at the start of the loop."""
        here = self.now(now)
        if here.position >= here.length:
            here = replace(here, position=0.0 if here.loop is None else here.loop[0])
        return replace(here, playing=True)

    def pause(self, now: float) -> "ReplayPosition":
        """Pause."""
        return replace(self.now(now), playing=False)

    def toggle(self, now: float) -> "ReplayPosition":
        """Play or pause."""
        return self.pause(now) if self.now(now).playing else self.play(now)

    def seek(self, now: float, position: float) -> "ReplayPosition":
        """Go to a position and keep playing or pausing."""
        return replace(self.now(now), position=self._inside(position), playing=self.playing)

    def move(self, now: float, by: float) -> "ReplayPosition":
        """Move forward or back by a time [s]."""
        return self.seek(now, self.at(now) + by)

    def pace(self, now: float, speed: float) -> "ReplayPosition":
        """Set the speed."""
        return replace(self.now(now), speed=speed)

    def faster(self, now: float, steps: int) -> "ReplayPosition":
        """Change the speed by steps in `SPEEDS`."""
        rank = bisect_right(SPEEDS, self.speed) - 1 if steps > 0 else bisect_left(SPEEDS, self.speed)
        return self.pace(now, SPEEDS[min(max(rank + steps, 0), len(SPEEDS) - 1)])

    def repeat(self, now: float, loop: tuple[float, float] | None) -> "ReplayPosition":
        """Set or clear the loop."""
        if loop is not None:
            loop = self._inside(loop[0]), self._inside(loop[1])
            if not loop[0] < loop[1]:
                raise ValueError("expected a loop longer than 0 s")
        return replace(self.now(now), loop=loop)


def clock(position: float) -> str:
    """Format a position as a clock time."""
    tenths = round(position * 10)
    return f"{tenths // 600}:{tenths // 10 % 60:02d}.{tenths % 10}"
