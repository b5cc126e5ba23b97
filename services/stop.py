"""``netboard stop``: the emergency stop, at once or when a key is pressed."""

from typing import TYPE_CHECKING, Annotated

import typer

from netboard.base.errors import ConfigError, NetboardError
from netboard.services.loading import load
from netboard.services.options import ConfigFile, Overrides, examples

if TYPE_CHECKING:
    from netboard.base.tables.rig import Network
    from netboard.nodes.operator.operator import Operator

app = typer.Typer()

POLL_INTERVAL_S = 0.05
"""Interval at which the keyboard is checked [s]."""


@app.command(
    epilog=examples("netboard stop", "netboard stop --guard -c rig.toml", "netboard stop --release"),
)
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
    from rich.console import Console

    from netboard.nodes.operator import shell
    from netboard.nodes.ports import emergency

    console = Console(highlight=False)
    with shell.connected(settings.network) as operator:
        if guard and not key_pressed(operator, settings.network):
            return
        shell.carry_out(operator, settings.network, emergency.RELEASE if release else emergency.STOP)
    if release:
        console.print("The emergency stop is released. To continue: netboard control resume")
    else:
        console.print("[bold red]EMERGENCY STOP[/]: all forces are zero. To release it: netboard stop --release")


def key_pressed(operator: "Operator", network: "Network") -> bool:
    """Wait until a key is pressed; return False if the process is asked to end."""
    from netboard.base.process import Stopping
    from netboard.nodes.operator.keyboard import Keyboard
    from netboard.nodes.operator.shell import status_of

    with Keyboard() as keyboard, Stopping() as stopping:
        if not keyboard.there:
            raise NetboardError("--guard: needs a terminal, because it waits for a key")
        typer.echo("Ready: press ANY KEY for the emergency stop. Ctrl-C leaves without stopping.")
        while not stopping():
            if keyboard.pressed(POLL_INTERVAL_S) is not None:
                return True
            status_of(operator, network)
    return False
