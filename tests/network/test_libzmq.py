"""libzmq's functions written with pyzmq's, as on Windows: the tests of the fast path pass with them."""

import os
import subprocess
import sys
from pathlib import Path

import pytest

from hidden_libzmq import PROOF, hiding_environment

TESTS = Path(__file__).parents[1]


@pytest.mark.slow
def test_fast_path_passes_its_tests_through_pyzmq(tmp_path: Path) -> None:
    files = [str(TESTS / "network/test_fastpath.py"), str(TESTS / "nodes/test_agent_runs.py")]
    done = subprocess.run(
        [sys.executable, "-m", "pytest", "-q", "-p", "no:cacheprovider", "-n", "0", *files],
        cwd=tmp_path,
        env=os.environ | hiding_environment(tmp_path, TESTS),
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 0, done.stdout[-4000:] + done.stderr[-4000:]
    assert " passed" in done.stdout
    assert "skipped" not in done.stdout
    assert PROOF in done.stderr
