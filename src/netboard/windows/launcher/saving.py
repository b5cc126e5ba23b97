"""Files that a page of the launcher writes: complete or not at all, and nothing that is there is lost."""

from pathlib import Path

from netboard.base.errors import ConfigError, NetboardError, writing
from netboard.base.files.new import free_backup, new_file, write_synced
from netboard.base.files.text import read_text


class EditedFile:
    """The file that a page shows; saving replaces only this one, only as it was read, and keeps a backup."""

    def __init__(self) -> None:
        self.text = ""
        self._shown: Path | None = None

    def show(self, path: Path | None, text: str = "") -> None:
        """Remember whose text the page shows; None for a text that is not of a file, or if it could not be read."""
        self._shown, self.text = path if path is None else path.resolve(), text

    def shows(self, name: str) -> bool:
        """Return whether the page shows the file of this name."""
        return self._shown == Path(name).resolve()

    def save(self, path: Path, text: str) -> str:
        """Write a text, unless the file has it; the page then shows this file. Return the backup's name, if any."""
        backup = ""
        if self._replaces(path):
            if text == self.text:
                return ""
            backup = _back_up(path, self.text)
        with new_file(path, force=True) as part:
            write_synced(part, text)
        self.show(path, text)
        return backup

    def _replaces(self, path: Path) -> bool:
        """Return whether a file exists; refuse one that is not the one that is shown, or was changed elsewhere."""
        with writing(path, NetboardError):
            exists, other = path.exists(), path.resolve() != self._shown
        if exists and other:
            raise ConfigError(f"{path}: exists already, and is not the file that is shown here; name another file")
        if exists and read_text(path) != self.text:
            raise ConfigError(
                f"{path}: was changed elsewhere after it was read here; save under another name, and compare both"
            )
        return exists


def _back_up(path: Path, text: str) -> str:
    """Keep the text of a file beside it; return the name."""
    backup = free_backup(path)
    with new_file(backup) as part:
        write_synced(part, text)
    return backup.name
