"""``netboard lsl``: streams for the Lab Streaming Layer (LSL)."""

import logging
from typing import Annotated

import typer

from netboard.services.loading import load
from netboard.services.options import ConfigFile, Overrides, examples

app = typer.Typer()
log = logging.getLogger(__name__)


@app.command(epilog=examples("netboard lsl -c rig.toml", "netboard lsl -c b.toml --name pair2"))
def lsl(
    config: ConfigFile = None,
    overrides: Overrides = None,
    name: Annotated[
        str, typer.Option(help="Prefix of the stream names; choose another one for each dyad in the same network.")
    ] = "netboard",
) -> None:
    """Stream board, hands, forces and events to the Lab Streaming Layer (LSL), for example for LabRecorder."""
    settings = load(config, overrides)
    from netboard.base.process.realtime import leave_reserved_cpus
    from netboard.base.process.stopping import Stopping
    from netboard.base.terminal.logs import log_to_stderr
    from netboard.network.transport import sockets
    from netboard.nodes.logger.log_link import SocketLink
    from netboard.nodes.logger.lsl_outlets import Outlets
    from netboard.nodes.logger.subscriber import Subscriber

    log_to_stderr("lsl")
    leave_reserved_cpus(settings.realtime)
    outlets = Outlets(name, settings.network.port)
    with Stopping() as stopping, sockets.open_context() as context:
        subscriber = Subscriber(SocketLink(settings.network, "listener", context), outlets, "Lab Streaming Layer")
        subscriber.run(stopping)
    log.info("%d ticks and %d events sent, %d records lost", outlets.ticks, outlets.events, subscriber.lost)
