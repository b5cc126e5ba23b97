"""Every classical method gives the same bits on any processor and in any process."""

import json
import os
import subprocess
import sys
from pathlib import Path
from typing import Any

import numba
import pytest
from method_bits import CLASSICAL, digests

import sampling

SCRIPT = Path(__file__).with_name("method_bits.py")
BITS = sampling.some("bits of classical methods", CLASSICAL, 3)


def run_script(**environment: str) -> Any:
    """The output of the script in a new process."""
    done = subprocess.run(
        [sys.executable, str(SCRIPT), *BITS], env=os.environ | environment, capture_output=True, text=True, check=True
    )
    return json.loads(done.stdout)


@pytest.mark.slow
@pytest.mark.sampled(1, of="plain Python")
def test_plain_python_gives_the_same_bits() -> None:
    assert run_script(NUMBA_DISABLE_JIT="1") == digests(BITS)


@pytest.mark.skipif(bool(numba.config.DISABLE_JIT), reason="nothing is compiled")
@pytest.mark.slow
@pytest.mark.sampled(1, of="processors")
def test_another_processor_gives_the_same_bits(tmp_path: Path) -> None:
    """Compile for a processor without AVX or fused multiply-add."""
    plain = {"NUMBA_CPU_NAME": "generic", "NUMBA_CPU_FEATURES": "", "NUMBA_CACHE_DIR": str(tmp_path)}
    assert run_script(**plain) == digests(BITS)
