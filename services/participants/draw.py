"""``netboard participants draw``: participants of a posterior."""

import json as json_text
from typing import Annotated

import typer

from netboard.services.loading import load
from netboard.services.options import POSTERIOR, ConfigFile, Json, Overrides, examples

app = typer.Typer()


@app.command(
    epilog=examples(
        "netboard participants draw --number 8", "netboard participants draw --posterior fit/posterior.json --json"
    )
)
def draw(
    posterior: Annotated[
        str,
        typer.Option(
            metavar=POSTERIOR, help="File of netboard participants fit, or the posterior that comes with netboard."
        ),
    ] = "bimanual_off",
    number: Annotated[int, typer.Option(min=1, max=400, help="Number of participants.")] = 4,
    seed: Annotated[int, typer.Option(min=0, help="Random seed of the first one; the others have the next ones.")] = 1,
    config: ConfigFile = None,
    overrides: Overrides = None,
    json: Json = False,
) -> None:
    """Draw usual participants from a posterior, and print their fitted parameters."""
    settings = load(config, overrides)
    from netboard.analysis.cohort.posterior import read_posterior
    from netboard.base.terminal.output import FittedTable, plain_console

    found = read_posterior(posterior)
    people = [found.participant(settings.participant, seed + place) for place in range(number)]
    rows = {name: [getattr(person, name) for person in people] for name in found.parameters}
    if json:
        typer.echo(json_text.dumps(rows))
        return
    table = FittedTable("key", *(f"seed {seed + place}" for place in range(number)))
    for name, values in rows.items():
        table.add_row(name, *(f"{value:.4g}" for value in values))
    plain_console().print(table)
