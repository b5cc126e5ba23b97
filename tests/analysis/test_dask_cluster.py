"""A real Dask cluster computes the same tables, and unsuitable workers are refused."""

from collections.abc import Iterator
from importlib import import_module
from pathlib import Path
from typing import Any

import pytest

from extractions import assert_same, extracted, study_from
from netboard.analysis.cohort.workers import Runner
from netboard.analysis.extraction import workers
from netboard.analysis.extraction.settings import Readings
from netboard.analysis.extraction.workers import WorkerPool, dask
from netboard.analysis.report.analysing import AnalysisOptions, analyse
from netboard.base.errors import ConfigError, RecordingError

distributed = pytest.importorskip("distributed")
pytestmark = pytest.mark.slow
on_cluster = pytest.mark.sampled(0, of="longest", part="dask")
ANY_PORT = "127.0.0.1:0"


@pytest.fixture(scope="module")
def address() -> Iterator[str]:
    with distributed.LocalCluster(
        n_workers=2, threads_per_worker=1, dashboard_address=ANY_PORT, silence_logs=50
    ) as cluster:
        yield cluster.scheduler_address


@on_cluster
def test_cluster_computes_the_same_tables(address: str, recordings: tuple[Path, ...]) -> None:
    there = extracted(recordings, Readings(), dask(address))
    here = extracted(recordings, Readings())
    assert there.peak > 1e7
    assert_same(study_from(there), study_from(here))


def test_analysis_on_a_cluster_starts_no_processes_here(
    recordings: tuple[Path, ...], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def counted(count: int) -> WorkerPool:
        raise KeyboardInterrupt(count)

    monkeypatch.setattr(workers, "processes", counted)
    chosen = AnalysisOptions(dask="tcp://127.0.0.1:1", keep=False)
    with pytest.raises(KeyboardInterrupt, match=r"^1$"):
        next(analyse(recordings, tmp_path / "out", "", (), chosen, Readings))


@on_cluster
def test_virtual_studies_run_on_the_cluster(address: str) -> None:
    runner = Runner(lambda what, done, total: None, address=address)
    assert dict(runner.run_all(hex, range(100))) == {number: hex(number) for number in range(100)}


@on_cluster
def test_unreadable_recording_on_the_cluster_is_refused_or_left_out(
    address: str, recordings: tuple[Path, ...], tmp_path: Path
) -> None:
    data = recordings[0].read_bytes()
    damaged = tmp_path / "damaged.mcap"
    damaged.write_bytes(data[:200_000] + bytes(64) + data[200_064:])
    with pytest.raises(RecordingError, match=r"damaged.mcap: is damaged"):
        extracted([damaged, recordings[1]], Readings(), dask(address))
    found = extracted([damaged, recordings[1]], Readings(), dask(address), skip=True)
    assert [one.file for one in found.left_out] == ["damaged.mcap"]


@on_cluster
def test_workers_that_do_not_see_the_files_are_refused(address: str, tmp_path: Path) -> None:
    with pytest.raises(ConfigError, match=r"its worker tcp://127.*cannot read .*there.mcap"):  # noqa: SIM117
        with dask(address)([tmp_path / "there.mcap"]):
            pytest.fail("a worker saw a file that does not exist")


@on_cluster
def test_workers_with_other_code_are_refused(
    address: str, recordings: tuple[Path, ...], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(workers, "fingerprint", lambda root: "other code")
    with pytest.raises(ConfigError, match=r"has netboard .* with other code .* than here"):  # noqa: SIM117
        with dask(address)(recordings):
            pytest.fail("workers with other code were accepted")


class Absent:
    """An object that cannot be unpickled on the worker."""

    def __reduce__(self) -> Any:
        return import_module, ("a_module_that_is_nowhere",)


@on_cluster
def test_workers_without_netboard_are_refused(
    address: str, recordings: tuple[Path, ...], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(workers, "_account", Absent())
    with pytest.raises(ConfigError, match=r"has no netboard of this version .*a_module_that_is_nowhere"):  # noqa: SIM117
        with dask(address)(recordings):
            pytest.fail("workers without netboard were accepted")


def test_scheduler_without_workers_is_reported_after_a_timeout(recordings: tuple[Path, ...]) -> None:
    with (
        distributed.LocalCluster(n_workers=0, dashboard_address=ANY_PORT, silence_logs=50) as cluster,
        pytest.raises(ConfigError, match=r"has had no workers for 0.5 s"),
        dask(cluster.scheduler_address, patience=0.5)(recordings),
    ):
        pytest.fail("a scheduler without workers was accepted")
