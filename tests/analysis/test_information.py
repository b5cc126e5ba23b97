"""Influence of one signal on another, against another library, closed forms and independent signals."""

from functools import partial

import numpy as np
import pandas as pd
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from statsmodels.tsa.stattools import grangercausalitytests

from netboard.analysis.measures.information import Past, chance_level, granger, transfer_entropy

ONE = Past(step=1, own=1, other=1, delay=1)


def coupled(n: int, strength: float, seed: int, noise: float = 1.0) -> tuple[np.ndarray, np.ndarray]:
    """White x, and y that follows it one sample later: y[t] = strength x[t - 1] + noise."""
    rng = np.random.default_rng(seed)
    x = rng.normal(size=n)
    y = noise * rng.normal(size=n)
    y[1:] += strength * x[:-1]
    return x, y


@pytest.mark.evidence("independent", granger, by="statsmodels")
@pytest.mark.parametrize("order", [1, 2, 4])
@pytest.mark.parametrize("seed", range(3))
def test_granger_equals_that_of_statsmodels(order: int, seed: int) -> None:
    x, y = coupled(300, 0.2, seed)
    y = np.convolve(y, [1.0, 0.6, 0.2])[:300]
    theirs = grangercausalitytests(pd.DataFrame({"y": y, "x": x})[["y", "x"]], maxlag=[order])[order][0]["ssr_ftest"]
    found = granger([x], [y], past=Past(step=1, own=order, other=order, delay=1))
    f, p, denominator, numerator = theirs
    assert (found.f, found.p) == pytest.approx((f, p), rel=1e-9)
    assert (found.denominator, found.numerator) == (denominator, numerator)
    assert found.n == 300 - order


@pytest.mark.evidence("truth", transfer_entropy)
@pytest.mark.parametrize("strength", [0.0, 0.5, 1.0, 2.0])
def test_transfer_entropy_equals_the_gaussian_closed_form(strength: float) -> None:
    # Of normal variables: half the logarithm of the variances without and with the source, 1 + c^2 and 1.
    x, y = coupled(8000, strength, 7)
    truth = 0.5 * np.log(1.0 + strength**2)
    assert transfer_entropy([x], [y], past=ONE) == pytest.approx(truth, abs=0.02)
    assert transfer_entropy([x], [y], past=ONE, estimator="nearest") == pytest.approx(truth, abs=0.04)
    assert abs(transfer_entropy([y], [x], past=ONE, estimator="nearest")) < 0.03


@pytest.mark.evidence("truth", transfer_entropy)
def test_binned_transfer_entropy_equals_the_closed_form_of_symbols() -> None:
    # A coin that is copied with probability 1 - e: ln 2 less the entropy of the error.
    rng = np.random.default_rng(3)
    x, wrong = rng.integers(0, 2, 20_000), rng.random(20_000) < 0.1
    y = np.zeros(20_000)
    y[1:] = np.where(wrong[1:], 1 - x[:-1], x[:-1])
    truth = np.log(2.0) + 0.1 * np.log(0.1) + 0.9 * np.log(0.9)
    found = transfer_entropy([x.astype(float)], [y], past=ONE, estimator="binned", bins=2)
    assert found == pytest.approx(truth, abs=0.01)
    assert transfer_entropy([y], [x.astype(float)], past=ONE, estimator="binned", bins=2) == pytest.approx(
        0.0, abs=1e-3
    )


@pytest.mark.evidence("truth", transfer_entropy)
def test_quadratic_influence_is_missed_by_the_linear_estimator_only() -> None:
    rng = np.random.default_rng(5)
    x = rng.normal(size=4000)
    y = 0.3 * rng.normal(size=4000)
    y[1:] += x[:-1] ** 2
    assert transfer_entropy([x], [y], past=ONE) < 0.01
    assert transfer_entropy([x], [y], past=ONE, estimator="nearest") > 0.5
    assert transfer_entropy([x], [y], past=ONE, estimator="binned") > 0.2


@pytest.mark.evidence("truth", granger)
def test_influence_is_largest_at_the_true_delay() -> None:
    rng = np.random.default_rng(9)
    x = rng.normal(size=6000)
    y = rng.normal(size=6000)
    y[12:] += 0.8 * x[:-12]
    strengths = [granger([x], [y], past=Past(step=1, own=1, other=1, delay=delay)).strength for delay in range(1, 20)]
    assert int(np.argmax(strengths)) == 11


@pytest.mark.evidence("truth", granger, transfer_entropy)
def test_conditioning_on_a_common_cause_removes_its_influence() -> None:
    rng = np.random.default_rng(1)
    ball = rng.normal(size=5000)
    x, y = rng.normal(size=5000), rng.normal(size=5000)
    x[1:] += ball[:-1]
    y[2:] += ball[:-2]
    two = Past(step=1, own=2, other=1, delay=1)
    assert granger([x], [y], past=two).strength > 0.1
    assert granger([x], [y], past=two, given=[[ball]]).p > 0.01
    assert abs(transfer_entropy([x], [y], past=two, given=[[ball]], estimator="nearest")) < 0.03


def test_past_never_extends_before_the_start_of_a_trial() -> None:
    x, y = coupled(1000, 1.0, 2)
    cut = [slice(0, 300), slice(300, 310), slice(310, 1000)]
    found = granger([x[part] for part in cut], [y[part] for part in cut], past=ONE)
    assert found.n == 1000 - 3
    assert found.strength == pytest.approx(granger([x], [y], past=ONE).strength, abs=0.02)
    coarse = granger([x], [y], past=Past(step=20, own=3, other=2, delay=55))
    assert coarse.n == len(range(75, 1000, 20))


