"""Registry of robot partners: one entry for each, from its word in ``[block] left`` or ``right`` to its policy.

A partner is imported only when it is used. Other packages register partners in the entry-point group
``netboard.partners``, under the same kind of target.
"""

from collections.abc import Iterable

from netboard.base import plugins
from netboard.base.compiled import is_kernel
from netboard.base.config import SIDES, Config, Side
from netboard.base.errors import ConfigError
from netboard.base.tables.experiment import PERSON, STILL
from netboard.participants.policy import Policy

GROUP = "netboard.partners"
"""Entry-point group of third-party partners."""

POLICIES = {
    "augmented": "netboard.participants.robots.augmented:Augmented",
    "follower": "netboard.participants.robots.follower:Follower",
    "game": "netboard.participants.robots.game:Game",
    "leader": "netboard.participants.robots.leader:Leader",
    "learned": "netboard.participants.robots.learned:Learned",
    "lqg": "netboard.participants.robots.lqg:Lqg",
    "playback": "netboard.recording.importing.recorded_hand:partner",
    "robot": "netboard.participants.people.person:partner",
    "shared": "netboard.participants.robots.shared:Shared",
}
"""For each built-in partner, the module and the function of ``(config, side)`` that makes its policy."""


def names() -> tuple[str, ...]:
    """Return the names of all partners, sorted."""
    return plugins.names(GROUP, POLICIES)


def partners_of(config: Config) -> dict[Side, Policy]:
    """Return the robot partners of a block; refuse one that this machine does not have, or cannot make."""
    movers = {side: getattr(config.block, side) for side in SIDES}
    return {side: make_partner(name, config, side) for side, name in movers.items() if name not in (PERSON, STILL)}


def problems_of(configs: Iterable[Config]) -> list[str]:
    """Return why this machine cannot make the robot partners of some blocks; each reason once, with its first block."""
    found: dict[str, str] = {}
    for config in configs:
        try:
            partners_of(config)
        except ConfigError as error:
            found.setdefault(str(error), f"block {config.block.number} ({config.block.label}): {error}")
    return list(found.values())


def make_partner(name: str, config: Config, side: Side) -> Policy:
    """Return the policy of a partner at a side; its parameters are those of ``[partners.<side>]``."""
    made = plugins.load(GROUP, name, POLICIES, "robot partner", ConfigError)
    if not callable(made):
        raise ConfigError(f"the robot partner {name!r} is {made!r}, expected a function of (config, side)")
    policy = made(config, side)
    if not isinstance(policy, Policy):
        raise ConfigError(
            f"the robot partner {name!r} makes {policy!r}, expected a netboard.participants.policy.Policy"
        )
    if not is_kernel(policy.decide):
        raise ConfigError(
            f"the robot partner {name!r} has a kernel `decide` in plain Python, expected one that is compiled: one "
            "decorated with netboard.base.compiled.inlined"
        )
    return policy
