"""The logger as a process."""

from netboard import sockets
from netboard.config import Config
from netboard.nodes.log_link import SocketLink
from netboard.nodes.logger import Logger
from netboard.process import Stopping, make_way, speak


def main(config: Config, *, once: bool = False) -> int:
    """Record until told to stop."""
    speak("logger")
    make_way(config.realtime)
    with Stopping() as stopping, sockets.open_context() as context:
        return Logger(config.recording, SocketLink(config.network, "logger", context), once=once).run(stopping)
