"""``netboard status``: the state of a running session and of its peers."""

import json as jsonlib
import time
from dataclasses import asdict
from math import isnan
from typing import TYPE_CHECKING, Annotated

import typer

from netboard.base.errors import NetboardError
from netboard.services.options import OPERATE, ConfigFile, Json, Overrides, examples, load

if TYPE_CHECKING:
    from netboard.base.config import Config
    from netboard.network.protocol.control import Status
    from netboard.nodes.operator.operator import Operator

app = typer.Typer()

ANSWER_SECONDS = 3.0
ROUND_SECONDS = 1.2
"""Interval between two requests; rates and losses are those of a second [s]."""


@app.command(
    rich_help_panel=OPERATE,
    epilog=examples("netboard status", "netboard status --watch -c rig.toml", "netboard status --json"),
)
def status(
    config: ConfigFile = None,
    overrides: Overrides = None,
    watch: Annotated[bool, typer.Option("--watch", help="Update until Ctrl-C.")] = False,
    json: Json = False,
) -> None:
    """Show a running session and its peers: connection, round-trip time, clock, rate, losses, version."""
    settings = load(config, overrides)
    from rich.console import Console
    from rich.live import Live

    from netboard.base.process import Stopping
    from netboard.network.transport import sockets
    from netboard.nodes.operator.operator import Operator
    from netboard.nodes.operator.status_table import status_tables

    console = Console(highlight=False)
    with Stopping() as stopping, sockets.open_context() as context:
        operator = Operator(settings.network, context)
        try:
            asked(operator, settings)
            operator.attend(ROUND_SECONDS)
            answer = asked(operator, settings)
            if json:
                typer.echo(jsonlib.dumps(plain(answer)))
            elif not watch:
                console.print(status_tables(answer))
            else:
                with Live(status_tables(answer), console=console, auto_refresh=False) as live:
                    while not stopping():
                        operator.attend(ROUND_SECONDS)
                        live.update(status_tables(asked(operator, settings)), refresh=True)
        finally:
            operator.leave()


def asked(operator: "Operator", config: "Config") -> "Status":
    """Return the status; ask until the server answers or the timeout."""
    until = time.monotonic() + ANSWER_SECONDS
    while time.monotonic() < until:
        answer = operator.ask(0.2)
        if answer is not None:
            return answer
    where = f"{config.network.host}:{config.network.port}"
    raise NetboardError(
        f"no server answers at {where} within {ANSWER_SECONDS:.0f} s; check that it is running and uses this address"
    )


def plain(status: "Status") -> dict[str, object]:
    """Return the status for JSON: links as objects, unknown values as null."""
    names = ("peer", "name", "version", "age", "round_trip", "clock_bound", "drift_ppm", "rate", "lost")
    links = [{name: _known(value) for name, value in zip(names, link, strict=True)} for link in status.links]
    loops = [{"peer": peer, "late": _known(late), "limit": limit} for peer, late, limit in status.loops]
    return {**asdict(status), "links": links, "loops": loops}


def _known(value: object) -> object:
    """Return None for NaN, which JSON does not have."""
    return None if isinstance(value, float) and isnan(value) else value
