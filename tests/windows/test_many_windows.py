"""Many windows open and close under an eager garbage collector, and the process survives.

More of them by hand: ``NETBOARD_WINDOWS=2000 python -m pytest tests/windows/test_many_windows.py``.
"""

import os
import subprocess
import sys
from pathlib import Path

import pytest

SCRIPT = Path(__file__).parent / "many_windows.py"
COUNTS = {"participant": 100, "console": 3, "monitor": 10}


@pytest.mark.slow
@pytest.mark.parametrize("kind", COUNTS)
@pytest.mark.sampled(1)
def test_process_survives_many_windows(app, kind: str) -> None:
    count = os.environ.get("NETBOARD_WINDOWS", str(COUNTS[kind]))
    command = [sys.executable, "-X", "dev", "-W", "ignore", str(SCRIPT), kind, count]
    ended = subprocess.run(command, capture_output=True, text=True, timeout=280, check=False)
    assert (ended.returncode, ended.stdout) == (0, f"{count} windows\n"), ended.stderr[-5000:]
