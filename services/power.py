"""``netboard power``: power, false-positive rate and precision of a study against its number of dyads."""

from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from netboard.services.loading import load, load_study
from netboard.services.options import (
    CohortSeed,
    ConfigFile,
    Dask,
    Overrides,
    Posterior,
    Studies,
    Study,
    Workers,
    examples,
)
from netboard.services.values import whole_numbers_of

if TYPE_CHECKING:
    from netboard.base.terminal.output import FittedTable

app = typer.Typer()


@app.command(
    epilog=examples(
        "netboard power paper --dyads 4,8,12,16,24 --studies 200 -o power",
        "netboard power paper --contrast 'completion time: dyadic' --trials 60,180 -o short",
        "netboard power paper --cohort cohort --dyads 4 -o four",
        "netboard power study.toml --dyads 8,16 --models -o models",
        "netboard power paper --posterior bimanual_off --dyads 8,16 -o assured",
    )
)
def power(
    study: Study,
    output: Annotated[Path, typer.Option("--output", "-o", metavar="FOLDER", help="New folder of the results.")],
    contrasts: Annotated[
        list[str] | None,
        typer.Option(
            "--contrast",
            metavar="TEXT",
            help="Only contrasts whose name, MEASURE: CONTRAST, contains this text; repeat for several.",
        ),
    ] = None,
    dyads: Annotated[str, typer.Option(metavar="N,N", help="Numbers of dyads.")] = "4,8,12,16,24",
    trials: Annotated[
        str, typer.Option(metavar="N,N", help="Use only this many first trials of each condition, in groups of 30.")
    ] = "all",
    studies: Studies = 200,
    seed: CohortSeed = 1,
    alpha: Annotated[float, typer.Option(min=0.0001, max=0.5, help="Significance level, two-sided.")] = 0.05,
    models: Annotated[
        bool, typer.Option("--models", help="Also fit the models of all trials, which takes long.")
    ] = False,
    cohort: Annotated[
        Path | None,
        typer.Option(metavar="FOLDER", help="Use all finished studies of this cohort instead of simulating one."),
    ] = None,
    posterior: Posterior = None,
    workers: Workers = None,
    dask: Dask = None,
    config: ConfigFile = None,
    overrides: Overrides = None,
) -> None:
    r"""Compute what a study can find: power, false positives and precision of its contrasts by number of dyads.

    Needs additional libraries: pip install 'netboard\[analysis]', and for --dask also 'netboard\[dask]'.
    """
    settings = load(config, overrides)
    from netboard.analysis.cohort.planning import Request, answer
    from netboard.analysis.cohort.posterior import read_posterior
    from netboard.analysis.cohort.workers import Runner
    from netboard.base.process.stopping import interrupted_by_stop_signals
    from netboard.base.process.workers import cores
    from netboard.base.terminal.bars import telling
    from netboard.base.terminal.output import plain_console

    request = Request(
        load_study(study, settings),
        settings,
        dyads=whole_numbers_of("--dyads", dyads, 2),
        trials=(0,) if trials == "all" else whole_numbers_of("--trials", trials, 1),
        studies=studies,
        seed=seed,
        alpha=alpha,
        contrasts=tuple(contrasts or ()),
        models=models,
        posterior=None if posterior is None else read_posterior(posterior),
    )
    with interrupted_by_stop_signals(), telling() as tell:
        found = answer(request, output, cohort, Runner(tell, workers or cores(), dask))
    console = plain_console(soft_wrap=True)
    for part in found.parts:
        if part["name"] in ("about", "power", "assurance"):  # the others are in power.json
            console.print(table_of(part))
    console.print(found.sentence)
    console.print(f"{output}: power.csv, power.json, power.png, power.svg, methods.txt")


def table_of(part: "Mapping[str, Any]") -> "FittedTable":
    """Return one table of an answer."""
    from netboard.base.terminal.output import FittedTable, as_cell

    return FittedTable(*part["columns"], rows=[tuple(map(as_cell, row)) for row in part["rows"]], title=part["title"])
