"""How sound a recording is: findings, each with a grade, and the verdict that follows from the worst of them."""

from collections.abc import Sequence
from dataclasses import dataclass
from enum import IntEnum
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from netboard.recording.integrity.verification import Verdict

EXIT_CODES = (0, 3, 1)
"""Exit code of each `Grade`: losses that a file lists are no damage, and still not nothing [1]."""


class Grade(IntEnum):
    """What a finding means for the file."""

    SOUND = 0  # as it should be
    LOSS = 1  # something is not there, and the file says so itself
    DAMAGE = 2  # the file is not what was written, or contradicts itself


VERDICTS = ("complete", "complete with listed losses", "damaged")
"""Verdict on a file by its worst `Grade`."""


@dataclass(frozen=True, slots=True)
class Finding:
    """One thing that was looked at.

    Attributes
    ----------
    part : str
        What was looked at: ``file``, ``numbers``, ``forces``, ``time``, ``clocks``, ``configuration``, ``trials``,
        ``plan``, ``journal`` or ``replay``.
    """

    part: str
    grade: Grade
    text: str


@dataclass(frozen=True, slots=True)
class Report:
    """What is known of one file.

    Attributes
    ----------
    ticks : int
        Ticks in it, or that can be recovered of it [1].
    replay : Verdict or None
        Outcome of computing every tick again, if that was asked for.
    computing : float
        Time that this took, reading not included [s].
    """

    path: Path
    findings: tuple[Finding, ...]
    ticks: int = 0
    replay: Verdict | None = None
    computing: float = 0.0

    @property
    def grade(self) -> Grade:
        """The worst that was found."""
        return worst(self.findings)

    @property
    def verdict(self) -> str:
        """The same in words: one of `VERDICTS`."""
        return VERDICTS[self.grade]


def worst(findings: Sequence[Finding]) -> Grade:
    """Return the worst grade of some findings."""
    return max((finding.grade for finding in findings), default=Grade.SOUND)


def numbers_in_words(numbers: NDArray[np.int64]) -> str:
    """Name the first numbers of what may be many."""
    shown = ", ".join(str(number) for number in numbers[:3])
    return shown if len(numbers) <= 3 else f"{shown} and {len(numbers) - 3} more"
