"""Trials that are done once more at the end of their block: asked for by an operator, or by the rule for doubtful ones.

The k-th that is asked for is done again as trial ``trials + k`` of the block. A veto takes back what has not begun yet.
No trial is asked for twice at a time, and a repeat is never repeated by the rule, so that every block comes to an end.
"""

from dataclasses import dataclass, replace

from netboard.base.tables.experiment import Quality


@dataclass(frozen=True, slots=True)
class Repeats:
    """What is to be done once more in a block.

    Attributes
    ----------
    trials : int
        How many trials the block has by its plan [1].
    asked : tuple of int
        Numbers of the trials to be done once more, in the order in which that will be [1].
    vetoed : tuple of int
        Numbers of those that the rule shall leave alone, because an operator has taken their repeat back [1].
    """

    trials: int
    asked: tuple[int, ...] = ()
    vetoed: tuple[int, ...] = ()

    @property
    def extra(self) -> int:
        """How many trials that adds to the block [1]."""
        return len(self.asked)

    def repeated_by(self, trial: int) -> int:
        """Trial that a trial repeats; 0 for none [1].

        Parameters
        ----------
        trial : int
            Its number in the block [1].
        """
        place = trial - self.trials - 1
        return self.asked[place] if 0 <= place < len(self.asked) else 0

    def ask(self, trial: int) -> "Repeats":
        """Have a trial done once more.

        Parameters
        ----------
        trial : int
            Its number [1].
        """
        return replace(self, asked=(*self.asked, trial), vetoed=tuple(other for other in self.vetoed if other != trial))

    def veto(self, trial: int) -> "Repeats":
        """Take back the newest wish for a trial.

        Parameters
        ----------
        trial : int
            Its number, which has been asked for [1].
        """
        place = len(self.asked) - 1 - self.asked[::-1].index(trial)
        return replace(self, asked=self.asked[:place] + self.asked[place + 1 :], vetoed=(*self.vetoed, trial))

    def why_not_ask(self, trial: int, present: int) -> str:
        """Say why a trial cannot be done once more, in a sentence; nothing if it can.

        Parameters
        ----------
        trial : int
            Its number [1].
        present : int
            Number of the trial that goes on [1].
        """
        if not 1 <= trial < present:
            done = f"trials 1 to {present - 1} are done" if present > 1 else "no trial is done"
            return f"trial {trial} cannot be repeated: {done} in this block"
        if trial in self._to_come(present):
            return f"trial {trial} will be repeated already"
        return ""

    def why_not_veto(self, trial: int, present: int) -> str:
        """Say why the repeat of a trial cannot be taken back, in a sentence; nothing if it can.

        Parameters
        ----------
        trial : int
            Its number [1].
        present : int
            Number of the trial that goes on [1].
        """
        if trial in self._to_come(present):
            return ""
        if trial in self.asked:
            return f"the repeat of trial {trial} has begun: skip it, if it is not wanted"
        return f"no repeat of trial {trial} has been asked for"

    def newest(self, present: int) -> int:
        """Trial whose repeat was asked for last and has not begun; 0 for none [1].

        Parameters
        ----------
        present : int
            Number of the trial that goes on [1].
        """
        return self._to_come(present)[-1] if self._to_come(present) else 0

    def _to_come(self, present: int) -> tuple[int, ...]:
        """Return what has not begun."""
        return self.asked[max(present - self.trials, 0) :]


def wants_repeat(rules: Quality, outcome: str, flags: tuple[str, ...], trial: int, repeats: Repeats) -> bool:
    """Tell whether the rule has a trial done once more, when it ends.

    Parameters
    ----------
    rules : Quality
        The rules of the block.
    outcome : str
        What has become of the attempt.
    flags : tuple of str
        Why it is doubtful.
    trial : int
        Number of the trial [1].
    repeats : Repeats
        What is to be repeated already.
    """
    wanted = rules.repeat == "flagged" and outcome == "success" and bool(flags)
    return wanted and trial <= repeats.trials and trial not in (*repeats.asked, *repeats.vetoed)
