"""A recording as text, event by event, at the original pace."""

import time
from collections.abc import Callable
from pathlib import Path

from netboard.base.clock import now_ns
from netboard.nodes.server.event_log import printable
from netboard.recording.files.reader import Recording

NAP = 0.05
"""Longest sleep before a request to stop is noticed [s]."""


def print_events(path: Path, speed: float, stopping: Callable[[], bool], say: Callable[[str], None]) -> None:
    """Print the events of a recording."""
    with Recording(path) as recording:
        events = recording.events()
    if not events:
        say("this recording contains no events")
        return
    first_ns, begin_ns = events[0].time_ns, now_ns()
    for event in events:
        due_ns = begin_ns + (event.time_ns - first_ns) / speed
        while (left := (due_ns - now_ns()) * 1e-9) > 0:
            if stopping():
                return
            time.sleep(min(left, NAP))
        tick = event.tick if event.tick >= 0 else "-"  # the end of a rehearsal names none
        when = f"{(event.time_ns - first_ns) * 1e-9:9.3f} s  tick {tick:>8}"
        say(f"{when}  {event.name:16s}  {printable(event.details)}")
