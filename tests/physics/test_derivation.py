"""The kernels, evaluated on symbols, satisfy the derived equations (``derivation.py``)."""

import json
import os
import subprocess
import sys
from pathlib import Path

import pytest

SCRIPT = Path(__file__).with_name("derivation.py")


@pytest.mark.slow
def test_kernels_satisfy_the_derived_equations_symbolically() -> None:
    done = subprocess.run(
        [sys.executable, str(SCRIPT)],
        env=os.environ | {"NUMBA_DISABLE_JIT": "1"},
        capture_output=True,
        text=True,
        check=True,
    )
    claims = json.loads(done.stdout)
    assert len(claims) > 50
    assert [claim for claim, holds in claims.items() if not holds] == []
