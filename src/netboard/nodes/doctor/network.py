"""Checks of the machine's network: how well clocks can be compared, and whether ports and keys are in order.

Two sockets of this process exchange stamps over loopback, through ZeroMQ, as server and agents do over the network.
Both ends use one clock, so the offset found must be 0 within the bound. Between machines no bound can be smaller.
"""

import array
import errno
import socket as net
import struct
import time
from collections.abc import Callable
from pathlib import Path
from typing import TypeVar

from netboard.base.clock import now_ns
from netboard.base.errors import ConfigError, NetboardError
from netboard.base.finding import Finding, text_of
from netboard.base.system.device_files import ioctl
from netboard.base.tables.rig import Network
from netboard.network import keys
from netboard.network.protocol.clock_estimator import ClockEstimator
from netboard.network.transport import channels, poller, sockets
from netboard.network.transport.ports import free_port, try_to_bind

LOOPBACK = "127.0.0.1"
POLL_TIMEOUT_NS = 5_000_000_000
"""Timeout for one frame over loopback [ns]."""

NET = Path("/sys/class/net")
SIOCETHTOOL, ETHTOOL_GCOALESCE, COALESCE_WORDS = 0x8946, 0x0E, 23
"""Linux's request for a network card's interrupt coalescing, and the 32-bit words of the answer."""

T = TypeVar("T")


def clock_bound(network: Network, exchanges: int, progress: Callable[[float], None]) -> Finding:
    """Compare the clock of this machine with itself, over loopback."""
    name = "clock bound"
    estimator = compare(exchanges, progress)
    offset_us, bound_us = estimator.offset_ns / 1000, estimator.bound_ns / 1000
    found = f"offset to itself {offset_us:+.1f} us, with an error of up to {bound_us:.1f} us"
    figures = {"offset_us": offset_us, "bound_us": bound_us}
    if abs(offset_us) > bound_us:
        return Finding(
            name, "red", found, "the clock jumps: look for a faulty virtual machine or clock source", figures
        )
    if bound_us > network.clock_bound_ms * 1000:
        return Finding(name, "red", found, f"devices are armed below {network.clock_bound_ms:g} ms only", figures)
    return Finding(name, "green", found, figures=figures)


def compare(exchanges: int, progress: Callable[[float], None]) -> ClockEstimator:
    """Exchange stamps between two sockets of this process."""
    where = channels.addresses(Network(host=LOOPBACK, bind=LOOPBACK, port=free_port()))
    estimator = ClockEstimator()
    with sockets.open_context() as context:
        server = sockets.control_server(context, where.listen(channels.CONTROL))
        peer = sockets.control_client(context, where.reach(channels.CONTROL), "doctor")
        at_server, at_peer = poller.Waiter((server.socket,)), poller.Waiter((peer,))
        for number in range(exchanges):
            _send_when_connected(peer, b"hello")
            name = _received(at_server, server.receive)[0]
            t0 = now_ns()
            server.send(name, b"ping")
            _received(at_peer, lambda: sockets.receive(peer))
            t1 = now_ns()
            sockets.send(peer, b"pong")
            _received(at_server, server.receive)
            estimator.add(t0, t1, t1, now_ns())
            progress((number + 1) / exchanges)
    return estimator


def _send_when_connected(peer: sockets.Socket, frame: bytes) -> None:
    """Send as soon as a peer is connected."""
    until = now_ns() + POLL_TIMEOUT_NS
    while not sockets.send(peer, frame):
        if now_ns() > until:
            raise NetboardError(f"no connection over loopback within {POLL_TIMEOUT_NS * 1e-9:g} s")
        time.sleep(0.001)


def _received(waiter: poller.Waiter, receive: Callable[[], T | None]) -> T:
    """Wait for the next result of `receive`, and return it."""
    received = receive() if waiter.wait(POLL_TIMEOUT_NS * 1e-9) else None
    if received is None:
        raise NetboardError(f"a frame did not arrive over loopback within {POLL_TIMEOUT_NS * 1e-9:g} s")
    return received


def ports(network: Network) -> Finding:
    """Check whether a server could listen here."""
    name = "ports"
    if network.transport != "tcp":
        return Finding(name, "green", f"none needed: transport is {network.transport}")
    numbers = range(network.port, network.port + len(channels.CHANNELS))
    found = f"{network.bind}:{numbers[0]}-{numbers[-1]}"
    for number in numbers:
        try:
            try_to_bind(network.bind, number)
        except OSError as error:
            if error.errno == errno.EADDRNOTAVAIL:
                return Finding(
                    name, "green", f"{network.bind} is the address of another machine, so no server listens here"
                )
            advice = "is a server running? else choose another [network] port"
            return Finding(name, "yellow", f"{network.bind}:{number}: {error.strerror}", advice)
    return Finding(name, "green", f"{found} are free")


def is_alone(network: Network) -> bool:
    """Return whether no other machine takes part."""
    return keys.local(network.bind) and keys.local(network.host)


def secrets(network: Network) -> Finding:
    """Check whether the required keys are here, and only their owner can read them."""
    name = "keys"
    if not keys.encrypted(network):
        if is_alone(network):
            return Finding(name, "green", "none needed within one machine")
        return Finding(name, "yellow", "switched off", 'with [network] curve = "on" every peer needs a key')
    folder = Path(network.keys)
    try:
        found = [file for file, _, _ in keys.key_files(folder)]
    except ConfigError as error:
        return Finding(name, "red", str(error), "only the owner may read the keys")
    if not found:
        advice = "at the server: netboard keys init; at a station: bring the files that netboard keys add made for it"
        return Finding(name, "red", f"none in {folder}", advice)
    return Finding(name, "green", f"{', '.join(found)} in {folder}")


def card(network: Network, folder: Path = NET, delay_us: Callable[[str], int | None] | None = None) -> Finding:
    """Check whether the network cards delay frames: wireless ones, and those that collect interrupts."""
    name = "network card"
    if network.transport != "tcp" or is_alone(network):
        return Finding(name, "green", "none in use: server and agents share this machine")
    cards = [device.parent for device in sorted(folder.glob("*/device"))]
    up = [card for card in cards if text_of(card / "operstate") == "up"]
    if wireless := [card.name for card in up if (card / "wireless").exists()]:
        return Finding(name, "yellow", f"{', '.join(wireless)}: wireless", "connect server and agents by cable")
    delays = {card.name: (delay_us or coalescing_us)(card.name) for card in up}
    found = ", ".join(f"{card}: {'?' if us is None else us} us" for card, us in delays.items())
    if slow := [card for card, us in delays.items() if us]:
        advice = "; ".join(f"ethtool -C {card} rx-usecs 0" for card in slow)
        return Finding(name, "yellow", f"interrupts are delayed: {found}", advice)
    return Finding(name, "green", f"delay of interrupts: {found}" if found else "no network card is up")


def coalescing_us(card: str) -> int | None:
    """Return by how much a card may delay the interrupt of a received frame [us]; None if it does not say."""
    words = array.array("I", [ETHTOOL_GCOALESCE] + [0] * (COALESCE_WORDS - 1))
    request = struct.pack("16sP", card.encode(), words.buffer_info()[0])
    try:
        with net.socket(net.AF_INET, net.SOCK_DGRAM) as probe:
            ioctl(probe.fileno(), SIOCETHTOOL, request)
    except OSError:
        return None
    return words[1]
