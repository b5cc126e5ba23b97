"""``netboard bench physics``: work and precision of the integration methods."""

from typing import Annotated, Literal

import typer

from netboard.services.bench.options import Force, Output, Quick
from netboard.services.options import examples

app = typer.Typer()


@app.command(
    epilog=examples("netboard bench physics --quick", "netboard bench physics --peers heyoka -o results"),
)
def physics(
    output: Output = None,
    quick: Quick = False,
    force: Force = False,
    peers: Annotated[
        str | None, typer.Option(metavar="NAMES", help="Compare only with these libraries, for example heyoka,mujoco.")
    ] = None,
    no_peers: Annotated[bool, typer.Option("--no-peers", help="Compare with no other library.")] = False,
    model: Annotated[
        Literal["paper", "lagrangian"] | None, typer.Option(help="Only the equations of this model.")
    ] = None,
    repeats: Annotated[int | None, typer.Option(min=1, help="Repetitions of each timing.")] = None,
) -> None:
    """Work and precision of the integration methods, compared with other libraries.

    It also measures the cost of a tick and of sampling, and what simple scenes save.
    """
    from netboard.benchmarks.physics import bench as study

    names = [] if no_peers else peers.split(",") if peers else None
    raise typer.Exit(study.main(output, quick=quick, force=force, peers=names, model=model, repeats=repeats))
