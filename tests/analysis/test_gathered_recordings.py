"""The tables do not depend on workers or cache; a recording that cannot be measured is reported in one line."""

import pickle
import shutil
import time
from collections.abc import Iterator, Sequence
from concurrent.futures import BrokenExecutor, Executor
from contextlib import contextmanager
from pathlib import Path

import numpy as np
import pytest

import rehearsed
from extractions import HERE, assert_same, extracted, study_from
from made_recordings import recorded, two_trials
from netboard.analysis.extraction import running
from netboard.analysis.extraction.cache import Cache
from netboard.analysis.extraction.settings import Readings, parse
from netboard.analysis.extraction.study import StudyData
from netboard.analysis.extraction.workers import dask, processes
from netboard.base.config import Config
from netboard.base.config import parse as parse_config
from netboard.base.errors import ConfigError, NetboardError, RecordingError
from netboard.base.process.workers import cores
from netboard.recording.export.formats import export
from netboard.recording.files.locate import find_recordings
from netboard.recording.files.reader import Recording
from netboard.recording.importing.table_import import ImportOptions, import_table

pytestmark = pytest.mark.slow


@contextmanager
def no_workers(recordings: Sequence[Path]) -> Iterator[Executor]:
    """Fail if workers are requested."""
    pytest.fail(f"{recordings} were to be measured anew")
    yield


@pytest.fixture(scope="module")
def alone(recordings: tuple[Path, ...]) -> StudyData:
    return study_from(extracted(recordings, Readings()))


def test_interruption_ends_the_processes_at_once(recordings: tuple[Path, ...]) -> None:
    asked = []

    def interrupted() -> None:
        with processes(2)(recordings) as pool:
            asked.append(pool.submit(time.sleep, 30.0))
            while not asked[0].running():
                time.sleep(0.001)
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        interrupted()
    assert isinstance(asked[0].exception(), BrokenExecutor)


def test_tables_do_not_depend_on_file_order_or_processes(recordings: tuple[Path, ...], alone: StudyData) -> None:
    reports: list[tuple[str, int, int]] = []
    found = extracted(recordings[::-1], Readings(), processes(2), None, lambda *words: reports.append(words))
    assert [source.run.path for source in found.sources] == list(recordings)
    assert found.left_out == ()
    assert found.peak > 1e7
    assert [done for _, done, _ in reports] == [1, 2, 3, 4]
    seconds = alone.blocks["duration"].sum()
    assert reports[-1] == (f"4 of 4 recordings, {seconds:.0f} s of data", 4, 4)
    assert_same(study_from(found), alone)


def test_cached_tables_equal_measured_tables(recordings: tuple[Path, ...], alone: StudyData, tmp_path: Path) -> None:
    cache = Cache(tmp_path)
    some = extracted(recordings[:2], Readings(), HERE, cache)
    assert [source.cached for source in some.sources] == [False, False]
    mixed = extracted(recordings, Readings(), HERE, cache)
    assert [source.cached for source in mixed.sources] == [True, True, False, False]
    assert_same(study_from(mixed), alone)
    kept = extracted(recordings, Readings(), no_workers, cache)
    assert kept.peak == 0.0
    assert_same(study_from(kept), alone)


def test_changed_exclusions_reuse_cached_measures(
    recordings: tuple[Path, ...], alone: StudyData, tmp_path: Path
) -> None:
    cache = Cache(tmp_path)
    extracted(recordings, Readings(), HERE, cache)
    stricter = parse("[exclusions]\nwarm_up = 1")
    study = study_from(extracted(recordings, stricter, no_workers, cache), stricter)
    assert len(study.counted) == len(alone.counted) - len(recordings)
    coarser = parse("[filters]\nfast = 10.0")
    found = extracted(recordings[:1], coarser, HERE, cache)
    assert not found.sources[0].cached
    name = recordings[0].stem
    assert not np.array_equal(study_from(found, coarser).paths[name]["theta"], alone.paths[name]["theta"])


