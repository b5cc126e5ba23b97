"""``netboard participants fit``: the posterior of the parameters, by simulation-based inference."""

from pathlib import Path
from typing import Annotated

import typer

from netboard.services.loading import load
from netboard.services.options import CohortSeed, ConfigFile, Dask, Overrides, Workers, examples
from netboard.services.power import table_of

app = typer.Typer()


@app.command(
    epilog=examples(
        "netboard participants fit -o fit",
        "netboard participants fit --designs 2000 --calibrations 300 --truths 200 -o long",
        "netboard participants fit --set participant.arm_stiffness=250 -o stiffer",
    )
)
def fit(
    output: Annotated[Path, typer.Option("--output", "-o", metavar="FOLDER", help="New folder of the results.")],
    designs: Annotated[int, typer.Option(min=1, help="Parameter sets to which the emulator is fitted.")] = 400,
    calibrations: Annotated[int, typer.Option(min=1, help="Parameter sets that give its error.")] = 100,
    truths: Annotated[int, typer.Option(min=2, help="Known parameter sets that the fit must recover.")] = 50,
    predictions: Annotated[int, typer.Option(min=2, max=400, help="Draws of the posterior to simulate.")] = 50,
    seed: CohortSeed = 1,
    workers: Workers = None,
    dask: Dask = None,
    config: ConfigFile = None,
    overrides: Overrides = None,
) -> None:
    r"""Fit simulated participants to the paper's bimanual results with haptic feedback off, and check the fit.

    Needs additional libraries: pip install 'netboard\[analysis,fit]'.
    """
    settings = load(config, overrides)
    from netboard.analysis.cohort.workers import Runner
    from netboard.analysis.inference import tables
    from netboard.analysis.inference.fit import FitRequest
    from netboard.analysis.inference.fit import fit as fitted
    from netboard.base.files.new import refuse_existing
    from netboard.base.process.stopping import interrupted_by_stop_signals
    from netboard.base.process.workers import cores
    from netboard.base.terminal.bars import telling
    from netboard.base.terminal.output import plain_console

    refuse_existing(output)
    request = FitRequest(settings, seed, designs, calibrations, truths, predictions)
    with interrupted_by_stop_signals(), telling() as tell:
        found = fitted(request, Runner(tell, workers or cores(), dask))
    console = plain_console(soft_wrap=True)
    for part in tables.write(output, found):
        console.print(table_of(part))
    console.print(f"{output}: posterior.json, fit.json")
