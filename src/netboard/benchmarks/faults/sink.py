"""A sink: a process that takes what an attacker sends as the server does, and does nothing else.

The same attack on a sink beside the dyad shows what the attack costs the machine; the rest is what it costs the server.

Run as ``python -m netboard.benchmarks.faults.sink CONFIG``; it prints its port, and ends when its input does.
"""

import sys
import threading
import time
from dataclasses import replace
from pathlib import Path

from netboard.base.config import parse
from netboard.network import keys
from netboard.network.transport import channels, sockets
from netboard.nodes.operator.launcher import free_port

TURN = 4
"""Messages taken from each channel in a turn [1]."""

TURN_S = 1e-3
"""Time between turns, that of a tick [s]."""


def main(file: Path) -> None:
    """Serve the channels until the input ends."""
    config = parse(file.read_text(encoding="utf-8"), str(file))
    network = replace(config.network, port=free_port())
    authenticator = keys.make_authenticator(network)
    where = channels.addresses(network, authenticator)
    reader = threading.Thread(target=sys.stdin.read, daemon=True)
    reader.start()
    with sockets.open_context(apart=True) as context:
        routers = [
            serve(context, where.listen(channel))
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
                for _ in range(TURN):
                    if router.receive() is None:
                        break
            time.sleep(TURN_S)


if __name__ == "__main__":
    main(Path(sys.argv[1]))
