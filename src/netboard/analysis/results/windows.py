"""How many trials the first and the last ones are, and those of a group: as set, or chosen from how many there are."""

from dataclasses import dataclass

from netboard.analysis.extraction.study import Study
from netboard.analysis.measures.performance import ENDS, window_sizes
from netboard.analysis.results.groups import counted

SHORTER = 0.25
"""So many of the series may have fewer trials than the windows are chosen for [1]."""


@dataclass(frozen=True, slots=True)
class Windows:
    """Numbers of trials that are looked at together.

    Attributes
    ----------
    ends_note, group_note : str
        Why they are not the paper's; empty if they are, or if they are set.
    """

    ends: int
    group: int
    ends_note: str = ""
    group_note: str = ""

    @property
    def note(self) -> str:
        """Of both."""
        return self.ends_note or self.group_note


def windows_of(study: Study) -> Windows:
    """Choose the windows of a study: the settings', or the paper's 30, or as many as short conditions have room for."""
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
