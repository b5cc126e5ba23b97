"""The kernels give the same bits on any processor and contain only the arithmetic that a scene needs."""

import json
import os
import platform
import re
import subprocess
import sys
from pathlib import Path
from typing import Any

import numba
import numpy as np
import pytest
from random_steps import SCENES, digests
from trajectories import Scene, scene_of

import sampling
from netboard.physics.methods.catalogue import NUMBER
from netboard.physics.methods.march import make_march

SCRIPT = Path(__file__).with_name("random_steps.py")
BITS = sampling.some("bits of scenes", SCENES, 2)
needs_compiler = pytest.mark.skipif(bool(numba.config.DISABLE_JIT), reason="nothing is compiled")


def run_script(**environment: str) -> Any:
    """The output of the script in a new process."""
    done = subprocess.run(
        [sys.executable, str(SCRIPT), *BITS], env=os.environ | environment, capture_output=True, text=True, check=True
    )
    return json.loads(done.stdout)


@pytest.fixture(scope="module")
def compiled_digests() -> dict[str, str]:
    return digests(BITS)


@pytest.mark.slow
@pytest.mark.sampled(1, of="plain Python")
def test_plain_python_gives_the_same_bits(compiled_digests: dict[str, str]) -> None:
    assert run_script(NUMBA_DISABLE_JIT="1") == {"digests": compiled_digests, "cache": []}


@needs_compiler
@pytest.mark.slow
@pytest.mark.timeout(300)
@pytest.mark.sampled(1, of="processors")
def test_another_processor_gives_the_same_bits_and_fills_the_disk_cache(
    compiled_digests: dict[str, str], tmp_path: Path
) -> None:
    """Compile for a processor without AVX or fused multiply-add; a second process uses the disk cache."""
    plain = {"NUMBA_CPU_NAME": "generic", "NUMBA_CPU_FEATURES": "", "NUMBA_CACHE_DIR": str(tmp_path)}
    assert run_script(**plain) == {"digests": compiled_digests, "cache": [[0, 1]] * len(BITS)}
    assert run_script(**plain) == {"digests": compiled_digests, "cache": [[1, 0]] * len(BITS)}


def assembly_of(scene: Scene) -> str:
    """Assembly of a scene's steps, compiled anew because code from the disk cache cannot be inspected."""
    march: Any = make_march(NUMBER["rk4"], scene.parts)
    fresh = numba.njit(error_model="numpy")(march.py_func)
    whole, one = np.ones(1), np.ones(1, np.int64)
    state, out = (0.0,) * scene.length, np.zeros((0, scene.length))
    fresh(state, np.zeros((1, 8)), whole, one, one - 1, np.zeros((1, 0, 0, 0)), scene.packed, out)
    return str(fresh.inspect_asm(fresh.signatures[0]))


def count_arithmetic(assembly: str) -> int:
    """Number of floating-point additions, subtractions and multiplications, on an x86 processor."""
    return len(re.findall(r"^\s+v?(?:add|sub|mul)[sp]d\b", assembly, re.MULTILINE))


@needs_compiler
@pytest.mark.slow
def test_assembly_has_no_fused_or_unneeded_arithmetic() -> None:
    scenes = [
        scene_of(balls=2, model="lagrangian", coupling="left", b_p=0.02, rolling_resistance=0.01),
        scene_of(balls=2, model="lagrangian", coupling="left", b_p=0.02),
        scene_of(balls=2, model="lagrangian", coupling="left"),
        scene_of(balls=2, model="lagrangian"),
        scene_of(model="lagrangian"),
        scene_of(),
        scene_of(False),
        scene_of(balls=0),
        scene_of(balls=0, board="hinged"),
        scene_of(balls=0, board="level"),
    ]
    assemblies = [assembly_of(scene) for scene in scenes]
    assert ["sqrt" in assembly for assembly in assemblies] == [True] + [False] * (len(assemblies) - 1)
    for assembly in assemblies:
        assert not re.search(r"\bv?f(?:n?m)(?:add|sub)|\bfml[as]\b", assembly)
        assert not re.search(r"\bcall\w*\s+\S*(?:sin|cos|pow)", assembly)
    if platform.machine() in {"x86_64", "AMD64"}:
        counts = [count_arithmetic(assembly) for assembly in assemblies]
        assert counts == sorted(set(counts), reverse=True)
        assert counts[-1] > 0
