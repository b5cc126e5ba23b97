"""Sensitivity d' of answers, against closed forms and simulated answers of known sensitivity."""

from math import isnan, sqrt

import numpy as np
import pytest
from scipy import stats

from netboard.analysis.statistics.detection import clustered_d_prime, d_prime


@pytest.mark.evidence("truth", d_prime, clustered_d_prime)
def test_sensitivity_of_simulated_observers_is_found() -> None:
    """Many answers of observers with a criterion of their own, whose d' is known."""
    rng = np.random.default_rng(5)
    for true in (0.0, 0.8, 1.6):
        signals = rng.normal(true, 1.0, 200_000) > 0.3
        others = rng.normal(0.0, 1.0, 200_000) > 0.3
        assert d_prime(signals.sum(), signals.size, others.sum(), others.size) == pytest.approx(true, abs=0.02)


@pytest.mark.evidence("truth", clustered_d_prime)
def test_interval_contains_the_true_sensitivity_as_often_as_it_says() -> None:
    rng = np.random.default_rng(6)
    within, runs, true = 0, 400, 1.0
    for _ in range(runs):
        signals, others = rng.normal(true, 1.0, (12, 10)) > 0.5, rng.normal(0.0, 1.0, (12, 10)) > 0.5
        counts = np.column_stack([signals.sum(1), np.full(12, 10), others.sum(1), np.full(12, 10)])
        found = clustered_d_prime(counts)
        within += found.low <= true <= found.high
    assert 0.92 <= within / runs <= 0.98


@pytest.mark.evidence("independent", d_prime, by="scipy")
@pytest.mark.parametrize("counts", [(8, 10, 3, 10), (0, 5, 5, 5), (12, 12, 0, 12), (1, 2, 1, 40)])
def test_sensitivity_is_the_difference_of_normal_quantiles(counts: tuple[int, int, int, int]) -> None:
    hits, signals, false_alarms, others = counts
    expected = stats.norm.ppf((hits + 0.5) / (signals + 1)) - stats.norm.ppf((false_alarms + 0.5) / (others + 1))
    assert d_prime(*counts) == pytest.approx(expected, rel=1e-12)


@pytest.mark.evidence("independent", clustered_d_prime, by="scipy")
def test_interval_is_students_of_the_pseudo_values() -> None:
    counts = np.array([(8, 10, 3, 10), (5, 10, 4, 10), (9, 10, 1, 10), (6, 10, 6, 10), (7, 10, 2, 10)])
    whole = d_prime(*counts.sum(0))
    pseudo = [5 * whole - 4 * d_prime(*(counts.sum(0) - one)) for one in counts]
    low, high = stats.t.interval(0.9, 4, loc=whole, scale=np.std(pseudo, ddof=1) / sqrt(5))
    found = clustered_d_prime(counts, level=0.9)
    assert (found.value, found.low, found.high) == pytest.approx((whole, low, high), rel=1e-12)
    assert (found.n, found.unit, found.method) == (5, "dyad", "jackknife")


@pytest.mark.evidence("properties", d_prime, of=("mirror", "order"))
def test_swapped_kinds_or_answers_turn_the_sign() -> None:
    value = d_prime(8, 10, 3, 12)
    assert d_prime(3, 12, 8, 10) == pytest.approx(-value, rel=1e-12)
    assert d_prime(10 - 8, 10, 12 - 3, 12) == pytest.approx(-value, rel=1e-12)
    assert d_prime(5, 10, 6, 12) == pytest.approx(0.0, abs=1e-12)


@pytest.mark.evidence("properties", clustered_d_prime, of=("mirror", "order", "constant"))
def test_order_of_units_and_units_without_events_do_not_matter() -> None:
    counts = np.array([(8, 10, 3, 10), (5, 10, 4, 10), (9, 10, 1, 10)])
    found = clustered_d_prime(counts)
    assert clustered_d_prime([*counts[::-1], (0, 0, 0, 0)]) == pytest.approx(found)
    turned = clustered_d_prime(counts[:, [2, 3, 0, 1]])
    assert (turned.value, turned.low, turned.high) == pytest.approx((-found.value, -found.high, -found.low))


def test_there_is_no_interval_from_one_unit_or_if_one_unit_has_all_of_a_kind() -> None:
    assert isnan(clustered_d_prime([(8, 10, 3, 10)]).low)
    lone = clustered_d_prime([(8, 10, 3, 10), (0, 0, 2, 5)])
    assert not isnan(lone.value)
    assert isnan(lone.low)
    assert isnan(d_prime(0, 0, 2, 5))
    assert clustered_d_prime(np.zeros((3, 4))).n == 0


@pytest.mark.parametrize(
    ("counts", "said"),
    [([(11, 10, 0, 10)], "more answers"), ([(1, 2, -1, 3)], "negative"), ([(1, 2, 3)], "expected, found shape")],
)
def test_impossible_counts_are_refused(counts: list[tuple[int, ...]], said: str) -> None:
    with pytest.raises(ValueError, match=said):
        clustered_d_prime(counts)
    with pytest.raises(ValueError, match="no more answers than events"):
        d_prime(3, 2, 0, 1)
