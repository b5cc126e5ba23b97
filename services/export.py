"""Exports recordings to the formats of other tools."""

from collections.abc import Sequence
from pathlib import Path

from rich.console import Console
from rich.markup import escape
from rich.progress import BarColumn, Progress, TaskProgressColumn, TextColumn, TimeRemainingColumn

from netboard.export.formats import export
from netboard.recording.finding import find_recordings


def main(words: Sequence[Path], name: str, output: Path | None) -> int:
    """Export recordings to a new folder, and say what is in it.

    Parameters
    ----------
    words : sequence of Path
        Recordings, and folders of them.
    name : str
        Name of the format.
    output : Path or None
        The new folder; None names it after the format and what is exported.

    Returns
    -------
    int
        Exit code.
    """
    recordings = find_recordings(words)
    folder = output or Path(f"{words[0].stem}_{name}")
    screen = Console(stderr=True)
    bars = (TextColumn("{task.description}"), BarColumn(), TaskProgressColumn(), TimeRemainingColumn())
    with Progress(*bars, console=screen, transient=True, disable=not screen.is_terminal) as progress:
        task = progress.add_task("")

        def tell(what: str, done: int, total: int) -> None:
            progress.update(task, description=escape(what), completed=done, total=total)

        export(recordings, name, folder, tell)
    files = [path for path in folder.rglob("*") if path.is_file()]
    size = sum(path.stat().st_size for path in files) / 1e6
    Console(highlight=False, soft_wrap=True).print(
        f"{folder}: {len(recordings)} recordings, {len(files)} files, {size:.1f} MB", markup=False
    )
    return 0
