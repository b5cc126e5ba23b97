"""``netboard display``: a participant's display, and information on the screens."""

from typing import TYPE_CHECKING, Annotated

import typer

from netboard.base.errors import ConfigError
from netboard.services.loading import load
from netboard.services.options import ConfigFile, Offscreen, Overrides, Screenshot, ScreenshotDelay, Side, examples

if TYPE_CHECKING:
    from netboard.base.config import Config

app = typer.Typer()


@app.command(
    epilog=examples(
        "netboard display --station left",
        "netboard display --station right --offscreen --screenshot r.png",
        "netboard display --calibrate --set display.screen=1",
    )
)
def display(
    station: Annotated[Side | None, typer.Option(help="Seat of the participant.")] = None,
    config: ConfigFile = None,
    overrides: Overrides = None,
    screenshot: Screenshot = None,
    after: ScreenshotDelay = None,
    offscreen: Offscreen = False,
    list_screens: Annotated[
        bool, typer.Option("--list-screens", help="List the screens of this computer, and stop.")
    ] = False,
    calibrate: Annotated[
        bool, typer.Option("--calibrate", help="Measure the pixel size of the screen with a bank card, and stop.")
    ] = False,
) -> None:
    """Run a participant's display: board, ball, target and the participant's own stylus."""
    settings = load(config, overrides)
    if station is None and not (list_screens or calibrate):
        raise ConfigError("--station: not given, expected left or right")
    from netboard.base.process.display_server import choose_screen

    choose_screen(offscreen)
    if list_screens:
        print_screens()
        return
    if calibrate:
        raise typer.Exit(measure_pixels(settings))
    assert station is not None
    from netboard.base.config import played_sides
    from netboard.base.process.realtime import leave_reserved_cpus
    from netboard.base.process.stopping import Stopping
    from netboard.base.terminal.logs import log_to_stderr

    log_to_stderr(f"display {station}")
    leave_reserved_cpus(settings.realtime)
    from netboard.windows.participant import client

    play: client.Play | None = None
    if station in played_sides(settings):
        from netboard.windows.participant.playing import Playing

        play = Playing
    with Stopping() as stopping:
        client.run(settings, station, stopping, screenshot, after, play)


def print_screens() -> None:
    """Print the screens of this computer, by their numbers for ``[display] screen``."""
    from netboard.windows.participant.window import application, in_words, screens

    application()
    for number, screen in enumerate(screens()):
        typer.echo(in_words(number, screen))


def measure_pixels(config: "Config") -> int:
    """Measure the pixel size of the chosen screen with a bank card, and print the settings for the configuration."""
    from netboard.windows.participant.screen_size import calibrate

    size, screen = calibrate(config.display.screen)
    typer.echo(f"screen {screen}")
    if size is None:
        typer.echo("not calibrated: the window was closed before Enter was pressed")
        return 1
    typer.echo(f"[display]\nscreen = {config.display.screen}\nmm_per_pixel = {size:.4f}")
    return 0
