"""An operator's command from a shell, and the emergency stop."""

import json
import time

from rich.console import Console

from netboard.base.config import Config
from netboard.base.errors import NetboardError
from netboard.base.process import Stopping
from netboard.network.protocol.control import Reply, Status
from netboard.network.transport import sockets
from netboard.nodes.operator.operator import ANSWER_SECONDS, Operator
from netboard.nodes.ports import emergency
from netboard.services.keyboard import Keyboard
from netboard.services.status import asked, plain

LOOK_SECONDS = 0.05
"""Interval at which the keyboard and the server are checked [s]."""


def command(
    config: Config, name: str, argument: str, *, take: bool, until: str | None, seconds: float | None, as_json: bool
) -> int:
    """Send a command to the server, and print its reply.

    Returns
    -------
    int
        Exit code: 1 if the server refuses, or the phase is not reached.
    """
    with sockets.open_context() as context:
        operator = Operator(config.network, context)
        try:
            status = asked(operator, config)
            reply = operator.do("take") if take else None
            if reply is None or reply.accepted:
                reply = end(operator) if name == "end" else operator.do(name, argument)
            if name != "end":
                status = asked(operator, config)
            if reply.accepted and until is not None:
                status = wait(operator, config, until, seconds)
        finally:
            operator.leave()
    if as_json:
        print(json.dumps({"accepted": reply.accepted, "reason": reply.reason, "status": plain(status)}))  # noqa: T201
    elif not reply.accepted:
        raise NetboardError(reply.reason)
    else:
        words = reply.reason or ("the server ends" if name == "end" else f"the trial is {status.phase}")
        print(f"{name}: {words}")  # noqa: T201
    return 0 if reply.accepted and until in (None, status.phase) else 1


def end(operator: Operator) -> Reply:
    """End the session; if the reply is lost and the server no longer answers, the command has succeeded."""
    try:
        return operator.do("end")
    except NetboardError:
        if operator.ask(ANSWER_SECONDS) is not None:
            raise
        return Reply(0, True, "no server answers any more")


def wait(operator: Operator, config: Config, until: str, seconds: float | None) -> Status:
    """Wait for a phase of the trial, or for the timeout [s]."""
    began = time.monotonic()
    with Stopping() as stopping:
        while True:
            status = asked(operator, config)
            over = seconds is not None and time.monotonic() - began > seconds
            if status.phase == until or over or stopping():
                return status
            operator.attend(LOOK_SECONDS)


def emergency_stop(config: Config, *, release: bool, guard: bool) -> int:
    """Set all forces to zero, at once or at a key press; or release the emergency stop."""
    console = Console(highlight=False)
    with sockets.open_context() as context:
        operator = Operator(config.network, context)
        try:
            if guard and not key_pressed(operator, config, console):
                return 0
            told(operator, config, emergency.RELEASE if release else emergency.STOP)
        finally:
            operator.leave()
    if release:
        console.print("The emergency stop is released. When everybody is ready: netboard control resume")
    else:
        console.print("[bold red]EMERGENCY STOP[/]: no device has a force. To end it: netboard stop --release")
    return 0


def told(operator: Operator, config: Config, name: str) -> None:
    """Give a command that must be carried out, and raise an error if it is not."""
    asked(operator, config)
    try:
        reply = operator.do(name)
    except NetboardError as error:
        if name == emergency.STOP:
            raise NetboardError(f"{error}: TAKE THE STYLUSES OUT OF THE HANDS") from None
        raise
    if not reply.accepted:
        raise NetboardError(reply.reason)


def key_pressed(operator: Operator, config: Config, console: Console) -> bool:
    """Wait until a key is pressed; return False if asked to end."""
    with Keyboard() as keyboard, Stopping() as stopping:
        if not keyboard.there:
            raise NetboardError("--guard needs a terminal: it waits for a key")
        console.print("Standing by: [bold]any key[/] takes all forces away at once. Ctrl-C ends standing by.")
        while not stopping():
            if keyboard.pressed(LOOK_SECONDS) is not None:
                return True
            asked(operator, config)
    return False
