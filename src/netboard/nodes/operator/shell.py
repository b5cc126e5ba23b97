"""Requests of shell commands to a server: each waits for its answer, or raises an error for the operator."""

import time
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from dataclasses import asdict
from typing import Any

from netboard.base.errors import NetboardError
from netboard.base.tables.rig import Network
from netboard.network.protocol.control import FORM_AWAITED, Reply, Status
from netboard.network.transport import names, sockets
from netboard.nodes.operator.operator import ANSWER_SECONDS, Operator
from netboard.nodes.ports.emergency import STOP
from netboard.nodes.ports.waiting import in_words
from netboard.recording.format.summary import or_null

POLL_INTERVAL_S = 0.05
"""Interval at which the server is asked while waiting for a phase [s]."""


@contextmanager
def connected(network: Network) -> Iterator[Operator]:
    """Connect to the server, and take leave of it."""
    with sockets.open_context() as context:
        operator = Operator(network, context)
        try:
            yield operator
        finally:
            operator.leave()


def status_of(operator: Operator, network: Network) -> Status:
    """Return the status; ask until the server answers or the timeout."""
    until = time.monotonic() + ANSWER_SECONDS
    while time.monotonic() < until:
        answer = operator.ask(0.2)
        if answer is not None:
            return answer
    raise NetboardError(
        names.trouble(network.host)
        or f"no server answers at {network.host}:{network.port} within {ANSWER_SECONDS:.0f} s; "
        "check that it is running and uses this address"
    )


def end(operator: Operator) -> Reply:
    """End the session; if the reply is lost and the server no longer answers, the command has succeeded."""
    try:
        return operator.do("end")
    except NetboardError:
        if operator.ask(ANSWER_SECONDS) is not None:
            raise
        return Reply(0, True, "the server has stopped")


def status_after(operator: Operator, network: Network, reply: Reply) -> Status | None:
    """Return the status after a command; None if it was carried out and ended the server, as after a last block."""
    try:
        operator.attend(POLL_INTERVAL_S)  # until the command has taken effect, and earlier answers have come
        return status_of(operator, network)
    except NetboardError:
        if not reply.accepted:
            raise
        return None


def wait(
    operator: Operator, network: Network, until: str, seconds: float | None, stopping: Callable[[], bool]
) -> Status:
    """Wait for a phase of the trial, for the timeout [s], or for a pause."""
    began, first = time.monotonic(), status_of(operator, network).tick
    while True:
        status = status_of(operator, network)
        over = seconds is not None and time.monotonic() - began > seconds
        paused = status.phase == "paused" and status.tick > first  # a command takes effect with the next tick
        if status.phase == until or paused or over or stopping():
            return status
        operator.attend(POLL_INTERVAL_S)


def carry_out(operator: Operator, network: Network, name: str) -> Reply:
    """Send a command; raise an error if it is not carried out."""
    status_of(operator, network)
    return _required(operator.do(name))


def emergency_stop(operator: Operator, network: Network) -> None:
    """Send the emergency stop now, and again until the server confirms it; raise an error after the timeout.

    It does not wait for a connection first, and connects again if one is lost or refused.
    """
    until, sent = time.monotonic() + ANSWER_SECONDS, list[int]()
    trouble = f"the server at {network.host}:{network.port} has not confirmed it within {ANSWER_SECONDS:g} s"
    while time.monotonic() < until:
        sent.append(operator.command(STOP))
        try:
            operator.poll(trace=False)
            operator.attend(POLL_INTERVAL_S)
        except NetboardError as error:
            trouble = str(error)
        for reply in filter(None, map(operator.reply, sent)):
            _required(reply)
            return
    if why := names.trouble(network.host):
        trouble += f" ({why})"
    raise NetboardError(f"{STOP}: {trouble}: LET GO OF THE STYLUSES")


def _required(reply: Reply) -> Reply:
    """Raise an error if a command was refused."""
    if not reply.accepted:
        raise NetboardError(reply.reason)
    return reply


def plain(status: Status) -> dict[str, object]:
    """Return the status for JSON: links as objects, unknown values as null."""

    def objects(items: Iterable[Any]) -> list[dict[str, object]]:
        return [{name: or_null(value) for name, value in item._asdict().items()} for item in items]

    names = ("links", "loops", "devices", "displays", "stand_ins")
    return {**asdict(status), **{name: objects(getattr(status, name)) for name in names}}


def state_text(status: Status) -> str:
    """Return the phase of the trial, and why it is paused or what the server waits for."""
    if status.notice.startswith("paused"):
        return f"the trial is {status.notice}"
    waiting = f"; waiting for {in_words(status.waiting_for)}" if status.waiting_for else ""
    form = next((f"; {part}" for part in status.notice.split("; ") if part.startswith(FORM_AWAITED)), "")
    return f"the trial is {status.phase}{waiting}{form.partition(',')[0]}"  # without the time that is left
