"""The emergency stop on any key of a terminal: connected in advance, and sent as soon as the key is pressed.

A server that does not answer, refuses the connection or starts later does not end the guard: it says so, and tries
again. Once a key is pressed, the stop is sent until the server confirms it.
"""

import time
from collections.abc import Callable

from netboard.base.errors import NetboardError
from netboard.base.process.stopping import Stopping
from netboard.base.tables.rig import Network
from netboard.network.transport import names
from netboard.nodes.operator.keyboard import Keyboard
from netboard.nodes.operator.operator import ANSWER_SECONDS, Operator
from netboard.nodes.operator.shell import POLL_INTERVAL_S, emergency_stop

READY = "Ready: press ANY KEY for the emergency stop. Ctrl-C leaves without stopping."


def guard(operator: Operator, network: Network, say: Callable[[str], None]) -> bool:
    """Wait for a key, and carry out the emergency stop; return False if the process was asked to end before."""
    with Keyboard(all_keys=True) as keyboard, Stopping() as stopping:
        if not keyboard.available:
            raise NetboardError("--guard: needs a terminal, because it waits for a key")
        if not key_pressed(operator, network, keyboard, stopping, say):
            return False
        while True:
            try:
                emergency_stop(operator, network)
            except NetboardError as error:
                if stopping():
                    raise
                say(str(error))
            else:
                return True


def key_pressed(
    operator: Operator, network: Network, keyboard: Keyboard, stopping: Callable[[], bool], say: Callable[[str], None]
) -> bool:
    """Wait until a key is pressed; return False if the process is asked to end. Say whether the server answers."""
    silent = f"NO ANSWER from the server at {network.host}:{network.port}: an emergency stop may not arrive"
    shown, answered = "", time.monotonic()
    while not stopping():
        if keyboard.touched(POLL_INTERVAL_S):
            return True
        state = shown
        try:
            if operator.poll(trace=False) is not None:
                state, answered = READY, time.monotonic()
            elif time.monotonic() - answered > ANSWER_SECONDS:
                why = names.trouble(network.host)
                state = f"{silent}: {why}" if why else silent
        except NetboardError as error:
            state, answered = str(error), time.monotonic()
        if state != shown:
            say(state)
            shown = state
    return False
