"""Confidence intervals of means that stay in the range of their quantity: shares, times, counts, correlations."""

from math import atanh, inf, log, sqrt, tanh

import numpy as np
import pytest
import statsmodels.api as sm
from hypothesis import given
from hypothesis import strategies as st
from scipy import stats
from statsmodels.stats.proportion import proportion_confint

from netboard.analysis.statistics.estimates import Range, mean_interval, t_interval, wilson_interval

SHARES = st.lists(st.floats(0.0, 1.0), min_size=2, max_size=8)
TIMES = st.lists(st.floats(1e-6, 1e3), min_size=2, max_size=8)
INSIDE: dict[Range, tuple[float, float]] = {"positive": (0.0, inf), "share": (0.0, 1.0), "balance": (-1.0, 1.0)}


@pytest.mark.evidence("independent", wilson_interval, by="statsmodels")
@given(st.integers(0, 40), st.integers(1, 40), st.floats(0.5, 0.999))
def test_wilson_intervals_equal_those_of_statsmodels(events: int, others: int, level: float) -> None:
    n, quantile = events + others, float(stats.norm.ppf(0.5 + level / 2.0))
    found = wilson_interval(events / n, n, quantile)
    assert found == pytest.approx(proportion_confint(events, n, 1.0 - level, method="wilson"), abs=1e-12)


@pytest.mark.evidence("truth", mean_interval)
def test_one_fall_of_one_dyad_has_an_interval_within_0_and_1() -> None:
    found = mean_interval([0.0, 0.0, 0.0, 1 / 24], "share", events=96)
    assert found.value == pytest.approx(1 / 96)
    assert t_interval([0.0, 0.0, 0.0, 1 / 24]).low < 0.0
    t, size = float(stats.t.ppf(0.975, 3)), 95.0  # m (1 - m) / s^2, with s = m for one dyad of four
    middle, whole = 1 / 96 + t**2 / (2 * size), 1 + t**2 / size
    half = t * sqrt(1 / 96 * 95 / 96 / size + t**2 / (4 * size**2))
    assert (found.low, found.high) == pytest.approx(((middle - half) / whole, (middle + half) / whole))
    assert (found.method, found.level, found.n) == ("Wilson", 0.95, 4)


@pytest.mark.evidence("independent", mean_interval, by="statsmodels")
def test_share_without_any_event_has_the_interval_of_all_attempts() -> None:
    found = mean_interval([0.0] * 4, "share", events=96)
    alpha = 2.0 * float(stats.norm.sf(stats.t.ppf(0.975, 3)))
    assert (found.low, found.high) == pytest.approx(proportion_confint(0, 96, alpha, method="wilson"))
    assert mean_interval([0.25] * 4, "share", events=96).high > 0.3
    alike = mean_interval([0.25] * 4, "share")
    assert (alike.low, alike.high) == pytest.approx((0.25, 0.25))


@pytest.mark.evidence("independent", mean_interval, by="statsmodels")
@given(st.lists(st.floats(0.1, 50.0), min_size=3, max_size=8).filter(lambda x: np.ptp(x) > 0.1))
def test_interval_of_times_equals_that_of_a_log_link(values: list[float]) -> None:
    """A log-linear model of the mean with robust errors is the delta method on the log scale."""
    n = len(values)
    model = sm.GLM(values, np.ones(n), family=sm.families.Poisson()).fit(cov_type="HC0", tol=1e-12, maxiter=200)
    half = float(stats.t.ppf(0.975, n - 1)) * float(model.bse[0]) * sqrt(n / (n - 1))
    found = mean_interval(values, "positive")
    assert (log(found.low), log(found.high)) == pytest.approx(
        (model.params[0] - half, model.params[0] + half), abs=1e-6
    )


