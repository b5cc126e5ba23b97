"""``netboard stop``: the emergency stop, at once or when a key is pressed."""

from typing import Annotated

import typer

from netboard.base.errors import ConfigError
from netboard.services.loading import load
from netboard.services.options import ConfigFile, Overrides, examples

app = typer.Typer()


@app.command(epilog=examples("netboard stop", "netboard stop --guard -c rig.toml", "netboard stop --release"))
def stop(
    config: ConfigFile = None,
    overrides: Overrides = None,
    release: Annotated[
        bool, typer.Option("--release", help="Release the emergency stop: devices may be armed again.")
    ] = False,
    guard: Annotated[bool, typer.Option("--guard", help="Connect now, and stop when any key is pressed.")] = False,
) -> None:
    """Emergency stop: set all commanded forces to zero until it is released.

    With --guard the program is already connected and acts within a millisecond; without, it has to start first.
    """
    if release and guard:
        raise ConfigError("--release and --guard: expected one of them")
    settings = load(config, overrides)
    from netboard.base.terminal.output import plain_console
    from netboard.nodes.operator import shell
    from netboard.nodes.operator.guard import guard as wait_and_stop
    from netboard.nodes.ports import emergency

    console = plain_console()
    with shell.connected(settings.network) as operator:
        if guard and not wait_and_stop(operator, settings.network, typer.echo):
            return
        if release:
            reply = shell.carry_out(operator, settings.network, emergency.RELEASE)
            status = shell.status_after(operator, settings.network, reply)
        elif not guard:
            shell.emergency_stop(operator, settings.network)
    if release:
        command = "resume" if status is not None and status.phase == "paused" else "start"
        console.print(f"{reply.reason}. To continue: netboard control {command}")
    else:
        console.print("EMERGENCY STOP", style="bold red", end="")
        console.print(": all forces are zero. To release it: netboard stop --release")
