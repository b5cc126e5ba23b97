"""The physics server as a process."""

from netboard import sockets
from netboard.config import Config
from netboard.nodes.server import Server
from netboard.process import Stopping, lock_memory, real_time, speak

PRIORITY = 60


def main(config: Config, *, autostart: bool = True) -> int:
    """Serve one session.

    Parameters
    ----------
    config : Config
        Rig and experiment.
    autostart : bool
        Start the block as soon as everything is there.

    Returns
    -------
    int
        Exit code: 1 if records are not known to be on disk.
    """
    speak("server")
    real_time(PRIORITY)
    lock_memory()
    with Stopping() as stopping, sockets.open_context() as context:
        server = Server(config, context, autostart=autostart)
        server.run(stopping)
    return 0 if server.everything_recorded else 1
