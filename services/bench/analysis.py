"""``netboard bench analysis``: cost, sensitivity, calibration and errors of an analysis."""

from pathlib import Path
from typing import Annotated

import typer

from netboard.base.errors import ConfigError
from netboard.services.bench.options import Force, Json, Output, Quick
from netboard.services.options import examples

app = typer.Typer()


@app.command(
    epilog=examples(
        "netboard bench analysis --quick",
        "netboard bench analysis recordings/ -o results",
        "netboard bench analysis recordings/ --sensitivity",
        "netboard bench analysis --calibration --quick",
        "netboard bench analysis --truth",
    )
)
def analysis(
    recordings: Annotated[
        Path | None, typer.Argument(metavar="[DIR]", help="Recordings of a study; default: rehearse the paper's plan.")
    ] = None,
    sensitivity: Annotated[
        bool,
        typer.Option("--sensitivity", help="Sensitivity of each measure to settings, noise and lost samples, instead."),
    ] = False,
    calibration: Annotated[
        bool,
        typer.Option("--calibration", help="False positive rate of the tests in simulated studies, instead."),
    ] = False,
    truth: Annotated[
        bool, typer.Option("--truth", help="Measures of trials whose true values are known, instead.")
    ] = False,
    output: Output = None,
    quick: Quick = False,
    force: Force = False,
    json: Json = None,
    workers: Annotated[
        int | None,
        typer.Option(min=1, metavar="N", help="Processes; default: one per core, or one for a small study."),
    ] = None,
) -> None:
    """Cost of analysing a study: time and memory against its size, with and without the cache."""
    alone = not (sensitivity or recordings is not None or workers is not None)
    if calibration and (truth or not alone):
        raise ConfigError(
            "--calibration: found with recordings, --sensitivity, --truth or --workers; it simulates its own studies"
        )
    if truth and not alone:
        raise ConfigError("--truth: found with recordings, --sensitivity or --workers; it makes its own trials")
    if workers is not None and sensitivity:
        raise ConfigError("--workers: found with --sensitivity, which uses all cores; leave it out")
    from netboard.benchmarks.harness.running import run_named

    if calibration:
        from netboard.benchmarks.analysis.calibration import study as simulations

        run_named("calibration", simulations, output, json, quick=quick, force=force)
    elif truth:
        from netboard.benchmarks.analysis.ground_truth_bench import study as ground_truth

        run_named("truth", ground_truth, output, json, quick=quick, force=force)
    elif sensitivity:
        from netboard.benchmarks.analysis import sensitivity_bench

        sensitivity_bench.main(recordings, output, json, quick=quick, force=force)
    else:
        from netboard.benchmarks.analysis import speed_bench

        speed_bench.main(recordings, workers, output, json, quick=quick, force=force)
