"""Addresses to which sockets are bound and connected: their parts, names of this machine, and whether one is free."""

import errno
import socket as net
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager

import zmq
from zmq import ZMQError

from netboard.base.errors import NetboardError
from netboard.network.transport.channels import Endpoint
from netboard.network.transport.local_endpoints import local_endpoints
from netboard.network.transport.names import addresses_of, is_loopback, is_numeric, unresolved
from netboard.network.transport.ports import reserved, try_to_bind

IN_USE = frozenset({errno.EADDRINUSE, int(zmq.EADDRINUSE)})
"""Error numbers of an address that another process has: Python's and libzmq's, which differ on Windows."""


def local_address(address: str) -> str:
    """Return the address to bind, with a name of this machine resolved: libzmq would not."""
    host, port = host_and_port(address)
    if not host or host == "*" or is_numeric(host) or _is_interface(host):
        return address
    try:
        found = addresses_of(host)[0]
    except OSError as error:
        raise NetboardError(unresolved(host, error, "bind")) from error
    if is_loopback(found) and host != "localhost":
        raise NetboardError(
            f"cannot listen on {host!r}: it is {found} here, which no other machine can reach; "
            "write the address of this machine's network card in [network] bind"
        )
    return url_of(found, port)


def _is_interface(name: str) -> bool:
    """Tell whether a name is that of a network interface, whose address libzmq finds."""
    try:
        return bool(net.if_nametoindex(name))
    except OSError:
        return False


def host_and_port(address: str) -> tuple[str, str]:
    """Return the machine and the port of a TCP address, or two empty texts."""
    host, _, port = address.removeprefix("tcp://").rpartition(":")
    return (host.strip("[]"), port) if address.startswith("tcp://") else ("", "")


def url_of(host: str, port: str) -> str:
    """Return a TCP address; that of IPv6 in brackets."""
    return f"tcp://[{host}]:{port}" if ":" in host else f"tcp://{host}:{port}"


@contextmanager
def free_address(endpoint: Endpoint) -> Iterator[None]:
    """Hold an address while its server and other processes are started, which would join another server's session.

    Raises `NetboardError` if another server listens there, or is being started in the same way.
    """
    with ExitStack() as held:
        try:
            refuse_taken(endpoint.address)
            if endpoint.address.startswith("tcp://"):
                host, _, port = endpoint.address.removeprefix("tcp://").rpartition(":")
                try_to_bind(host, int(port))
                held.enter_context(reserved(host, int(port)))
        except (OSError, ZMQError) as error:
            if error.errno in IN_USE:
                raise NetboardError(
                    f"another server listens on {endpoint.address}, perhaps another user's; "
                    "end it, or choose another [network] port"
                ) from error
            # The server itself reports any other error of the address.
        yield


def is_ipv6(address: str) -> bool:
    """Return whether an address is of IPv6."""
    return address.startswith("tcp://[")


def refuse_taken(address: str) -> None:
    """Raise an error if somebody listens at an address that libzmq would take over silently."""
    if local_endpoints.is_taken(address):
        raise ZMQError(zmq.EADDRINUSE)
