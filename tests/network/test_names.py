"""Servers that are reached by name: reasons of failures, retries, IPv6, and link-local addresses."""

import logging
import re
import socket as net
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

from netboard.base.errors import NetboardError
from netboard.base.tables.rig import Network
from netboard.network.transport import addresses, channels, names, sockets
from netboard.network.transport.ports import free_port, try_to_bind
from waiting import until

pytestmark = pytest.mark.integration


class NameServer:
    """Stands for the system's look-up of names; a name without entry is unknown."""

    def __init__(self) -> None:
        self.entries: dict[str, tuple[str, ...]] = {}
        self.asked = 0

    def __call__(self, host: str) -> tuple[str, ...]:
        self.asked += 1
        if host in self.entries:
            return self.entries[host]
        raise net.gaierror(net.EAI_NONAME, "Name or service not known")


@pytest.fixture
def name_server(monkeypatch: pytest.MonkeyPatch) -> NameServer:
    made = NameServer()
    monkeypatch.setattr(names, "addresses_of", made)
    monkeypatch.setattr(addresses, "addresses_of", made)
    monkeypatch.setattr(names, "RETRY_S", 0.01)
    monkeypatch.setattr(sockets, "RENEW_S", 0.02)
    names.known.cache_clear()
    return made


class Channel:
    """A server and an agent of the motion channel, at the ends of an address."""

    def __init__(self, context: sockets.Context) -> None:
        self._context = context
        self.server: Any = None
        self.agent: Any = None

    def listen(self, where: channels.Addresses) -> None:
        self.server = sockets.motion_server(self._context, where.listen(channels.MOTION))

    def connect(self, where: channels.Addresses) -> None:
        self.agent = sockets.motion_agent(self._context, where.reach(channels.MOTION), "agent.left@test")

    def meets(self) -> bool:
        until(lambda: sockets.send_or_renew(self.agent, b"hello"))
        return bool(until(self.server.receive) == (b"agent.left@test", b"hello"))


@pytest.fixture
def channel() -> Iterator[Channel]:
    with sockets.open_context() as context:
        yield Channel(context)
        context.destroy(linger=0)


def at(host: str, port: int, *, bind: str = "127.0.0.1") -> channels.Addresses:
    return channels.addresses(Network(host=host, bind=bind, port=port))


def require_ipv6() -> None:
    try:
        try_to_bind("::1", free_port())
    except OSError:
        pytest.skip("this machine has no IPv6")


def test_unknown_name_is_named_with_its_reason_and_a_peer_goes_on_trying(
    name_server: NameServer, channel: Channel, caplog: pytest.LogCaptureFixture
) -> None:
    caplog.set_level(logging.INFO)
    where = at("sever1", free_port())
    channel.connect(where)
    said = "cannot resolve 'sever1': Name or service not known; check [network] host"
    assert until(lambda: names.trouble("sever1")) == said
    assert until(lambda: not sockets.send_or_renew(channel.agent, b"hello") and name_server.asked > 5)
    assert caplog.messages == [f"{said}; it is tried again"]
    channel.listen(where)
    name_server.entries["sever1"] = ("127.0.0.1",)
    assert channel.meets()
    assert names.trouble("sever1") == ""
    assert caplog.messages[1:] == ["'sever1' is 127.0.0.1 now"]


def test_reason_is_repeated_at_intervals(
    name_server: NameServer, caplog: pytest.LogCaptureFixture, monkeypatch: pytest.MonkeyPatch
) -> None:
    caplog.set_level(logging.INFO)
    monkeypatch.setattr(names, "REPEAT_S", 0.0)
    name = names.known("sever1")
    assert until(lambda: name.ask_again() or len(caplog.messages) > 3)
    assert len(set(caplog.messages)) == 1


def test_resolved_name_survives_a_failure_of_the_name_server(name_server: NameServer) -> None:
    name_server.entries["server"] = ("127.0.0.1",)
    name = names.known("server")
    assert until(lambda: name.addresses)
    name_server.entries.clear()
    asked = name_server.asked
    assert until(lambda: name.ask_again() or name_server.asked > asked + 1)
    assert (name.addresses, name.trouble) == (("127.0.0.1",), "")


@pytest.mark.parametrize("addresses", [("::1",), ("127.0.0.1", "::1"), ("192.0.2.1", "::1")])
def test_name_with_an_address_of_ipv6_is_reached(
    name_server: NameServer, channel: Channel, addresses: tuple[str, ...]
) -> None:
    """Also if nobody listens at its first address."""
    require_ipv6()
    name_server.entries["server"] = addresses
    where = at("server", free_port(), bind="::1")
    channel.listen(where)
    channel.connect(where)
    assert channel.meets()


def test_server_listens_at_a_name(name_server: NameServer, channel: Channel) -> None:
    name_server.entries["localhost"] = ("127.0.0.1",)
    where = at("localhost", free_port(), bind="localhost")
    channel.listen(where)
    channel.connect(where)
    assert channel.meets()


@pytest.mark.parametrize(
    ("bind", "said"),
    [
        ("sever1", r"^cannot resolve 'sever1': Name or service not known; check \[network\] bind$"),
        ("lab1", r"^cannot listen on 'lab1': it is 127\.0\.1\.1 here, which no other machine can reach; write"),
        ("192.0.2.77", r"^cannot listen on tcp://192\.0\.2\.77:\d+: Cannot assign .*; check \[network\] bind"),
        ("fe80::1%nonet0", r"^cannot resolve 'fe80::1%nonet0': .*\[network\] bind, and that this machine has that"),
    ],
)
def test_server_that_cannot_listen_says_why(name_server: NameServer, channel: Channel, bind: str, said: str) -> None:
    name_server.entries["lab1"] = ("127.0.1.1",)
    with pytest.raises(NetboardError, match=said):
        channel.listen(at("127.0.0.1", free_port(), bind=bind))


def link_local() -> str:
    """Return a link-local address of this machine, with its interface."""
    listed = Path("/proc/net/if_inet6")
    for line in listed.read_text(encoding="ascii").splitlines() if listed.exists() else ():
        digits, *_, interface = line.split()
        if digits.startswith("fe80"):
            return ":".join(digits[k : k + 4] for k in range(0, 32, 4)) + f"%{interface}"
    pytest.skip("this machine has no link-local address")


def test_link_local_address_with_its_interface_is_reached(channel: Channel) -> None:
    address = link_local()
    names.known.cache_clear()
    where = at(address, free_port(), bind=address)
    channel.listen(where)
    channel.connect(where)
    assert channel.meets()


@pytest.mark.parametrize(("host", "reason"), [("a..b", "not a valid name"), ("fe80::1%nonet0", "check .*interface")])
def test_host_that_is_no_name_is_told_from_one_that_is_unknown(host: str, reason: str) -> None:
    names.known.cache_clear()
    names.known(host)
    assert re.search(reason, until(lambda: names.trouble(host)))


@pytest.mark.parametrize(
    ("host", "numeric"),
    [("127.0.0.1", True), ("::1", True), ("fe80::1%eth0", False), ("localhost", False), ("1.2.3", False)],
)
def test_only_complete_addresses_need_no_resolving(host: str, numeric: bool) -> None:
    assert names.is_numeric(host) is numeric
