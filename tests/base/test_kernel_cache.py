"""A cached kernel that is damaged, or that is not the one asked for, is compiled again; nothing else happens."""

import hashlib
import os
import pickle
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import pytest

from netboard.base import kernel_cache
from netboard.base.files.sealed import Damaged, sealed, unsealed, write_sealed

SCRIPT = """
from netboard.base.compiled import kernel
@kernel
def inner(x):
    return x + 1.0
@kernel
def outer(x):
    return 2.0 * inner(x)
print(outer(1.0), sum(outer.stats.cache_hits.values()))
"""


@pytest.fixture
def script(tmp_path: Path) -> Path:
    path = tmp_path / "made.py"
    path.write_text(SCRIPT, encoding="utf-8")
    return path


def run(script: Path, folder: Path) -> tuple[str, str]:
    """Return what the script prints, the result and the kernels that it found in the cache, and what it logs."""
    environment = {**os.environ, "NUMBA_CACHE_DIR": str(folder)}
    done = subprocess.run([sys.executable, str(script)], env=environment, capture_output=True, text=True, check=True)
    return done.stdout.strip(), done.stderr


def of_other_code(path: Path) -> None:
    """Give every kernel the sound file of another one."""
    (other,) = (one for one in path.parent.glob("*inner*.nbc"))
    path.write_bytes(other.read_bytes())


