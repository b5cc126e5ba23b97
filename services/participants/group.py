"""``netboard participants``: the parameters of simulated participants, fitted to people and drawn."""

import typer

from netboard.services.participants import draw, fit

app = typer.Typer(
    name="participants",
    help="Fit simulated participants to results of people, and draw participants from the fit.",
    no_args_is_help=True,
)
for command in (fit, draw):
    app.add_typer(command.app)
