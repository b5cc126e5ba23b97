"""A recording proves itself: its inputs, run through the stage of its own configuration, give its ticks again."""

from netboard.config import parse
from netboard.errors import RecordingError
from netboard.recording.reader import Recording
from netboard.stage import Verdict, make_stage, verify


def verify_recording(recording: Recording) -> Verdict:
    """Compute every tick of an open recording again and compare it to the bit.

    Parameters
    ----------
    recording : Recording
        The recording.

    Returns
    -------
    Verdict
        Identical, or where and how not.

    Raises
    ------
    RecordingError
        If it cannot be read or has no tick: nothing would be proved.
    ConfigError
        If its configuration is not one of this version.
    """
    ticks = recording.ticks()
    if not len(ticks):
        raise RecordingError(f"{recording.path}: has no tick to verify")
    return verify(make_stage(parse(recording.config_text, str(recording.path))), ticks)
