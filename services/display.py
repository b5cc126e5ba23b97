"""A participant's display as a process, and information on the screens."""

import os
from pathlib import Path

from netboard.base.config import Config, Side, played_sides
from netboard.base.process import Stopping, make_way, speak


def main(
    config: Config,
    *,
    station: Side,
    screenshot: Path | None = None,
    after: float | None = None,
    offscreen: bool = False,
) -> int:
    """Show one station's view until the window is closed or the process is stopped; a player's input moves the stylus.

    Parameters
    ----------
    after : float or None
        Time of the screenshot after the first view [s]; None takes the first view and stops.
    """
    speak(f"display {station}")
    make_way(config.realtime)
    if offscreen:
        os.environ["QT_QPA_PLATFORM"] = "offscreen"
    from netboard.windows.participant import client

    play: client.Play | None = None
    if station in played_sides(config):
        from netboard.windows.participant.playing import Playing

        play = Playing
    with Stopping() as stopping:
        client.run(config, station, stopping, screenshot, after, play)
    return 0


def list_screens() -> int:
    """Print the screens of this machine, by their numbers for ``[display] screen``."""
    from netboard.windows.participant.window import application, in_words, screens

    application()
    for number, screen in enumerate(screens()):
        print(in_words(number, screen))  # noqa: T201  (what was asked for)
    return 0


def calibrate(config: Config) -> int:
    """Measure the pixel size of the chosen screen with a bank card, and print the settings for the configuration."""
    from netboard.windows.participant.screen_size import calibrate as measure

    size, screen = measure(config.display.screen)
    print(f"screen {screen}")  # noqa: T201  (what was asked for)
    if size is None:
        print("not calibrated: the window was closed before Enter was pressed")  # noqa: T201
        return 1
    print(f"[display]\nscreen = {config.display.screen}\nmm_per_pixel = {size:.4f}")  # noqa: T201
    return 0
