"""The operator's console as a process."""

import os
from pathlib import Path

from netboard.base.config import Config
from netboard.base.process import Stopping, make_way, speak


def main(config: Config, *, screenshot: Path | None = None, after: float | None = None, offscreen: bool = False) -> int:
    """Show the operator's console until it is closed or the process is stopped.

    Parameters
    ----------
    after : float or None
        Time of the screenshot after the server's first message [s]; None takes it at once and stops.
    """
    speak("console")
    make_way(config.realtime)
    if offscreen:
        os.environ["QT_QPA_PLATFORM"] = "offscreen"
    from netboard.windows.operator import client

    with Stopping() as stopping:
        client.run(config, stopping, screenshot, after)
    return 0
