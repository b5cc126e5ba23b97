"""The study of the servo callback: its statistics, and a run with a fake libHD."""

import json
import re
import threading
from pathlib import Path

import numpy as np
import pytest
from typer.testing import CliRunner

from libhd import fake_library
from netboard.base.errors import NetboardError
from netboard.base.tick import TICK_NS
from netboard.benchmarks.harness.running import Options
from netboard.benchmarks.loop.servo import (
    BARE,
    KINDS,
    LOADS,
    PYTHON,
    C,
    compute,
    duration_part,
    lateness_part,
    main,
    measure,
    unsteadiness,
)
from netboard.services.cli import app

COUNT = 1000


def ticks(latency_ns: int, off_ns: int) -> np.ndarray:
    """Ticks that are alternately early and late."""
    began = np.arange(COUNT) * TICK_NS + np.arange(COUNT) % 2 * off_ns
    return np.stack([began, began + latency_ns], axis=1)


def found(python_ns: int, busy_ns: int) -> dict[str, np.ndarray]:
    cost = {BARE: 100, PYTHON: python_ns, C: 1000}
    return {
        kind + suffix: ticks(busy_ns if suffix and kind == PYTHON else cost[kind], 10 * cost[kind])
        for suffix in LOADS
        for kind in KINDS
    }


def test_jitter_counts_early_and_late_ticks() -> None:
    assert set(unsteadiness(ticks(5, 300)).tolist()) == {300}


def test_callbacks_are_compared_with_the_bare_tick() -> None:
    part = lateness_part(found(20_000, 500_000))
    assert all(len(row) == len(part.columns) for row in part.rows)
    rows = {row[0]: row[1:] for row in part.rows}
    assert rows["python"] == (COUNT - 1, *(pytest.approx(0.2),) * 4)
    assert rows["python / bare tick [1]"][1:] == (pytest.approx(200.0),) * 4
    assert rows["c / bare tick, busy thread [1]"][1:] == (pytest.approx(10.0),) * 4


def test_callback_longer_than_a_tick_fails() -> None:
    good, bad = duration_part(found(20_000, 500_000)), duration_part(found(20_000, 5_000_000))
    assert [verdict.holds for verdict in good.verdicts] == [True, True]
    assert [verdict.holds for verdict in bad.verdicts] == [False, True]
    rows = {row[0]: row[1:] for row in bad.rows}
    assert rows["python / c, busy thread [1]"][1:] == (pytest.approx(5000.0),) * 4


def test_busy_thread_stops_on_request() -> None:
    stopping = threading.Event()
    thread = threading.Thread(target=compute, args=(stopping,))
    thread.start()
    stopping.set()
    thread.join(10)
    assert not thread.is_alive()


@pytest.mark.slow
@pytest.mark.sampled(1, of="quick benchmarks")
def test_study_runs_with_a_fake_library(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    library, out, copy = str(fake_library()), tmp_path / "out", tmp_path / "copy.json"
    main(library, 0.05, Options(out, copy, quick=True))
    output = capsys.readouterr().out
    assert re.search(r"\d+ cores", output)
    assert "python / bare tick, busy thread" in output
    results = json.loads(copy.read_text(encoding="utf-8"))
    assert results["machine"]["cores"] > 0
    assert [part["name"] for part in results["parts"]] == ["lateness", "duration"]
    assert {path.name for path in out.iterdir()} == {"lateness.csv", "duration.csv", "results.json"}


@pytest.mark.slow
def test_missing_device_is_reported(monkeypatch: pytest.MonkeyPatch) -> None:
    library = str(fake_library())
    monkeypatch.setenv("FAKE_LIBHD_UNPLUGGED", "1")
    with pytest.raises(NetboardError, match="there is no haptic device at all"):
        measure(library, C, 0.05, busy=False)


def test_missing_library_is_reported_and_nothing_is_written(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    result = CliRunner().invoke(app, ["bench", "servo", "--quick", "--library", "nothing/libHD.so"])
    assert result.exit_code == 1
    assert "tried nothing/libHD.so" in result.output
    assert list(tmp_path.iterdir()) == []
