"""``netboard bench stability`` and ``velocity``: the stability of methods and of velocity estimators."""

from typing import Annotated

import typer

from netboard.services.bench.options import Force, Json, Output, Quick
from netboard.services.options import examples

app = typer.Typer()


@app.command(epilog=examples("netboard bench stability --quick", "netboard bench stability --soak -o results"))
def stability(
    output: Output = None,
    quick: Quick = False,
    force: Force = False,
    soak: Annotated[bool, typer.Option("--soak", help="Also step 1e9 times through random scenes.")] = False,
) -> None:
    """Stability of the integration methods: theory, nonlinear runs, stiff scenes and unusual hands."""
    from netboard.benchmarks.stability import bench as study

    raise typer.Exit(study.main(output, quick=quick, force=force, soak_too=soak))


@app.command(epilog=examples("netboard bench velocity --quick", "netboard bench velocity -o results"))
def velocity(output: Output = None, quick: Quick = False, force: Force = False, json: Json = None) -> None:
    """Estimators of stylus velocity: lag, noise, computing time, and the largest stable delay with each."""
    from netboard.benchmarks.harness.running import run_named
    from netboard.benchmarks.stability.velocity import study

    run_named("velocity", study, output, json, quick=quick, force=force)
