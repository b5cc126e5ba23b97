"""Addresses of the channels."""

import sys

import pytest

from netboard.base.tables.rig import Network
from netboard.network import keys
from netboard.network.transport import authenticator, channels


def test_channels_have_consecutive_ports() -> None:
    where = channels.addresses(Network(host="10.0.0.1", bind="0.0.0.0", port=6000))
    assert where.listen(channels.MOTION).address == "tcp://0.0.0.0:6000"
    assert where.reach(channels.CONTROL).address == "tcp://10.0.0.1:6004"
    assert {channels.VIEW["left"], channels.VIEW["right"]} == {2, 3}
    assert channels.PARTNER == {"left": 6, "right": 7}
    assert len(channels.CHANNELS) == 8


@pytest.mark.parametrize("host", ["fe80::1%eth0", "[fe80::1%eth0]"])
def test_ipv6_address_is_in_brackets_before_its_port(host: str) -> None:
    where = channels.addresses(Network(host=host, bind="::", port=6000))
    assert where.reach(channels.MOTION).address == "tcp://[fe80::1%eth0]:6000"
    assert where.listen(channels.LOG).address == "tcp://[::]:6001"


@pytest.mark.parametrize(
    ("address", "local"),
    [("127.0.0.1", True), ("localhost", True), ("::1", True), ("[::1]", True), ("::", False), ("10.0.0.1", False)],
)
def test_only_loopback_addresses_are_local(address: str, local: bool) -> None:
    assert keys.local(address) is local


def test_moves_channel_is_local_and_has_no_keys() -> None:
    credentials = authenticator.Credentials("p" * 40, "s" * 40, "q" * 40)
    where = channels.addresses(Network(host="10.0.0.1", bind="0.0.0.0", port=6000), credentials)
    for moves in (where.listen(channels.MOVES), where.reach(channels.MOVES)):
        assert moves == channels.Endpoint("tcp://127.0.0.1:6005", channels.MOVES)
    assert where.reach(channels.LOG).security is credentials
    assert "ssss" not in repr(credentials)


@pytest.mark.skipif(sys.platform == "win32", reason="Unix domain sockets")
def test_pointer_and_force_channels_are_local_and_use_no_port() -> None:
    credentials = authenticator.Credentials("p" * 40, "s" * 40, "q" * 40)
    for transport in ("tcp", "ipc"):
        network = Network(host="10.0.0.1", bind="0.0.0.0", port=6000, transport=transport)  # type: ignore[arg-type]
        where = channels.addresses(network, credentials)
        ends = [end(side) for end in (where.pointer, where.felt) for side in ("left", "right")]
        assert all(end.address.startswith("ipc:///tmp/netboard-") and end.security is None for end in ends)
        assert len({end.address for end in ends}) == 4
