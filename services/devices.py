"""``netboard devices``: the devices of a rig, one at a time and without a server.

A command that moves a device says so first, and waits for a typed sentence or ``--yes``.
"""

from functools import partial
from pathlib import Path
from typing import Annotated

import typer

from netboard.services.loading import load
from netboard.services.options import ConfigFile, HandSide, Json, Overrides, examples

app = typer.Typer(
    name="devices",
    help="List, test, identify, watch and calibrate haptic devices, without a server.",
    no_args_is_help=True,
)

Yes = Annotated[bool, typer.Option("--yes", help="Do not ask; everybody at the device has agreed.")]
Replace = Annotated[bool, typer.Option("--replace", help="Keep no backup (.bak) of the previous profile.")]


@app.command("list", epilog=examples("netboard devices list", "netboard devices list --json"))
def list_(config: ConfigFile = None, overrides: Overrides = None, json: Json = False) -> None:
    """List the connected devices by serial number, whether they can be opened, and the available backends."""
    settings = load(config, overrides)
    from netboard.nodes.operator import device_commands as commands

    raise typer.Exit(commands.show_list(settings, as_json=json))


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
    yes: Yes = False,
    json: Json = False,
) -> None:
    """Measure rate, jitter, resolution, noise, range and buttons of a device; with --force, also its response time.

    Meanwhile move the stylus, press each button, and put the stylus down for a second.
    """
    settings = load(config, overrides)
    from netboard.nodes.operator import device_commands as commands

    raise typer.Exit(commands.examine(settings, side, seconds=seconds, force=force, yes=yes, as_json=json))


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
        bool,
        typer.Option("--held", help="A hand holds the stylus: identify both together; write no profile."),
    ] = False,
    yes: Yes = False,
    replace: Replace = False,
    json: Json = False,
) -> None:
    """Identify a device's mass, damping and friction by moving it gently, and write them to its profile."""
    settings = load(config, overrides)
    from netboard.nodes.operator import device_commands as commands

    raise typer.Exit(commands.identify(settings, side, held=held, yes=yes, replace_it=replace, as_json=json))


@app.command(
    epilog=examples(
        "netboard devices monitor --side left -c rig.toml",
        "netboard devices monitor --side left --text",
    )
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
) -> None:
    """Show position, velocity and buttons of a device live, in scene coordinates, without force."""
    settings = load(config, overrides)
    from netboard.nodes.operator import device_commands as commands

    if text:
        commands.monitor(settings, side, seconds, commands.print_readings)
    else:
        from netboard.windows.monitor import run

        commands.monitor(settings, side, seconds, partial(run, picture=screenshot))


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
    replace: Replace = False,
) -> None:
    """Find the neutral height, the workspace and the scale of a device, and write them to its profile."""
    from netboard.nodes.operator import device_commands as commands

    given, others = commands.placement_values(overrides or ())
    settings = load(config, others)
    raise typer.Exit(commands.calibrate(settings, side, zero_only=zero_only, yes=yes, given=given, replace_it=replace))
