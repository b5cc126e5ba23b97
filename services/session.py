"""``netboard session``: rehearsals of the sessions of a study."""

from pathlib import Path
from typing import Annotated

import typer

from netboard.services.loading import load, load_study
from netboard.services.options import Blocks, ConfigFile, Dyad, Json, Overrides, PlanSeed, Study, Trials, examples

app = typer.Typer(
    name="session", help="Rehearse the sessions of a study with simulated participants.", no_args_is_help=True
)


@app.command(
    epilog=examples(
        "netboard session rehearse paper --dyad 3",
        "netboard session rehearse study.toml --dyad 1 --blocks 2 --trials 5",
        "netboard session rehearse paper --dyad 3 --output simulated --workers 2",
    )
)
def rehearse(
    study: Study,
    dyad: Dyad = 1,
    seed: PlanSeed = 1,
    config: ConfigFile = None,
    overrides: Overrides = None,
    fast: Annotated[bool, typer.Option("--fast/--real-time", help="Run as fast as possible, or in real time.")] = True,
    blocks: Blocks = None,
    trials: Trials = None,
    output: Annotated[
        Path | None, typer.Option("--output", "-o", metavar="FOLDER", help="Write a recording of each block there.")
    ] = None,
    workers: Annotated[int, typer.Option(min=1, max=64, help="Number of processes, each with one block.")] = 1,
    json: Json = False,
) -> None:
    """Rehearse all blocks of a dyad with simulated participants, without devices, network or clock."""
    settings = load(config, overrides)
    from netboard.base.process.stopping import interrupted_by_stop_signals
    from netboard.nodes.rehearsal.session import rehearse_blocks
    from netboard.task.plans.plan import blocks_of, shortened

    wanted = list(shortened(blocks_of(settings, load_study(study, settings), seed, dyad), blocks, trials))
    with interrupted_by_stop_signals():
        code = rehearse_blocks(wanted, seed, dyad, folder=output, fast=fast, workers=workers, as_json=json)
    raise typer.Exit(code)