DAMAGES: dict[str, Callable[[Path], object]] = {
    "is empty": lambda path: path.write_bytes(b""),
    "has only zeroes": lambda path: path.write_bytes(bytes(path.stat().st_size)),
    "is incomplete": lambda path: os.truncate(path, path.stat().st_size // 2),
    "was changed": lambda path: path.write_bytes(path.read_bytes()[::-1]),
    "does not load: ValueError": lambda path: path.write_bytes(sealed(pickle.dumps([1, 2, 3]))),
    "belongs to other code": of_other_code,
}


@pytest.mark.slow
@pytest.mark.skipif("NUMBA_DISABLE_JIT" in os.environ, reason="nothing is compiled")
@pytest.mark.sampled(2)
@pytest.mark.parametrize("reason", DAMAGES)
def test_damaged_kernel_is_compiled_again_and_replaced(script: Path, tmp_path: Path, reason: str) -> None:
    assert run(script, tmp_path / "cache") == ("4.0 0", "")
    (folder,) = (tmp_path / "cache").glob("kernels-*")
    (damaged,) = folder.glob("*outer*.nbc")
    DAMAGES[reason](damaged)
    printed, logged = run(script, tmp_path / "cache")
    assert printed == "4.0 0"
    assert reason in logged
    assert len(logged.splitlines()) == 1
    assert logged.startswith(str(damaged))
    assert run(script, tmp_path / "cache") == ("4.0 1", "")


@pytest.mark.skipif("NUMBA_DISABLE_JIT" in os.environ, reason="nothing is compiled")
def test_cache_of_which_every_file_is_damaged_logs_one_line(script: Path, tmp_path: Path) -> None:
    run(script, tmp_path / "cache")
    files = list((tmp_path / "cache").rglob("*.nbc"))
    assert len(files) == 2
    for file in files:
        file.write_bytes(b"")
    printed, logged = run(script, tmp_path / "cache")
    assert (printed, len(logged.splitlines())) == ("4.0 0", 1)
    assert all(unsealed(file.read_bytes()) for file in files)


@pytest.mark.skipif("NUMBA_DISABLE_JIT" in os.environ, reason="nothing is compiled")
def test_missing_kernel_is_compiled_without_a_word(script: Path, tmp_path: Path) -> None:
    run(script, tmp_path / "cache")
    (missing,) = (tmp_path / "cache").rglob("*outer*.nbc")
    missing.unlink()
    assert run(script, tmp_path / "cache") == ("4.0 0", "")
    assert missing.exists()


@pytest.mark.skipif("NUMBA_DISABLE_JIT" in os.environ, reason="nothing is compiled")
def test_kernel_that_cannot_be_kept_runs_with_one_log_line(script: Path, tmp_path: Path) -> None:
    """A folder in place of each file stands for a disk that takes none."""
    run(script, tmp_path / "cache")
    for file in list((tmp_path / "cache").rglob("*.nbc")):
        file.unlink()
        file.mkdir()
        (file / "occupied").touch()
    printed, logged = run(script, tmp_path / "cache")
    assert printed == "4.0 0"
    assert [line.rpartition("; ")[2] for line in logged.splitlines()] == [
        "compiled kernels that are damaged are compiled again",
        "each start compiles them again",
    ]
    assert not list((tmp_path / "cache").rglob("*.part"))


@pytest.mark.skipif("NUMBA_DISABLE_JIT" in os.environ, reason="nothing is compiled")
def test_changed_script_is_compiled_again(script: Path, tmp_path: Path) -> None:
    run(script, tmp_path / "cache")
    script.write_text(SCRIPT.replace("x + 1.0", "x + 2.0"), encoding="utf-8")
    assert run(script, tmp_path / "cache") == ("6.0 0", "")


@pytest.mark.skipif("NUMBA_DISABLE_JIT" in os.environ, reason="nothing is compiled")
def test_kernel_of_another_package_is_compiled_again_when_one_that_it_calls_has_changed(tmp_path: Path) -> None:
    package = tmp_path / "plugged"
    (package / "room").mkdir(parents=True)
    inner, outer = SCRIPT.split("@kernel\ndef outer")
    (package / "inner.py").write_text(inner, encoding="utf-8")
    imports = "from netboard.base.compiled import kernel\nfrom plugged.inner import inner\n"
    (package / "room" / "outer.py").write_text(f"{imports}@kernel\ndef outer{outer}", encoding="utf-8")
    script = tmp_path / "started.py"
    script.write_text("import plugged.room.outer", encoding="utf-8")
    assert run(script, tmp_path / "cache") == ("4.0 0", "")
    assert run(script, tmp_path / "cache") == ("4.0 1", "")
    (package / "inner.py").write_text(inner.replace("x + 1.0", "x + 2.0"), encoding="utf-8")
    assert run(script, tmp_path / "cache") == ("6.0 0", "")


MADE = """
from netboard.base.compiled import inlined
from plugged.inner import inner
def make(number):
    @inlined
    def scaled(x):
        return number * inner(x)
    @inlined
    def around(x):
        return scaled(x) + 1.0
    return around
"""
"""A kernel with another one in its closure."""

COMPOSED = """
from netboard.base.compiled import composed
from plugged.parts import make
def _part(x):
    raise NotImplementedError
def _whole(x):
    return _part(x)
for number in (2.0, 3.0):
    whole = composed(_whole, _part=make(number))
    print(whole(1.0), sum(whole.stats.cache_hits.values()))
"""


@pytest.mark.skipif("NUMBA_DISABLE_JIT" in os.environ, reason="nothing is compiled")
def test_kernel_made_with_other_kernels_is_cached_as_long_as_they_are_the_same(tmp_path: Path) -> None:
    package, script = tmp_path / "plugged", tmp_path / "composing.py"
    package.mkdir()
    inner = SCRIPT.partition("@kernel\ndef outer")[0]
    (package / "inner.py").write_text(inner, encoding="utf-8")
    (package / "parts.py").write_text(MADE, encoding="utf-8")
    script.write_text(COMPOSED, encoding="utf-8")
    assert run(script, tmp_path / "cache") == ("5.0 0\n7.0 0", "")
    assert run(script, tmp_path / "cache") == ("5.0 1\n7.0 1", "")
    (package / "inner.py").write_text(inner.replace("x + 1.0", "x + 5.0"), encoding="utf-8")
    assert run(script, tmp_path / "cache") == ("13.0 0\n19.0 0", "")


def test_examination_names_each_damaged_file(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("NUMBA_CACHE_DIR", str(tmp_path))
    write_sealed(tmp_path / "a.nbc", b"code")
    write_sealed(tmp_path / "shim.so", b"library")
    (tmp_path / "locks").mkdir()
    assert kernel_cache.examine() == (2, 11, [])
    (tmp_path / "b.nbc").touch()
    os.truncate(tmp_path / "shim.so", 20)
    assert kernel_cache.examine() == (3, 4, ["b.nbc is empty", "shim.so is incomplete or was changed"])


@pytest.mark.parametrize("content", [b"", b"x", bytes(1000)])
def test_sealed_content_comes_back_and_no_shortened_or_changed_one(content: bytes) -> None:
    whole = sealed(content)
    assert whole == content + hashlib.sha256(content).digest()
    assert unsealed(whole) == content
    for length in range(len(whole)):
        with pytest.raises(Damaged):
            unsealed(whole[:length])
    for place in range(len(whole)):
        with pytest.raises(Damaged, match="was changed"):
            unsealed(whole[:place] + bytes([whole[place] ^ 1]) + whole[place + 1 :])


WATCHED = """
class Watcher:
    def compiled(self, count):
        print(count, end=" ")
    def rests(self):
        print("rests")
with compilation.watched(Watcher):
    outer(1.0), outer(1.0)
outer(1)
"""


@pytest.mark.skipif("NUMBA_DISABLE_JIT" in os.environ, reason="nothing is compiled")
def test_watcher_is_told_of_kernels_that_are_compiled_and_of_nothing_that_is_loaded(tmp_path: Path) -> None:
    path = tmp_path / "watched.py"
    kernels = SCRIPT.replace("print(outer(1.0), sum(outer.stats.cache_hits.values()))", WATCHED)
    path.write_text(f"from netboard.base.compilation import compilation{kernels}", encoding="utf-8")
    assert run(path, tmp_path / "cache") == ("0 0 1 2 rests", ""), "outer begins, inner begins and ends, outer ends"
    assert run(path, tmp_path / "cache") == ("", "")
