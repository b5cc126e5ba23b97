"""The physics server as a process."""

from collections.abc import Sequence

from netboard import keys, sockets
from netboard.config import Config
from netboard.nodes.server import Server
from netboard.process import Priority, Stopping, cpus_for, io_priority, prepare, speak


def main(configs: Sequence[Config], *, autostart: bool = True) -> int:
    """Serve one session of each of some dyads.

    Parameters
    ----------
    configs : sequence of Config
        One for each dyad; what the process asks of its machine is that of the first.
    autostart : bool
        Start each block as soon as everything is there.

    Returns
    -------
    int
        Exit code: 1 if records are not known to be on disk.
    """
    doors = [keys.door(config.network) for config in configs]
    speak("server")
    wanted = configs[0].realtime
    came = prepare(wanted, Priority.SERVER, cpus_for("server", wanted))
    with Stopping() as stopping, sockets.open_context(io_priority(came, Priority.SERVER)) as context:
        server = Server(configs, context, doors, autostart=autostart)
        server.run(stopping, came)
    return 0 if server.everything_recorded else 1
