"""The benchmark of the analysis: the fit of a straight line, and the tables that it writes."""

import json
from collections.abc import Callable, Sequence
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest
from typer.testing import CliRunner

from evidence.__main__ import app
from evidence.analysis import costs, speed_bench
from evidence.analysis.costs import TablesCost, Time
from evidence.analysis.speed_bench import SHARES, Row, _row, _scaling, line, mixed
from evidence.analysis.step_costs import STEPS
from rehearsed_study import small_study

pytest.importorskip("pyarrow")
pytest.importorskip("matplotlib")


def test_line_returns_slope_intercept_and_r2() -> None:
    x = np.array([18.0, 36.0, 54.0, 72.0])
    slope, start, explained = line(x, 3.0 + 0.25 * x)
    assert slope == pytest.approx(0.25)
    assert start == pytest.approx(3.0)
    assert explained == pytest.approx(1.0)
    y = np.array([1.0, 5.0, 2.0, 4.0])
    assert line(x, y)[2] == pytest.approx(np.corrcoef(x, y)[0, 1] ** 2)
    assert line(x, np.ones(4))[2] == 1.0


@pytest.mark.parametrize(("power", "noise", "holds"), [(1.0, 0.0, True), (1.0, 0.03, True), (2.0, 0.0, False)])
def test_growth_is_linear_despite_noise_but_not_quadratic(power: float, noise: float, holds: bool) -> None:
    signs = (1, -1, -1, 1)  # least like a straight line
    times = [Time(0.0, 0.3 + share**power + noise * sign) for share, sign in zip(SHARES, signs, strict=True)]
    tables = [TablesCost(round(1000 * share), 0.0, time, 0.0, 0.0) for share, time in zip(SHARES, times, strict=True)]
    rows = [Row(1, time, table, table) for time, table in zip(times, tables, strict=True)]
    claim, _ = _scaling(rows).verdicts
    assert claim.holds is holds


def test_least_disturbed_uncached_analysis_counts(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    used: list[Path] = []

    def measured(recordings: Sequence[Path], workers: int, cache: Path) -> TablesCost:
        used.append(cache)
        return TablesCost(10, 1.0, Time(9.0, (3.0, 2.0, 4.0, 0.5)[len(used) - 1]), 100.0 * len(used), 0.0)

    def called(function: Callable[..., object], *arguments: object) -> object:
        return function(*arguments)

    for module in (costs, speed_bench):
        monkeypatch.setattr(module, "cost_of_tables", measured)
    monkeypatch.setattr(costs, "cost_of_reading", lambda recordings, workers: Time(1.0, 1.0))
    monkeypatch.setattr(speed_bench, "in_fresh_process", called)
    row = _row([tmp_path / "a.mcap"], 1, tmp_path / "cache", 3)
    assert (row.uncached.time.cpu, row.cached.time.cpu) == (2.0, 0.5)
    assert row.uncached.peak == 100.0  # as in a fresh process
    assert len(set(used[:3])) == 3  # each with an empty cache
    assert used[3] == used[0]


@pytest.mark.slow
@pytest.mark.sampled(0, of="longest")
def test_benchmark_writes_every_table(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(speed_bench, "SHARES", (0.5, 1.0))
    (made := tmp_path / "made").mkdir()
    small_study(made)
    words = ["analysis", str(made), "-o", "out", "--workers", "1", "--json", "analysis.json"]
    result = CliRunner().invoke(app, words)
    assert result.exit_code == 0, result.output
    parts = {part["name"]: part for part in json.loads(Path("analysis.json").read_text())["parts"]}
    assert set(parts) == {"steps", "tasks", "costs", "scaling", "memory", "whole", "again"}
    assert [row[0] for row in parts["steps"]["rows"]] == [*STEPS, "whole recording"]
    assert all(row[1] > 0.0 for row in parts["steps"]["rows"] if row[0] != "controls")  # some blocks have none
    assert [row[0] for row in parts["again"]["rows"]] == ["first", "second"]
    rows = parts["costs"]["rows"]
    assert [row[0] for row in rows] == [2, 4]
    assert all(after[1] > before[1] and after[2] > before[2] for before, after in pairwise(rows))
    assert [row[0] for row in parts["scaling"]["rows"]] == ["reading alone", "uncached", "cached"]
    assert Path("analysis.json").read_bytes() == Path("out/results.json").read_bytes()


def test_shares_have_recordings_of_both_halves() -> None:
    study = [Path(f"{place}.mcap") for place in range(7)]
    assert [int(path.stem) for path in mixed(study)] == [0, 4, 1, 5, 2, 6, 3]
    assert mixed(study[:1]) == study[:1]
