"""``netboard devices test``: the measured properties of a device."""

from typing import Annotated

import typer

from netboard.services.loading import load
from netboard.services.options import Agreed, ConfigFile, HandSide, Json, Overrides, examples

app = typer.Typer()


@app.command(
    "test",
    epilog=examples(
        "netboard devices test --side left -c rig.toml", "netboard devices test --side left -c rig.toml --force 0.3"
    ),
)
def examine(
    side: HandSide,
    config: ConfigFile = None,
    overrides: Overrides = None,
    seconds: Annotated[float, typer.Option(min=2.0, max=600.0, help="Duration in seconds.")] = 10.0,
    force: Annotated[
        float, typer.Option(min=0.0, max=1.0, metavar="N", help="Force of the test pushes in N; 0: none.")
    ] = 0.0,
    yes: Agreed = False,
    json: Json = False,
) -> None:
    """Measure rate, jitter, resolution, noise, range and buttons of a device; with --force, also its response time.

    Meanwhile move the stylus, press each button, and put the stylus down for a second.
    """
    settings = load(config, overrides)
    from netboard.nodes.operator import device_commands as commands

    raise typer.Exit(commands.examine(settings, side, seconds=seconds, force=force, yes=yes, as_json=json))
