"""Reads the movements of a hand from a recording, for a robot partner that plays them.

It takes the successful trials of a block, each from the release of the ball to its end, as the heights that moved the
board. A trial with a tick that is missing is left out. The heights are low-passed without a delay, because a hand that
follows the steps of an encoder would shake.
"""

from functools import lru_cache
from hashlib import sha256
from math import ceil
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from scipy.signal import butter, sosfiltfilt

from netboard.base.config import Config, Side
from netboard.base.errors import ConfigError, RecordingError
from netboard.base.tables.experiment import STILL
from netboard.base.tick import TICK_SECONDS
from netboard.participants.policy import parameters_of
from netboard.participants.robots.playback import STEP_TICKS, PlaybackParameters, PlaybackPartner, RecordedHand
from netboard.recording.files.reader import Recording

SUCCESS = "success"
"""Outcome of the attempts that are played."""

MIN_RANGE = 1e-4
"""A hand that moved less than this over all trials was held still [m]."""


def partner(config: Config, side: Side) -> PlaybackPartner:
    """Return the robot partner that plays a recorded hand, as ``[partners.<side>]`` says.

    Raises
    ------
    ConfigError
        If a parameter is wrong, or the file is no recording with such a hand.
    """
    parameters = parameters_of(PlaybackParameters, config, side)
    where = f"[partners.{side}]"
    if not parameters.file:
        raise ConfigError(f"{where} file: found none, expected the recording (.mcap) of a block whose hand is played")
    path = Path(parameters.file)
    try:
        stamp = path.stat().st_mtime_ns
    except OSError as error:
        raise ConfigError(f"{where} file: {path}: cannot be read: {error.strerror}") from None
    own = side if parameters.hand == "same" else parameters.hand
    try:
        recorded = _read(path, stamp, own, parameters.first, parameters.last, parameters.cutoff_hz)
    except (ConfigError, RecordingError) as error:
        raise ConfigError(f"{where} file: {error}") from None
    return PlaybackPartner(config, side, recorded)


@lru_cache(maxsize=16)
def _read(path: Path, stamp: int, hand: Side, first: int, last: int, cutoff_hz: float) -> RecordedHand:
    """Read the movements of a hand. ``stamp``: time of the last change of the file, so that a new file is read anew."""
    name = f"{hand}_used_z"
    with Recording(path) as recording:
        if getattr(recording.config.block, hand) == STILL:
            raise ConfigError(f"{path}: its {hand} hand was held still, expected one that moved")
        attempts = [one for one in recording.attempts() if one.outcome == SUCCESS and one.trial >= first]
        attempts = [one for one in attempts if not last or one.trial <= last]
        columns = recording.columns("tick", name)
    found: dict[bool, list[NDArray[np.float64]]] = {True: [], False: []}
    sign, digest = (1 if hand == "right" else -1), sha256()
    for one in attempts:
        begin, stop = np.searchsorted(columns["tick"], (one.tick, one.stop))
        heights = columns[name][begin:stop]
        if len(heights) == one.stop - one.tick and np.isfinite(heights).all():
            towards = sign * one.target > 0
            found[towards].append(_smoothed(heights, cutoff_hz))
            digest.update(np.array([towards, len(heights)], "<i8").tobytes() + heights.astype("<f8").tobytes())
    for direction, word in ((True, "its own side"), (False, "the other side")):
        if not found[direction]:
            count = len(found[not direction])
            raise ConfigError(
                f"{path}: found {count} complete successful trials from trial {first} on, and none of them with the "
                f"target at {word} of the {hand} hand; expected at least one at each side"
            )
    every = np.concatenate(found[True] + found[False])
    if np.ptp(every) < MIN_RANGE:
        raise ConfigError(f"{path}: its {hand} hand moved {1e3 * np.ptp(every):.2g} mm, expected one that moved")
    return RecordedHand(tuple(found[True]), tuple(found[False]), digest.hexdigest())


def _smoothed(heights: NDArray[np.float64], cutoff_hz: float) -> NDArray[np.float64]:
    """Return the heights at intervals of `STEP_TICKS`, and the last one, low-passed without a delay [m]."""
    sections = butter(2, cutoff_hz, fs=1.0 / TICK_SECONDS, output="sos")
    smooth = sosfiltfilt(sections, heights, padlen=min(150, len(heights) - 1))
    kept = np.minimum(STEP_TICKS * np.arange(1 + ceil((len(heights) - 1) / STEP_TICKS)), len(heights) - 1)
    return np.asarray(smooth[kept], np.float64)
