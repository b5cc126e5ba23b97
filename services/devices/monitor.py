"""``netboard devices monitor``: the readings of a device, live."""

from functools import partial
from pathlib import Path
from typing import Annotated

import typer

from netboard.base.errors import ConfigError
from netboard.services.loading import load
from netboard.services.options import ConfigFile, HandSide, Offscreen, Overrides, Theme, examples

app = typer.Typer()


@app.command(
    epilog=examples("netboard devices monitor --side left -c rig.toml", "netboard devices monitor --side left --text")
)
def monitor(
    side: HandSide,
    config: ConfigFile = None,
    overrides: Overrides = None,
    text: Annotated[bool, typer.Option("--text", help="Print to the terminal instead of opening a window.")] = False,
    seconds: Annotated[float | None, typer.Option(min=0.1, help="Stop after this many seconds.")] = None,
    screenshot: Annotated[
        Path | None, typer.Option(metavar="FILE", help="Save the window as a PNG file at the end.")
    ] = None,
    offscreen: Offscreen = False,
    theme: Theme = "system",
) -> None:
    """Show position, velocity and buttons of a device live, in scene coordinates, without force."""
    for name, given in (
        ("--screenshot", screenshot is not None),
        ("--offscreen", offscreen),
        ("--theme", theme != "system"),
    ):
        if text and given:
            raise ConfigError(f"devices monitor: found --text and {name}, expected one of them")
    settings = load(config, overrides)
    from netboard.nodes.operator import device_commands as commands

    if text:
        commands.monitor(settings, side, seconds, commands.print_readings)
    else:
        from netboard.base.process.display_server import choose_screen

        choose_screen(offscreen)
        from netboard.windows.monitor import run

        commands.monitor(settings, side, seconds, partial(run, picture=screenshot, theme=theme))
