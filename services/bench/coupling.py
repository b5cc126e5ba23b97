"""``netboard bench coupling`` and ``forces``: the virtual coupling, and the forces on both hands."""

import typer

from netboard.services.bench.options import Force, Json, Output, Quick
from netboard.services.options import examples

app = typer.Typer()


@app.command(epilog=examples("netboard bench coupling --quick", "netboard bench coupling -o results"))
def coupling(output: Output = None, quick: Quick = False, force: Force = False, json: Json = None) -> None:
    """Maximum stable delay of the virtual coupling: theory, the simulated service, and what extends it."""
    from netboard.benchmarks.coupling.bench import study
    from netboard.benchmarks.harness.running import run_named

    run_named("coupling", study, output, json, quick=quick, force=force)


@app.command(epilog=examples("netboard bench forces --quick", "netboard bench forces -o results"))
def forces(output: Output = None, quick: Quick = False, force: Force = False, json: Json = None) -> None:
    """Forces on both hands for one movement under each of the six force conditions, as a figure and a table."""
    from netboard.benchmarks.coupling.forces import study
    from netboard.benchmarks.harness.running import run_named

    run_named("forces", study, output, json, quick=quick, force=force)
