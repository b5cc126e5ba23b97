"""Which recordings are meant by the names of files and folders."""

from collections.abc import Sequence
from pathlib import Path

from netboard.base.errors import RecordingError


def find_recordings(paths: Sequence[Path]) -> tuple[Path, ...]:
    """Find the recordings that are meant.

    Returns
    -------
    tuple of Path
        Each once, in the order in which they are named, and by name within a folder.

    Raises
    ------
    RecordingError
        If there is none, or two of them have one name: what is made of them could not be told apart.
    """
    found: list[Path] = []
    for path in paths:
        here = sorted(path.glob("*.mcap")) if path.is_dir() else [path]
        if not here:
            raise RecordingError(f"{path}: there is no recording (.mcap) in this folder")
        found += here
    names: dict[str, Path] = {}
    for path in dict.fromkeys(found):
        other = names.setdefault(path.stem, path)
        if other != path:
            raise RecordingError(f"{other} and {path} have the same name; take them one at a time, or rename one")
    return tuple(names.values())
