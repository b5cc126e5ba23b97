"""The first start after an installation: what it compiles and says; a prepared session compiles nothing."""

import os
import subprocess
import sys
from pathlib import Path

import pytest

from netboard.nodes.launching.kernels import EXPECTED
from netboard.services.guard import KERNELS

pytestmark = [
    pytest.mark.slow,
    pytest.mark.integration,
    pytest.mark.skipif("NUMBA_DISABLE_JIT" in os.environ, reason="nothing is compiled"),
]

TIMEOUT_S = 900.0


def run(folder: Path, *words: str) -> str:
    """Return what a command prints that has its own cache."""
    environment = {**os.environ, "NUMBA_CACHE_DIR": str(folder / "cache")}
    command = [sys.executable, "-m", "netboard.services.cli", *words]
    done = subprocess.run(
        command, env=environment, cwd=folder, capture_output=True, text=True, check=False, timeout=TIMEOUT_S
    )
    assert done.returncode == 0, done.stdout + done.stderr
    return done.stdout + done.stderr


def kernels(folder: Path) -> set[str]:
    return {path.name for path in (folder / "cache").rglob("*.nbc")}


def test_prepared_session_compiles_nothing_more(tmp_path: Path) -> None:
    said = run(tmp_path, "up", "--prepare")
    found = kernels(tmp_path)
    assert len(found) == pytest.approx(EXPECTED.kernels, rel=0.15), "as many as the estimate of the time left assumes"
    assert sum(one.kernels for one in KERNELS.values()) == pytest.approx(EXPECTED.kernels, rel=0.15)
    assert "compiling kernels for this machine, once after an installation or an update: " in said
    assert f"kernels        {len(found)} compiled in " in said
    assert run(tmp_path, "up", "--prepare") == "kernels        ready\n"
    run(tmp_path, "demo", "--no-displays", "--trials", "1")
    reading = ("netboard.recording.", "netboard.task.trials.quality.")  # which the demo does after the session
    assert [name for name in kernels(tmp_path) - found if not name.startswith(reading)] == []
    logs = "".join(path.read_text(encoding="utf-8") for path in tmp_path.rglob("*.log"))
    assert logs
    assert "compiling" not in logs
