"""Files that a page of the launcher writes: complete or not at all, and nothing that is there is lost."""

from itertools import count
from pathlib import Path

from netboard.base.errors import ConfigError, NetboardError, writing
from netboard.base.files.new import new_file, write_synced


class EditedFile:
    """The file that a page shows; of all files that exist, saving replaces only this one."""

    def __init__(self) -> None:
        self._shown: Path | None = None

    def show(self, path: Path | None) -> None:
        """Remember whose text the page shows; None for a text that is not of a file, or if it could not be read."""
        self._shown = path if path is None else path.resolve()

    def refuse_others(self, path: Path) -> None:
        """Refuse a file that exists and is not the one that is shown."""
        with writing(path, NetboardError):
            other = path.exists() and path.resolve() != self._shown
        if other:
            raise ConfigError(f"{path}: exists already, and is not the file that is shown here; name another file")

    def save(self, path: Path, text: str) -> None:
        """Write a text; the page then shows this file."""
        self.refuse_others(path)
        with new_file(path, force=True) as part:
            write_synced(part, text)
        self.show(path)


def free_backup(path: Path) -> Path:
    """Return the name of the next backup of a file: no earlier backup is replaced."""
    first = path.with_name(f"{path.name}.bak")
    numbered = (path.with_name(f"{path.name}.bak.{number}") for number in count(2))
    return first if not first.exists() else next(name for name in numbered if not name.exists())


def back_up(path: Path, text: str) -> None:
    """Keep the text of a file beside it."""
    with new_file(free_backup(path)) as part:
        write_synced(part, text)
