"""``netboard train evaluate``: a learned partner beside held-out simulated participants."""

from dataclasses import asdict
from typing import Annotated

import typer

from netboard.services.loading import load
from netboard.services.options import POSTERIOR, ConfigFile, Json, Overrides, examples

app = typer.Typer()


@app.command(epilog=examples("netboard train evaluate trained/weights.json", "netboard train evaluate learned --json"))
def evaluate(
    weights: Annotated[
        str, typer.Argument(metavar="FILE|learned", help="File of weights, or those that come with netboard.")
    ],
    posterior: Annotated[
        str, typer.Option(metavar=POSTERIOR, help="What the simulated participants are drawn from.")
    ] = "bimanual_off",
    held_out: Annotated[int, typer.Option(min=1, max=400, help="Number of held-out participants.")] = 8,
    trials: Annotated[int, typer.Option(min=1, max=1000, help="Trials beside each of them, at each side.")] = 5,
    config: ConfigFile = None,
    overrides: Overrides = None,
    json: Json = False,
) -> None:
    """Play blocks beside simulated participants that no training uses, and compare with pairs of them."""
    settings = load(config, overrides)
    import json as json_text

    from netboard.analysis.cohort.posterior import read_posterior
    from netboard.base.process.stopping import interrupted_by_stop_signals
    from netboard.base.terminal.bars import telling
    from netboard.base.terminal.output import plain_console
    from netboard.participants.robots.learned import read_weights
    from netboard.training.evaluation import evaluate as evaluated
    from netboard.training.population import Population

    read_weights(weights)  # refused before anything is computed
    people = Population(read_posterior(posterior), settings.participant).held_out(held_out)
    with interrupted_by_stop_signals(), telling() as tell:
        found = evaluated(weights, people, settings, trials, tell)
    if json:
        typer.echo(json_text.dumps(asdict(found)))
        return
    console = plain_console(soft_wrap=True)
    for line in found.lines():
        console.print(line)
