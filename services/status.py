"""Asks a running server for its status, and shows it."""

import json
import time
from dataclasses import asdict
from math import isnan

from rich.console import Console
from rich.live import Live

from netboard.base.config import Config
from netboard.base.errors import NetboardError
from netboard.base.process import Stopping
from netboard.network.protocol.control import Status
from netboard.network.transport import sockets
from netboard.nodes.operator.operator import Operator
from netboard.nodes.operator.status_table import status_tables

ANSWER_SECONDS = 3.0
ROUND_SECONDS = 1.2
"""Interval between two requests; rates and losses are those of a second [s]."""


def main(config: Config, *, watch: bool, as_json: bool) -> int:
    """Show every peer of a session: link, round-trip time, clock, rate, losses, version."""
    console = Console(highlight=False)
    with Stopping() as stopping, sockets.open_context() as context:
        operator = Operator(config.network, context)
        try:
            asked(operator, config)
            operator.attend(ROUND_SECONDS)
            status = asked(operator, config)
            if as_json:
                print(json.dumps(plain(status)))  # noqa: T201
            elif not watch:
                console.print(status_tables(status))
            else:
                with Live(status_tables(status), console=console, auto_refresh=False) as live:
                    while not stopping():
                        operator.attend(ROUND_SECONDS)
                        live.update(status_tables(asked(operator, config)), refresh=True)
        finally:
            operator.leave()
    return 0


def asked(operator: Operator, config: Config) -> Status:
    """Return the status, asking until the server answers or the timeout."""
    until = time.monotonic() + ANSWER_SECONDS
    while time.monotonic() < until:
        status = operator.ask(0.2)
        if status is not None:
            return status
    where = f"{config.network.host}:{config.network.port}"
    raise NetboardError(
        f"no server answers at {where} within {ANSWER_SECONDS:.0f} s; is it running, and is that its port?"
    )


def plain(status: Status) -> dict[str, object]:
    """Return the status for JSON: links as objects, unknown values as null."""
    names = ("peer", "name", "version", "age", "round_trip", "clock_bound", "drift_ppm", "rate", "lost")
    links = [
        {
            name: None if isinstance(value, float) and isnan(value) else value
            for name, value in zip(names, link, strict=True)
        }
        for link in status.links
    ]
    loops = [
        {"peer": peer, "late": None if isnan(late) else late, "limit": limit} for peer, late, limit in status.loops
    ]
    return {**asdict(status), "links": links, "loops": loops}
