"""``netboard devices identify``: mass, damping and friction of a device, from its motion."""

from typing import Annotated

import typer

from netboard.services.loading import load
from netboard.services.options import Agreed, ConfigFile, HandSide, Json, Overrides, ReplaceProfile, examples

app = typer.Typer()


@app.command(
    epilog=examples(
        "netboard devices identify --side left -c rig.toml", "netboard devices identify --side left -c rig.toml --held"
    )
)
def identify(
    side: HandSide,
    config: ConfigFile = None,
    overrides: Overrides = None,
    held: Annotated[
        bool, typer.Option("--held", help="A hand holds the stylus: identify both together; write no profile.")
    ] = False,
    yes: Agreed = False,
    replace: ReplaceProfile = False,
    json: Json = False,
) -> None:
    """Identify a device's mass, damping and friction by moving it gently, and write them to its profile."""
    settings = load(config, overrides)
    from netboard.nodes.operator import device_commands as commands

    raise typer.Exit(commands.identify(settings, side, held=held, yes=yes, replace_it=replace, as_json=json))
