"""From the file of a recording to what can be played. The one module of the package that reads files."""

from pathlib import Path

from netboard.recording.reader import Recording
from netboard.replay.reel import Material, Reel


def load(path: Path) -> Reel:
    """Read a recording, all of it.

    Parameters
    ----------
    path : Path
        The file.

    Raises
    ------
    RecordingError
        If it cannot be read, or has no tick.
    ConfigError
        If its configuration cannot be read.
    """
    with Recording(path) as recording:
        return Reel(Material(path.name, recording.config_text, recording.ticks(), recording.events()))
