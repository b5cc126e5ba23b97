"""Cached kernels are never older than their source, and are kept apart."""

import ast
import os
import re
import shutil
import subprocess
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import netboard
from netboard.base.compiled import STRICT, borrowed, fast, inlined, kernel, machine_code
from netboard.base.kernel_cache import sources

SCRIPT = """
import numpy as np
from netboard.base.config import Physics
from netboard.physics.methods.march import make_grid, run
from netboard.physics.scene.parameters import pack_scene, parts_of
parts, scene = parts_of(Physics()), pack_scene(Physics())
grid = make_grid("euler", np.full(3, 1e-3), np.ones(3, np.int64), parts, 6, scene)
print(repr(float(run("euler", (0.0,) * 6, np.zeros((3, 8)), grid, parts, scene)[-1, 0])))
"""


FOLDER = "from netboard.base import kernel_cache; print(kernel_cache.folder())"


@pytest.mark.slow
@pytest.mark.timeout(300)
def test_change_in_an_imported_file_invalidates_the_kernel_cache(tmp_path: Path) -> None:
    package = tmp_path / "netboard"
    skip = shutil.ignore_patterns("__pycache__")
    shutil.copytree(Path(netboard.__file__).parent, package, ignore=skip)
    environment = {name: value for name, value in os.environ.items() if name != "NUMBA_CACHE_DIR"}
    environment["PYTHONPATH"] = str(tmp_path)

    def printed_by(script: str) -> str:
        command = [sys.executable, "-c", script]
        return subprocess.run(command, env=environment, capture_output=True, check=True, text=True).stdout.strip()

    before, old = printed_by(SCRIPT), Path(printed_by(FOLDER))
    assert list((package / "__pycache__").glob("kernels-*")) == [old]
    models, elsewhere = (
        package / "physics" / "scene" / "models.py",
        package / "analysis" / "report" / "answer.py",
    )
    elsewhere.write_text(elsewhere.read_text() + "\nX = 1\n")
    assert printed_by(FOLDER) == str(old)  # no kernel uses it
    text = models.read_text()
    assert text.count('scene["M"] * scene["g"]') == 1
    models.write_text(text.replace('scene["M"] * scene["g"]', '0.0 * scene["g"]'))
    assert printed_by(SCRIPT) != before
    assert old.exists()  # a process that was started before may still need it
    models.write_text(text)
    assert printed_by(SCRIPT) == before
    os.utime(old, (0.0, 0.0))
    models.write_text(text + "\n")
    assert printed_by(FOLDER) != str(old)
    assert not old.exists()


def imported(text: str) -> set[str]:
    """What a module imports, and what it may: names after a from can be modules."""
    found = set()
    for node in ast.walk(ast.parse(text)):
        if isinstance(node, ast.Import):
            found |= {alias.name for alias in node.names}
        if isinstance(node, ast.ImportFrom):
            assert node.level == 0
            found |= {str(node.module), *(f"{node.module}.{alias.name}" for alias in node.names)}
    return found | {".".join(name.split(".")[:n]) for name in found for n in range(1, name.count(".") + 1)}


@pytest.mark.skipif(os.name == "nt", reason="no such limit there")
def test_kernel_runs_if_a_full_disk_cannot_cache_it() -> None:
    """A limit of the kernel of the operating system replaces the full disk."""
    import resource

    limits = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (0, limits[1]))
    try:
        assert kernel(lambda x: x + 1.0)(2.0) == 3.0
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, limits)


def test_cache_folder_depends_on_every_source_that_a_kernel_may_use() -> None:
    """Modules that can make kernels, and whatever they import, found here by Python's own parser."""
    package = Path(netboard.__file__).parent
    paths = {".".join(path.relative_to(package.parent).with_suffix("").parts): path for path in package.rglob("*.py")}
    paths = {name.removesuffix(".__init__"): path for name, path in paths.items()}
    imports = {name: imported(path.read_text(encoding="utf-8")) & paths.keys() for name, path in paths.items()}
    reached = {name for name, others in imports.items() if "netboard.base.compiled" in others}
    while more := set().union(*(imports[name] for name in reached)) - reached:
        reached |= more
    assert sources(package) == sorted(paths[name] for name in reached)
    assert len(reached) < len(paths) / 2