def test_influence_is_nan_when_it_cannot_be_estimated() -> None:
    assert np.isnan(granger([[1.0, 2.0]], [[1.0, 2.0]]).strength)
    assert np.isnan(granger([], []).f)
    assert np.isnan(transfer_entropy([np.ones(3)], [np.ones(3)], estimator="nearest"))
    straight = np.arange(50.0)
    assert np.isnan(granger([straight**2], [straight], past=Past(step=1, own=2, other=1, delay=1)).strength)


def test_invalid_arguments_are_refused() -> None:
    with pytest.raises(ValueError, match="same length"):
        granger([np.ones(3)], [np.ones(4)])
    with pytest.raises(ValueError, match="number of trials"):
        granger([np.ones(3)], [])
    with pytest.raises(ValueError, match="1 or more"):
        Past(step=0)
    with pytest.raises(ValueError, match="two or more dyads"):
        chance_level([[np.ones(9)]], [[np.ones(9)]], lambda a, b: 0.0, np.random.default_rng(0))


def strength_of(sources: list[np.ndarray], targets: list[np.ndarray]) -> float:
    return granger(sources, targets, past=ONE).strength


def dyads(count: int, strength: float, task: float, seed: int = 0) -> tuple[list, list]:
    """Dyads of five trials; `task` scales a drive shared by all sources and, one sample later, by all targets."""
    rng = np.random.default_rng(seed)
    shared = rng.normal(size=(5, 400))
    sources, targets = [], []
    for _ in range(count):
        x = task * shared + rng.normal(size=(5, 400))
        y = rng.normal(size=(5, 400))
        y[:, 1:] += strength * x[:, :-1] + task * shared[:, :-1]
        sources.append(list(x))
        targets.append(list(y[:, :380]))
    return sources, targets


@pytest.mark.evidence("truth", chance_level)
@pytest.mark.parametrize(("count", "pairings", "exchanges"), [(2, 1, 1), (3, 2, 5), (4, 9, 23), (6, 265, 719)])
def test_coupled_dyads_have_the_least_p_of_all_pairings(count: int, pairings: int, exchanges: int) -> None:
    found = chance_level(*dyads(count, 0.5, 0.0), strength_of, np.random.default_rng(1))
    assert len(found.surrogates) == pairings
    assert found.p == found.least_p == pytest.approx(1 / (exchanges + 1))
    assert found.value == pytest.approx(np.log(1.25), abs=0.05)
    assert found.level == pytest.approx(0.0, abs=0.01)
    assert (found.n, found.unit, found.exact) == (count, "dyad", True)


@pytest.mark.evidence("truth", chance_level)
def test_common_task_drive_sets_the_chance_level() -> None:
    found = chance_level(*dyads(6, 0.0, 1.0), strength_of, np.random.default_rng(1))
    assert found.value > 0.1
    assert found.level == pytest.approx(found.value, abs=0.02)
    assert found.excess == pytest.approx(0.0, abs=0.02)
    assert found.p > 0.05


@pytest.mark.slow
@pytest.mark.evidence("disturbance", chance_level, of="noise")
def test_p_of_uncoupled_dyads_is_not_too_small() -> None:
    p = [chance_level(*dyads(4, 0.0, 0.5, seed), strength_of, np.random.default_rng(seed)).p for seed in range(100)]
    assert np.mean(np.array(p) <= 0.1) <= 0.2
    assert 0.4 < np.mean(p) < 0.7


@pytest.mark.slow
@pytest.mark.evidence("truth", chance_level)
@pytest.mark.parametrize("count", [3, 4, 5, 6])
def test_p_of_uncoupled_dyads_has_the_nominal_error_rate(count: int) -> None:
    """With surrogates only, the least p would occur 1.6 times too often with 4 dyads and 3.3 times with 5."""
    rng = np.random.default_rng(count)

    def strength(source: list, target: list) -> float:
        return float(table[int(source[0][0]), int(target[0][0])])

    labels = [[np.array([float(k)])] for k in range(count)]
    found = []
    for _ in range(400):
        table = rng.normal(size=(count, count))
        found.append(chance_level(labels, labels, strength, rng).p)
    for p in (1 / 6, 0.1, 0.05):
        assert np.mean(np.array(found) <= p + 1e-12) <= p + 3 * np.sqrt(p * (1 - p) / len(found))


def test_pairings_of_many_dyads_are_sampled_with_a_seed() -> None:
    sources, targets = dyads(10, 0.3, 0.0)
    first, again, other = (
        chance_level(sources, targets, strength_of, np.random.default_rng(seed), most=20) for seed in (1, 1, 2)
    )
    assert not first.exact
    assert 0 < len(first.surrogates) < 20
    assert first.surrogates.tolist() == again.surrogates.tolist() != other.surrogates.tolist()
    assert first.p == first.least_p == pytest.approx(1 / 21)


@pytest.mark.evidence("properties", transfer_entropy, of=("unit", "constant", "mirror"))
@given(st.floats(0.1, 100.0), st.floats(-5.0, 5.0), st.integers(0, 50))
@settings(max_examples=20, deadline=None)
def test_transfer_entropy_is_invariant_to_unit_offset_and_sign(scale: float, offset: float, seed: int) -> None:
    x, y = coupled(400, 0.7, seed)
    for estimator in ("gaussian", "binned", "nearest"):
        measure = partial(transfer_entropy, past=ONE, estimator=estimator)
        assert measure([scale * x + offset], [-scale * y]) == pytest.approx(measure([x], [y]), abs=0.05)
