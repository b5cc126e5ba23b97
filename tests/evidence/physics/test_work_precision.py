"""The tables, ratios and claims of the work-precision study, independent of run times."""

from itertools import pairwise
from math import inf, log10
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from evidence.physics.bench import Selection, choose_peers, study
from evidence.physics.figures import draw
from evidence.physics.horizons import holds_part
from evidence.physics.netboard_methods import collocation_solvers, meeting, one_step_solvers
from evidence.physics.parts import AGREEMENT, mujoco_part, ratios_parts
from evidence.physics.peer_mujoco import LIBRARY as MUJOCO
from evidence.physics.peer_mujoco import STAGES, many_at_once
from evidence.physics.reference import make_reference, tight
from evidence.physics.work_precision import (
    OURS,
    TARGETS,
    Row,
    compare,
    cost_at,
    frontier,
    least_cost,
    measure,
)
from netboard.base.errors import ConfigError
from netboard.benchmarks.harness.results import Folder
from netboard.benchmarks.physics.problem import MODELS, Model, Problem

SHORT = Problem("paper", "settled", duration=0.1)


def row(error: float, cost: float, library: str = OURS, method: str = "rk4", problem: str = "paper, settled") -> Row:
    errors = (0.1 * error, error, 0.5 * error, error)
    return Row(
        problem,
        library,
        method,
        f"{cost} us",
        False,
        10,
        20,
        errors,
        error,
        3,
        0.0,
        cost,
        cost,
        2 * cost,
        2 * cost,
        inf,
        0.002,
        1.0,
        inf,
        0.01,
    )


# --- comparing ---------------------------------------------------------------------------------------------------


@given(st.lists(st.tuples(st.floats(1e-12, 1.0), st.floats(1.0, 1e6)), max_size=30))
def test_frontier_contains_exactly_the_undominated_runs(points: list[tuple[float, float]]) -> None:
    rows = [row(*point) for point in points]
    best = frontier(rows)
    for one in rows:
        beaten = any(other.scaled <= one.scaled and other.physics <= one.physics for other in best)
        assert beaten
    for one in best:
        assert not any(
            other.scaled <= one.scaled
            and other.physics <= one.physics
            and (other.scaled < one.scaled or other.physics < one.physics)
            for other in rows
        )
    assert [one.physics for one in best] == sorted(one.physics for one in best)


def test_costs_are_interpolated_on_a_log_log_line() -> None:
    curve = [row(1e-2, 10.0), row(1e-4, 1000.0)]
    assert cost_at(curve, 1e-3) == pytest.approx(100.0)
    assert cost_at(curve, 1e-4) == pytest.approx(1000.0)


def test_large_error_costs_as_much_as_the_cheapest_run() -> None:
    assert cost_at([row(1e-2, 10.0), row(1e-4, 1000.0)], 0.1) == 10.0


def test_unreached_error_has_infinite_cost() -> None:
    assert cost_at([row(1e-2, 10.0), row(1e-4, 1000.0)], 1e-5) == inf
    assert cost_at([], 1e-5) == inf
    assert cost_at([row(inf, 1.0)], 1e-5) == inf


def test_dominated_run_is_not_on_the_curve() -> None:
    assert cost_at([row(1e-2, 10.0), row(1e-1, 50.0), row(1e-4, 1000.0)], 1e-3) == pytest.approx(100.0)


def test_least_cost_is_that_of_a_single_best_method() -> None:
    rows = [row(1e-2, 10.0), row(1e-6, 1e5), row(1e-4, 2000.0, method="dop853"), row(1e-8, 4000.0, method="dop853")]
    assert least_cost(rows, 1e-3) == pytest.approx(100.0)
    assert least_cost(rows, 1e-4) == pytest.approx(1000.0)
    assert least_cost(rows, 1e-6) == pytest.approx(8e6**0.5)


def test_cost_ratios_compare_solvers_at_equal_error() -> None:
    rows = [row(1e-2, 10.0), row(1e-6, 100.0), row(1e-2, 20.0, "peer"), row(1e-8, 50.0, "peer")]
    comparison = next(one for one in compare(rows) if one.what == "physics")
    ratios = dict(zip(TARGETS, comparison.ratios, strict=True))
    assert ratios[1e-2] == pytest.approx(2.0)
    assert ratios[1e-6] == pytest.approx(20.0 * 2.5 ** (4 / 6) / 100.0)
    assert ratios[1e-8] == 0.0
    assert ratios[1e-12] is None
    assert not comparison.beaten
    assert not ratios_parts(compare(rows))[0].holds


def test_error_reached_by_netboard_only_has_infinite_ratio() -> None:
    ours, theirs = [row(1e-2, 1.0), row(1e-12, 2.0)], [row(1e-2, 3.0, "peer")]
    comparison = next(one for one in compare([*ours, *theirs]) if one.what == "physics")
    assert comparison.ratios == (3.0, *[inf] * (len(TARGETS) - 1))
    assert comparison.beaten
    assert ratios_parts([comparison])[0].holds


@pytest.mark.parametrize(
    ("h", "expected"), [(0.001, (2, 1)), (0.000125, (16, 1)), (0.002, (1, 1)), (0.004, (1, 2)), (0.005, (2, 5))]
)
def test_steps_coincide_with_grid_points(h: float, expected: tuple[int, int]) -> None:
    assert meeting(h) == expected


# --- measuring ---------------------------------------------------------------------------------------------------


