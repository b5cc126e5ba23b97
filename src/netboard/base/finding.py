"""What the doctor finds: for each thing looked at a colour, what was found, and what to do about it."""

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


def text_of(path: Path) -> str:
    """Text of one of the system's files, stripped; empty where it is not there or not for us to read."""
    try:
        return path.read_text(encoding="utf-8", errors="replace").strip()
    except OSError:
        return ""
