"""Tables with several rows for each attempt: its movements of the board, and its downsampled path.

Delays are signed, left minus right, and are stored twice: with the threshold as set, and at fractions of each side's
own peak. A path has every `STEP`-th sample of the filtered motion.
"""

from collections.abc import Sequence
from itertools import groupby

import numpy as np

from netboard.analysis.extraction.tables import PLACE, Columns, count, number
from netboard.analysis.extraction.trials import RATE, AttemptData
from netboard.analysis.measures.cooperation import PORTIONS, Contributions, Delays, contributions, delays
from netboard.analysis.measures.segments import Segments
from netboard.analysis.measures.signals import lasts
from netboard.base.config import SIDES
from netboard.recording.format.channels import DTYPES

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


def delays_of(take: AttemptData, movements: Segments | None = None) -> tuple[Contributions, Delays]:
    """Return the contributions to movements of the board, and their delays as set.

    By default, to the movements that begin in the attempt.
    """
    own = take.own_segments if movements is None else movements
    found, how = take.motion, take.block.readings.delays
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


def movements(name: str, takes: Sequence[AttemptData]) -> Columns:
    """Return the rows of the movements of the board in the attempts of a recording, by its name.

    Attempts of one filtered motion are measured together.
    """
    parts = [_movements(name, list(own)) for _, own in groupby(takes, key=lambda take: id(take.motion))]
    none = {field.name: np.zeros(0, DTYPES[field.kind]) for field in MOVEMENTS}
    return {key: np.concatenate([empty, *(part[key] for part in parts)]) for key, empty in none.items()}


def _movements(name: str, takes: Sequence[AttemptData]) -> Columns:
    """Return the rows of the movements in attempts of one filtered motion."""
    each = [take.own_segments for take in takes]
    counts = [len(own) for own in each]
    own = Segments(*(np.concatenate([getattr(one, key) for one in each]) for key in Segments.__slots__))
    moved, as_set = delays_of(takes[0], own)
    found = takes[0].motion
    of_own = delays(own, moved, found.left_vz, found.right_vz, RATE, threshold="own_peak")
    release = np.repeat([take.trial.release for take in takes], counts)
    return {
        "recording": np.full(len(own), name, DTYPES["string"]),
        "trial": np.repeat([take.attempt.trial for take in takes], counts),
        "attempt": np.repeat([take.attempt.attempt for take in takes], counts),
        "movement": np.concatenate([np.arange(1, count + 1) for count in counts]),
        "onset": (own.first - release) / RATE,
        "duration": lasts(own.first, own.stop, RATE),
        "angle": own.angle,
        "cut": own.cut.astype(np.int64),
        "left_moved": moved.left,
        "right_moved": moved.right,
        "cooperative": moved.cooperative.astype(np.int64),
        "left_peak": as_set.left_peak,
        "right_peak": as_set.right_peak,
        **{f"delay_{q}": as_set.signed[:, j] for j, q in enumerate(THRESHOLDS)},
        **{f"truncated_{q}": as_set.truncated[:, j].astype(np.int64) for j, q in enumerate(THRESHOLDS)},
        **{f"own_delay_{q}": of_own.signed[:, j] for j, q in enumerate(THRESHOLDS)},
    }


def path(take: AttemptData) -> Columns:
    """Return the rows of an attempt's path, from release to end, without the columns that locate it."""
    trial, found = take.trial, take.motion
    at = np.arange(trial.release, trial.stop, STEP)
    names = (*(f"{side}_z" for side in SIDES), *(f"{side}_vz" for side in SIDES), "theta", "p", "speed")
    return {"time": (at - trial.release) / RATE, **{name: getattr(found, name)[at] for name in names}}
