"""``netboard trace``: why a session stuttered, from the stamps of its recording."""

import json
from pathlib import Path
from typing import Annotated

import typer

from netboard.base.errors import RecordingError
from netboard.base.files.figure import refuse_figure, save_figure
from netboard.services.options import JsonObject, RecordingFile, examples

app = typer.Typer()


@app.command(
    "trace",
    epilog=examples(
        "netboard trace S01.mcap",
        "netboard trace S01.mcap --figure stutter.png --tick 48211",
        "netboard trace S01.mcap --late 0.2 --json",
    ),
)
def trace(
    recording: RecordingFile,
    late: Annotated[
        float,
        typer.Option(
            min=0, max=60_000, metavar="MS", help="A tick stutters if it begins this long after its deadline [ms]."
        ),
    ] = 0.5,
    worst: Annotated[int, typer.Option(min=0, help="Number of episodes to list.")] = 10,
    figure: Annotated[
        Path | None, typer.Option(metavar="FILE", help="Plot the ticks around the worst one: .png, .svg or .pdf.")
    ] = None,
    tick: Annotated[int | None, typer.Option(min=0, help="Tick in the figure; default: the worst one.")] = None,
    scheduler: Annotated[
        Path | None,
        typer.Option(metavar="FILE", help="The kernel's sched_switch events, to name the threads that ran instead."),
    ] = None,
    as_json: JsonObject = False,
) -> None:
    """Find the ticks that stuttered, the cause of each, and what to do about it."""
    from netboard.base.terminal.output import plain_console
    from netboard.recording.files.reader import Recording
    from netboard.recording.timing import scheduler as switches
    from netboard.recording.timing.figure import draw
    from netboard.recording.timing.stamps import stamps_of
    from netboard.recording.timing.trace import advice, as_data, causes_table, row_of, spreads_table, worst_table
    from netboard.recording.timing.trace import trace as traced

    refuse_figure(figure)
    with Recording(recording) as opened:
        found = traced(stamps_of(opened), round(late * 1e6))
    shown = None if tick is None else row_of(found, tick)
    if shown is not None and found.stamps.tick[shown] != tick:
        first, last = found.stamps.tick[0], found.stamps.tick[-1]
        raise RecordingError(f"{recording}: has no tick {tick}; found ticks {first} to {last}")
    ran = None if scheduler is None else switches.read(scheduler)
    if as_json:
        typer.echo(json.dumps(as_data(found, recording.name)))
    else:
        console = plain_console()
        console.print(spreads_table(found), causes_table(found))
        for sentence in advice(found):
            console.print(sentence)
        if found.episodes and worst:
            console.print("", worst_table(found, worst))
        if ran is not None:
            console.print(switches.table(found, ran, worst))
    if figure is not None:
        save_figure(draw(found, recording.name, shown), figure, 150)
