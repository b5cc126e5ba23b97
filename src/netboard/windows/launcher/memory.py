"""What the launcher remembers, in a file of the user's configuration folder, and the lock of the only launcher."""

from pathlib import Path

from PySide6.QtCore import QLockFile, QStandardPaths

from netboard.base.errors import ConfigError, NetboardError, writing
from netboard.base.files.text import read_text
from netboard.base.settings import write
from netboard.windows.launcher.control import LauncherMemory
from netboard.windows.launcher.settings_form import checked


def folder() -> Path:
    """Return the folder of the user's configuration of netboard."""
    where = QStandardPaths.StandardLocation.GenericConfigLocation
    return Path(QStandardPaths.writableLocation(where)) / "netboard"


def remembered(path: Path) -> tuple[LauncherMemory, str]:
    """Return what is remembered, and what is wrong with the file; the defaults if it is missing or damaged."""
    if not path.exists():
        return LauncherMemory(), ""
    try:
        return checked(LauncherMemory, read_text(path, ""), str(path)), ""
    except ConfigError as error:
        return LauncherMemory(), f"nothing is remembered: {error}"


def remember(path: Path, memory: LauncherMemory) -> None:
    """Write the file."""
    with writing(path, NetboardError):
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(write(memory), encoding="utf-8")


def only_launcher(path: Path) -> QLockFile:
    """Take the lock of the launcher, which lasts as long as the result; raise an error if another one is open."""
    with writing(path, NetboardError):
        path.parent.mkdir(parents=True, exist_ok=True)
    lock = QLockFile(str(path))
    lock.setStaleLockTime(0)
    if not lock.tryLock(0):
        process, host, *_ = lock.getLockInfo()
        raise NetboardError(
            f"another launcher is open (process {process} on {host}): use its window, or close it first"
        )
    return lock