def printed_folder(**variables: str) -> subprocess.CompletedProcess[str]:
    environment = {name: value for name, value in os.environ.items() if name != "NUMBA_CACHE_DIR"} | variables
    return subprocess.run([sys.executable, "-c", FOLDER], env=environment, capture_output=True, check=False, text=True)


def test_systemd_service_keeps_its_kernels_in_its_cache_directory(tmp_path: Path) -> None:
    folder = Path(printed_folder(CACHE_DIRECTORY=f"{tmp_path}{os.pathsep}elsewhere").stdout.strip())
    assert folder.parent == tmp_path
    assert folder.name.startswith("kernels-")


def test_user_who_may_not_write_there_has_kernels_of_this_version_too(tmp_path: Path) -> None:
    """Numba's own choice would be one folder for all versions. A file stands for a folder that is read-only."""
    (tmp_path / "file").touch()
    folder = Path(printed_folder(CACHE_DIRECTORY=f"{tmp_path}/file", XDG_CACHE_HOME=f"{tmp_path}/cache").stdout.strip())
    assert folder.parent == tmp_path / "cache" / "netboard"
    assert folder.name == Path(printed_folder(CACHE_DIRECTORY=f"{tmp_path}/service").stdout.strip()).name


def test_user_who_may_write_nowhere_is_told_so(tmp_path: Path) -> None:
    (tmp_path / "file").touch()
    run = printed_folder(CACHE_DIRECTORY=f"{tmp_path}/file", XDG_CACHE_HOME=f"{tmp_path}/file")
    assert re.search(
        r"ConfigError: compiled code can be kept in none of these.*file, \S+file.netboard; set .*DIR", run.stderr
    )


def test_folder_that_the_user_has_set_has_kernels_of_this_version_too(tmp_path: Path) -> None:
    folder = Path(printed_folder(NUMBA_CACHE_DIR=str(tmp_path)).stdout.strip())
    assert folder.parent == tmp_path
    assert folder.name == Path(printed_folder(CACHE_DIRECTORY=f"{tmp_path}/service").stdout.strip()).name
    assert printed_folder(NUMBA_CACHE_DIR=str(folder)).stdout.strip() == str(folder)  # as a child process gets it


def test_folder_that_the_user_has_set_and_may_not_write_to_is_refused(tmp_path: Path) -> None:
    """Numba would look for another one by itself, and find there what another version has left."""
    (tmp_path / "file").touch()
    run = printed_folder(NUMBA_CACHE_DIR=f"{tmp_path}/file")
    assert re.search(r"ConfigError: compiled code can be kept in none of these.*: \S+/file; set .*DIR", run.stderr)


@inlined
def sum_of_product(a: float, b: float, c: float) -> float:
    return a * b + c


@fast
def rounded_once(a: float, b: float, c: float) -> float:
    return sum_of_product(a, b, c)


@kernel
def rounded_twice(a: float, b: float, c: float) -> float:
    return sum_of_product(a, b, c)


def test_strict_kernel_stays_strict_if_a_fast_one_calls_its_code_first() -> None:
    """Numba lets what it compiles inherit the options of the first caller, unless these are given explicitly."""
    least = 2.0**-30
    for caller in (rounded_once, rounded_twice):
        assert caller(1 + least, 1 - least, -1.0) == 0.0


def test_every_kernel_is_compiled_with_explicit_options() -> None:
    assert {"error_model", "fastmath", "forceinline"} <= set(STRICT)
    package = Path(netboard.__file__).parent
    asks = re.compile(r"numba\.n?jit|from numba import n?jit")
    compiling = [path for path in package.rglob("*.py") if asks.search(path.read_text())]
    assert compiling == [package / "base" / "compiled.py"]


