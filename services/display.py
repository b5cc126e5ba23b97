"""A participant's display as a process."""

import os
from pathlib import Path

from netboard.config import Config, Side
from netboard.process import Stopping, make_way, speak


def main(
    config: Config,
    *,
    station: Side,
    screenshot: Path | None = None,
    after: float | None = None,
    offscreen: bool = False,
) -> int:
    """Show one station's view until the window is closed or the process is told to stop.

    Parameters
    ----------
    config : Config
        Rig and experiment.
    station : str
        ``left`` or ``right``.
    screenshot : Path or None
        Where a picture goes.
    after : float or None
        When it is taken, after the first view [s]; None takes the first view and stops.
    offscreen : bool
        Draw without a screen.

    Returns
    -------
    int
        Exit code.
    """
    speak(f"display {station}")
    make_way(config.realtime)
    if offscreen:
        os.environ["QT_QPA_PLATFORM"] = "offscreen"
    from netboard.display import client

    with Stopping() as stopping:
        client.run(config, station, stopping, screenshot, after)
    return 0
