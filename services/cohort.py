"""``netboard cohort``: virtual studies with simulated participants, as tables."""

from pathlib import Path
from typing import Annotated, Literal

import typer

from netboard.base.plural import plural
from netboard.services.loading import load, load_study
from netboard.services.options import (
    STUDY_HELP,
    CohortSeed,
    ConfigFile,
    Dask,
    Overrides,
    Posterior,
    Studies,
    Workers,
    examples,
)

app = typer.Typer()


@app.command(
    epilog=examples(
        "netboard cohort paper --studies 100 --dyads 4 -o cohort",
        "netboard cohort study.toml --studies 1000 --dyads 16 --set participant.partner_model=mechanics -o without",
        "netboard cohort paper --studies 1000 --dyads 4 -o cohort --resume",
        "netboard cohort paper --studies 1000 --posterior bimanual_off -o uncertain",
        "netboard cohort paper --studies 100 --dyads 4 -o all --trials parquet --dask tcp://10.0.0.5:8786",
    )
)
def cohort(
    output: Annotated[Path, typer.Option("--output", "-o", metavar="FOLDER", help="Folder of the cohort.")],
    study: Annotated[str, typer.Argument(metavar="[STUDY]", help=STUDY_HELP)] = "paper",
    studies: Studies = 100,
    dyads: Annotated[int, typer.Option(min=1, help="Dyads in each virtual study.")] = 4,
    seed: CohortSeed = 1,
    trials: Annotated[
        Literal["parquet", "csv"] | None,
        typer.Option(help="Also write a table with a row for each attempt, in this format. The models need it."),
    ] = None,
    workers: Workers = None,
    dask: Dask = None,
    posterior: Posterior = None,
    resume: Annotated[
        bool, typer.Option("--resume", help="Continue a cohort that was interrupted, or add studies to it.")
    ] = False,
    config: ConfigFile = None,
    overrides: Overrides = None,
) -> None:
    r"""Simulate many virtual studies of a plan, and write their results as tables, without recordings.

    Needs additional libraries: pip install 'netboard\[analysis]', and for --dask also 'netboard\[dask]'.
    """
    settings = load(config, overrides)
    import time

    from netboard.analysis.cohort.folder import make_cohort
    from netboard.analysis.cohort.posterior import read_posterior
    from netboard.analysis.cohort.virtual import VirtualDesign
    from netboard.analysis.cohort.workers import Runner
    from netboard.base.process.stopping import interrupted_by_stop_signals
    from netboard.base.process.workers import cores
    from netboard.base.terminal.bars import telling
    from netboard.base.terminal.output import plain_console

    design = VirtualDesign(
        load_study(study, settings),
        settings,
        dyads,
        seed,
        keep_trials=trials is not None,
        posterior=None if posterior is None else read_posterior(posterior),
    )
    began = time.perf_counter()
    with interrupted_by_stop_signals(), telling() as tell:
        runner = Runner(tell, workers or cores(), dask)
        made = make_cohort(design, studies, output, runner, resume=resume, ending=trials or "parquet")
    seconds = time.perf_counter() - began
    console = plain_console(soft_wrap=True)
    size = f"{plural(studies, 'virtual study', 'virtual studies')} of {plural(dyads, 'dyad')}"
    console.print(f"{made.folder / 'tables'}: {size}; {seconds:.1f} s")
