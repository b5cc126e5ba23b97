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
    name : str
        What was looked at.
    colour : str
        ``green``: in order; ``yellow``: works, and could be better; ``red``: not fit for an experiment.
    found : str
        What was found.
    advice : str
        What to do about it, unless green.
    figures : dict of str to float
        What was measured, each with its unit in its name.
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
