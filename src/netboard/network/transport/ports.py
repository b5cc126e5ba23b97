"""Free TCP ports for the channels of a server."""

import random
import socket as net

from netboard.base.errors import NetboardError
from netboard.network.transport.channels import CHANNELS

_guards: list[net.socket] = []
"""Sockets that reserve the ranges of ports which this process has found free."""


def free_port() -> int:
    """Return the first of enough consecutive free ports; no other process finds the same while this one lives.

    The ports are bound only later, by processes that are slow to start. Until then the port behind them is held.
    """
    count = len(CHANNELS)
    ports = range(5550, 32_000, count + 1)
    for port in random.sample(ports, len(ports)):
        guard = net.socket()
        try:
            guard.bind(("127.0.0.1", port + count))
            for channel in range(count):
                with net.socket() as probe:
                    probe.bind(("127.0.0.1", port + channel))
        except OSError:
            guard.close()
            continue
        _guards.append(guard)
        return port
    raise NetboardError(f"there are no {count} free ports in a row on this machine")
