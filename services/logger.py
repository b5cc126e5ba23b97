"""``netboard logger``: writes the recordings."""

from typing import Annotated

import typer

from netboard.services.loading import load
from netboard.services.options import ConfigFile, Overrides, examples

app = typer.Typer()

ORPHANED_S = 15.0
"""How long the logger goes on if `netboard up` was killed, so that it takes the server's last records [s]."""


@app.command(epilog=examples("netboard logger", "netboard logger --set recording.directory=/data --once"))
def logger(
    config: ConfigFile = None,
    overrides: Overrides = None,
    once: Annotated[bool, typer.Option("--once", help="Stop after one session.")] = False,
) -> None:
    """Run the logger: it writes every tick and event to a recording."""
    settings = load(config, overrides)
    from netboard.base.process.realtime import leave_reserved_cpus
    from netboard.base.process.stopping import Stopping
    from netboard.base.terminal.logs import log_to_stderr
    from netboard.network.transport import sockets
    from netboard.nodes.logger.log_link import SocketLink
    from netboard.nodes.logger.logger import Logger

    log_to_stderr("logger")
    leave_reserved_cpus(settings.realtime)
    with Stopping(ORPHANED_S) as stopping, sockets.open_context() as context:
        link = SocketLink(settings.network, "logger", context)
        raise typer.Exit(Logger(settings.recording, link, once=once).run(stopping))
