"""``netboard explain``: how each measure of one trial is computed, as a figure."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from netboard.base.errors import ConfigError, RecordingError
from netboard.services.loading import load_readings
from netboard.services.options import Overrides, RecordingFile, SettingsFile, examples

if TYPE_CHECKING:
    from netboard.analysis.extraction.settings import Readings
    from netboard.analysis.extraction.trials import AttemptData

app = typer.Typer()

KINDS = ("png", "svg", "pdf")
"""Suffixes of the figures that can be written."""


@app.command(
    epilog=examples(
        "netboard explain S01.mcap --trial 12",
        "netboard explain S01.mcap --trial 12 --set peaks.window=whole -o trial12.svg",
    )
)
def explain(
    recording: RecordingFile,
    trial: Annotated[int, typer.Option(min=1, help="Number of the trial in its block.")],
    attempt: Annotated[int | None, typer.Option(min=1, help="Number of the attempt; default: the last one.")] = None,
    settings: SettingsFile = None,
    overrides: Overrides = None,
    output: Annotated[
        Path | None,
        typer.Option(
            "--output", "-o", metavar="FILE", help="New figure (.png, .svg or .pdf); default: named after the trial."
        ),
    ] = None,
) -> None:
    """Plot how each measure of one trial is computed: its signals, and what the measures detect in them."""
    typer.echo(draw(recording, trial, attempt, load_readings(settings, overrides), output))


def draw(path: Path, trial: int, attempt: int | None, readings: "Readings", output: Path | None) -> str:
    """Write the figure of an attempt, or of the last one at the trial, and return what was written."""
    from netboard.base.files.new import new_file
    from netboard.recording.export.formats import library

    library("matplotlib", "analysis")
    from netboard.analysis.topics.figure import as_bytes
    from netboard.analysis.topics.trial import sheet

    output = output or Path(f"{path.stem}_trial{trial}.png")
    kind = output.suffix.removeprefix(".")
    if kind not in KINDS:
        raise ConfigError(f"--output {output}: expected a file that ends with .{', .'.join(KINDS)}")
    picture = sheet(_find(path, trial, attempt, readings))
    assert picture.figure is not None
    with new_file(output) as part:
        part.write_bytes(as_bytes(picture.figure, kind))
    return f"{output}: {picture.title} of {path.name}"


def _find(path: Path, trial: int, attempt: int | None, readings: "Readings") -> "AttemptData":
    """Find an attempt that can be measured."""
    from netboard.analysis.extraction.trials import BlockData
    from netboard.recording.export.runs import runs_of
    from netboard.recording.files.reader import Recording

    (run,) = runs_of([path])
    with Recording(path) as recording:
        block = BlockData.of(recording, run.config, readings)
    takes = [take for take in block.takes() if take.attempt.trial == trial]
    found = [take for take in takes if attempt in (None, take.attempt.attempt)]
    if not found:
        what = f"trial {trial}" if attempt is None else f"attempt {attempt} at trial {trial}"
        trials = sorted({one.trial for one in block.attempts})
        numbers = f"trials {trials[0]} to {trials[-1]} are there" if trials else "there is no trial"
        raise RecordingError(f"{path}: {what} has no end that can be measured; {numbers}")
    return found[-1]
