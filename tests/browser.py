"""A headless browser for tests of pages: what a page is after its scripts have run, and how it looks at a size."""

import os
import shutil
import subprocess
from pathlib import Path

BROWSERS = ("chromium-headless-shell", "chromium", "google-chrome")

DARK, LIGHT = 0, 1
"""Themes that a desktop may have, as the browser counts them."""


def find_browser() -> str:
    """Return the path of a browser; empty if this machine has none."""
    return next(filter(None, map(shutil.which, BROWSERS)), "")


def opened(
    address: str, profile: Path, *, size: tuple[int, int] = (1366, 768), theme: int = LIGHT, picture: Path | None = None
) -> str:
    """Return what a page is after its scripts have run, in a browser of its own; ``picture``: where to save a PNG."""
    browser = find_browser()
    assert browser, "these tests need a browser; install it with: deploy/setup.sh site"
    command = [browser, "--headless", "--disable-gpu", f"--user-data-dir={profile}", "--virtual-time-budget=10000"]
    command += [f"--window-size={size[0]},{size[1]}", f"--blink-settings=preferredColorScheme={theme}"]
    command += ["--hide-scrollbars", f"--screenshot={picture}"] if picture is not None else []
    command += ["--no-sandbox"] if os.geteuid() == 0 else []  # the sandbox refuses root, as which containers test
    done = subprocess.run([*command, "--dump-dom", address], capture_output=True, text=True, check=False, timeout=120)
    assert done.returncode == 0, done.stderr
    return done.stdout
