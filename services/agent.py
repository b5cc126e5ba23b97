"""An agent as a process: one device, for one hand."""

from netboard import sockets
from netboard.config import Config, Side
from netboard.devices import registry
from netboard.devices.virtual import VirtualTouch
from netboard.nodes.agent import Agent
from netboard.nodes.companion import companion_of
from netboard.process import Stopping, lock_memory, real_time, speak

PRIORITY = 50


def main(config: Config, *, side: Side) -> int:
    """Serve one device until told to stop.

    Parameters
    ----------
    config : Config
        Rig and experiment.
    side : str
        ``left`` or ``right``.

    Returns
    -------
    int
        Exit code.
    """
    speak(f"agent {side}")
    real_time(PRIORITY)
    lock_memory()
    with Stopping() as stopping, sockets.open_context() as context, registry.make(side, config) as device:
        companion = companion_of(config, device, context) if isinstance(device, VirtualTouch) else None
        Agent(config, side, device, context, companion).run(stopping)
    return 0
