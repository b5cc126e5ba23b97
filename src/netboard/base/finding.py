"""Findings of the doctor: colour, observation and advice for each check."""

from dataclasses import dataclass, field
from pathlib import Path
from typing import Literal

Colour = Literal["green", "yellow", "red"]


@dataclass(frozen=True, slots=True)
class Finding:
    """One line of a report.

    Attributes
    ----------
    colour : str
        ``green``: in order; ``yellow``: works, and could be better; ``red``: not fit for an experiment.
    """

    name: str
    colour: Colour
    found: str
    advice: str = ""
    figures: dict[str, float] = field(default_factory=dict)


def graded(
    name: str, good: bool, found: str, advice: str, figures: dict[str, float] | None = None, *, else_: Colour = "yellow"
) -> Finding:
    """Return a green finding without advice if all is good, and one of another colour with it if not."""
    return Finding(name, "green" if good else else_, found, "" if good else advice, figures or {})


def text_of(path: Path) -> str:
    """Return the text of a system file, stripped; empty if it is missing or may not be read."""
    try:
        return path.read_text(encoding="utf-8", errors="replace").strip()
    except OSError:
        return ""
