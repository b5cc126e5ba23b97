"""What this process is, and what it takes of its machine: memory, and the user's folder."""

import os
import platform
from pathlib import Path

from netboard.base.errors import ConfigError

NAME = f"{platform.node()}:{os.getpid()}"
"""Identity of this process: host and process number."""


def peak_memory() -> float:
    """Return the peak memory of this process; NaN if the system does not report it [bytes]."""
    return _memory("self", "VmHWM:")


def resident_memory(process: int | str = "self") -> float:
    """Return the resident memory of a process; NaN if the system does not report it [bytes]."""
    return _memory(process, "VmRSS:")


def _memory(process: int | str, kind: str) -> float:
    status = Path(f"/proc/{process}/status")
    lines = status.read_text(encoding="utf-8").splitlines() if status.exists() else []
    return next((float(line.split()[1]) * 1024 for line in lines if line.startswith(kind)), float("nan"))


def home_folder() -> Path:
    """Return the user's home folder; raise ConfigError if there is none, as for an unnamed user of a container."""
    try:
        return Path.home()
    except RuntimeError:
        raise ConfigError("this user has no home folder; set the environment variable HOME") from None
