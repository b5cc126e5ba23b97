"""Firth's penalised likelihood against brglm2, closed forms, and conditions without events."""

import json
from pathlib import Path

import numpy as np
import pytest
from scipy import stats

from netboard.analysis.statistics.firth import Family, firth_fit, profile_interval

REFERENCE = json.loads((Path(__file__).parents[1] / "data" / "models" / "reference.json").read_text(encoding="utf-8"))
TABLE = {name: np.array(column, dtype=float) for name, column in REFERENCE["firth"]["table"].items()}
SATURATED = np.column_stack([np.ones(len(TABLE["h"])), TABLE["h"], TABLE["c"], TABLE["h"] * TABLE["c"]])
FULL = np.column_stack([SATURATED[:, :3], np.log(TABLE["trial"]), SATURATED[:, 3]])


@pytest.mark.evidence("independent", firth_fit, by="brglm2")
@pytest.mark.parametrize(
    ("name", "response", "columns", "family"),
    [
        ("logistic", "fell", FULL, "binomial"),
        ("poisson", "count", FULL, "poisson"),
        ("logistic_separated", "fell", SATURATED, "binomial"),
    ],
)
def test_estimates_equal_those_of_brglm2(name: str, response: str, columns: np.ndarray, family: Family) -> None:
    found = firth_fit(TABLE[response], columns, family)
    reference = REFERENCE["firth"][name]
    assert found.converged
    assert found.coefficients == pytest.approx(reference["coefficients"], rel=1e-6)
    assert np.sqrt(np.diag(found.covariance)) == pytest.approx(reference["errors"], rel=1e-5)


@pytest.mark.evidence("truth", firth_fit)
def test_estimate_of_two_groups_adds_half_an_event_to_each_cell() -> None:
    failed = np.repeat([1.0, 0.0, 1.0, 0.0], [6, 14, 0, 20])
    columns = np.column_stack([np.ones(40), np.repeat([-0.5, 0.5], 20)])
    found = firth_fit(failed, columns, "binomial")
    assert found.coefficients[1] == pytest.approx(np.log(0.5 / 20.5) - np.log(6.5 / 14.5), rel=1e-7)
    counted = firth_fit(failed, columns, "poisson")
    assert counted.coefficients[1] == pytest.approx(np.log(0.5 / 6.5), rel=1e-7)
    assert counted.means == pytest.approx(np.repeat([6.5 / 20, 0.5 / 20], 20))


@pytest.mark.evidence("truth", profile_interval)
def test_profile_interval_ends_at_the_likelihood_ratio_limit() -> None:
    failed = np.repeat([1.0, 0.0, 1.0, 0.0], [6, 14, 0, 20])
    columns = np.column_stack([np.ones(40), np.repeat([-0.5, 0.5], 20)])
    best, row = firth_fit(failed, columns, "binomial"), np.array([0.0, 1.0])
    drop = 0.5 * stats.chi2.ppf(0.95, 1)
    ends = profile_interval(failed, columns, "binomial", best, row, drop)
    assert ends[0] < best.coefficients[1] < ends[1] < 0.0
    for end in ends:
        held = firth_fit(failed, columns, "binomial", (row, end))
        assert row @ held.coefficients == pytest.approx(end)
        assert best.likelihood - held.likelihood == pytest.approx(drop, abs=1e-4)
    # Far more room away from zero than towards it: no interval of an estimate and its error says that.
    assert best.coefficients[1] - ends[0] > 1.3 * (ends[1] - best.coefficients[1])


@pytest.mark.evidence("independent", profile_interval, by="scipy")
def test_constrained_fit_equals_direct_maximisation() -> None:
    from scipy.optimize import minimize

    row, value = np.array([0.0, 1.0, 0.0, 0.5]), -2.0
    held = firth_fit(TABLE["fell"], SATURATED, "binomial", (row, value))

    def lost(free: np.ndarray) -> float:
        b = np.array([free[0], value - 0.5 * free[2], free[1], free[2]])
        p = 1.0 / (1.0 + np.exp(-SATURATED @ b))
        information = (SATURATED * (p * (1.0 - p))[:, None]).T @ SATURATED
        likelihood = np.log(np.where(TABLE["fell"] > 0, p, 1.0 - p)).sum()
        return -float(likelihood + 0.5 * np.linalg.slogdet(information)[1])

    direct = minimize(lost, np.zeros(3), method="Nelder-Mead", options={"xatol": 1e-9, "fatol": 1e-12, "maxiter": 9999})
    assert held.likelihood == pytest.approx(-direct.fun, abs=1e-7)


@pytest.mark.evidence("properties", firth_fit, profile_interval, of=("order", "mirror"))
def test_fit_is_invariant_to_row_order_and_mirrored_conditions() -> None:
    by = np.random.default_rng(2).permutation(len(FULL))
    turned = FULL[by] * [1.0, -1.0, 1.0, 1.0, -1.0]
    one, other = firth_fit(TABLE["fell"], FULL, "binomial"), firth_fit(TABLE["fell"][by], turned, "binomial")
    assert other.coefficients == pytest.approx(one.coefficients * [1.0, -1.0, 1.0, 1.0, -1.0], abs=1e-7)
    row = np.eye(5)[1]
    low, high = profile_interval(TABLE["fell"], FULL, "binomial", one, row, 1.92)
    mirrored = profile_interval(TABLE["fell"][by], turned, "binomial", other, row, 1.92)
    assert mirrored == pytest.approx((-high, -low), abs=1e-4)


def test_fit_converges_without_events_and_with_events_only() -> None:
    for response in (np.zeros(len(SATURATED)), np.ones(len(SATURATED))):
        found = firth_fit(response, SATURATED, "binomial")
        assert found.converged
        assert found.coefficients[1:] == pytest.approx(0.0, abs=1e-7)


def test_profile_far_from_the_maximum_stays_finite() -> None:
    """Few trials, one event, and a flat profile of the slope: far from the maximum all means are 0 or 1."""
    columns = np.column_stack([np.ones(8), [-1.5, 1.5] * 4, [-25.0, -25.0, 25.0, 25.0] * 2])
    response = np.array([0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0])
    far = firth_fit(response, columns, "binomial", (np.array([0.0, 0.0, 1.0]), 1e4))
    assert np.isfinite(far.coefficients).all()
    best = firth_fit(response, columns, "binomial")
    low, high = profile_interval(response, columns, "binomial", best, np.array([0.0, 1.0, 0.0]), 1.92)
    assert low < best.coefficients[1] < high


@pytest.mark.slow
@pytest.mark.parametrize("trials", [2, 4, 8])
def test_profile_with_little_information_terminates(trials: int) -> None:
    """Few trials, failures in one condition only, and a wide interval: the profile extends far out."""
    h, c, order = (index.ravel() for index in np.indices((2, 2, trials)))
    columns = np.column_stack([np.ones(4 * trials), h - 0.5, c - 0.5, (h - 0.5) * (c - 0.5), np.log(order + 1.0)])
    failed = ((h == 0) & (c == 0) & (order == 0)).astype(float)
    for family in ("binomial", "poisson"):
        best = firth_fit(failed, columns, family)
        assert best.converged
        for row in np.eye(5):
            low, high = profile_interval(failed, columns, family, best, row, 40.0)
            assert low < row @ best.coefficients < high
