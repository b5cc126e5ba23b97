"""``netboard status``: the state of a running session and of its peers."""

import json as jsonlib
from contextlib import nullcontext
from typing import TYPE_CHECKING, Annotated

import typer

from netboard.base.errors import NetboardError
from netboard.services.loading import load
from netboard.services.options import ConfigFile, Json, Overrides, examples

if TYPE_CHECKING:
    from netboard.base.tables.rig import Network
    from netboard.network.protocol.control import Status
    from netboard.nodes.operator.operator import Operator

app = typer.Typer()

ROUND_SECONDS = 1.2
"""Interval between two requests; rates and losses are those of a second [s]."""


@app.command(epilog=examples("netboard status", "netboard status --watch -c rig.toml", "netboard status --json"))
def status(
    config: ConfigFile = None,
    overrides: Overrides = None,
    watch: Annotated[
        bool,
        typer.Option(
            "--watch", help="Update until Ctrl-C, also while no server answers; with --json, one line for each answer."
        ),
    ] = False,
    json: Json = False,
) -> None:
    """Show a running session and its peers: connection, round-trip time, clock, rate, losses, version."""
    settings = load(config, overrides)
    from rich.live import Live
    from rich.text import Text

    from netboard.base.process.stopping import Stopping
    from netboard.base.terminal.output import plain_console
    from netboard.nodes.operator import shell
    from netboard.nodes.operator.status_table import status_tables

    console = plain_console()
    redrawn = watch and console.is_terminal and not json
    with Stopping() as stopping, shell.connected(settings.network) as operator:
        shell.status_of(operator, settings.network)
        with Live(console=console, auto_refresh=False) if redrawn else nullcontext() as live:
            while True:
                operator.attend(ROUND_SECONDS)
                answer = latest(operator, settings.network, keep_asking=watch)
                if live is not None:
                    live.update(Text(answer) if isinstance(answer, str) else status_tables(answer), refresh=True)
                elif isinstance(answer, str):
                    typer.echo(f"netboard: {answer}", err=True)
                elif json:
                    typer.echo(jsonlib.dumps(shell.plain(answer)))
                else:
                    console.print(status_tables(answer))
                if not watch or stopping():
                    return


def latest(operator: "Operator", network: "Network", *, keep_asking: bool) -> "Status | str":
    """Return the status; if there is none, raise an error, or return its text to `keep_asking`."""
    from netboard.nodes.operator import shell

    try:
        return shell.status_of(operator, network)
    except NetboardError as error:
        if not keep_asking:
            raise
        return str(error)
