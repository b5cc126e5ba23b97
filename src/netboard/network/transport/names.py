"""Names of servers, resolved in a thread, because a name server may take seconds to answer, or start later.

libzmq would resolve a name by itself: silently, to one address, and of IPv4 only, as long as IPv6 is off. Here each
failure has its reason, which is logged at once and then now and then while somebody asks. A name may have several
addresses, such as of IPv6 and IPv4; a peer tries one after the other. A link-local address with its interface
(``fe80::1%eth0``) is resolved like a name, because the interface may appear later.
"""

import ipaddress
import logging
import socket as net
import time
from functools import cache
from threading import Event, Thread
from typing import Any

from netboard.base.process.realtime import beside_loop

log = logging.getLogger(__name__)

FIRST_S = 1.0
"""Time that a first connection waits for a name to be resolved [s]."""

RETRY_S = 2.0
"""Shortest time between two attempts to resolve a name [s]."""

REPEAT_S = 30.0
"""Time after which the log repeats why a name cannot be resolved [s]."""


class Name:
    """The name of a machine, and its addresses as soon as they are known."""

    def __init__(self, host: str) -> None:
        self.host = host
        self.addresses: tuple[str, ...] = ()  # IPv4 first
        self.trouble = ""  # why there are none
        self._logged = -REPEAT_S
        self._tried, self._asked = Event(), Event()
        Thread(target=self._work, name="names", daemon=True).start()

    def wait(self) -> None:
        """Wait for the first attempt, for `FIRST_S` at most."""
        self._tried.wait(FIRST_S)

    def ask_again(self) -> None:
        """Let the thread look the name up again: nothing answers at its addresses, or there are none yet."""
        self._asked.set()

    def _work(self) -> None:
        while True:
            beside_loop()
            self._look_up()
            self._tried.set()
            time.sleep(RETRY_S)
            self._asked.wait()
            self._asked.clear()

    def _look_up(self) -> None:
        """Look the name up; keep the addresses that are known if it cannot be resolved now."""
        try:
            self.addresses, before = addresses_of(self.host), self.trouble
            self.trouble = ""
            if before:
                log.info("%r is %s now", self.host, ", ".join(self.addresses))
        except OSError as error:
            self.trouble = "" if self.addresses else unresolved(self.host, error, "host")
            self._log_now_and_then()

    def _log_now_and_then(self) -> None:
        now = time.monotonic()
        if self.trouble and now - self._logged >= REPEAT_S:
            self._logged = now
            log.info("%s; it is tried again", self.trouble)


def addresses_of(host: str) -> tuple[str, ...]:
    """Return the addresses of a name, IPv4 first; raise an OSError if it has none."""
    try:
        found = net.getaddrinfo(host, None, type=net.SOCK_STREAM)
    except UnicodeError as error:  # such as two dots in a row
        raise OSError(0, "it is not a valid name") from error
    found.sort(key=lambda entry: entry[0] != net.AF_INET)
    return tuple(dict.fromkeys(_with_interface(entry[4]) for entry in found))


def _with_interface(address: tuple[Any, ...]) -> str:
    """Return an address of the system as libzmq takes it: a link-local one with its interface, by name or number."""
    host, _, *rest = address
    scope = rest[1] if len(rest) > 1 else 0
    if not scope or "%" in host:
        return str(host)
    name = net.if_indextoname(scope)
    return f"{host}%{name if name[0].isalpha() else scope}"


def unresolved(host: str, error: OSError, key: str) -> str:
    """Return in words that a name cannot be resolved; ``key``: the setting that has it."""
    advice = f"check [network] {key}"
    if "%" in host:
        advice += ", and that this machine has that network interface"
    return f"cannot resolve {host!r}: {error.strerror or error}; {advice}"


def is_numeric(host: str) -> bool:
    """Tell whether an address needs no resolving: it is one of IPv4 or IPv6, and names no interface."""
    try:
        return "%" not in host and bool(ipaddress.ip_address(host))
    except ValueError:
        return False


def is_loopback(address: str) -> bool:
    """Tell whether no other machine can reach a numeric address."""
    return ipaddress.ip_address(address).is_loopback


@cache
def known(host: str) -> Name:
    """Return the name, which all sockets of this process share."""
    return Name(host)


def trouble(host: str) -> str:
    """Return why a server's name cannot be resolved, in words; empty if it can, or needs no resolving."""
    return "" if is_numeric(host.strip("[]")) else known(host.strip("[]")).trouble
