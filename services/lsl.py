"""The streams of the Lab Streaming Layer (LSL) as a process."""

import logging

from netboard.base.config import Config
from netboard.base.process import Stopping, make_way, speak
from netboard.network.transport import sockets
from netboard.nodes.logger.log_link import SocketLink
from netboard.nodes.logger.lsl_outlets import Outlets
from netboard.nodes.logger.subscriber import Listener

log = logging.getLogger(__name__)


def main(config: Config, name: str) -> int:
    """Send ticks and events to LSL until stopped."""
    speak("lsl")
    make_way(config.realtime)
    outlets = Outlets(name, config.network.port)
    with Stopping() as stopping, sockets.open_context() as context:
        listener = Listener(SocketLink(config.network, "listener", context), outlets, "Lab Streaming Layer")
        listener.run(stopping)
    log.info("%d ticks and %d events sent, %d records lost", outlets.ticks, outlets.events, listener.lost)
    return 0
