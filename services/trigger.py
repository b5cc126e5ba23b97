"""``netboard trigger``: TTL pulses for events of the session, by the trigger box at this machine."""

import logging

import typer

from netboard.base.errors import ConfigError
from netboard.services.loading import load
from netboard.services.options import ConfigFile, Overrides, examples

app = typer.Typer()
log = logging.getLogger(__name__)


@app.command(
    epilog=examples(
        "netboard trigger -c rig.toml",
        "netboard trigger --set triggers.kind=serial --set triggers.address=/dev/ttyACM0",
    )
)
def trigger(config: ConfigFile = None, overrides: Overrides = None) -> None:
    r"""Give TTL pulses for events of the session, by the trigger box at this machine (\[triggers])."""
    settings = load(config, overrides)
    from netboard.base.process.realtime import Priority, io_priority, leave_reserved_cpus, prepare
    from netboard.base.process.stopping import Stopping, no_terminal_suspension
    from netboard.base.terminal.logs import log_to_stderr
    from netboard.devices.triggers import registry
    from netboard.network.transport import sockets
    from netboard.nodes.trigger.node import TriggerLink, TriggerNode

    if not settings.triggers.declared:
        raise ConfigError(f'[triggers] kind: found "none", expected one of {", ".join(registry.names())}')
    registry.require_known(settings.triggers)
    log_to_stderr("trigger")
    leave_reserved_cpus(settings.realtime)
    granted = prepare(settings.realtime, Priority.TRIGGER, "")
    with (
        Stopping() as stopping,
        no_terminal_suspension(),
        sockets.open_context(io_priority(granted, Priority.TRIGGER)) as context,
    ):
        node = TriggerNode(registry.make(settings.triggers), TriggerLink(settings.network, context))
        node.run(stopping)
    log.info("%d pulses made, %d failed", node.made, node.failed)
