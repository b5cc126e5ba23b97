"""``netboard devices calibrate``: neutral height, workspace and scale of a device."""

from typing import Annotated

import typer

from netboard.base.errors import ConfigError
from netboard.services.loading import load
from netboard.services.options import ConfigFile, HandSide, ReplaceProfile, examples

app = typer.Typer()


@app.command(
    epilog=examples(
        "netboard devices calibrate --side left -c rig.toml",
        "netboard devices calibrate --side left --zero-only",
        "netboard devices calibrate --side left --set placement.zero_z=0.02",
    )
)
def calibrate(
    side: HandSide,
    config: ConfigFile = None,
    overrides: Annotated[
        list[str] | None,
        typer.Option(
            "--set",
            metavar="TABLE.KEY=VALUE",
            help="Set a value of the profile (placement.zero_z=0.02) instead of measuring it, or override one setting "
            "of the configuration; repeat for several.",
        ),
    ] = None,
    zero_only: Annotated[bool, typer.Option("--zero-only", help="Measure only the neutral height.")] = False,
    yes: Annotated[bool, typer.Option("--yes", help="Do not ask; wait five seconds before each position.")] = False,
    replace: ReplaceProfile = False,
) -> None:
    """Find the neutral height, the workspace and the scale of a device, and write them to its profile."""
    from netboard.nodes.operator import device_commands as commands

    given, others = commands.placement_values(overrides or ())
    if given and zero_only:
        raise ConfigError("devices calibrate: found --zero-only and --set placement., expected one of them")
    settings = load(config, others)
    raise typer.Exit(commands.calibrate(settings, side, zero_only=zero_only, yes=yes, given=given, replace_it=replace))
