"""Judges the quality of recorded attempts as the server did: by the rules in the configuration.

The ticks go to the referee in batches, each followed by its frames, as on a live server.
"""

from collections.abc import Iterable
from operator import attrgetter
from typing import Any

from numpy.typing import NDArray

from netboard.network.protocol.motion import Safeguard
from netboard.recording.files.reader import Recording
from netboard.task.trials.quality import FIELDS_NEEDED, Referee, Verdict

_PORTION = 100
"""Ticks per batch: fewer than the delay after which the server knows every frame [1]."""


def judged(recording: Recording) -> tuple[Verdict, ...]:
    """Judge every completed attempt in a recording."""
    return judged_along(recording, recording.batches(names=FIELDS_NEEDED, as_sent=True))


def judged_along(recording: Recording, portions: Iterable[NDArray[Any]]) -> tuple[Verdict, ...]:
    """Judge every completed attempt while the ticks are read for another purpose.

    ``portions``: all ticks in order, with at least the fields in `netboard.task.trials.quality.FIELDS_NEEDED`.
    """
    referee = Referee(recording.config, Safeguard.CLAMPED)
    frames = sorted(recording.frames(), key=attrgetter("tick"))
    verdicts: list[Verdict] = []
    passed = 0
    for rows in portions:
        for first in range(0, rows.size, _PORTION):
            count = min(_PORTION, rows.size - first)
            verdicts += referee.watch(rows, first, count)
            newest = rows["tick"][first + count - 1]
            while passed < len(frames) and frames[passed].tick <= newest:
                frame = frames[passed]
                referee.paint(frame.station, frame.tick, frame.painted_ns)
                passed += 1
    return tuple(verdicts)
