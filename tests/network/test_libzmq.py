"""libzmq's functions written with pyzmq's, as on Windows: the tests of the fast path, and a session, pass with them."""

import os
import subprocess
import sys
from pathlib import Path

import pytest

TESTS = Path(__file__).parents[1]

HIDDEN = """
import sys, zmq
# A library without libzmq's functions, as pyzmq's binding in a wheel for Windows.
sys.modules[zmq.backend.Socket.__module__].__file__ = {library!r}
from netboard.network.transport import libzmq
assert libzmq._THROUGH_PYTHON is not None
"""

PYTEST = """
import pytest
sys.exit(pytest.main(["-q", "-p", "no:cacheprovider", "-n", "0", *{files!r}]))
"""

DEMO = """
from netboard.services.cli import main
sys.argv = ["netboard", *{arguments!r}]
main()
"""


def run(folder: Path, script: str, **values: object) -> str:
    library = __import__("msgpack._cmsgpack").__dict__["_cmsgpack"].__file__
    text = (HIDDEN + script).format(library=library, **values)
    done = subprocess.run(
        [sys.executable, "-c", text],
        cwd=folder,
        env=os.environ | {"PYTHONPATH": str(TESTS), "QT_QPA_PLATFORM": "offscreen"},
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 0, done.stdout[-4000:] + done.stderr[-4000:]
    return done.stdout


@pytest.mark.slow
def test_fast_path_passes_its_tests_through_pyzmq(tmp_path: Path) -> None:
    files = [str(TESTS / "network/test_fastpath.py"), str(TESTS / "nodes/test_agent_runs.py")]
    said = run(tmp_path, PYTEST, files=files)
    assert " passed" in said
    assert "skipped" not in said
