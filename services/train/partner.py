"""``netboard train partner``: a robot partner learns beside a population of simulated participants."""

from pathlib import Path
from typing import Annotated

import typer

from netboard.services.loading import load
from netboard.services.options import MOST_SEED, POSTERIOR, ConfigFile, Overrides, examples

app = typer.Typer()


@app.command(
    epilog=examples(
        "netboard train partner -o trained",
        "netboard train partner -o trained --resume",
        "netboard train partner --seed 2 --rounds 32 -o longer",
        "netboard demo --play left --partner trained/weights.json",
    )
)
def partner(
    output: Annotated[
        Path, typer.Option("--output", "-o", metavar="FOLDER", help="New folder of the results and checkpoints.")
    ],
    seed: Annotated[int, typer.Option(min=0, max=MOST_SEED, help="Random seed of the training.")] = 1,
    rounds: Annotated[
        int, typer.Option(min=1, max=1000, help="Rounds of 131 072 steps; each ends with a checkpoint.")
    ] = 6,
    units: Annotated[int, typer.Option(min=1, max=128, help="Units of each hidden layer.")] = 32,
    posterior: Annotated[
        str, typer.Option(metavar=POSTERIOR, help="What the simulated participants are drawn from.")
    ] = "bimanual_off",
    held_out: Annotated[int, typer.Option(min=1, max=400, help="Held-out participants of the evaluation.")] = 8,
    trials: Annotated[int, typer.Option(min=1, max=1000, help="Trials beside each of them, at each side.")] = 5,
    resume: Annotated[bool, typer.Option("--resume", help="Continue the training in this folder.")] = False,
    config: ConfigFile = None,
    overrides: Overrides = None,
) -> None:
    r"""Train a robot partner, and evaluate it beside held-out participants.

    Needs additional libraries: pip install 'netboard\[train]'; the how-to page says how to avoid CUDA on Linux.
    """
    settings = load(config, overrides)
    from netboard.base.process.stopping import interrupted_by_stop_signals
    from netboard.base.terminal.bars import telling
    from netboard.base.terminal.output import plain_console
    from netboard.training.progress import TrainingRequest
    from netboard.training.session import TrainingSession

    request = TrainingRequest(seed=seed, rounds=rounds, units=units)
    console = plain_console(soft_wrap=True)
    with interrupted_by_stop_signals(), telling() as tell:
        session = TrainingSession(request, settings, posterior, output, resume=resume)
        found = session.run(tell, held_out=held_out, trials=trials)
    for line in found.lines():
        console.print(line)
    console.print(f"{output}: weights.json, curve.csv, curve.png")
