"""The study of the Taylor method, independent of run times."""

import numpy as np
import pytest

from evidence.participants.trials import Population
from evidence.physics.netboard_taylor import taylor_solvers
from evidence.physics.reference import make_reference, tight
from evidence.physics.taylor_bench import sampled_part
from evidence.physics.taylor_lanes import LANES, group_runs, make_taylor_lanes
from evidence.physics.taylor_stress import CLAIM, Case, cases, moving, outcome_of, touches
from evidence.physics.taylor_trials import NAMES, Trial, drives_with_80_bits, errors_of, trials_of
from evidence.physics.work_precision import measure
from netboard.base.tables.scene import Physics
from netboard.benchmarks.harness.results import ResultPart
from netboard.benchmarks.physics.problem import Model, Problem
from netboard.physics.hands.sampled import Hands, drives_along, hold_hands
from netboard.physics.scene.parameters import pack_scene, parts_of
from netboard.physics.scene.series import table_of


@pytest.mark.slow
def test_errors_of_the_taylor_method_fall_with_its_tolerance() -> None:
    problem = Problem("paper", "cold", duration=0.3)
    rows = measure(problem, make_reference(problem, "tight", tight(problem)), taylor_solvers(problem, True), 1, 0.0)
    errors = [row.scaled for row in rows]
    assert errors == sorted(errors, reverse=True)
    assert errors[1] < 1e-5
    assert errors[-1] < 1e-11
    assert all(row.dense >= 0.0 and row.whole > row.physics for row in rows)


def test_cases_under_stress_have_names_of_their_own() -> None:
    names = [case.name for case in cases()]
    assert len(set(names)) == len(names) > 40


@pytest.mark.slow
def test_stiff_couplings_and_touches_are_within_the_claim() -> None:
    stiff = outcome_of(Case("stiff", Physics(k_h=20_000.0, c_h=200.0), moving(0.005)))
    assert stiff.error < CLAIM
    assert 1.0 < stiff.stiffness < 20.0
    part = ResultPart("touches", "", "case | steps | longest [ms] | longest [1] | error [1]")
    assert [said for _, said in touches(part) if said] == []
    assert np.all(np.array([row[-1] for row in part.rows]) == 0.0)


@pytest.mark.slow
def test_sampled_hands_are_simulated_within_the_claim() -> None:
    part = sampled_part(1)
    assert part.holds
    assert {row[0] for row in part.rows} == {"paper", "lagrangian"}


@pytest.mark.slow
@pytest.mark.parametrize("model", ["paper", "lagrangian"])
def test_a_trial_of_the_paper_is_simulated_within_the_claim(model: Model) -> None:
    job = Population(trials=1).jobs(1)[0]
    trial = next(trials_of(job))
    short = Trial(Hands(trial.hands.t[:301], trial.hands.z[:301], trial.hands.vz[:301]), trial.start)
    errors = errors_of(Physics(model=model), short)
    assert errors.shape == (len(NAMES),)
    assert errors.max() < CLAIM


def test_drives_with_80_bits_are_those_of_simulations() -> None:
    hands, physics = moving(0.02), Physics()
    held = hold_hands(hands, "hermite")
    drives = drives_along(held, held.ticks[:-1], pack_scene(physics))
    precise = drives_with_80_bits(physics, hands).reshape(-1, 8).astype(np.float64)
    assert np.all(np.abs(drives - precise) <= 1e-7 * np.abs(drives).max(axis=0))


@pytest.mark.slow
@pytest.mark.parametrize("physics", [Physics(), Physics(model="lagrangian", c_h=60.0)])
def test_simulations_in_lanes_equal_the_same_simulations_alone(physics: Physics) -> None:
    together, alone = group_runs(physics, 2 * LANES)
    found, exact = together(), alone()
    ranges = np.ptp(exact, axis=(0, 1))
    assert np.all(np.ptp(exact[:, -1], axis=0)[[2, 4]] > 1e-3 * ranges[[2, 4]])
    assert np.all(np.abs(found - exact).max(axis=(0, 1)) < 1e-11 * ranges)


def test_lanes_whose_state_overflows_are_nan() -> None:
    march, room = make_taylor_lanes(parts_of(Physics())), np.zeros(table_of(6).size * LANES)
    out = np.zeros((2, 6, LANES))
    first, drives, lengths = np.full((6, LANES), 1e300), np.zeros((2, 8, LANES)), np.full(2, 1e-3)
    march(first, drives, lengths, 1e-12, 15, pack_scene(Physics()), room, out)
    assert np.isnan(out).all()
