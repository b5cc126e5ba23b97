"""The rule by which an attempt counts in an analysis: one rule for the running session and for the analysis.

An attempt counts if it was measured, which means that it ended with a success, a fall or the time limit, and if it has
no flag that excludes it. Which flags exclude is a setting of the recording, `[quality] exclude`, so that it is declared
before the data are collected. An analysis may set other flags; what else it excludes (catch trials, pilots, roles of
blocks) depends on the design and not on how an attempt went.
"""

from collections.abc import Collection, Iterable, Mapping
from dataclasses import dataclass

from netboard.base.config import SIDES, Config, Side
from netboard.base.tables.experiment import TECHNICAL
from netboard.task.trials.quality import FLAG_WORDS

MEASURED = ("success", "fell", "timed_out")
"""Outcomes of the attempts that an analysis measures."""

_STUCK = ("stuck_left", "stuck_right")
"""Flags that exclude no attempt of simulated participants, whose hands may be still."""


def excluding(flags: Iterable[str], exclude: Collection[str], *, simulated: bool) -> tuple[str, ...]:
    """Return those of an attempt's flags that exclude it.

    Parameters
    ----------
    flags : iterable of str
        Flags of the attempt, from `netboard.task.trials.quality.FLAGS`.
    exclude : collection of str
        Flags that exclude an attempt.
    simulated : bool
        Whether no person held a device.
    """
    return tuple(flag for flag in flags if flag in exclude and not (simulated and flag in _STUCK))


def is_simulated(config: Config, metadata: Mapping[str, str], sides: Collection[Side]) -> bool:
    """Return whether simulated participants move these sides.

    Parameters
    ----------
    metadata : mapping of str
        Metadata of the block's recording; empty for a live session.
    sides : collection of str
        Sides that people move.
    """
    if metadata.get("imported") in ("measured", "simulated"):
        return metadata["imported"] == "simulated"
    virtual = all(config.agents.of(side).device == "virtual" for side in sides)
    return virtual or metadata.get("rehearsed") == "true"


@dataclass(frozen=True, slots=True)
class ExclusionRule:
    """The rule of one block.

    Attributes
    ----------
    exclude : tuple of str
        Flags that exclude an attempt.
    simulated : bool
        Whether no person held a device.
    """

    exclude: tuple[str, ...]
    simulated: bool

    def reasons(self, flags: Iterable[str]) -> tuple[str, ...]:
        """Return in a few words each why an attempt is excluded; empty if it is not."""
        return tuple(FLAG_WORDS[flag] for flag in excluding(flags, self.exclude, simulated=self.simulated))

    def consequence(self, outcome: str, flags: Iterable[str]) -> str:
        """Return ``excluded``, and why, for an attempt that does not count; empty if it counts.

        Parameters
        ----------
        outcome : str
            Outcome of the attempt, live or as a recording names it.
        """
        if outcome not in MEASURED:
            return "excluded"
        reasons = self.reasons(flags)
        return f"excluded: {', '.join(reasons)}" if reasons else ""


USUAL_RULE = ExclusionRule(TECHNICAL, simulated=False)
"""The rule while the configuration of a block is not known."""


def rule_of(config: Config, metadata: Mapping[str, str] | None = None) -> ExclusionRule:
    """Return the rule of a block.

    Parameters
    ----------
    metadata : mapping of str, optional
        Metadata of the block's recording; none for a live session.
    """
    sides = [side for side in SIDES if getattr(config.block, side) == "person"]
    return ExclusionRule(config.quality.exclude, is_simulated(config, metadata or {}, sides))
