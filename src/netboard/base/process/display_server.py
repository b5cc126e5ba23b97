"""Whether a window appears on a screen here, decided before Qt starts, because Qt aborts the process if it finds none.

A window is drawn off screen only where that was asked for: with ``--offscreen``, or with the user's own
``QT_QPA_PLATFORM=offscreen``. Otherwise a missing screen is an error: a window that nobody sees looks like one that
works.
"""

import os
import re
import subprocess
import sys
from functools import cache
from pathlib import Path
from typing import NamedTuple

from netboard.base.errors import NetboardError

PLATFORM = "QT_QPA_PLATFORM"
"""Environment variable that chooses how Qt draws, in place of the screens of `SCREENS`."""

SCREENS = ("WAYLAND_DISPLAY", "DISPLAY")
"""Environment variables that name a screen, in the order in which Qt tries them."""

OFFSCREEN = "offscreen"

UNSEEN = (OFFSCREEN, "minimal", "minimalegl")
"""Platforms of Qt whose windows nobody sees."""

LOAD = "import PySide6.QtWidgets"
"""Script that loads Qt."""

OPEN = "from PySide6.QtGui import QGuiApplication; QGuiApplication([])"
"""Script that opens the screen."""

SECONDS = 60.0
"""Timeout for opening the screen: loading Qt takes seconds on a slow disk, and a broken screen never answers [s]."""

QT_CATEGORY = re.compile(r"^(qt\.[a-z.]+|error): ")
"""Beginning of a message of Qt that says where in Qt it comes from."""

X_SOCKETS = Path("/tmp/.X11-unix")
"""Folder with a socket for each X screen of this computer."""


class NoScreen(NamedTuple):
    """Why no window can be seen here, and what to do."""

    why: str
    advice: str


def choose_screen(offscreen: bool) -> None:
    """Prepare to open windows: off screen if that is asked for, else on the screen; raise an error if there is none."""
    if offscreen:
        os.environ[PLATFORM] = OFFSCREEN
    else:
        require_screen()


def unseen(platform: str) -> bool:
    """Return whether nobody sees the windows of a platform of Qt; its options follow a colon."""
    return platform.partition(":")[0] in UNSEEN


def asked_offscreen() -> str:
    """Return the setting by which windows are drawn off screen, as NAME=VALUE; empty if none asks for that."""
    platform = os.environ.get(PLATFORM, "")
    return f"{PLATFORM}={platform}" if unseen(platform) else ""


def require_screen() -> None:
    """Raise an error if no window can be opened here, unless windows are to be drawn off screen."""
    if not asked_offscreen() and (found := no_screen()):
        raise NetboardError(f"{found.why}; {found.advice}; to draw windows where nobody sees them: --offscreen")


def why_no_qt() -> str:
    """Return why Qt cannot be loaded on this machine; empty if it can."""
    loaded = _run(LOAD)
    if loaded is None:
        return f"no answer within {SECONDS:.0f} s"
    lines = loaded.stderr.strip().splitlines() or [f"exit code {loaded.returncode}"]
    return lines[-1] if loaded.returncode else ""


def no_screen() -> NoScreen | None:
    """Return why no window can be opened here; None if one can, or if Qt cannot even be loaded."""
    named = {name: os.environ.get(name, "") for name in (PLATFORM, *SCREENS)}
    if sys.platform == "linux" and not any(named.values()):
        return NoScreen(f"there is no screen ({' and '.join(SCREENS)} are not set)", _where_to_run())
    return _tried(tuple(named.items()))


@cache
def _tried(named: tuple[tuple[str, str], ...]) -> NoScreen | None:
    """Try in another process whether Qt opens the screen that these variables name."""
    which = " ".join(("the screen", *(f"{name}={value}" for name, value in named if value)))
    tried = _run(OPEN)
    if tried is None:
        return NoScreen(f"{which} does not answer within {SECONDS:.0f} s", "check the display server")
    if tried.returncode >= 0:  # an exception, such as that of a missing library, is raised again where windows open
        return None
    lines = tried.stderr.strip().splitlines() or [f"Qt was ended by signal {-tried.returncode}"]
    reason = QT_CATEGORY.sub("", lines[0]).strip()
    return NoScreen(f"{which} cannot be opened ({reason})", _screens_here())


def _run(script: str) -> subprocess.CompletedProcess[str] | None:
    """Run a script in another process; return None if it takes too long."""
    try:
        return subprocess.run(
            [sys.executable, "-c", script], capture_output=True, text=True, check=False, timeout=SECONDS
        )
    except subprocess.TimeoutExpired:
        return None


def _where_to_run() -> str:
    """Return where to start a process so that it finds the screen."""
    if os.environ.get("INVOCATION_ID"):
        return "a service must start after the desktop session, in its environment (WantedBy=graphical-session.target)"
    if os.environ.get("SSH_CONNECTION"):
        return f"over ssh, name the screen (DISPLAY=:0 netboard ...), or run it at that computer; {_screens_here()}"
    return "run it in a terminal of the desktop session"


def _screens_here() -> str:
    """List the X screens of this computer."""
    names = sorted(f":{socket.name.removeprefix('X')}" for socket in X_SOCKETS.glob("X*"))
    return f"screens of this computer: {', '.join(names)}" if names else "this computer has no X screen"
