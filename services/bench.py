"""Benchmarks and studies of the physics: ``netboard bench``.

A study, and the libraries it needs, is imported when it is asked for.
"""

from pathlib import Path
from typing import Annotated, Literal

import typer

app = typer.Typer(help="Measure the physics on this machine: stability and cost of the methods.", no_args_is_help=True)

Model = Literal["paper", "lagrangian"]

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
    from netboard.endurance import bench as study

    raise typer.Exit(study.main(output, quick=quick, force=force, soak_too=soak))


@app.command(
    epilog="Examples:\n\n  netboard bench physics --quick\n\n  netboard bench physics --peers heyoka -o results"
)
def physics(
    output: Output = None,
    quick: Quick = False,
    force: Force = False,
    peers: Annotated[
        str | None, typer.Option(metavar="NAMES", help="Only these libraries beside us, as in heyoka,mujoco.")
    ] = None,
    no_peers: Annotated[bool, typer.Option("--no-peers", help="No libraries beside us.")] = False,
    model: Annotated[Model | None, typer.Option(help="Only this model's equations.")] = None,
    repeats: Annotated[int | None, typer.Option(min=1, help="Turns of each in the timing.")] = None,
) -> None:
    """Work and precision of the methods, beside other libraries; cost of a tick, of sampling, of what a scene lacks."""
    from netboard.precision import bench as study

    names = [] if no_peers else peers.split(",") if peers else None
    raise typer.Exit(study.main(output, quick=quick, force=force, peers=names, model=model, repeats=repeats))
