"""``netboard bench fuzz`` and ``faults``: malformed frames and faults in real processes."""

from typing import Annotated

import typer

from netboard.services.bench.options import Force, Output, Quick
from netboard.services.options import examples

app = typer.Typer()


@app.command(epilog=examples("netboard bench fuzz --quick", "netboard bench fuzz --frames 1000000 -o results"))
def fuzz(
    output: Output = None,
    quick: Quick = False,
    force: Force = False,
    frames: Annotated[
        int | None,
        typer.Option(min=100, metavar="N", help="Malformed frames per codec and socket; default: a million."),
    ] = None,
) -> None:
    """Malformed frames for the codec and every socket: no crash, no hang, no growth, no changed force."""
    from netboard.benchmarks.faults import fuzz as study

    raise typer.Exit(study.main(output, quick=quick, force=force, frames=frames))


@app.command(
    epilog=examples("netboard bench faults --quick", "netboard bench faults --case server-killed -o results"),
)
def faults(
    output: Output = None,
    quick: Annotated[bool, typer.Option("--quick", help="Short version: fewer faults and shorter waits.")] = False,
    force: Force = False,
    case: Annotated[list[str] | None, typer.Option(metavar="NAME", help="Only this fault; repeat for several.")] = None,
    listing: Annotated[bool, typer.Option("--list", help="List the faults, and stop.")] = False,
) -> None:
    """Faults in real processes (kill, stop, cut the network, fill the disk), and how the system reacts."""
    from netboard.benchmarks.faults import bench as study

    raise typer.Exit(study.list_cases() if listing else study.main(output, quick=quick, force=force, names=case or ()))
