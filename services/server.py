"""The physics server as a process."""

from collections.abc import Sequence

from netboard.base.config import Config
from netboard.base.process import Priority, Stopping, cpus_for, io_priority, prepare, speak
from netboard.network import keys
from netboard.network.transport import sockets
from netboard.nodes.server.attempts import Attempts
from netboard.nodes.server.blocks import BlockSequence
from netboard.nodes.server.server import Server
from netboard.services.planned import Planned, Wanted, agreed


def main(configs: Sequence[Config], *, autostart: bool = True) -> int:
    """Serve one block for each of these dyads.

    Parameters
    ----------
    configs : sequence of Config
        One for each dyad; the first one's real-time settings apply to the process.

    Returns
    -------
    int
        Exit code: 1 if records are not known to be on disk.
    """
    return serve([(BlockSequence([config]), Attempts()) for config in configs], autostart=autostart)


def study(config: Config, wanted: Wanted, *, autostart: bool, resume: bool, yes: bool) -> int:
    """Serve one session of a study."""
    planned = Planned(config, wanted)
    session = planned.resumed(agreed(yes)) if resume else planned.begun()
    return serve([session], autostart=autostart)


def serve(sessions: Sequence[tuple[BlockSequence, Attempts]], *, autostart: bool) -> int:
    """Serve sessions until all have ended; return 1 if records are not known to be on disk."""
    configs = [sequence.block.config for sequence, _ in sessions]
    authenticators = [keys.make_authenticator(config.network) for config in configs]
    speak("server")
    wanted = configs[0].realtime
    came = prepare(wanted, Priority.SERVER, cpus_for("server", wanted))
    above = io_priority(came, Priority.SERVER)
    network = sockets.open_context(above, apart=True, loop_priority=Priority.SERVER)
    with Stopping() as stopping, network as context:
        server = Server(sessions, context, authenticators, autostart=autostart)
        server.run(stopping, came)
    return 0 if server.everything_recorded else 1
