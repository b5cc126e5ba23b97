"""The states of the console, from those of the fake server of its tests."""

from dataclasses import replace
from importlib.metadata import version

from netboard.base.config import Config
from netboard.base.tables.experiment import Block, Session
from netboard.network.protocol.control import Status
from netboard.windows.operator.lamps import SILENT, limits_of
from netboard.windows.operator.window import ConsoleWindow, State
from windows.console_server import DONE, FIRST, STATES, attempts, point  # type: ignore[import-not-found]

AHEAD = ("bimanual A, haptics off", "dyadic, haptics off", "bimanual B, haptics on")
SESSION = Session(name="S03", dyad="D03", participant_a="P07", participant_b="P08", pilot=False, consent=True)
ME = "lab-pc-3: 88"
BLOCK = Block(number=3, blocks=18)
POINTS = [point(tick) for tick in range(0, 10_001, 5)]

NAMES = {
    "form": "unopened",
    "waiting": "waiting",
    "ready": "ready",
    "rest": "rest",
    "running": "running",
    "pilot": "pilot",
    "trouble": "troubled",
    "unrecorded": "unrecorded",
    "paused": "paused",
    "confirm": "simulated",
    "stopped": "stopped",
    "lost": "running",
    "lost-trials": "lost",
    "unanswered": "unanswered",
    "finished": "finished",
}
"""States of the fake server, by the names of the screenshots."""


def make() -> ConsoleWindow:
    """Return a console without a server."""
    config = Config()
    return ConsoleWindow(config, limits_of(config, version("netboard")), ME)


def show(window: ConsoleWindow, state: str) -> None:
    """Show a state."""
    status: Status = replace(STATES[NAMES[state]], ahead=AHEAD, session=state)
    begun = NAMES[state] not in FIRST
    if begun:
        status = replace(status, commander=ME)
    silence = 8.0 if state == "lost" else SILENT / 2
    shown = State(
        status,
        silence,
        attempts=attempts(DONE) if begun else (),
        points=POINTS if begun else (),
        session=SESSION,
        block=BLOCK,
    )
    for _ in range(3):  # the first one opens the form, the others draw the strips
        window.show_state(shown)
    window.strips.redraw()


def leave(window: ConsoleWindow) -> None:
    """Close a console."""
    window.hide()
