"""``netboard example``: copies the recording that netboard ships."""

from pathlib import Path
from typing import Annotated

import typer

from netboard.services.options import examples

app = typer.Typer()


@app.command(epilog=examples("netboard example", "netboard example S01.mcap"))
def example(
    file: Annotated[Path, typer.Argument(metavar="FILE", help="The file to create.")] = Path("example.mcap"),
) -> None:
    """Copy a small recording of two simulated participants, to try tools and to develop readers."""
    from netboard.base.terminal.output import plain_console
    from netboard.recording.files.example import copy_example

    copy_example(file)
    plain_console().print(f"{file}: one dyadic trial of simulated participants, with haptic feedback")
