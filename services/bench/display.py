"""``netboard bench display``: latency of a participant's display."""

from typing import Annotated

import typer

from netboard.services.bench.options import Force, Json, Output, Quick
from netboard.services.loading import load
from netboard.services.options import ConfigFile, Overrides, examples

app = typer.Typer()


@app.command(
    epilog=examples("netboard bench display --quick", "netboard bench display --set display.width=1920"),
)
def display(
    config: ConfigFile = None,
    overrides: Overrides = None,
    output: Output = None,
    quick: Quick = False,
    force: Force = False,
    json: Json = None,
    seconds: Annotated[
        float | None,
        typer.Option(min=1, metavar="S", help="Seconds per measurement; default: 30."),
    ] = None,
) -> None:
    """Latency of a display, from sending a view to painting it: late views, dropped frames, cost."""
    settings = load(config, overrides)
    from netboard.benchmarks.loop import display as study

    raise typer.Exit(study.main(settings, output, json, seconds, quick=quick, force=force))
