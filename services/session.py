"""Sessions of a study: ``netboard session``."""

from pathlib import Path
from typing import Annotated

import typer

from netboard.services import configuration
from netboard.services.configuration import ConfigFile, Overrides

app = typer.Typer(help="Rehearse the sessions of a study with simulated people.", no_args_is_help=True)


@app.command(
    epilog="Examples:\n\n  netboard session rehearse paper --dyad 3\n\n"
    "  netboard session rehearse study.toml --dyad 1 --blocks 2 --trials 5\n\n"
    "  netboard session rehearse paper --dyad 3 --output simulated --workers 2"
)
def rehearse(
    study: Annotated[str, typer.Argument(metavar="STUDY", help="A built-in study's name or a file.")],
    dyad: Annotated[int, typer.Option(min=1, help="Number of the dyad: its plan, and who its people are.")] = 1,
    seed: Annotated[int, typer.Option(min=0, max=2**31 - 1, help="Seed of everything that is drawn.")] = 1,
    config: ConfigFile = None,
    overrides: Overrides = None,
    fast: Annotated[
        bool, typer.Option("--fast/--real-time", help="As fast as the machine allows, or at the pace of the clock.")
    ] = True,
    blocks: Annotated[int | None, typer.Option(min=1, help="Only the first blocks.")] = None,
    trials: Annotated[int | None, typer.Option(min=1, help="At most so many trials in each.")] = None,
    output: Annotated[
        Path | None, typer.Option("--output", "-o", metavar="FOLDER", help="Write a recording of each block there.")
    ] = None,
    workers: Annotated[int, typer.Option(min=1, max=64, help="How many blocks at once, each in a process.")] = 1,
    json: Annotated[bool, typer.Option("--json", help="One line of JSON.")] = False,
) -> None:
    """Rehearse all blocks of a dyad with simulated participants, without devices, network or clock."""
    settings = configuration.load(config, overrides or ())
    from netboard.services import rehearsal as service
    from netboard.services import studies
    from netboard.task.plans.plan import blocks_of, shortened

    wanted = list(shortened(blocks_of(settings, studies.load(study), seed, dyad), blocks, trials))
    code = service.main(wanted, seed, dyad, folder=output, fast=fast, workers=workers, as_json=json)
    raise typer.Exit(code)
