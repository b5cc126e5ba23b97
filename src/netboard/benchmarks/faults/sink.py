"""A process that receives an attacker's messages as the server does, and discards them.

An attack on this sink shows the load that the attack itself puts on the machine; the difference to an attack on the
server is the server's own work for the messages.

Run as ``python -m netboard.benchmarks.faults.sink CONFIG``; it prints its port, and exits when its input closes.
"""

import sys
import threading
import time
from dataclasses import replace
from pathlib import Path

from netboard.base.config import parse
from netboard.network import keys
from netboard.network.transport import channels, sockets
from netboard.network.transport.ports import free_port

MESSAGES_PER_TURN = 4
"""Messages received from each channel in a turn [1]."""

TICK_S = 1e-3
"""Time between turns, equal to the server's tick [s]."""


def main(file: Path) -> None:
    """Receive on every channel until the standard input closes."""
    config = parse(file.read_text(encoding="utf-8"), str(file))
    network = replace(config.network, port=free_port())
    authenticator = keys.make_authenticator(network)
    addresses = channels.addresses(network, authenticator)
    reader = threading.Thread(target=sys.stdin.read, daemon=True)
    reader.start()
    with sockets.open_context(apart=True) as context:
        routers = [
            serve(context, addresses.listen(channel))
            for serve, channel in (
                (sockets.motion_server, channels.MOTION),
                (sockets.log_server, channels.LOG),
                (sockets.control_server, channels.CONTROL),
            )
        ]
        print(network.port, flush=True)  # noqa: T201
        while reader.is_alive():
            if authenticator is not None:
                authenticator.answer_handshakes()
                authenticator.reports(time.monotonic_ns())
            for router in routers:
                for _ in range(MESSAGES_PER_TURN):
                    if router.receive() is None:
                        break
            time.sleep(TICK_S)


if __name__ == "__main__":
    main(Path(sys.argv[1]))