@pytest.mark.slow
@pytest.mark.parametrize(("method", "order"), [("euler", 1), ("heun", 2), ("rk4", 4)])
def test_error_of_a_run_follows_the_order_of_its_method(method: str, order: int) -> None:
    reference = make_reference(SHORT, "tight", tight(SHORT))
    solvers = [one for one in one_step_solvers(SHORT, quick=False) if one.method == method]
    rows = measure(SHORT, reference, solvers, 1, 0.0)
    errors = {one.setting: one.scaled for one in rows}
    slope = log10(errors["1 ms"] / errors["0.25 ms"]) / log10(4.0)
    assert slope == pytest.approx(order, abs=0.35)
    assert errors["4 ms"] > errors["2 ms"] > errors["1 ms"] > errors["0.5 ms"] > errors["0.25 ms"]
    for one in rows:
        assert one.whole > one.physics > 0.0
        assert one.physics_median >= one.physics
        assert one.library == OURS
        assert one.turns >= 1


@pytest.mark.slow
def test_collocation_is_accurate_in_long_steps() -> None:
    problem = Problem("paper", "cold", duration=0.3)
    reference = make_reference(problem, "tight", tight(problem))
    rows = measure(problem, reference, collocation_solvers(problem, quick=True), 1, 0.0)
    found = {(one.method, one.setting): one.scaled for one in rows}
    assert found["collocation 8", "10 ms, tol 1e-14"] < 1e-8
    assert found["collocation 8", "5 ms, tol 1e-14"] < 1e-10
    opened = found["collocation 8, short steps first", "5 ms then 50 ms, tol 1e-14"]
    assert opened < 1e-9 < found["collocation 8", "50 ms, tol 1e-14"]


def test_exact_method_is_offered_for_level_boards_only() -> None:
    assert "exact" not in {one.method for one in one_step_solvers(SHORT, quick=False)}


# --- the study ---------------------------------------------------------------------------------------------------


@pytest.mark.slow
@pytest.mark.parametrize("model", MODELS)
@pytest.mark.sampled(1)
def test_higher_order_extrapolation_reduces_the_error_of_every_signal(model: Model) -> None:
    problem = Problem(model, "settled", duration=1.0)
    rows = holds_part([(problem, make_reference(problem, "tight", tight(problem)))]).rows
    errors = [
        next(np.array(row[3:7], float) for row in rows if row[1] == hold) for hold in ("zoh", "cv", "ca", "hermite")
    ]
    for worse, better in pairwise(errors):
        assert (better < worse).all()


@pytest.mark.slow
def test_extrapolation_errors_are_within_the_claims() -> None:
    problem = Problem("paper", "settled", duration=1.0)
    assert holds_part([(problem, make_reference(problem, "tight", tight(problem)))]).holds


@pytest.mark.slow
@pytest.mark.sampled(1, of="quick benchmarks")
def test_quick_study_has_all_its_parts(tmp_path: Path) -> None:
    folder = Folder(tmp_path / "results")
    selection = Selection((Problem("paper", "settled"),), (), repeats=1, budget=0.0)
    parts = list(study(selection, folder, lambda text, share: None, quick=True))
    names = [part.name for part in parts]
    assert names[:5] == ["reference", "runs", "steps", "costs-paper-settled", "frontier"]
    assert {"holds", "tick"} < set(names)
    assert all(part.rows for part in parts)
    assert all(len(line) == len(part.columns) for part in parts for line in part.rows)
    folder.write(parts, {})
    assert {path.suffix for path in folder.path.iterdir()} == {".csv", ".json", ".png", ".svg"}


@pytest.mark.slow
def test_figures_are_written(tmp_path: Path) -> None:
    rows = [row(1e-2, 10.0), row(1e-4, 100.0), row(inf, 1.0), row(1e-3, 30.0, "peer", "Taylor")]
    folder = Folder(tmp_path / "figures")
    draw(rows, folder)
    assert sorted(path.name for path in folder.path.iterdir()) == [
        "work-precision-paper-settled-signals.png",
        "work-precision-paper-settled-signals.svg",
        "work-precision-paper-settled.png",
        "work-precision-paper-settled.svg",
    ]
    drawn = (folder.path / "work-precision-paper-settled.svg").read_text(encoding="utf-8")
    assert "netboard rk4" in drawn
    assert "peer Taylor" in drawn


def test_peer_libraries_are_chosen_by_name() -> None:
    with pytest.raises(ConfigError, match="heyoka, mujoco, scipy"):
        choose_peers(["octave"], quick=False)
    assert choose_peers([], quick=False) == ()
    assert choose_peers(["scipy"], quick=True) == ("scipy",)
    assert "scipy" in choose_peers(None, quick=True)


def test_many_simulations_at_once_take_the_same_steps_as_mujoco() -> None:
    pytest.importorskip("mujoco")
    theirs, ours, apart = many_at_once(Problem("lagrangian", "settled"), 1)
    assert theirs > 0.0
    assert ours > 0.0
    assert 0.0 < apart < AGREEMENT


@pytest.mark.parametrize(("ours", "apart", "holds"), [(40.0, 1e-12, True), (60.0, 1e-12, False), (40.0, 1e-3, False)])
def test_steps_of_many_simulations_are_compared_with_those_of_mujoco(ours: float, apart: float, holds: bool) -> None:
    problem = "lagrangian, settled"
    rows = [row(1e-3, 1.0, problem=problem), row(1e-3, 100.0, MUJOCO, STAGES, problem)]
    part = mujoco_part(rows, [], {problem: (5000.0, ours, apart)})
    assert [verdict.holds for verdict in part.verdicts] == [holds]
    assert part.rows[1][-1] == 5000.0 / ours
