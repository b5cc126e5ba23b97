"""Tables with several rows for each attempt: its movements of the board, and its downsampled path.

Delays are signed, left minus right, and are stored twice: with the threshold as set, and at fractions of each side's
own peak. A path has every `STEP`-th sample of the filtered motion.
"""

from collections.abc import Iterator, Mapping
from typing import Any

import numpy as np

from netboard.analysis.extraction.tables import PLACE, Columns, count, number
from netboard.analysis.extraction.trials import RATE, AttemptData
from netboard.analysis.measures.cooperation import PORTIONS, Contributions, Delays, contributions, delays
from netboard.analysis.measures.signals import lasts
from netboard.base.config import SIDES

STEP = 20
"""Samples between two rows of a path: 20 ms. The filtered motion has no relevant content above 20 Hz [1]."""

THRESHOLDS = tuple(round(100 * portion) for portion in PORTIONS)
"""Thresholds of the delays, as fractions of a peak [%]."""

MOVEMENTS = (
    *PLACE,
    count("movement", "number of the movement of the board in the attempt, from 1"),
    number("onset", "onset of the movement, from the release", "s"),
    number("duration", "duration of the movement", "s"),
    number("angle", "change of the tilt in the movement, + = right end up", "rad"),
    count("cut", "1: truncated; the movement may have begun earlier or ended later"),
    number("left_moved", "displacement of the left stylus in the movement, + = up", "m"),
    number("right_moved", "displacement of the right stylus in the movement, + = up", "m"),
    count(
        "cooperative", "1: cooperative; opposite directions, and neither displacement more than nine times the other"
    ),
    number("left_peak", "peak velocity of the left stylus in its own direction", "m/s"),
    number("right_peak", "peak velocity of the right stylus in its own direction", "m/s"),
    *(
        number(
            f"delay_{q}", f"delay at {q} % of the peak chosen in the settings, left minus right: + = right first", "s"
        )
        for q in THRESHOLDS
    ),
    *(count(f"truncated_{q}", f"1: a side was already above {q} % where the search ended") for q in THRESHOLDS),
    *(number(f"own_delay_{q}", f"delay at {q} % of each side's own peak, left minus right", "s") for q in THRESHOLDS),
)
"""Columns of the table of movements."""

PATHS = (
    *PLACE,
    number("time", "time from the release", "s"),
    number("left_z", "height of the left stylus, filtered", "m"),
    number("right_z", "height of the right stylus, filtered", "m"),
    number("left_vz", "velocity of the left stylus", "m/s"),
    number("right_vz", "velocity of the right stylus", "m/s"),
    number("theta", "tilt of the board, + = right end up, filtered", "rad"),
    number("p", "ball along the board, + = right, filtered", "m"),
    number("speed", "absolute velocity of the ball, also filtered at the low cutoff", "m/s"),
)
"""Columns of the table of paths."""


def delays_of(take: AttemptData) -> tuple[Contributions, Delays]:
    """Return the contributions to the movements of the board that begin in an attempt, and their delays as set."""
    own, found, how = take.own_segments, take.motion, take.block.readings.delays
    moved = contributions(
        own, found.left_z, found.right_z, opposite=how.opposite, amount=how.amount, largest_ratio=how.largest_ratio
    )
    as_set = delays(
        own,
        moved,
        found.left_vz,
        found.right_vz,
        RATE,
        threshold=how.threshold,
        search=how.search,
        velocity=how.velocity,
    )
    return moved, as_set


def movements(take: AttemptData) -> Iterator[Mapping[str, Any]]:
    """Yield the rows of the movements of the board that begin in an attempt, without the columns that locate it."""
    own, found = take.own_segments, take.motion
    moved, as_set = delays_of(take)
    of_own = delays(own, moved, found.left_vz, found.right_vz, RATE, threshold="own_peak")
    for k in range(len(own)):
        yield {
            "movement": k + 1,
            "onset": (own.first[k] - take.trial.release) / RATE,
            "duration": float(lasts(own.first[k], own.stop[k], RATE)),
            "angle": own.angle[k],
            "cut": int(own.cut[k]),
            "left_moved": moved.left[k],
            "right_moved": moved.right[k],
            "cooperative": int(moved.cooperative[k]),
            "left_peak": as_set.left_peak[k],
            "right_peak": as_set.right_peak[k],
            **{f"delay_{q}": as_set.signed[k, j] for j, q in enumerate(THRESHOLDS)},
            **{f"truncated_{q}": int(as_set.truncated[k, j]) for j, q in enumerate(THRESHOLDS)},
            **{f"own_delay_{q}": of_own.signed[k, j] for j, q in enumerate(THRESHOLDS)},
        }


def path(take: AttemptData) -> Columns:
    """Return the rows of an attempt's path, from release to end, without the columns that locate it."""
    trial, found = take.trial, take.motion
    at = np.arange(trial.release, trial.stop, STEP)
    names = (*(f"{side}_z" for side in SIDES), *(f"{side}_vz" for side in SIDES), "theta", "p", "speed")
    return {"time": (at - trial.release) / RATE, **{name: getattr(found, name)[at] for name in names}}
