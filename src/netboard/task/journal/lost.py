"""Lost trials: successes that the analysis will exclude, and that the operator can still repeat."""

from collections import Counter
from collections.abc import Collection, Iterable
from dataclasses import dataclass, replace

from netboard.base.plural import plural
from netboard.task.journal.outcome import AttemptOutcome
from netboard.task.trials.exclusion import ExclusionRule

WILL_BE_EXCLUDED = "will be excluded"
"""Words by which a notice of lost trials is recognised."""


@dataclass(frozen=True, slots=True)
class Losses:
    """Lost trials of a block, or of several.

    Attributes
    ----------
    why : dict of tuple of str
        By the number of each lost trial, why it will be excluded, in a few words [1].
    done : int
        Number of successful trials [1].
    """

    why: dict[int, tuple[str, ...]]
    done: int

    @property
    def trials(self) -> tuple[int, ...]:
        """Numbers of the lost trials [1]."""
        return tuple(self.why)

    @property
    def text(self) -> str:
        """How many trials are lost, and why, the most frequent reason first; empty if none is."""
        if not self.why:
            return ""
        counts = Counter(reason for reasons in self.why.values() for reason in reasons)
        reasons = ", ".join(reason for reason, _ in counts.most_common())
        return f"{len(self.why)} of {plural(self.done, 'trial')} {WILL_BE_EXCLUDED}: {reasons}"

    def without(self, trials: Collection[int]) -> "Losses":
        """Return these losses without some trials.

        Parameters
        ----------
        trials : collection of int
            Numbers of trials that are repeated, or need no repeat [1].
        """
        return replace(self, why={trial: reasons for trial, reasons in self.why.items() if trial not in trials})


def losses(attempts: Iterable[AttemptOutcome], rule: ExclusionRule) -> Losses:
    """Return the lost trials among some attempts of a block.

    Parameters
    ----------
    attempts : iterable of AttemptOutcome
        Attempts of one block, in order.
    rule : ExclusionRule
        The rule of the block.
    """
    successes = [one for one in attempts if one.outcome == "success"]
    return Losses({one.trial: found for one in successes if (found := rule.reasons(one.flag_list))}, len(successes))
