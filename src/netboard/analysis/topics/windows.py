"""Window sizes: number of first and last trials and group size, as set or chosen from the data.

The paper compares 30 first with 30 last trials and groups 30 trials. Studies with shorter conditions get smaller
windows, and a note gives the reason. They follow the trials that count, not the planned ones: in a short condition,
windows of half the plan would leave out every performer of whom one trial is excluded.
"""

from dataclasses import dataclass

from netboard.analysis.extraction.study import Study
from netboard.analysis.measures.performance import ENDS, window_sizes
from netboard.analysis.topics.groups import counted

SHORTER = 0.25
"""Largest share of the series with fewer trials than the windows require [1]."""


@dataclass(frozen=True, slots=True)
class Windows:
    """Window sizes of a study.

    Attributes
    ----------
    ends_note, group_note : str
        Reasons for deviating from the paper's sizes; empty for the paper's or set sizes.
    """

    ends: int
    group: int
    ends_note: str = ""
    group_note: str = ""

    @property
    def note(self) -> str:
        """Both notes, each once."""
        return "; ".join(dict.fromkeys(filter(None, (self.ends_note, self.group_note))))


def windows_of(study: Study) -> Windows:
    """Return the windows of a study: as set, or the paper's 30, or as many as short conditions allow."""
    how = study.readings.summaries
    trials = counted(study)
    if not len(trials):
        return Windows(how.ends or ENDS, how.group or ENDS)
    lengths = trials.groupby(["team", "dyad", "performer", *(["condition"] * (how.numbering == "condition"))]).size()
    usual = int(lengths.groupby(level="team").quantile(SHORTER).min())
    ends, group = window_sizes(usual)
    note = f"windows of trials chosen for {usual} trials in a condition; the paper's are {ENDS}"
    return Windows(
        how.ends or ends,
        how.group or group,
        note if not how.ends and ends < ENDS else "",
        note if not how.group and group < ENDS else "",
    )
