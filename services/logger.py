"""The logger as a process."""

from netboard.base.config import Config
from netboard.base.process import Stopping, make_way, speak
from netboard.network.transport import sockets
from netboard.nodes.logger.log_link import SocketLink
from netboard.nodes.logger.logger import Logger


def main(config: Config, *, once: bool = False) -> int:
    """Record until stopped."""
    speak("logger")
    make_way(config.realtime)
    with Stopping() as stopping, sockets.open_context() as context:
        return Logger(config.recording, SocketLink(config.network, "logger", context), once=once).run(stopping)
