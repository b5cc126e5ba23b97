"""``netboard console``: the operator's console."""

import typer

from netboard.services.loading import load
from netboard.services.options import ConfigFile, Offscreen, Overrides, Screenshot, ScreenshotDelay, Theme, examples

app = typer.Typer()


@app.command(epilog=examples("netboard console", "netboard console -c rig.toml", "netboard console --screenshot c.png"))
def console(
    config: ConfigFile = None,
    overrides: Overrides = None,
    screenshot: Screenshot = None,
    after: ScreenshotDelay = None,
    offscreen: Offscreen = False,
    theme: Theme = "system",
) -> None:
    """Open the operator's console: open, run, watch and stop a session."""
    settings = load(config, overrides)
    from netboard.base.process.display_server import choose_screen
    from netboard.base.process.realtime import leave_reserved_cpus
    from netboard.base.process.stopping import Stopping
    from netboard.base.terminal.logs import log_to_stderr

    log_to_stderr("console")
    leave_reserved_cpus(settings.realtime)
    choose_screen(offscreen)
    from netboard.windows.operator import client

    with Stopping() as stopping:
        client.run(settings, stopping, screenshot, after, theme)
