"""TCP ports for the channels of a server: whether one is free, and a range of free ones."""

import random
import socket as net
from collections.abc import Iterator
from contextlib import contextmanager

from netboard.base.errors import NetboardError
from netboard.network.transport.channels import CHANNELS
from netboard.network.transport.local_endpoints import local_endpoints, set_exclusive


def try_to_bind(host: str, port: int) -> None:
    """Bind a port as a server would, and release it; raise an OSError if that fails."""
    host = _bound(host)
    with net.socket(_family(host)) as probe:
        set_exclusive(probe)
        probe.bind((host, port))


@contextmanager
def reserved(host: str, port: int) -> Iterator[None]:
    """Reserve a port for a server that is started within this context; raise an OSError if another process has it.

    The server binds the TCP port only seconds later. Until then the UDP port of this number is held, which netboard
    does not use otherwise.
    """
    host = _bound(host)
    with net.socket(_family(host), net.SOCK_DGRAM) as guard:
        guard.bind((host, port))
        yield


def _bound(host: str) -> str:
    """Return an address of the configuration as the system takes it."""
    return "" if host == "*" else host.strip("[]")


def _family(host: str) -> net.AddressFamily:
    return net.AF_INET6 if ":" in host else net.AF_INET


def free_port() -> int:
    """Return the first of enough consecutive free ports; no other process finds the same while this one lives.

    The ports are bound only later, by processes that are slow to start. Until then the port behind them is held.
    """
    count = len(CHANNELS)
    step = count + 1 + local_endpoints.ports
    ports = range(5550, 32_000, step)  # below those that Linux gives to outgoing connections, from 32 768 on
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
        guard.detach()  # left open, for the system to close with this process
        return port
    raise NetboardError(f"there are no {count} free ports in a row on this machine")
