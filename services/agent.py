"""An agent as a process: one device, for one hand."""

from netboard import sockets
from netboard.config import Config, Side
from netboard.devices import registry
from netboard.nodes.agent import Agent
from netboard.nodes.companion import companion_of
from netboard.process import Priority, Stopping, cpus_for, io_priority, prepare, speak


def main(config: Config, *, side: Side) -> int:
    """Serve one device until told to stop."""
    speak(f"agent {side}")
    came = prepare(config.realtime, Priority.AGENT, cpus_for(side, config.realtime))
    with (
        Stopping() as stopping,
        sockets.open_context(io_priority(came, Priority.AGENT)) as context,
        registry.make(side, config) as device,
    ):
        Agent(config, side, device, context, companion_of(config, device, context)).run(stopping)
    return 0