@kernel
def summed_through_a_tuple(parts: tuple[tuple[np.ndarray, np.ndarray], ...], times: int) -> float:
    total = 0.0
    parts = borrowed(parts)
    for k in range(times):
        values, zeros = parts[k % len(parts)]
        total += values[k % len(values)] + zeros[0]
    return total


def test_borrowed_arguments_keep_their_values_and_reference_counts() -> None:
    arrays = [np.arange(3.0), np.arange(10.0, 14.0)]
    zeros = np.zeros(1)
    parts = tuple((array, zeros) for array in arrays)
    counts = [sys.getrefcount(one) for one in (*arrays, zeros)]
    expected = sum(arrays[k % 2][k % len(arrays[k % 2])] for k in range(1000))
    assert summed_through_a_tuple(parts, 1000) == expected
    assert machine_code(summed_through_a_tuple, parts, 1000)(parts, 1000) == expected
    assert [sys.getrefcount(one) for one in (*arrays, zeros)] == counts


COUNTER = np.dtype([("count", "<i8"), ("values", "<f8", (2,))])


@kernel
def counted(record: Any, rows: Any, more: tuple[Any, Any]) -> float:
    record["count"] += 1
    return rows[1]["values"][0] + more[0][0]["values"][1] + more[1]


def test_machine_code_tells_records_of_one_type_in_arrays_of_different_layouts_apart() -> None:
    rows = np.zeros(4, COUNTER)
    rows["values"] = [(1.0, 2.0), (3.0, 4.0), (5.0, 6.0), (7.0, 8.0)]
    locked = rows.copy()
    locked.setflags(write=False)
    for given, second in ((rows, 3.0), (rows[::2], 5.0), (locked, 3.0)):
        arguments = rows[0], given, (given, 0.5)
        assert machine_code(counted, *arguments)(*arguments) == second + 2.0 + 0.5
    assert rows[0]["count"] == 3


MADE = """
import sys
from netboard.base.compiled import kernel
def make(number):
    @kernel
    def inner(x):
        return x + number
    @kernel
    def outer(x):
        return inner(x) + inner(2.0 * x)
    return outer
for number in map(float, sys.argv[1:]):
    print(make(number)(0.0))
"""


def test_kernels_with_different_constants_never_share_machine_code(tmp_path: Path) -> None:
    """Two processes compile one of them each, and a third one loads both from the cache."""
    script = tmp_path / "made.py"
    script.write_text(MADE, encoding="utf-8")

    def run(*numbers: str) -> list[float]:
        command = [sys.executable, str(script), *numbers]
        environment = {**os.environ, "NUMBA_CACHE_DIR": str(tmp_path)}
        found = subprocess.run(command, env=environment, capture_output=True, check=True, text=True)
        return [float(word) for word in found.stdout.split()]

    assert run("1") == [2.0]
    assert run("5") == [10.0]
    assert run("1", "5") == [2.0, 10.0]
    assert run("5", "1") == [10.0, 2.0]


SHARED = """
import sys
from netboard.participants.people.submovement import minimum_jerk as shared
print("ready", flush=True)
sys.stdin.readline()
shared(0.5)
print(sum(shared.stats.cache_misses.values()))
"""
"""A program that compiles a kernel or loads it, and tells how often it compiled it."""


@pytest.mark.slow
@pytest.mark.skipif(sys.platform == "win32", reason="files cannot be locked in this way")
def test_processes_that_start_together_compile_a_kernel_once(tmp_path: Path) -> None:
    """All are ready to call it before any is told to."""
    environment = {**os.environ, "NUMBA_CACHE_DIR": str(tmp_path)}
    command = [sys.executable, "-c", SHARED]
    started = [
        subprocess.Popen(command, env=environment, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True)
        for _ in range(3)
    ]
    for one in started:
        assert one.stdout is not None
        assert one.stdout.readline() == "ready\n"
    for one in started:
        assert one.stdin is not None
        one.stdin.write("go\n")
        one.stdin.flush()
    printed = [one.communicate()[0] for one in started]
    assert sorted(map(int, printed)) == [0, 0, 1]
