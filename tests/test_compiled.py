"""Kept kernels are never older than their source."""

import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

import netboard

SCRIPT = """
from netboard.physics.kernels import rk4_free
from netboard.stage import make_stage
from netboard.config import Config
import numpy as np
from netboard.tick import TICK
stage = make_stage(Config())
rows, state = np.zeros(3, TICK), stage.initial()
stage.advance(state, rows, 0, 3)
print(repr(float(state["z"][0])))
"""


@pytest.mark.slow
@pytest.mark.timeout(300)
def test_a_changed_kernel_in_another_file_is_not_served_from_the_cache(tmp_path: Path) -> None:
    package = tmp_path / "netboard"
    skip = shutil.ignore_patterns("__pycache__")
    shutil.copytree(Path(netboard.__file__).parent, package, ignore=skip)
    environment = {name: value for name, value in os.environ.items() if name != "NUMBA_CACHE_DIR"}
    environment["PYTHONPATH"] = str(tmp_path)

    def height() -> float:
        run = subprocess.run(
            [sys.executable, "-c", SCRIPT], env=environment, capture_output=True, check=True, text=True
        )
        return float(run.stdout)

    before = height()
    assert height() == before
    machine = package / "physics" / "kernels.py"
    text = machine.read_text()
    assert text.count("def coupling(") == 1
    machine.write_text(text.replace('s["g"]', '(0.0 * s["g"])').replace('scene["g"]', '(0.0 * scene["g"])'))
    assert machine.read_text() != text
    assert height() != before
    assert len(list((package / "__pycache__").glob("kernels-*"))) == 1
