"""The operator's end of the control channel: it reconnects to a server that has not answered for long."""

from dataclasses import replace

import pytest

from fakes import STATUS
from netboard.base.tables.rig import Network
from netboard.network.protocol.codec import decode, encode
from netboard.network.protocol.control import Command, StatusRequest
from netboard.network.protocol.joining import HELLO_FIRST, Hello, Refusal, Welcome
from netboard.network.protocol.messages import PROTOCOL_VERSION, Message
from netboard.network.transport import channels, endpoints, sockets
from netboard.network.transport.ports import free_port
from netboard.nodes.operator import operator
from netboard.nodes.operator.operator import Operator

TRIES = 100


def received_messages(router: endpoints.Router) -> list[tuple[bytes, Message]]:
    found = []
    while (received := router.receive()) is not None:
        found.append((received[0], decode(received[1])))
    return found


@pytest.mark.slow
def test_operator_says_hello_again_to_a_silent_server(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(operator, "SILENCE_TIMEOUT_NS", 200_000_000)
    monkeypatch.setattr(sockets, "RENEW_S", 0.0)
    network = replace(Network(), port=free_port())
    with sockets.open_context() as context:
        router = sockets.control_server(context, channels.addresses(network).listen(channels.CONTROL))
        console = Operator(network, context)
        hello_count, answered, silent = 0, None, False
        for _ in range(TRIES):
            answered = console.ask(0.05) or answered
            for peer, message in received_messages(router):
                if isinstance(message, Hello):
                    hello_count += 1
                    router.send(peer, encode(Welcome("session", PROTOCOL_VERSION, 0, "")))
                    silent = hello_count == 1
                elif isinstance(message, StatusRequest) and not silent:
                    router.send(peer, encode(STATUS))
            if answered is not None:
                break
        assert answered == STATUS
        assert hello_count >= 2
        console.leave()
        router.close_after_goodbye()


@pytest.mark.slow
def test_operator_says_hello_again_after_hello_first_refusal() -> None:
    network = replace(Network(), port=free_port())
    with sockets.open_context() as context:
        router = sockets.control_server(context, channels.addresses(network).listen(channels.CONTROL))
        console = Operator(network, context)
        hello_count, answered = 0, None
        for _ in range(TRIES):
            answered = console.ask(0.05) or answered
            for peer, message in received_messages(router):
                if isinstance(message, Hello):
                    hello_count += 1
                    router.send(peer, encode(Welcome("session", PROTOCOL_VERSION, 0, "")))
                elif isinstance(message, StatusRequest):
                    router.send(peer, encode(Refusal(HELLO_FIRST) if hello_count == 1 else STATUS))
            if answered is not None:
                break
        assert answered == STATUS
        assert hello_count == 2
        console.leave()
        router.close_after_goodbye()


def test_text_that_is_not_utf_8_is_sent_with_question_marks() -> None:
    network = replace(Network(), port=free_port())
    with sockets.open_context() as context:
        router = sockets.control_server(context, channels.addresses(network).listen(channels.CONTROL))
        console = Operator(network, context)
        sent: list[Message] = []
        for _ in range(TRIES):
            if not sent:
                console.command("note", "gr\udcfcn")  # as Python reads a note from a terminal with another coding
            console.ask(0.02)
            sent += [message for _, message in received_messages(router) if isinstance(message, Command)]
            if sent:
                break
        assert isinstance(sent[0], Command)
        assert sent[0].argument == "gr?n"
        console.leave()
        router.close_after_goodbye()
