"""Options that several benchmarks have."""

from pathlib import Path
from typing import Annotated

import typer

Output = Annotated[
    Path | None, typer.Option("--output", "-o", metavar="DIR", help="Folder for the results; default: a new one here.")
]
Quick = Annotated[bool, typer.Option("--quick", help="Short version, in less than a minute.")]
Force = Annotated[bool, typer.Option("--force", help="Write into an existing folder.")]
Json = Annotated[Path | None, typer.Option("--json", metavar="FILE", help="Also write the results there, as JSON.")]
