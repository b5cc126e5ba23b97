"""The example scripts of deploy/ run as the documentation shows."""

import os
import subprocess
import sys
from pathlib import Path

import pytest

import code_blocks
from netboard.network.transport.ports import free_port

SCRIPT = "deploy/examples/session.sh"

pytestmark = [pytest.mark.integration, pytest.mark.quiet, pytest.mark.timeout(600)]


def test_example_session_verifies_as_the_page_shows(tmp_path: Path) -> None:
    (page,) = (block for block in code_blocks.blocks() if block.text.startswith(f"$ {SCRIPT}"))
    path = f"{Path(sys.executable).parent}{os.pathsep}{os.environ['PATH']}"
    environment = {**os.environ, "PATH": path, "PORT": str(free_port()), "COLUMNS": "160"}
    done = subprocess.run(
        ["sh", str(code_blocks.ROOT / SCRIPT)],
        cwd=tmp_path,
        env=environment,
        capture_output=True,
        text=True,
        check=False,
        timeout=500,
    )
    assert done.returncode == 0, done.stderr
    ((_, expected),) = code_blocks.outputs(page)
    # What is awaited, and whether the trial is over before the pause, depend on the time that processes take to start.
    assert code_blocks.shape(done.stdout)[-2:] == code_blocks.shape(expected)[-2:]
