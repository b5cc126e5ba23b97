"""The welcomes of a block: what each kind of peer gets of its configuration.

Agents and loggers get all of it. Displays and consoles get what `netboard.stage.blinding` lets them have.
"""

from collections.abc import Mapping
from typing import NamedTuple

from netboard.base.clock import now_ns
from netboard.base.config import SIDES, Config, resolve
from netboard.network.protocol.joining import Welcome, role_and_side
from netboard.network.protocol.messages import PROTOCOL_VERSION
from netboard.stage.blinding import for_display, for_operator

DISPLAYS = {side: role_and_side("display", side) for side in SIDES}
"""Role and side of the displays."""

OPERATORS = ("console", "trigger")
"""Roles of the other peers on the control channel."""

RECEIVERS = (*DISPLAYS.values(), *OPERATORS)
"""Everybody on the control channel who gets a welcome."""


class BlockTexts(NamedTuple):
    """Configuration of a block as text."""

    full: str  # for agents and loggers, and for the recording
    shown: Mapping[str, str]  # for each of `RECEIVERS`


class Welcomes(NamedTuple):
    """Welcomes to a block."""

    full: Welcome
    shown: Mapping[str, Welcome]  # for each of `RECEIVERS`


def texts_of(config: Config, full: str = "") -> BlockTexts:
    """Return the texts of a block; ``full``: its whole configuration as a recording has it, if there is one."""
    full = full or resolve(config)
    operators = for_operator(config)
    shown = dict.fromkeys(OPERATORS, full if operators is config else resolve(operators))
    displays = {name: resolve(for_display(config, side)) for side, name in DISPLAYS.items()}
    return BlockTexts(full, displays | shown)


def unblinded(config: Config, full: str) -> BlockTexts:
    """Return the texts of a block that is over, of which operators may know all, as the recording has it."""
    texts = texts_of(config, full)
    return texts._replace(shown={**texts.shown, **dict.fromkeys(OPERATORS, full)})


def welcomes_of(texts: BlockTexts, session: str) -> Welcomes:
    """Return the welcomes of a block in a session, sent now."""
    now = now_ns()
    shown = {name: Welcome(session, PROTOCOL_VERSION, now, text) for name, text in texts.shown.items()}
    return Welcomes(Welcome(session, PROTOCOL_VERSION, now, texts.full), shown)
