"""The operator's window as a process."""

import os
from pathlib import Path

from netboard.base.config import Config
from netboard.base.process import Stopping, make_way, speak


def main(config: Config, *, screenshot: Path | None = None, after: float | None = None, offscreen: bool = False) -> int:
    """Show the operator's window until it is closed or the process is told to stop.

    Parameters
    ----------
    after : float or None
        When it is taken, after the server's first word [s]; None takes it then and stops.
    """
    speak("console")
    make_way(config.realtime)
    if offscreen:
        os.environ["QT_QPA_PLATFORM"] = "offscreen"
    from netboard.windows.operator import client

    with Stopping() as stopping:
        client.run(config, stopping, screenshot, after)
    return 0
