"""The kernels give the same bits however and wherever they are run, and cost no more than they must."""

import json
import os
import platform
import re
import subprocess
import sys
from pathlib import Path
from typing import Any

import numba
import pytest
from random_steps import STEPS, digest

from netboard.physics import kernels, trig

SCRIPT = Path(__file__).with_name("random_steps.py")
needs_compiler = pytest.mark.skipif(bool(numba.config.DISABLE_JIT), reason="nothing is compiled")


def elsewhere(**environment: str) -> Any:
    """What the script prints in a fresh process."""
    done = subprocess.run(
        [sys.executable, str(SCRIPT)], env=os.environ | environment, capture_output=True, text=True, check=True
    )
    return json.loads(done.stdout)


@pytest.fixture(scope="module")
def here() -> str:
    return digest(1500)


@pytest.mark.slow
def test_plain_python_gives_the_same_bits(here: str) -> None:
    assert elsewhere(NUMBA_DISABLE_JIT="1") == {"digest": here, "cache": []}


@needs_compiler
@pytest.mark.slow
def test_another_processor_gives_the_same_bits_and_a_second_process_finds_it_compiled(
    here: str, tmp_path: Path
) -> None:
    """A processor without AVX or fused multiply-add, where this one has them."""
    plain = {"NUMBA_CPU_NAME": "generic", "NUMBA_CPU_FEATURES": "", "NUMBA_CACHE_DIR": str(tmp_path)}
    assert elsewhere(**plain) == {"digest": here, "cache": [[0, 1]] * 3}
    assert elsewhere(**plain) == {"digest": here, "cache": [[1, 0]] * 3}


def compiled(step: Any, scene: Any) -> str:
    """Assembly of a step compiled anew (what comes from the disk cache cannot be inspected)."""
    fresh = numba.njit(error_model="numpy")(step.py_func)
    fresh(*[0.0] * 10, 1e-3, scene)
    return str(fresh.inspect_asm(fresh.signatures[0]))


def arithmetic(assembly: str) -> int:
    """Number of floating-point additions, subtractions and multiplications, on an x86 processor."""
    return len(re.findall(r"^\s+v?(?:add|sub|mul)[sp]d\b", assembly, re.MULTILINE))


@needs_compiler
@pytest.mark.slow
def test_nothing_is_fused_and_what_a_scene_does_not_need_is_not_there(scene: Any) -> None:
    free, fixed, bare = (compiled(step, scene) for step in STEPS)
    for assembly in (free, fixed, bare):
        assert not re.search(r"\bv?f(?:n?m)(?:add|sub)|\bfml[as]\b", assembly)
        assert not re.search(r"\bcall\w*\s+\S*(?:sin|cos|pow)", assembly)
    if platform.machine() in {"x86_64", "AMD64"}:
        assert arithmetic(free) > arithmetic(fixed) > arithmetic(bare) > 0


@needs_compiler
def test_no_kernel_asks_for_fast_math() -> None:
    functions = [each for each in (*vars(kernels).values(), *vars(trig).values()) if hasattr(each, "targetoptions")]
    assert len(functions) >= 10
    for function in functions:
        assert not function.targetoptions.get("fastmath", False)
        assert function.targetoptions["error_model"] == "numpy"
