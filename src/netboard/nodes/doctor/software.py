"""Checks of netboard's software on this machine: versions, and whether a window can be opened."""

import platform
import subprocess
import sys
from importlib.metadata import version

from netboard.base.finding import Finding
from netboard.network.transport import sockets

QT_SECONDS = 60.0
"""Timeout for loading Qt, which takes seconds on a slow disk and hangs on a broken screen [s]."""

OPEN_A_WINDOW = "from netboard.windows.participant.window import application; print(application().platformName())"


def versions() -> Finding:
    """Report the versions of Python and the libraries."""
    python = f"{platform.python_implementation()} {platform.python_version()}"
    libraries = [f"{name} {version(name)}" for name in ("netboard", "numba", "numpy", "pyzmq")]
    return Finding("software", "green", ", ".join([python, *libraries, sockets.library()]))


def qt(opening: str = OPEN_A_WINDOW) -> Finding:
    """Check whether displays can run here, in a separate process, because Qt aborts the process if they cannot."""
    name = "Qt"
    try:
        tried = subprocess.run(
            [sys.executable, "-c", opening], capture_output=True, text=True, check=False, timeout=QT_SECONDS
        )
    except subprocess.TimeoutExpired:
        return Finding(name, "yellow", f"no answer within {QT_SECONDS:.0f} s", "look after the screen's server")
    if tried.returncode:
        why = (tried.stderr.strip().splitlines() or [f"exit code {tried.returncode}"])[-1]
        return Finding(name, "yellow", f"no display can run here: {why}", "at a station: deploy/setup.sh run")
    found = tried.stdout.strip().splitlines()[-1]
    if found == "offscreen":
        return Finding(name, "green", "loads; no screen here, so displays draw off screen")
    return Finding(name, "green", f"loads; windows open on {found}")
