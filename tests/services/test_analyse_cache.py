"""A cached analysis is restored bit for bit, and never used for other data, settings or code."""

import errno
import json
import os
import shutil
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest
from typer.testing import CliRunner

from netboard.analysis.extraction import store as store_module
from netboard.analysis.extraction.store import ANALYSIS, FILE, Store
from netboard.analysis.report import folder as folder_module
from netboard.analysis.report.analysing import PLACEHOLDER, name_command
from netboard.services.cli import app
from rehearsed_study import small_study

pytest.importorskip("pyarrow")
pytest.importorskip("matplotlib")
pytest.importorskip("jinja2")
pytest.importorskip("statsmodels")

HEAVY = ("matplotlib", "numba", "numpy", "pandas", "pyarrow", "scipy", "statsmodels")


@pytest.fixture(scope="module")
def study(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return small_study(tmp_path_factory.mktemp("made"))[0].parent


@pytest.fixture(autouse=True)
def _run_in_empty_folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("COLUMNS", "200")
    monkeypatch.setenv("NO_COLOR", "1")
    monkeypatch.setattr("netboard.analysis.topics.everything.PICTURES", ())  # drawing takes most of the time


def analyse(*words: str | Path) -> str:
    command = ["analyse", *map(str, words), "--workers", "1", "--cache", "cache"]
    result = CliRunner().invoke(app, command)
    assert result.exit_code == 0, result.output
    return result.output


def contents(folder: str) -> dict[str, bytes]:
    return {str(path.relative_to(folder)): path.read_bytes() for path in Path(folder).rglob("*") if path.is_file()}


@pytest.mark.slow
def test_repeated_analysis_is_restored_from_the_cache_bit_for_bit(study: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(sys, "argv", ["netboard", "analyse", "it's <here>"])
    first = analyse(study, "-o", "first")
    assert "before" not in first

    def fail_if_called(*parts: object, **options: object) -> None:
        raise AssertionError("computed again")

    with monkeypatch.context() as patch:
        patch.setattr("netboard.analysis.report.folder.write_first_part", fail_if_called)
        again = analyse(study, "-o", "again")
    assert "; all were cached" in again
    (listed,) = Path("cache").glob(f"*{ANALYSIS}")
    files = json.loads(bytes(Store(Path("cache")).get(listed.name) or b""))["files"]
    assert {path.name for path in Path("cache").glob(f"*{FILE}")} == set(files.values()), (
        "each file of the cache is used"
    )
    said = first.splitlines()
    assert again.splitlines()[1:-1] == [line for line in said[1:-1] if not line.startswith("tables and answer: ")]
    assert len(said) == len(again.splitlines()) + 1
    assert contents("again") == contents("first")
    result = CliRunner().invoke(app, ["analyse", str(study), "-o", "anew", "--workers", "1", "--no-cache"])
    assert result.exit_code == 0
    assert contents("anew") == contents("first")
    assert json.loads(Path("again/provenance.json").read_text())["command"] == "netboard analyse 'it'\"'\"'s <here>'"
    report = Path("again/report.html").read_text()
    assert "&lt;here&gt;" in report
    assert PLACEHOLDER not in report
    missing = CliRunner().invoke(app, ["analyse", str(study), "-o", "unread", "--settings", "no.toml", "--cache=cache"])
    assert missing.exit_code == 2
    assert "no.toml: no such file" in missing.stderr  # not the cached analysis with the default settings
    assert not Path("unread").exists()
    Path("again/tables/trials.csv").write_text("changed by somebody")  # a copy, not the cached file
    analyse(study, "-o", "third")
    assert contents("third") == contents("first")


@pytest.mark.slow
@pytest.mark.slow
def test_analysis_goes_on_without_a_cache_whose_disk_is_full(study: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(sys, "argv", ["netboard", "analyse"])
    make, made = store_module.NamedTemporaryFile, []

    def make_few(**options: Any) -> Any:
        made.append(options)
        if len(made) > 3:
            raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))
        return make(**options)

    with monkeypatch.context() as patch:
        patch.setattr(store_module, "NamedTemporaryFile", make_few)
        said = analyse(study, "-o", "full")
    warning = "warning: cache: results cannot be cached there: No space left on device; --no-cache keeps none"
    assert said.count("No space left") == 1
    assert warning in said.splitlines()
    assert len(made) == 4, "nothing is tried after a failure"
    assert not list(Path("cache").glob(f"*{ANALYSIS}"))
    assert not list(Path().glob(".*"))
    assert "No space left" not in analyse(study, "-o", "again")
    assert contents("again") == contents("full")


def test_files_that_change_during_an_analysis_are_restored_as_written(
    study: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    written: dict[str, bytes] = {}

    def edit_first(*parts: object, **options: object) -> tuple[tuple[str, ...], float]:
        written.update(contents("out"))
        Path("out/tables/trials.csv").write_text("saved by a spreadsheet")
        Path("out/tables/.~lock.trials.csv#").write_text("its lock")
        return write_second_part(*parts, **options)

    write_second_part = folder_module.write_second_part
    with monkeypatch.context() as patch:
        patch.setattr(folder_module, "write_second_part", edit_first)
        analyse(study, "-o", "out")
    assert "; all were cached" in analyse(study, "-o", "again")
    again = contents("again")
    assert "tables/.~lock.trials.csv#" not in again
    assert {name for name, content in written.items() if again[name] != content} == {"report.html"}


@pytest.mark.slow
def test_cache_key_depends_on_recordings_settings_options_and_code(
    study: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    recordings = sorted(study.glob("*.mcap"))
    (other := Path("other")).mkdir()
    copies = [Path(shutil.copy(path, other)) for path in recordings]
    keys = [store_module.key_of_analysis(recordings, b"", ())]
    keys.append(store_module.key_of_analysis(recordings[:-1], b"", ()))
    keys.append(store_module.key_of_analysis(copies, b"", ()))
    keys.append(store_module.key_of_analysis(recordings, b"[filters]\nfast = 10.0\n", ()))
    keys.append(store_module.key_of_analysis(recordings, b"", ("filters.fast=10",)))
    keys.append(store_module.key_of_analysis(recordings, b"", ("paper=True",)))
    copies[0].write_bytes(copies[0].read_bytes() + b"\0")
    keys.append(store_module.key_of_analysis(copies, b"", ()))
    monkeypatch.setattr(store_module, "code_digest", lambda: "other code")
    keys.append(store_module.key_of_analysis(recordings, b"", ()))
    assert len(set(keys)) == len(keys)
    assert store_module.key_of_analysis(recordings, b"", ()) == keys[-1]


def test_code_digest_covers_every_source_file_and_library_version(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    digest = store_module.code_digest.__wrapped__
    before = digest()
    assert digest() == before
    package = tmp_path / "own"
    (package / "deep").mkdir(parents=True)
    (package / "__init__.py").write_text("")
    monkeypatch.syspath_prepend(tmp_path)
    monkeypatch.setattr(store_module, "PACKAGES", ("own",))
    digests = [digest()]
    for name in ("deep/module.py", "page.jinja", "style.css", "words.toml"):
        (package / name).write_text("one")
        digests.append(digest())
        (package / name).write_text("two")
        digests.append(digest())
    monkeypatch.setattr(store_module, "version", lambda name: "99")
    digests.append(digest())
    assert len(set(digests)) == len(digests)


def test_damaged_or_incomplete_cache_entry_is_not_used(tmp_path: Path) -> None:
    (folder := tmp_path / "folder" / "deep").mkdir(parents=True)
    (folder / "a.csv").write_bytes(b"1,2")
    (folder / "b.csv").write_bytes(b"3,4")
    store = Store(tmp_path / "store")
    store_module.store_entry(store, "key", store_module.store_files(store, tmp_path / "folder"), ["words"])
    (restored := tmp_path / "restored").mkdir()
    assert store_module.restore_analysis(store, "other", restored) is None
    assert store_module.restore_analysis(store, "key", restored) == ("words",)
    assert contents(str(restored)) == contents(str(tmp_path / "folder"))
    (empty := tmp_path / "empty").mkdir()
    for victim in [*(tmp_path / "store").glob(f"*{FILE}"), tmp_path / "store" / f"key{ANALYSIS}"]:
        content = victim.read_bytes()
        victim.write_bytes(content[:-1] + b"x")
        assert store_module.restore_analysis(store, "key", empty) is None
        victim.unlink()
        assert store_module.restore_analysis(store, "key", empty) is None
        victim.write_bytes(content)
    assert list(empty.iterdir()) == []
    assert store_module.restore_analysis(store, "key", empty) == ("words",)


def test_cached_analyses_respect_the_size_limit_of_the_store(tmp_path: Path) -> None:
    (folder := tmp_path / "folder").mkdir()
    for number in range(5):
        (folder / "table.csv").write_bytes(bytes([number]) * 10_000)
        store = Store(tmp_path / "store", limit=25_000)
        store_module.store_entry(store, str(number), store_module.store_files(store, folder), [])
    assert sum(path.stat().st_size for path in (tmp_path / "store").iterdir()) <= 25_000
    store = Store(tmp_path / "store")
    (restored := tmp_path / "restored").mkdir()
    assert store_module.restore_analysis(store, "4", restored) == ()
    assert store_module.restore_analysis(store, "0", restored) is None


def test_command_is_escaped_for_each_file_format(tmp_path: Path) -> None:
    (tmp_path / "provenance.json").write_text(f'{{"command": "{PLACEHOLDER}"}}')
    (tmp_path / "report.html").write_text(f"<code>{PLACEHOLDER}</code>")
    name_command(tmp_path, ["netboard", "a\u202eb", '"<&'])
    command = json.loads((tmp_path / "provenance.json").read_text(encoding="utf-8"))["command"]
    assert command == "netboard 'a\u202eb' '\"<&'"
    report = (tmp_path / "report.html").read_text(encoding="utf-8")
    assert "a[U+202E]b" in report
    assert "&#34;&lt;&amp;" in report


def test_cache_lookup_imports_no_numerical_library() -> None:
    code = "import sys, netboard.services.cli, netboard.services.analyse; print(*sys.modules)"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert not {name.partition(".")[0] for name in done.stdout.split()} & set(HEAVY)
