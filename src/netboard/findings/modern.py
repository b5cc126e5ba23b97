"""What a reader of today asks of a study, as one list."""

from collections.abc import Callable
from typing import Protocol

from netboard.findings.contrasts import comparisons
from netboard.findings.inert import controls
from netboard.findings.influence import influences
from netboard.findings.leadership import leaders
from netboard.findings.measures import overview
from netboard.findings.models import fits
from netboard.findings.paths import courses
from netboard.findings.quality import quality
from netboard.findings.results import Result
from netboard.measuring.study import Study


class Finding(Protocol):
    """What has results."""

    @property
    def results(self) -> list[Result]:
        """The numbers that are reported."""


MODERN_FINDINGS: tuple[Callable[[Study], Finding], ...] = (
    quality,
    overview,
    comparisons,
    fits,
    leaders,
    influences,
    controls,
    courses,
)
"""Each takes a study and returns what has results."""