@pytest.mark.evidence("truth", mean_interval)
def test_interval_of_a_correlation_is_symmetric_in_fishers_z() -> None:
    values = [-0.95, -0.9, -0.99, -0.7]
    found, plain = mean_interval(values, "balance"), t_interval(values)
    assert plain.low < -1.0 < found.low
    z, half = atanh(plain.value), (plain.high - plain.low) / 2.0 / (1.0 - plain.value**2)
    assert (found.low, found.high) == pytest.approx((tanh(z - half), tanh(z + half)))
    near = np.array([0.301, 0.3, 0.299, 0.302])  # similar correlations: as Student's t of their own z values
    t = t_interval(np.arctanh(near))
    narrow = mean_interval(near, "balance")
    assert (narrow.low, narrow.high) == pytest.approx((tanh(t.low), tanh(t.high)), abs=1e-5)


@pytest.mark.evidence("truth", mean_interval)
def test_small_variation_gives_the_t_interval() -> None:
    values = np.array([0.50001, 0.5, 0.49999, 0.50002])
    plain = t_interval(values)
    for within in INSIDE:
        found = mean_interval(values, within)
        assert (found.low, found.high) == pytest.approx((plain.low, plain.high), rel=1e-6)
    assert mean_interval(values, "real") == plain


@pytest.mark.evidence("properties", mean_interval, of=("unit", "order"))
@given(TIMES, st.floats(1e-3, 1e3))
def test_interval_of_times_follows_the_unit(values: list[float], unit: float) -> None:
    found, scaled = mean_interval(values, "positive"), mean_interval(unit * np.array(values)[::-1], "positive")
    assert (scaled.low, scaled.high) == pytest.approx((unit * found.low, unit * found.high), rel=1e-6)
    assert 0.0 <= found.low <= found.value * (1 + 1e-9) <= found.high * (1 + 2e-9)


@pytest.mark.evidence("properties", mean_interval, wilson_interval, of="mirror")
@given(SHARES, st.integers(2, 50))
def test_intervals_stay_in_their_range_and_follow_mirrors(shares: list[float], events: int) -> None:
    x = np.array(shares)
    for values, within, most in ((x, "share", events), (x, "share", inf), (2 * x - 1, "balance", inf)):
        found = mean_interval(values, within, events=most)  # type: ignore[arg-type]
        low, high = INSIDE[within]  # type: ignore[index]
        assert low <= found.low <= found.value + 1e-9
        assert found.value - 1e-9 <= found.high <= high
        other = mean_interval(low + high - values, within, events=most)  # type: ignore[arg-type]
        assert (other.low, other.high) == pytest.approx((low + high - found.high, low + high - found.low), abs=1e-6)


@pytest.mark.evidence("disturbance", mean_interval, of="holes")
def test_interval_leaves_out_missing_values_and_needs_two_units() -> None:
    for within in INSIDE:
        assert mean_interval([0.2, np.nan, 0.4], within) == mean_interval([0.2, 0.4], within)
        few = mean_interval([0.2], within)
        assert np.isnan([few.low, few.high]).all()
        assert mean_interval([], within).n == 0
    zero = mean_interval([0.0, 0.0], "positive")
    assert (zero.low, zero.high) == (0.0, 0.0)
    with pytest.raises(ValueError, match="a mean from 0 to 1 is expected"):
        mean_interval([1.5, 1.2], "share")


@pytest.mark.parametrize("dyads", [4, 8])
def test_intervals_of_clustered_shares_cover_the_true_share(dyads: int) -> None:
    """24 attempts of each dyad, 5 % falls on average, dyads' own shares from a beta distribution."""
    source = np.random.default_rng(20_261_128)
    own = source.beta(1.0, 19.0, (2000, dyads))
    shares = source.binomial(24, own) / 24
    wilson = [mean_interval(row, "share", events=24 * dyads) for row in shares]
    plain = [t_interval(row) for row in shares]
    covered = [np.mean([one.low <= 0.05 <= one.high for one in found]) for found in (wilson, plain)]
    assert covered[0] > 0.93
    assert covered[0] > covered[1]


def test_coverage_of_the_log_scale_for_skewed_times() -> None:
    source = np.random.default_rng(5)
    times = source.gamma(4.0, 0.25, (2000, 4))  # mean 1, standard deviation 0.5
    found = [mean_interval(row, "positive") for row in times]
    assert np.mean([one.low <= 1.0 <= one.high for one in found]) > 0.93
    assert min(one.low for one in found) > 0.0
