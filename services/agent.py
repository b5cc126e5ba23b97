"""The haptic agent as a process: one device, for one hand."""

from netboard.base.config import Config, Side
from netboard.base.process import Priority, Stopping, cpus_for, io_priority, prepare, speak
from netboard.devices.contract import registry
from netboard.network.transport import sockets
from netboard.nodes.agent.agent import Agent
from netboard.nodes.agent.stylus_source import companion_of


def main(config: Config, *, side: Side) -> int:
    """Serve one device until stopped."""
    speak(f"agent {side}")
    came = prepare(config.realtime, Priority.AGENT, cpus_for(side, config.realtime))
    with (
        Stopping() as stopping,
        sockets.open_context(io_priority(came, Priority.AGENT)) as context,
        registry.make(side, config) as device,
    ):
        Agent(config, side, device, context, companion_of(config, device, context)).run(stopping)
    return 0
