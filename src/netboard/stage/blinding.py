"""What is kept from participants, and in a blinded block from operators: who or what moves each hand.

Participants' displays never learn which robot partner is at a seat: `for_display` gives them a configuration without
it. If a block is ``blinded``, they do not learn that a hand is held still either, and operators learn of no seat
whether a person, a robot partner or nobody moves it: their consoles get `for_operator`, and log lines show
`shown_details`. The recording and the agents get everything. How a hand moves is not hidden; docs/how-to/studies.md
lists what else is not.
"""

from collections.abc import Mapping
from dataclasses import replace

from netboard.base.config import SIDES, Config, Side
from netboard.base.tables.experiment import PERSON, STILL, Design
from netboard.base.tables.questionnaires import ANSWERS, UNANSWERED

ANOTHER_HOLDER = "the block has another holder of the stylus"
"""Reason with which an agent leaves a session for a moment, to return with the device of the block's partner."""

ABOUT_FORMS = (ANSWERS, UNANSWERED, "answers_refused")
"""Events that may be about an earlier block: they have no log line in a session that has a blinded block."""

_UNSHOWN = (*ABOUT_FORMS, "robot_joined", "delay_limit", "stand_in_confirmed")
"""Events without a log line in a blinded block: whether there is one, or its numbers, depend on the partner."""

_KEPT = {
    "agent_joined": ("side", "name"),
    "agent_present": ("side", "name"),
    "block_began": ("number", "blocks"),
    "device_replaced": ("side",),
    "loop_too_slow": ("side",),
    "loop_in_time": ("side",),
    "softened": ("side",),
}
"""Details that a log line shows in a blinded block, of events whose others describe a device or a condition."""

_FACTOR = "factor_"
"""Beginning of the details that give the level of a factor in a trial."""


def for_display(config: Config, station: Side) -> Config:
    """Return the configuration of a block for the display of a station.

    A robot partner is a person in it, at the other side, and nobody at the side of the display, which has nothing to
    show. Levels of factors, labels and settings of the partners are left out.
    """
    block = config.block
    if getattr(block, station) != PERSON:  # the display is away, whatever moves the hands
        movers = {side: STILL if side == station else PERSON for side in SIDES}
    else:
        told = (STILL,) if not block.blinded else ()
        movers = {side: mover if (mover := getattr(block, side)) in told else PERSON for side in SIDES}
    own = getattr(config.agents, station)
    shown = _without_partner(config, movers)
    block = replace(shown.block, questionnaires="")
    agents = replace(shown.agents, **{station: own})
    return replace(shown, block=block, agents=agents, perturbation=type(config.perturbation)())


def for_operator(config: Config) -> Config:
    """Return the configuration of a block for consoles: all of it, unless the block is blinded."""
    return _without_partner(config, dict.fromkeys(SIDES, PERSON)) if config.block.blinded else config


def _without_partner(config: Config, movers: Mapping[Side, str]) -> Config:
    """Return a configuration with these movers, and without what else depends on the partner."""
    return replace(
        config,
        block=replace(config.block, label="", left=movers["left"], right=movers["right"]),
        design=Design(),
        partners=type(config.partners)(),
        agents=type(config.agents)(),
        analysis=type(config.analysis)(),
    )


def shown_details(name: str, details: Mapping[str, str]) -> dict[str, str] | None:
    """Return the details of an event that a log line shows in a blinded block; None: the event has no line.

    Parameters
    ----------
    name : str
        Name of the event.
    details : mapping of str
        All details of the event.
    """
    if name in _UNSHOWN or details.get("reason") == ANOTHER_HOLDER:
        return None
    kept = _KEPT.get(name, tuple(details))
    return {key: text for key, text in details.items() if key in kept and not key.startswith(_FACTOR)}
