"""``netboard status``: the state of a running session and of its peers."""

import json as jsonlib
from typing import Annotated

import typer

from netboard.services.loading import load
from netboard.services.options import ConfigFile, Json, Overrides, examples

app = typer.Typer()

ROUND_SECONDS = 1.2
"""Interval between two requests; rates and losses are those of a second [s]."""


@app.command(
    epilog=examples("netboard status", "netboard status --watch -c rig.toml", "netboard status --json"),
)
def status(
    config: ConfigFile = None,
    overrides: Overrides = None,
    watch: Annotated[bool, typer.Option("--watch", help="Update until Ctrl-C; with --json, one line each.")] = False,
    json: Json = False,
) -> None:
    """Show a running session and its peers: connection, round-trip time, clock, rate, losses, version."""
    settings = load(config, overrides)
    from rich.console import Console
    from rich.live import Live

    from netboard.base.process import Stopping
    from netboard.nodes.operator import shell
    from netboard.nodes.operator.status_table import status_tables

    console = Console(highlight=False)
    with Stopping() as stopping, shell.connected(settings.network) as operator:
        shell.status_of(operator, settings.network)
        operator.attend(ROUND_SECONDS)
        answer = shell.status_of(operator, settings.network)
        if watch and console.is_terminal and not json:
            with Live(status_tables(answer), console=console, auto_refresh=False) as live:
                while not stopping():
                    operator.attend(ROUND_SECONDS)
                    live.update(status_tables(shell.status_of(operator, settings.network)), refresh=True)
            return
        while True:
            if json:
                typer.echo(jsonlib.dumps(shell.plain(answer)))
            else:
                console.print(status_tables(answer))
            if not watch or stopping():
                return
            operator.attend(ROUND_SECONDS)
            answer = shell.status_of(operator, settings.network)
