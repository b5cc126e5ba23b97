"""``netboard train``: robot partners that learn beside simulated participants."""

import typer

from netboard.services.train import evaluate, onnx, partner

app = typer.Typer(
    name="train",
    help="Train a robot partner beside simulated participants, evaluate its weights, and export them.",
    no_args_is_help=True,
)
for command in (partner, evaluate, onnx):
    app.add_typer(command.app)
