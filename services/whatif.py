"""``netboard whatif``: counterfactual replay of a recording, attempt by attempt."""

import json
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from netboard.base.errors import RecordingError
from netboard.base.files.figure import refuse_figure, save_figure
from netboard.services.options import JsonObject, Model, Overrides, RecordingFile, changes_of, examples

if TYPE_CHECKING:
    from netboard.recording.counterfactual.what_if import AttemptComparison, WhatIf

app = typer.Typer()


@app.command(
    epilog=examples(
        "netboard whatif S01.mcap --set physics.k_h=400 --figure stiffer.png",
        "netboard whatif S01.mcap --set block.force=none --json",
        "netboard whatif S01.mcap --model lagrangian --output S01-lagrangian.mcap",
    )
)
def whatif(
    recording: RecordingFile,
    overrides: Overrides = None,
    model: Model = None,
    output: Annotated[
        Path | None, typer.Option("--output", "-o", metavar="FILE", help="Save the computed attempts as a recording.")
    ] = None,
    figure: Annotated[
        Path | None, typer.Option(metavar="FILE", help="Plot recorded and computed: .png, .svg or .pdf.")
    ] = None,
    trial: Annotated[
        int | None,
        typer.Option(
            min=1,
            help="Trial in the figure; default: the longest whose outcome changed, or else whose ball differs most.",
        ),
    ] = None,
    as_json: JsonObject = False,
) -> None:
    """Counterfactual replay: the recorded hands with another board, model or force condition.

    Open loop: the hands move as recorded. Each attempt starts from the state recorded at its release.
    """
    from netboard.base.config import parse
    from netboard.base.terminal.output import plain_console
    from netboard.recording.counterfactual.figure import draw
    from netboard.recording.counterfactual.table import EXPLANATION, as_data, table_of
    from netboard.recording.counterfactual.what_if import save, what_if
    from netboard.recording.files.reader import Recording
    from netboard.recording.format.partfile import require_new
    from netboard.recording.integrity.verification import why_not_computable
    from netboard.stage.stage import make_stage

    refuse_figure(figure)
    if output is not None:
        require_new(output)
    changes = changes_of(overrides, model)
    console = plain_console()
    with Recording(recording) as opened, plain_console(stderr=True).status("computing the attempts"):
        if why := why_not_computable(opened):
            raise RecordingError(f"{recording}: {why}")
        config = parse(opened.config_text, f"{recording} (its configuration)", changes)
        found = what_if(opened.ticks(), make_stage(config))
        source = opened.metadata
    if not found.comparisons:
        raise RecordingError(f"{recording}: contains no attempt to compare")
    shown = None if trial is None else attempt_at(found, trial, recording)
    if as_json:
        typer.echo(json.dumps(as_data(found, changes)))
    else:
        console.print(table_of(found.comparisons, changes))
        console.print("no difference: every bit is the same" if found.identical else EXPLANATION, soft_wrap=True)
    if output is not None:
        save(output, found, config, source, recording.name, changes)
    if figure is not None:
        save_figure(draw(found, changes, shown), figure, 100)


def attempt_at(found: "WhatIf", trial: int, path: Path) -> "AttemptComparison":
    """Return the last attempt at a trial."""
    attempts = [one for one in found.comparisons if one.then.trial == trial]
    if not attempts:
        trials = sorted({one.then.trial for one in found.comparisons})
        raise RecordingError(f"{path}: contains no attempt at trial {trial}; found trials {trials[0]} to {trials[-1]}")
    return attempts[-1]
