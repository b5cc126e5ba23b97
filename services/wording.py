"""What the help texts of all commands have in common."""

from pathlib import Path
from typing import Annotated

import typer

Screenshot = Annotated[Path | None, typer.Option(metavar="FILE", help="Save the first picture as a PNG file and stop.")]


def examples(*lines: str) -> str:
    """Write the epilog of a help text."""
    return "\n\n".join(("Examples:", *(f"  {line}" for line in lines)))
