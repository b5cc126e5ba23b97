"""Plots how each measure of one trial is computed."""

from pathlib import Path

from rich.console import Console

from netboard.analysis.extraction.settings import Readings
from netboard.analysis.extraction.trials import Block, Take
from netboard.base.errors import ConfigError, RecordingError
from netboard.recording.export.formats import library
from netboard.recording.export.runs import runs_of
from netboard.recording.files.reader import Recording

KINDS = ("png", "svg", "pdf")
"""Endings of the files that can be written."""


def main(path: Path, trial: int, attempt: int | None, readings: Readings, output: Path | None) -> int:
    """Plot the sheet of a trial.

    Parameters
    ----------
    attempt : int or None
        Number of the attempt at it; None for the last one.
    output : Path or None
        The new file; its ending says what kind. None names it after the recording and the trial.

    Raises
    ------
    RecordingError
        If the recording cannot be read, there is no such trial in it, or the file is there already.
    """
    library("matplotlib", "analysis")
    from netboard.analysis.topics.figure import as_bytes
    from netboard.analysis.topics.trial import sheet

    output = output or Path(f"{path.stem}_trial{trial}.png")
    kind = output.suffix.removeprefix(".")
    if kind not in KINDS:
        raise ConfigError(f"--output {output}: expected a file that ends with .{', .'.join(KINDS)}")
    picture = sheet(_find(path, trial, attempt, readings))
    assert picture.figure is not None
    try:
        with output.open("xb") as file:
            file.write(as_bytes(picture.figure, kind))
    except FileExistsError:
        raise RecordingError(f"{output}: is there already; name another --output") from None
    except OSError as error:
        raise RecordingError(f"{output}: cannot be written: {error.strerror}") from error
    Console(highlight=False, soft_wrap=True).print(f"{output}: {picture.title} of {path.name}", markup=False)
    return 0


def _find(path: Path, trial: int, attempt: int | None, readings: Readings) -> Take:
    """Find an attempt that can be measured."""
    (run,) = runs_of([path])
    with Recording(path) as recording:
        block = Block(recording, run.config, readings)
    takes = [take for take in block.takes() if take.attempt.trial == trial]
    found = [take for take in takes if attempt in (None, take.attempt.attempt)]
    if not found:
        what = f"trial {trial}" if attempt is None else f"attempt {attempt} at trial {trial}"
        there = sorted({one.trial for one in block.attempts})
        numbers = f"trials {there[0]} to {there[-1]} are there" if there else "there is no trial"
        raise RecordingError(f"{path}: {what} has no end that can be measured; {numbers}")
    return found[-1]