def test_changed_byte_invalidates_the_cache(recordings: tuple[Path, ...], tmp_path: Path) -> None:
    copy = tmp_path / recordings[0].name
    shutil.copy(recordings[0], copy)
    cache = Cache(tmp_path / "cache")
    extracted([copy], Readings(), HERE, cache)
    data = bytearray(copy.read_bytes())
    data[len(data) // 2] ^= 1
    copy.write_bytes(data)
    with pytest.raises((pytest.fail.Exception, RecordingError), match=r"measured anew|its checksum is wrong"):
        extracted([copy], Readings(), no_workers, cache)


@pytest.mark.parametrize("skip", [False, True])
def test_copies_count_once_whatever_they_are_called(
    recordings: tuple[Path, ...], alone: StudyData, tmp_path: Path, skip: bool
) -> None:
    export(recordings, "csv", tmp_path / "out", lambda *progress: None)
    table = tmp_path / "out" / "ticks" / f"{recordings[1].stem}.csv"
    imported = import_table(table, tmp_path, Config(), ImportOptions(), 1, lambda *progress: None).path
    renamed, same_name = tmp_path / "renamed.mcap", tmp_path / recordings[2].name
    for copy, original in ((renamed, recordings[0]), (same_name, recordings[2])):
        shutil.copy(original, copy)
    copies = (imported, renamed, same_name)
    found = extracted(find_recordings((*recordings, *copies)), Readings(), skip=skip)
    assert sorted(one.file for one in found.left_out) == sorted(copy.name for copy in copies)
    assert all("is a copy of" in one.why and "trials count once" in one.why for one in found.left_out)
    assert_same(study_from(found), alone)


def test_recordings_in_conflict_are_refused_also_where_unreadable_ones_are_skipped(
    recordings: tuple[Path, ...], tmp_path: Path
) -> None:
    with Recording(recordings[0]) as whole:
        rows, about, text = whole.ticks(), whole.metadata, whole.config_text
    rows["theta"][-1] += 1e-9
    changed = rehearsed.write(tmp_path / "changed.mcap", rows, parse_config(text), metadata=about, text=text)
    with pytest.raises(RecordingError, match="claim to be the same part of a block, and differ at tick"):
        extracted((*recordings, changed), Readings(), skip=True)


def unreadable(folder: Path, recordings: tuple[Path, ...]) -> list[Path]:
    """A sound recording, and four others: with damaged chunks, truncated, not MCAP, and without ticks."""
    sound, damaged, cut = (folder / f"{name}.mcap" for name in ("sound", "damaged", "cut"))
    shutil.copy(recordings[0], sound)
    data = recordings[1].read_bytes()
    cut.write_bytes(data[:-1000])
    hurt = bytearray(data)
    for place in range(100_000, 300_000, 20_000):  # one of them may fall into a chunk index, which is never read
        hurt[place : place + 64] = bytes(64)
    damaged.write_bytes(hurt)
    (folder / "text.mcap").write_text("no recording")
    empty = recorded(folder, two_trials()[:0])
    return [sound, damaged, cut, folder / "text.mcap", empty]


def test_unreadable_recordings_are_refused_or_left_out(recordings: tuple[Path, ...], tmp_path: Path) -> None:
    paths = unreadable(tmp_path, recordings)
    for path, why in zip(paths[1:], ("is damaged", "cut short", "not an MCAP file", "contains no ticks"), strict=True):
        with pytest.raises(RecordingError, match=rf"{path.name}: .*{why}") as caught:
            extracted([paths[0], path], Readings())
        assert "\n" not in str(caught.value)
    found = extracted(paths, Readings(), processes(2), skip=True)
    assert [source.run.path for source in found.sources] == paths[:1]
    assert [one.file for one in found.left_out] == sorted(path.name for path in paths[1:])
    assert not any(str(tmp_path) in one.why for one in found.left_out)
    assert len(study_from(found).blocks) == 1
    with pytest.raises(RecordingError, match="no recording can be"):
        extracted(paths[1:], Readings(), skip=True)


def test_file_that_changes_during_measuring_is_refused(
    recordings: tuple[Path, ...], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(running, "digests_of", lambda paths: dict.fromkeys(paths, "0" * 64))
    with pytest.raises(RecordingError, match="has changed since the start"):
        extracted(recordings[:1], Readings())


def die() -> None:
    """End a process as the out-of-memory killer does."""
    import os

    os._exit(9)


def test_worker_process_that_dies_is_reported_in_one_line(recordings: tuple[Path, ...]) -> None:
    with pytest.raises(NetboardError, match=r"a worker process ended.*--workers 2"):  # noqa: SIM117
        with processes(2)(recordings) as executor:
            executor.submit(die).result()


def test_recording_errors_survive_pickling() -> None:
    error = pickle.loads(pickle.dumps(RecordingError("S01.mcap: is damaged")))
    assert isinstance(error, RecordingError)
    assert str(error) == "S01.mcap: is damaged"
    assert cores() >= 1


def test_unreachable_scheduler_is_reported_in_one_line(recordings: tuple[Path, ...]) -> None:
    pytest.importorskip("distributed")
    with pytest.raises(ConfigError, match=r"--dask tcp://127.0.0.1:9: no scheduler answers there within 0.2 s"):  # noqa: SIM117
        with dask("tcp://127.0.0.1:9", patience=0.2)(recordings):
            pytest.fail("an unreachable scheduler was accepted")


@pytest.mark.parametrize("address", ["nonsense", "nonsense://x:1", "host:port"])
def test_invalid_scheduler_address_is_refused(recordings: tuple[Path, ...], address: str) -> None:
    pytest.importorskip("distributed")
    with pytest.raises(ConfigError, match=rf"--dask {address}: .*; expected an address such as tcp://10"):  # noqa: SIM117
        with dask(address)(recordings):
            pytest.fail("an invalid address was accepted")
