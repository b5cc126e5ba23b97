"""Trials repeated at the end of their block, on request of an operator or because an attempt was flagged.

The k-th requested repeat becomes trial ``trials + k`` of the block. A veto cancels a repeat that has not begun. A trial
has at most one pending repeat, and the rule never repeats a repeat, so that every block ends.
"""

from dataclasses import dataclass, replace

from netboard.base.tables.experiment import Quality


@dataclass(frozen=True, slots=True)
class Repeats:
    """Repeats of a block.

    Attributes
    ----------
    trials : int
        Number of trials in the plan of the block [1].
    asked : tuple of int
        Numbers of the trials to repeat, in the order of their repeats [1].
    vetoed : tuple of int
        Numbers of the trials that the rule no longer repeats, because an operator has cancelled their repeat [1].
    """

    trials: int
    asked: tuple[int, ...] = ()
    vetoed: tuple[int, ...] = ()

    @property
    def extra(self) -> int:
        """Number of trials added to the block [1]."""
        return len(self.asked)

    def repeated_by(self, trial: int) -> int:
        """Return the number of the trial that a trial repeats; 0 for none [1].

        Parameters
        ----------
        trial : int
            Number of the repeat in the block [1].
        """
        place = trial - self.trials - 1
        return self.asked[place] if 0 <= place < len(self.asked) else 0

    def ask(self, trial: int) -> "Repeats":
        """Request the repeat of a trial."""
        return replace(self, asked=(*self.asked, trial), vetoed=tuple(other for other in self.vetoed if other != trial))

    def veto(self, trial: int) -> "Repeats":
        """Cancel the newest repeat of a trial.

        Parameters
        ----------
        trial : int
            Number of the trial; its repeat must have been requested [1].
        """
        place = len(self.asked) - 1 - self.asked[::-1].index(trial)
        return replace(self, asked=self.asked[:place] + self.asked[place + 1 :], vetoed=(*self.vetoed, trial))

    def why_not_ask(self, trial: int, present: int, *, under_way: bool = False) -> str:
        """Return why a trial cannot be repeated, in a sentence; empty if it can.

        Parameters
        ----------
        under_way : bool
            Whether the ball of the current trial is free. It can then be repeated, too: after the last trial of a
            block it would be too late.
        """
        if not 1 <= trial < present + under_way:
            if present <= 1:
                return "no trial is done in this block, so none can be repeated"
            return f"trial {trial} cannot be repeated: trials 1 to {present - 1} are done in this block"
        if trial in self.to_come(present):
            return f"trial {trial} is already to be repeated"
        return ""

    def why_not_veto(self, trial: int, present: int) -> str:
        """Return why the repeat of a trial cannot be cancelled, in a sentence; empty if it can."""
        if trial in self.to_come(present):
            return ""
        if trial in self.asked:
            return f"the repeat of trial {trial} has begun; skip it to leave it out"
        return f"no repeat of trial {trial} was requested"

    def newest(self, present: int) -> int:
        """Return the trial whose repeat was requested last and has not begun; 0 for none [1]."""
        return self.to_come(present)[-1] if self.to_come(present) else 0

    def to_come(self, present: int) -> tuple[int, ...]:
        """Return the trials whose repeats have not begun [1]."""
        return self.asked[max(present - self.trials, 0) :]


def wants_repeat(rules: Quality, outcome: str, flags: tuple[str, ...], trial: int, repeats: Repeats) -> bool:
    """Return whether the rule repeats a trial whose attempt has just ended.

    Parameters
    ----------
    rules : Quality
        The quality rules of the block.
    repeats : Repeats
        The repeats that were requested or vetoed before.
    """
    wanted = rules.repeat == "flagged" and outcome == "success" and bool(flags)
    return wanted and trial <= repeats.trials and trial not in (*repeats.asked, *repeats.vetoed)
