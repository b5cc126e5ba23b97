"""The emergency stop from a shell: any key sends it, at once, whatever the server does."""

import os
import sys
from collections.abc import Iterator
from dataclasses import replace
from threading import Event, Thread

import pytest

from fakes import STATUS
from netboard.base.errors import NetboardError
from netboard.base.tables.rig import Network
from netboard.network.protocol.codec import decode, encode
from netboard.network.protocol.control import Command, Reply, StatusRequest
from netboard.network.protocol.joining import HELLO_FIRST, Hello, Refusal, Welcome
from netboard.network.protocol.messages import PROTOCOL_VERSION
from netboard.network.transport import channels, sockets
from netboard.network.transport.ports import free_port
from netboard.nodes.operator import guard, shell
from netboard.nodes.operator.guard import READY
from netboard.nodes.operator.keyboard import Keyboard
from netboard.nodes.operator.operator import Operator

pytestmark = pytest.mark.skipif(sys.platform == "win32", reason="terminals are POSIX's here")


class Server(Thread):
    """A server that answers only while it is not `silent`, and refuses peers that it does not know."""

    def __init__(self, network: Network) -> None:
        super().__init__(daemon=True)
        self.silent, self.stopping = Event(), Event()
        self.commands: list[str] = []
        self._where = channels.addresses(network).listen(channels.CONTROL)
        self._known: set[bytes] = set()

    def run(self) -> None:
        with sockets.open_context() as context:
            router = sockets.control_server(context, self._where)
            while not self.stopping.wait(0.001):
                while (received := router.receive()) is not None:
                    answer = self._answer(received[0], decode(received[1]))
                    if answer is not None and not self.silent.is_set():
                        router.send(received[0], encode(answer))
            router.close_after_goodbye()

    def _answer(self, who: bytes, message: object) -> object:
        match message:
            case Hello():
                self._known.add(who)
                return Welcome("session", PROTOCOL_VERSION, 0, "")
            case _ if who not in self._known:
                return Refusal(HELLO_FIRST)
            case StatusRequest():
                return STATUS
            case Command(name=name, number=number):
                self.commands.append(name)
                return Reply(number, True, "")
        return None


@pytest.fixture
def network() -> Network:
    return replace(Network(), port=free_port())


@pytest.fixture
def server(network: Network) -> Iterator[Server]:
    server = Server(network)
    server.start()
    yield server
    server.stopping.set()
    server.join()


TERMINAL_KEYS = [b"\x1a", b"\x1c", b"\x13", b"\x11"]
"""Ctrl-Z, Ctrl-\\, Ctrl-S and Ctrl-Q, which a terminal keeps for itself unless it is told not to."""


@pytest.fixture
def operator(network: Network) -> Iterator[Operator]:
    with sockets.open_context() as context:
        operator = Operator(network, context)
        yield operator
        operator.leave()


@pytest.fixture
def keys(monkeypatch: pytest.MonkeyPatch) -> Iterator[int]:
    """The end of a pseudo-terminal into which key presses are written."""
    writing_end, reading_end = os.openpty()
    with os.fdopen(reading_end) as terminal:
        monkeypatch.setattr(sys, "stdin", terminal)
        yield writing_end
    os.close(writing_end)


@pytest.mark.parametrize("key", [b"x", b"\x1b", b" ", b"\x1b[A", *TERMINAL_KEYS])
def test_any_key_is_the_emergency_stop(
    network: Network, server: Server, operator: Operator, keys: int, key: bytes
) -> None:
    said: list[str] = []

    def say(words: str) -> None:
        said.append(words)
        os.write(keys, key)

    assert guard.guard(operator, network, say)
    assert said == [READY]
    assert server.commands[0] == "emergency_stop"


def test_guard_outlives_a_silent_server_and_stops_when_it_answers_again(
    network: Network, server: Server, operator: Operator, keys: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(guard, "ANSWER_SECONDS", 0.3)
    monkeypatch.setattr(shell, "ANSWER_SECONDS", 0.3)
    said: list[str] = []

    def say(words: str) -> None:
        said.append(words)
        if words == READY:
            server.silent.set()
        elif words.startswith("NO ANSWER"):
            os.write(keys, b"x")
        else:
            assert server.commands
            assert words.endswith("LET GO OF THE STYLUSES")
            server.silent.clear()

    assert guard.guard(operator, network, say)
    assert len(said) >= 3


def test_stop_connects_while_it_is_sent(network: Network, server: Server, operator: Operator) -> None:
    shell.emergency_stop(operator, network)
    assert server.commands


def test_unconfirmed_stop_is_an_error(network: Network, operator: Operator, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(shell, "ANSWER_SECONDS", 0.1)
    with pytest.raises(NetboardError, match="LET GO OF THE STYLUSES"):
        shell.emergency_stop(operator, network)


def test_escape_alone_is_a_touch_of_the_keyboard(keys: int) -> None:
    with Keyboard() as keyboard:
        assert not keyboard.touched()
        os.write(keys, b"\x1b")
        assert keyboard.touched(60.0)
