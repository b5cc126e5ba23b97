"""Real links between stations and server: network namespaces on this machine, joined by virtual Ethernet pairs.

Each station has a namespace with its own address. The server and the thread that entered `Namespaces` are in a third
one, separate from the machine's network. To pull a cable, its interface is set down: the kernel behaves on both sides
as with a real cable. This requires the right to create namespaces (`refusal`).
"""

import ctypes
import os
import shutil
import subprocess
from contextlib import ExitStack
from pathlib import Path
from typing import Self

from netboard.base.config import SIDES, Side
from netboard.base.errors import NetboardError
from netboard.benchmarks.harness.rig import Route

SERVER = "10.213.0.1"
_CURRENT_NAMESPACE = Path("/proc/thread-self/ns/net")
_CLONE_NEWNET = 0x4000_0000
_TEST_COMMAND = "ip link add cable0 type veth peer name cable1"


def refusal() -> str:
    """Return why this machine cannot provide such links, or an empty string."""
    if not _CURRENT_NAMESPACE.exists() or shutil.which("ip") is None or shutil.which("unshare") is None:
        return "this machine has no network namespaces, or no ip command"
    tried = subprocess.run(["unshare", "-n", "sh", "-c", _TEST_COMMAND], capture_output=True, text=True, check=False)
    return f"namespaces are not permitted ({tried.stderr.strip()})" if tried.returncode else ""


class Namespaces:
    """Puts this thread and the processes it starts into a network of their own, with a cable to each station."""

    def __init__(self) -> None:
        self._names = {side: f"netboard-{os.getpid()}-{side}" for side in SIDES}
        self._stack = ExitStack()

    def __enter__(self) -> Self:
        with self._stack:
            before = self._stack.enter_context(_CURRENT_NAMESPACE.open("rb"))
            _call("unshare", _CLONE_NEWNET)
            self._stack.callback(_call, "setns", before.fileno(), _CLONE_NEWNET)
            _ip("link set lo up")
            _ip(f"addr add {SERVER}/32 dev lo")
            for number, side in enumerate(SIDES, start=1):
                self._lay_cable(side, f"10.213.{number}")
            self._stack = self._stack.pop_all()
        return self

    def __exit__(self, *raised: object) -> None:
        self._stack.close()

    def route(self, side: Side, port: int) -> Route:
        """Return the route of a process at a station to a port of the server."""
        return Route(SERVER, port, ("ip", "netns", "exec", self._names[side]))

    def pull(self, side: Side) -> None:
        """Pull the cable of a station."""
        _ip(f"link set {side} down")

    def plug(self, side: Side) -> None:
        """Plug the cable of a station in again."""
        _ip(f"link set {side} up")

    def _lay_cable(self, side: Side, net: str) -> None:
        name = self._names[side]
        _ip(f"netns add {name}")
        self._stack.callback(_ip, f"netns del {name}")
        _ip(f"link add {side} type veth peer name cable netns {name}")
        _ip(f"addr add {net}.1/30 dev {side}")
        _ip(f"link set {side} up")
        _ip(f"-n {name} addr add {net}.2/30 dev cable")
        _ip(f"-n {name} link set lo up")
        _ip(f"-n {name} link set cable up")
        _ip(f"-n {name} route add default via {net}.1")


def _ip(arguments: str) -> None:
    run_command("ip", *arguments.split())


def run_command(*command: str) -> None:
    """Run a command; raise an error with its output if it fails."""
    completed = subprocess.run(command, capture_output=True, text=True, check=False)
    if completed.returncode:
        raise NetboardError(f"{' '.join(command)}: {completed.stderr.strip()}")


def _call(name: str, *arguments: int) -> None:
    """Call a function of the C library that Python 3.11 does not wrap."""
    if getattr(ctypes.CDLL(None, use_errno=True), name)(*arguments):
        raise NetboardError(f"{name}: {os.strerror(ctypes.get_errno())}")
