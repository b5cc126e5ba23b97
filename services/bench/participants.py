"""``netboard bench participants``: simulated participants compared with the paper's."""

from typing import Annotated

import typer

from netboard.services.bench.options import Force, Json, Output, Quick
from netboard.services.options import Workers, examples

app = typer.Typer()


@app.command(epilog=examples("netboard bench participants --quick", "netboard bench participants --studies 200"))
def participants(
    output: Output = None,
    quick: Quick = False,
    force: Force = False,
    json: Json = None,
    studies: Annotated[int, typer.Option(min=1, metavar="N", help="Virtual studies of four dyads.")] = 200,
    dyads: Annotated[
        int | None,
        typer.Option(min=4, metavar="N", help="Dyads from which the studies are drawn, a multiple of 4; default: 16."),
    ] = None,
    workers: Workers = None,
) -> None:
    """Compare the simulated participants, and variants that lack one part, with the paper's results."""
    from netboard.benchmarks.harness.running import run_named
    from netboard.benchmarks.participants.bench import study

    run_named("participants", study(studies, dyads, workers), output, json, quick=quick, force=force)
