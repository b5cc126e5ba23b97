"""``netboard agent``: one device, for one hand."""

import logging

import typer

from netboard.services.loading import load
from netboard.services.options import ConfigFile, HandSide, Overrides, RobotPartnerName, examples, partner_settings

app = typer.Typer()
log = logging.getLogger(__name__)


@app.command(
    epilog=examples(
        "netboard agent --side left",
        "netboard agent --side right -c rig.toml",
        "netboard agent --side right --partner robot",
    )
)
def agent(
    side: HandSide, config: ConfigFile = None, overrides: Overrides = None, partner: RobotPartnerName = None
) -> None:
    """Run the agent of one device: it reads the stylus, and renders the force within safety limits."""
    settings = load(config, [*partner_settings(side, partner), *(overrides or ())])
    backend = settings.agents.of(side).device
    from netboard.base.device_kind import WORDS
    from netboard.base.process.realtime import Priority, cpus_for, io_priority, prepare
    from netboard.base.process.stopping import Stopping, no_terminal_suspension
    from netboard.base.terminal.logs import log_to_stderr
    from netboard.devices.contract import registry
    from netboard.network.transport import sockets
    from netboard.nodes.agent.agent import AgentNode
    from netboard.nodes.agent.stylus_source import stylus_source_of

    log_to_stderr(f"agent {side}")
    log.info("%s hand: %s (backend %s)", side, WORDS[registry.kind_of(backend)], backend)
    granted = prepare(settings.realtime, Priority.AGENT, cpus_for(side, settings.realtime))
    with (
        Stopping() as stopping,
        no_terminal_suspension(),
        sockets.open_context(io_priority(granted, Priority.AGENT)) as context,
        registry.make(side, settings) as device,
    ):
        AgentNode(settings, side, device, context, stylus_source_of(settings, device, context)).run(stopping)
