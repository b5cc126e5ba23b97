"""Benchmarks and studies of the physics: ``netboard bench``.

A study, and the libraries it needs, is imported when it is asked for.
"""

from pathlib import Path
from typing import Annotated

import typer

app = typer.Typer(help="Measure the physics on this machine: stability and cost of the methods.", no_args_is_help=True)

Output = Annotated[
    Path | None, typer.Option("--output", "-o", metavar="DIR", help="Folder for the results; else a new one here.")
]
Quick = Annotated[bool, typer.Option("--quick", help="A short form, in less than a minute.")]
Force = Annotated[bool, typer.Option("--force", help="Write into a folder that is already there.")]


@app.command(epilog="Examples:\n\n  netboard bench stability --quick\n\n  netboard bench stability --soak -o results")
def stability(
    output: Output = None,
    quick: Quick = False,
    force: Force = False,
    soak: Annotated[bool, typer.Option("--soak", help="Step 1e9 times through random scenes too.")] = False,
) -> None:
    """Where the methods hold and where they fail: theory beside nonlinear runs, stiff scenes, odd hands."""
    from netboard.studies import stability as study

    raise typer.Exit(study.main(output, quick=quick, force=force, soak=soak))
