"""Exports recordings to the formats of other tools."""

from collections.abc import Sequence
from pathlib import Path

from rich.console import Console

from netboard.recording.export.formats import export
from netboard.recording.files.locate import find_recordings
from netboard.services.wording import telling


def main(words: Sequence[Path], name: str, output: Path | None) -> int:
    """Export recordings to a new folder, and print its contents.

    Parameters
    ----------
    output : Path or None
        The new folder; None names it after the format and the recordings.
    """
    recordings = find_recordings(words)
    folder = output or Path(f"{words[0].resolve().stem}_{name}")
    with telling() as tell:
        export(recordings, name, folder, tell)
    files = [path for path in folder.rglob("*") if path.is_file()]
    count = "1 recording" if len(recordings) == 1 else f"{len(recordings)} recordings"
    size = sum(path.stat().st_size for path in files) / 1e6
    Console(highlight=False, soft_wrap=True).print(
        f"{folder}: {len(files)} files of {count}, {size:.1f} MB", markup=False
    )
    return 0
