"""Severity of findings, and the result of an integrity check, which follows from the worst finding."""

from collections.abc import Sequence
from dataclasses import dataclass
from enum import IntEnum
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from netboard.recording.integrity.verification import Verification

EXIT_CODES = (0, 3, 1)
"""Exit code of each `Severity`: listed losses are not damage, but differ from success [1]."""


class Severity(IntEnum):
    """Severity of a finding."""

    SOUND = 0  # as expected
    LOSS = 1  # data are missing, and the file itself lists them
    DAMAGE = 2  # the file has changed or contradicts itself


RESULTS = ("complete", "complete with listed losses", "damaged")
"""Result of a check, by the worst `Severity`."""


@dataclass(frozen=True, slots=True)
class CheckFinding:
    """One finding of a check; ``part`` is the name of the check, which `netboard.recording.integrity.checking` sets."""

    severity: Severity
    text: str
    part: str = ""


@dataclass(frozen=True, slots=True)
class CheckReport:
    """Report of the check of one file."""

    path: Path
    findings: tuple[CheckFinding, ...]
    ticks: int = 0  # ticks in the file, or recoverable from it
    replay: Verification | None = None  # result of verifying every tick, if requested
    computing: float = 0.0  # computing time of the verification, without reading [s]
    excluded: str = ""  # how many trials the analysis will exclude, and why; empty for none

    @property
    def severity(self) -> Severity:
        """Severity of the worst finding."""
        return worst(self.findings)

    @property
    def result(self) -> str:
        """Result in words: one of `RESULTS`."""
        return RESULTS[self.severity]


def worst(findings: Sequence[CheckFinding]) -> Severity:
    """Return the highest severity of the findings."""
    return max((finding.severity for finding in findings), default=Severity.SOUND)


def numbers_in_words(numbers: NDArray[np.int64]) -> str:
    """Format the first three of many numbers."""
    shown = ", ".join(str(number) for number in numbers[:3])
    return shown if len(numbers) <= 3 else f"{shown} and {len(numbers) - 3} more"
