"""The devices of a rig, one at a time and without a server: ``netboard devices``.

A command that moves a device says so first, and waits for a typed sentence or ``--yes``.
"""

from pathlib import Path
from typing import Annotated

import typer

from netboard.base.config import Side
from netboard.services import configuration
from netboard.services.configuration import ConfigFile, Overrides

app = typer.Typer(
    help="List, test, identify, watch and calibrate haptic devices, without a server.",
    no_args_is_help=True,
)

Whose = Annotated[Side, typer.Option(help="The hand this device is for.")]
Json = Annotated[bool, typer.Option("--json", help="Print one line of JSON.")]
Yes = Annotated[bool, typer.Option("--yes", help="Do not ask: the person at the device has agreed.")]
Replace = Annotated[bool, typer.Option("--replace", help="Do not keep a copy (.bak) of the previous profile.")]


@app.command("list", epilog="Examples:\n\n  netboard devices list\n\n  netboard devices list --json")
def list_(config: ConfigFile = None, overrides: Overrides = None, json: Json = False) -> None:
    """List the connected devices by serial number, whether they may be opened, and the available backends."""
    settings = configuration.load(config, overrides or ())
    from netboard.services import rig as service

    raise typer.Exit(service.show_list(settings, as_json=json))


@app.command(
    "test",
    epilog="Examples:\n\n  netboard devices test --side left -c rig.toml\n\n"
    "  netboard devices test --side left -c rig.toml --force 0.3",
)
def examine(
    side: Whose,
    config: ConfigFile = None,
    overrides: Overrides = None,
    seconds: Annotated[float, typer.Option(min=2.0, max=600.0, help="Duration of the reading (s).")] = 10.0,
    force: Annotated[
        float,
        typer.Option(
            min=0.0, max=1.0, metavar="N", help="Force of the push that measures the response time; 0: no force."
        ),
    ] = 0.0,
    yes: Yes = False,
    json: Json = False,
) -> None:
    """Measure a device's rate, jitter, resolution, noise, range and buttons; with --force, also its response time.

    Move the stylus while the device is read, press each button, and lay the stylus down for a second.
    """
    settings = configuration.load(config, overrides or ())
    from netboard.services import rig as service

    raise typer.Exit(service.examine(settings, side, seconds=seconds, force=force, yes=yes, as_json=json))


@app.command(
    epilog="Examples:\n\n  netboard devices identify --side left -c rig.toml\n\n"
    "  netboard devices identify --side left -c rig.toml --held"
)
def identify(
    side: Whose,
    config: ConfigFile = None,
    overrides: Overrides = None,
    held: Annotated[
        bool, typer.Option("--held", help="A hand holds the stylus: show the dynamics of both, and write no profile.")
    ] = False,
    yes: Yes = False,
    replace: Replace = False,
    json: Json = False,
) -> None:
    """Identify a device's mass, damping and friction by moving it gently, and write them to its profile."""
    settings = configuration.load(config, overrides or ())
    from netboard.services import rig as service

    raise typer.Exit(service.identify(settings, side, held=held, yes=yes, replace_it=replace, as_json=json))


@app.command(
    epilog="Examples:\n\n  netboard devices monitor --side left -c rig.toml\n\n"
    "  netboard devices monitor --side left --text"
)
def monitor(
    side: Whose,
    config: ConfigFile = None,
    overrides: Overrides = None,
    text: Annotated[bool, typer.Option("--text", help="In the terminal, without a window.")] = False,
    seconds: Annotated[float | None, typer.Option(min=0.1, help="Stop after this time (s).")] = None,
    screenshot: Annotated[
        Path | None, typer.Option(metavar="FILE", help="Save the window as a PNG file when it ends.")
    ] = None,
) -> None:
    """Show position, velocity and buttons of a device live, in the scene's frame, without force."""
    settings = configuration.load(config, overrides or ())
    from netboard.services import rig as service

    raise typer.Exit(service.monitor(settings, side, text=text, screenshot=screenshot, seconds=seconds))


@app.command(
    epilog="Examples:\n\n  netboard devices calibrate --side left -c rig.toml\n\n"
    "  netboard devices calibrate --side left --zero-only\n\n"
    "  netboard devices calibrate --side left --set placement.zero_z=0.02"
)
def calibrate(
    side: Whose,
    config: ConfigFile = None,
    overrides: Annotated[
        list[str] | None,
        typer.Option(
            "--set",
            metavar="TABLE.KEY=VALUE",
            help="Set a profile value (placement.zero_z=0.02) instead of measuring it, or override one setting of "
            "the configuration; repeatable.",
        ),
    ] = None,
    zero_only: Annotated[bool, typer.Option("--zero-only", help="Only the neutral height.")] = False,
    yes: Annotated[
        bool, typer.Option("--yes", help="Wait five seconds before each position instead of asking.")
    ] = False,
    replace: Replace = False,
) -> None:
    """Find the neutral height, the workspace and the scale of a device, and write them to its profile."""
    from netboard.services import rig as service

    given, others = service.placement_values(overrides or ())
    settings = configuration.load(config, others)
    raise typer.Exit(service.calibrate(settings, side, zero_only=zero_only, yes=yes, given=given, replace_it=replace))
