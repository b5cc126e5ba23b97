"""The quick stability study: theory against runs, stiff scenes, and files."""

import csv
import json
import math
from pathlib import Path

import numpy as np
import pytest
from rich.console import Console

from netboard.base.errors import ConfigError
from netboard.base.tables.scene import Physics
from netboard.base.tick import TICK_SECONDS
from netboard.benchmarks.harness.machine import describe
from netboard.benchmarks.harness.results import BenchVerdict, Folder, ResultPart, new_folder, show
from netboard.benchmarks.physics.problem import hermite_drives, styluses_at
from netboard.benchmarks.stability.maps import (
    PLANES,
    MapCell,
    draw_map,
    largest_scale,
    map_parts,
    measure_cell,
    tick_limits,
)
from netboard.benchmarks.stability.rest import energies, energy_drift, perfect_rest
from netboard.benchmarks.stability.runs import STUDIED, is_bounded, scaled
from netboard.benchmarks.stability.stress import ball_at_ends, large_tilts, stiff_forces

LIMITED = [method for method in STUDIED if method not in ("midpoint", "etd2rk", "etdrk4")]
SCENES = [{}, {"k_h": 1000.0}, {"c_h": 100.0}, {"k_h": 31.6, "c_h": 31.6}, {"M": 10.0, "I": 10.0}]


@pytest.mark.slow
@pytest.mark.parametrize("factors", SCENES, ids=str)
@pytest.mark.parametrize("method", LIMITED)
@pytest.mark.sampled(4)
def test_measured_step_limits_agree_with_theory(method: str, factors: dict[str, float]) -> None:
    cell = measure_cell(scaled(Physics(), **factors), method)
    assert cell.counts
    assert cell.agrees, cell


@pytest.mark.slow
@pytest.mark.parametrize("factors", [*SCENES, {"k_h": 1000.0, "c_h": 1000.0}, {"c_h": 1000.0}], ids=str)
@pytest.mark.parametrize("method", ["midpoint", "etd2rk", "etdrk4"])
def test_methods_without_a_step_limit_stay_bounded_at_tick_steps(method: str, factors: dict[str, float]) -> None:
    assert is_bounded(scaled(Physics(), **factors), method, TICK_SECONDS)


@pytest.mark.slow
def test_rk4_limits_of_scaled_couplings_are_known() -> None:
    part = tick_limits(["rk4"])
    assert part.holds, part.verdicts
    _, stiffer, more_damped, alike = part.rows[0]
    assert (stiffer, more_damped, alike) == pytest.approx((139, 4.49, 31.0), rel=0.01)


def test_largest_scale_is_searched_from_below() -> None:
    assert largest_scale(lambda scale: scale < 5.0 or scale > 7.0) == pytest.approx(5.0, rel=2e-3)
    assert largest_scale(lambda scale: True) == math.inf
    assert largest_scale(lambda scale: False) == 0.0


def test_polynomials_match_the_hands_at_both_ends() -> None:
    physics, times = Physics(), np.linspace(0.0, 0.1, 11)
    z, vz = styluses_at(times)
    drives = physics.k_h * z + physics.c_h * vz
    found = hermite_drives(physics, times, z, vz).reshape(10, 2, 4)
    assert np.allclose(found @ np.array([1.0, 0.0, 0.0, 0.0]), drives[:-1], rtol=1e-12)
    assert np.allclose(found @ 0.01 ** np.arange(4), drives[1:], rtol=1e-12)


@pytest.mark.slow
def test_forces_in_stiff_scenes_are_accurate() -> None:
    part = stiff_forces([(10.0, 3.2), (100.0, 10.0)])
    assert part.holds, part.verdicts


@pytest.mark.slow
def test_forces_at_large_tilts_are_accurate() -> None:
    part = large_tilts([17.0, 49.0])
    assert part.holds, part.verdicts


@pytest.mark.slow
@pytest.mark.sampled(1, of="quick benchmarks")
def test_energy_drift_of_an_undamped_board_depends_on_the_method() -> None:
    part = energy_drift(20_000, ["euler", "rk4", "midpoint", "etdrk4"])
    assert part.holds, part.verdicts
    assert [row[-1] for row in part.rows] == ["adds", "takes", "keeps", "keeps"]


def test_energy_starts_at_that_of_the_initial_state() -> None:
    physics = Physics()
    found = energies("rk4", (0.005, 0.0, 0.0, 0.0), 100)
    assert found[0] == pytest.approx(0.5 * (2 * physics.k_h + physics.k_s) * 0.005**2)


@pytest.mark.slow
def test_ball_at_the_ends_of_the_board_stays_valid() -> None:
    part = ball_at_ends()
    assert part.holds, part.verdicts


@pytest.mark.slow
def test_board_at_rest_reaches_zero_without_denormals() -> None:
    part = perfect_rest(10_000, ["rk4", "etdrk4"])
    assert part.verdicts[0].holds, part.verdicts
    assert all(row[1] == 0.0 for row in part.rows)


# --- what is written ---------------------------------------------------------------------------------------------


def part_of(holds: bool) -> ResultPart:
    return ResultPart(
        "lengths",
        "Lengths",
        ("what", "length [m]"),
        [("one", 0.5), ("none", math.inf)],
        [BenchVerdict("a", holds, "b")],
    )


def test_results_folder_is_overwritten_only_with_force(tmp_path: Path) -> None:
    folder = Folder(tmp_path / "study")
    folder.write([part_of(True)], {"quick": True})
    with pytest.raises(ConfigError, match="--force"):
        Folder(tmp_path / "study")
    Folder(tmp_path / "study", force=True)
    kept = json.loads((folder.path / "results.json").read_text())
    assert kept["quick"] is True
    assert kept["parts"][0]["rows"] == [["one", 0.5], ["none", "inf"]]
    assert kept["machine"]["cores"] >= 1
    with (folder.path / "lengths.csv").open(newline="") as file:
        assert list(csv.reader(file)) == [["what", "length [m]"], ["one", "0.5"], ["none", "inf"]]


def test_new_result_folders_are_numbered(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    first = Folder(new_folder("stability")).path
    assert (str(first), str(new_folder("stability"))) == ("stability-1", "stability-2")


@pytest.mark.parametrize(("holds", "word"), [(True, "holds"), (False, "FAILS")])
def test_verdicts_are_printed_with_their_table(holds: bool, word: str) -> None:
    console = Console(width=100)
    with console.capture() as captured:
        show(console, part_of(holds))
    assert f"{word}  a: b" in captured.get()
    assert "length [m]" in captured.get()


@pytest.mark.slow
def test_stability_map_is_summarised_and_drawn(tmp_path: Path) -> None:
    pytest.importorskip("matplotlib")
    plane = PLANES[0]
    cells = [
        MapCell(method, across, down, theory, nonlinear)
        for method, theory, nonlinear in (("rk4", 1e-3, 1.01e-3), ("euler", 1e-3, 0.8e-3), ("etdrk4", math.inf, 0.2))
        for down in (1.0, 10.0)
        for across in (1.0, 10.0)
    ]
    whole, summary = map_parts(plane, cells)
    assert (len(whole.rows), whole.on_screen) == (12, False)
    assert [verdict.holds for verdict in summary.verdicts] == [True, False, True]
    Folder(tmp_path / "map").save("map", lambda: draw_map(plane, cells))
    assert (tmp_path / "map" / "map.png").stat().st_size > 10_000
    assert "theory" in (tmp_path / "map" / "map.svg").read_text()


def test_machine_description_names_libraries() -> None:
    machine = describe()
    assert machine.libraries
    assert len(machine.lines()) == 3
