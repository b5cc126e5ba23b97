"""Files of one user, which no other user of the machine may open.

POSIX: the mode and the owner. Windows: a folder inherits the access rights of the one above it, and that of a user's
profile is closed to other users; netboard does not read these rights.
"""

import os
import stat
import sys
from pathlib import Path

from netboard.base.errors import NetboardError

if sys.platform != "win32":
    import grp

PRIVATE_FOLDER, PRIVATE_FILE = 0o700, 0o600


def why_open(path: Path) -> str:
    """Return why other users may read or change a file or folder, and what to do; empty if they may not."""
    if sys.platform == "win32":
        return ""
    mode = path.stat().st_mode & 0o777
    proper = PRIVATE_FOLDER if path.is_dir() else PRIVATE_FILE
    return f"is accessible to other users (mode {mode:04o}); do: chmod {proper:o} {path}" if mode & 0o077 else ""


def user_folder() -> Path:
    """Return the folder of this user's processes on this machine, made if missing; no other user can open it.

    It is the same for every process of the user, whatever its environment.
    """
    if sys.platform == "win32":
        folder = Path.home() / "AppData" / "Local" / "netboard"
        folder.mkdir(parents=True, exist_ok=True)
        return folder
    folder = Path(f"/tmp/netboard-{os.getuid()}")
    folder.mkdir(mode=PRIVATE_FOLDER, exist_ok=True)
    found = folder.lstat()
    if not stat.S_ISDIR(found.st_mode) or found.st_uid != os.getuid() or stat.S_IMODE(found.st_mode) != PRIVATE_FOLDER:
        raise NetboardError(f"{folder}: is not a folder of this user alone (mode 0700); remove it")
    return folder


def group_of(path: Path) -> str:
    """Return the group that may open a file; empty if it is unknown, as on Windows."""
    if sys.platform == "win32":
        return ""
    try:
        return grp.getgrgid(path.stat().st_gid).gr_name
    except (OSError, KeyError):
        return ""
