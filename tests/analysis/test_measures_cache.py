"""The cache of measures: its key covers the recording's bytes, the settings and the code, and nothing else."""

import os
import time
from dataclasses import fields, replace
from pathlib import Path

import numpy as np
import pytest

from netboard.analysis.extraction import fingerprint
from netboard.analysis.extraction.cache import Cache, key_of
from netboard.analysis.extraction.recordings import FIELDS, Measured
from netboard.analysis.extraction.settings import Exclusions, Filters, Readings, Summaries
from netboard.analysis.extraction.store import ABANDONED, default_folder
from netboard.analysis.extraction.store import TABLES as ENDING
from netboard.base.errors import RecordingError
from netboard.recording.format.channels import DTYPES

pytest.importorskip("pyarrow")

SHA = "ab" * 32
TEXTS = ("", "S01", "S01", "D-07 ü")
NUMBERS = np.array([0.0, -0.0, np.inf, np.frombuffer(b"\x01\x00\x00\x00\x00\x00\xf8\x7f")[0]])


def awkward_tables(size: int = 4) -> Measured:
    """Tables of values that are hard to store exactly."""
    values = {
        "integer": np.array([0, -1, 2**62, 5]),
        "number": NUMBERS,
        "string": np.array(TEXTS, DTYPES["string"]),
    }
    return Measured(
        **{
            name: {field.name: np.tile(values[field.kind], size // 4) for field in columns}
            for name, columns in FIELDS.items()
        }
    )


def identical(one: Measured, other: Measured) -> bool:
    pairs = [
        (getattr(one, table.name)[name], getattr(other, table.name)[name])
        for table in fields(Measured)
        for name in getattr(one, table.name)
    ]
    return all(
        a.dtype == b.dtype and (a.tolist() == b.tolist() if a.dtype == object else a.tobytes() == b.tobytes())
        for a, b in pairs
    )


def test_cached_tables_are_restored_to_the_bit(tmp_path: Path) -> None:
    cache = Cache(tmp_path / "new" / "folder")
    assert cache.get("key") is None
    cache.put("key", awkward_tables())
    found = cache.get("key")
    assert found is not None
    assert identical(found, awkward_tables())
    assert [path.name for path in (tmp_path / "new" / "folder").iterdir()] == [f"key{ENDING}"]


def test_empty_tables_are_restored(tmp_path: Path) -> None:
    empty = Measured(
        **{name: {field.name: np.empty(0, DTYPES[field.kind]) for field in columns} for name, columns in FIELDS.items()}
    )
    Cache(tmp_path).put("key", empty)
    found = Cache(tmp_path).get("key")
    assert found is not None
    assert identical(found, empty)


@pytest.mark.parametrize("at", [0, 40, -1])
def test_damaged_cache_entry_is_ignored(tmp_path: Path, at: int) -> None:
    cache = Cache(tmp_path)
    cache.put("key", awkward_tables())
    path = tmp_path / f"key{ENDING}"
    data = bytearray(path.read_bytes())
    data[at] ^= 1
    path.write_bytes(data)
    assert cache.get("key") is None
    path.write_bytes(data[: len(data) // 2])
    assert cache.get("key") is None
    path.write_bytes(b"")
    assert cache.get("key") is None
    cache.put("key", awkward_tables())
    assert cache.get("key") is not None


def test_cache_evicts_least_recently_used_entries(tmp_path: Path) -> None:
    cache = Cache(tmp_path)
    for number in range(4):
        cache.put(f"key{number}", awkward_tables(400))
        os.utime(tmp_path / f"key{number}{ENDING}", ns=(number, number))
    size = (tmp_path / f"key0{ENDING}").stat().st_size
    assert cache.get("key0") is not None
    Cache(tmp_path, limit=2 * size).trim()
    assert sorted(path.stem for path in tmp_path.iterdir()) == ["key0", "key3"]
    Cache(tmp_path).trim()
    assert len(list(tmp_path.iterdir())) == 2


def test_entries_in_use_are_kept_beyond_the_size_limit(tmp_path: Path) -> None:
    before, now = Cache(tmp_path, limit=1), Cache(tmp_path, limit=1)
    for key in ("old", "found"):
        before.put(key, awkward_tables())
    now.put("made", awkward_tables())
    assert now.get("found") is not None
    now.trim()
    assert sorted(path.stem for path in tmp_path.iterdir()) == ["found", "made"]


def test_abandoned_partial_files_are_removed_after_a_day(tmp_path: Path) -> None:
    now = time.time()
    for name, age in (("left.part", ABANDONED + 60.0), ("written.part", ABANDONED - 3600.0), ("new.part", 0.0)):
        (tmp_path / name).write_bytes(b"half")
        os.utime(tmp_path / name, (now - age, now - age))
    cache = Cache(tmp_path)
    cache.put("key", awkward_tables())
    cache.trim()
    assert {path.name for path in tmp_path.iterdir()} == {"written.part", "new.part", f"key{ENDING}"}


def test_cache_folder_that_cannot_be_created_is_reported(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("")
    with pytest.raises(RecordingError, match=r"file/cache: results cannot be cached there: .*; --no-cache keeps none"):
        Cache(tmp_path / "file" / "cache")


def test_default_cache_folder_follows_xdg_cache_home(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    assert default_folder() == tmp_path / "netboard" / "measures"
    monkeypatch.delenv("XDG_CACHE_HOME")
    assert default_folder() == Path.home() / ".cache" / "netboard" / "measures"


def test_cache_key_ignores_summaries_and_exclusions() -> None:
    other = replace(Readings(), summaries=Summaries(level="median"), exclusions=Exclusions(warm_up=5))
    assert key_of("S01", SHA, other) == key_of("S01", SHA, Readings())


def test_cache_key_depends_on_bytes_name_settings_and_code(monkeypatch: pytest.MonkeyPatch) -> None:
    keys = {
        key_of("S01", SHA, Readings()),
        key_of("S02", SHA, Readings()),
        key_of("S01", SHA[::-1], Readings()),
        key_of("S01", SHA, replace(Readings(), filters=Filters(fast=10.0))),
    }
    monkeypatch.setattr("netboard.analysis.extraction.cache.fingerprint", lambda: "other code")
    assert len(keys | {key_of("S01", SHA, Readings())}) == 5


def test_code_fingerprint_covers_all_imported_modules(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    found = fingerprint.sources()
    for name in (
        *("analysis.extraction.recordings", "analysis.extraction.attempts", "analysis.measures.lags"),
        *("task.trials.quality", "base.tick", "base.config"),
    ):
        assert found[f"netboard.{name}"].is_file()
    for name in (
        *("analysis.extraction.study", "analysis.extraction.exclusions", "analysis.extraction.cache"),
        *("analysis.topics.result", "analysis.topics.figure"),
    ):
        assert f"netboard.{name}" not in found
    before = fingerprint.fingerprint()
    copies = {name: tmp_path / f"{name}.py" for name in found}
    for name, copy in copies.items():
        copy.write_bytes(found[name].read_bytes())
    monkeypatch.setattr(fingerprint, "sources", lambda root: copies)
    fresh = fingerprint.fingerprint.__wrapped__
    assert fresh() == before
    copies["netboard.analysis.measures.lags"].write_bytes(found["netboard.analysis.measures.lags"].read_bytes() + b"\n")
    assert fresh() != before
