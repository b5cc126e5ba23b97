"""Severity of findings, and the result of a check, which follows from the worst finding."""

from collections.abc import Sequence
from dataclasses import dataclass
from enum import IntEnum
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from netboard.recording.integrity.verification import Verdict

EXIT_CODES = (0, 3, 1)
"""Exit code of each `Grade`: listed losses are not damage, but differ from success [1]."""


class Grade(IntEnum):
    """Severity of a finding."""

    SOUND = 0  # as expected
    LOSS = 1  # data are missing, and the file itself lists them
    DAMAGE = 2  # the file has changed or contradicts itself


VERDICTS = ("complete", "complete with listed losses", "damaged")
"""Result of a check, by the worst `Grade`."""


@dataclass(frozen=True, slots=True)
class Finding:
    """One finding of a check.

    Attributes
    ----------
    part : str
        Subject of the finding: ``file``, ``numbers``, ``forces``, ``time``, ``clocks``, ``configuration``, ``trials``,
        ``plan``, ``journal`` or ``replay``.
    """

    part: str
    grade: Grade
    text: str


@dataclass(frozen=True, slots=True)
class Report:
    """Report of the check of one file.

    Attributes
    ----------
    ticks : int
        Ticks in the file, or recoverable from it [1].
    replay : Verdict or None
        Result of verifying every tick, if requested.
    computing : float
        Computing time of the verification, without reading [s].
    """

    path: Path
    findings: tuple[Finding, ...]
    ticks: int = 0
    replay: Verdict | None = None
    computing: float = 0.0

    @property
    def grade(self) -> Grade:
        """Severity of the worst finding."""
        return worst(self.findings)

    @property
    def verdict(self) -> str:
        """Result in words: one of `VERDICTS`."""
        return VERDICTS[self.grade]


def worst(findings: Sequence[Finding]) -> Grade:
    """Return the highest severity of the findings."""
    return max((finding.grade for finding in findings), default=Grade.SOUND)


def numbers_in_words(numbers: NDArray[np.int64]) -> str:
    """Format the first of many numbers."""
    shown = ", ".join(str(number) for number in numbers[:3])
    return shown if len(numbers) <= 3 else f"{shown} and {len(numbers) - 3} more"
