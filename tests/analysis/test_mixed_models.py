"""Models of a study, against closed forms, explicit likelihoods and covariances, and statsmodels."""

import re
import subprocess
import sys
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import pandas as pd
import pytest
import statsmodels.formula.api as smf
from numpy.typing import NDArray
from scipy import stats
from statsmodels.genmod import families
from statsmodels.genmod.generalized_linear_model import GLM

from netboard.analysis.statistics import restricted as fitting
from netboard.analysis.statistics.effects import NOT_CONVERGED, Model
from netboard.analysis.statistics.estimates import t_interval
from netboard.analysis.statistics.factors import INTERCEPT, PRACTICE, FixedFactor, paper_factors
from netboard.analysis.statistics.models import MOST, count_model, log_time_model, share_model
from netboard.analysis.statistics.random_effects import AT_ZERO

Labels = dict[str, NDArray[Any]]
NAMES = ("dyads", "performers", "haptics", "dyadic", "order")
COLUMNS = (INTERCEPT, "haptics", "configuration", "haptics x configuration", PRACTICE)


@dataclass(frozen=True)
class Truth:
    """True coefficients in the order of COLUMNS, and standard deviations of the random effects."""

    effects: tuple[float, ...] = (1.5, -0.1, 0.2, -0.15, -0.1)
    dyad: float = 0.2
    performer: float = 0.1
    dyad_slope: float = 0.1
    performer_slope: float = 0.1
    residual: float = 0.4


def plan(dyads: int, trials: int) -> Labels:
    """Two participants alone and as a dyad, each with haptics off and on."""
    rows = [
        (f"D{dyad:02}", performer, haptics, performer == "both", trial)
        for dyad in range(dyads)
        for performer in ("A", "B", "both")
        for haptics in (False, True)
        for trial in range(1, trials + 1)
    ]
    return {name: np.array(column) for name, column in zip(NAMES, zip(*rows, strict=True), strict=True)}


def columns(labels: Labels) -> NDArray[np.float64]:
    h, c = labels["haptics"] - 0.5, labels["dyadic"] - 0.5
    return np.column_stack([np.ones(len(h)), h, c, h * c, np.log(labels["order"])])


def people(labels: Labels) -> NDArray[np.int64]:
    pairs = np.char.add(labels["dyads"].astype(str), labels["performers"].astype(str))
    return np.unique(pairs, return_inverse=True)[1]


def explained(labels: Labels, truth: Truth, seed: int) -> NDArray[np.float64]:
    """The linear predictor of each trial: fixed effects, and random effects of dyads and performers."""
    source = np.random.default_rng(seed)
    h = labels["haptics"] - 0.5
    dyad, person = np.unique(labels["dyads"], return_inverse=True)[1], people(labels)
    parts = ((truth.dyad, truth.dyad_slope, dyad), (truth.performer, truth.performer_slope, person))
    chance = sum(source.normal(0, s, 999)[i] + source.normal(0, slope, 999)[i] * h for s, slope, i in parts)
    return np.asarray(columns(labels) @ truth.effects + chance)


def times_of(labels: Labels, truth: Truth, seed: int) -> NDArray[np.float64]:
    noise = np.random.default_rng(1000 + seed).normal(0, truth.residual, len(labels["order"]))
    return np.exp(explained(labels, truth, seed) + noise)


def counts_of(labels: Labels, truth: Truth, seed: int) -> NDArray[np.float64]:
    return np.random.default_rng(seed).poisson(np.exp(explained(labels, truth, seed))).astype(float)


def failures_of(labels: Labels, truth: Truth, seed: int) -> NDArray[np.float64]:
    odds = np.exp(explained(labels, truth, seed) - 2.5)
    return (np.random.default_rng(seed).random(len(odds)) < odds / (1.0 + odds)).astype(float)


def numbers(model: Model) -> NDArray[np.float64]:
    """All estimates of the effects: value, interval, ratio and p."""
    found = [(e.estimate.value, e.estimate.low, e.estimate.high, e.ratio.value, e.p) for e in model.effects]
    return np.array(found)


def variances(model: Model) -> dict[str, float]:
    return {component.name: component.variance for component in model.components}


def kept(labels: Labels, keep: Any) -> Labels:
    return {name: label[keep] for name, label in labels.items()}


def given(labels: Labels) -> dict[str, Any]:
    """The arguments of a model."""
    others = {name: label for name, label in labels.items() if name not in ("haptics", "dyadic")}
    return others | {"factors": paper_factors(labels["haptics"], labels["dyadic"])}


MODELS: list[tuple[Callable[..., Model], Callable[[Labels, Truth, int], NDArray[np.float64]]]] = [
    (log_time_model, times_of),
    (count_model, counts_of),
    (share_model, failures_of),
]
every_model = pytest.mark.parametrize(("model", "sample"), MODELS, ids=["times", "counts", "shares"])


# --- the mixed model: closed forms -------------------------------------------------------------------------------


def one_condition(dyads: int, performers: int, trials: int) -> Labels:
    dyad, performer, _ = (index.ravel() for index in np.indices((dyads, performers, trials)))
    always = np.ones(len(dyad), dtype=bool)
    return {"dyads": dyad, "performers": performer, "haptics": always, "dyadic": always, "order": always.astype(int)}


@pytest.mark.evidence("truth", log_time_model)
def test_estimates_for_balanced_dyads_equal_anova() -> None:
    labels = one_condition(6, 1, 8)
    source = np.random.default_rng(3)
    log = 1.0 + np.repeat(source.normal(0, 0.5, 6), 8) + source.normal(0, 0.3, 48)
    groups = log.reshape(6, 8)
    between, within = 8 * groups.mean(axis=1).var(ddof=1), groups.var(axis=1, ddof=1).mean()
    found = log_time_model(np.exp(log), **given(labels))
    assert variances(found) == pytest.approx({"dyad": (between - within) / 8, "residual": within}, rel=1e-5)
    assert found.effect("intercept").error == pytest.approx(np.sqrt(between / 48), rel=1e-5)
    alone = t_interval(groups.mean(axis=1))
    estimate = found.effect("intercept").estimate
    assert (estimate.value, estimate.low, estimate.high) == pytest.approx(
        (alone.value, alone.low, alone.high), rel=1e-5
    )
    assert any(note.startswith("performer: no random effect") for note in found.notes)
    assert any(note.startswith("haptics: left out") for note in found.notes)


@pytest.mark.slow
def test_estimates_for_performers_nested_in_dyads_equal_anova() -> None:
    labels = one_condition(7, 3, 5)
    source = np.random.default_rng(4)
    log = source.normal(0, 0.6, (7, 1, 1)) + source.normal(0, 0.4, (7, 3, 1)) + source.normal(0, 0.3, (7, 3, 5))
    dyads, performers = 15 * log.mean(axis=(1, 2)).var(ddof=1), 5 * log.mean(axis=2).var(axis=1, ddof=1).mean()
    residual = log.var(axis=2, ddof=1).mean()
    expected = {"dyad": (dyads - performers) / 15, "performer": (performers - residual) / 5, "residual": residual}
    found = log_time_model(np.exp(log.ravel()), **given(labels))
    assert variances(found) == pytest.approx(expected, rel=1e-5)
    assert [component.levels for component in found.components] == [7, 21, 105]
    assert (found.trials, found.performers, found.dyads) == (105, 21, 7)


@pytest.mark.evidence("independent", log_time_model, by="scipy")
def test_haptics_effect_in_a_balanced_design_equals_the_paired_t_test() -> None:
    labels = kept(plan(5, 12), plan(5, 12)["dyadic"])
    times = times_of(labels, Truth(dyad_slope=0.3), 1)
    cells = np.log(times).reshape(5, 2, 12).mean(axis=2)
    expected = t_interval(cells[:, 1] - cells[:, 0])
    found = log_time_model(times, **given(labels)).effect("haptics")
    ends = (found.estimate.value, found.estimate.low, found.estimate.high)
    assert ends == pytest.approx((expected.value, expected.low, expected.high), rel=1e-4)
    assert found.p == pytest.approx(stats.ttest_rel(cells[:, 1], cells[:, 0]).pvalue, rel=1e-4)
    assert (found.estimate.n, found.estimate.unit, found.free) == (5, "dyad", 4.0)


# --- the mixed model: other ways ---------------------------------------------------------------------------------


@pytest.mark.evidence("independent", log_time_model, by="statsmodels")
def test_mixed_model_equals_mixedlm_formula_of_statsmodels() -> None:
    labels = plan(10, 10)
    truth = Truth(dyad=0.5, performer=0.4, dyad_slope=0.4)
    times = times_of(labels, truth, 2)
    table = pd.DataFrame(labels | {"log": np.log(times), "h": labels["haptics"] - 0.5, "c": labels["dyadic"] - 0.5})
    parts = {"performer": "0 + C(performers)", "slope": "0 + h"}
    other = smf.mixedlm("log ~ h * c + np.log(order)", table, groups="dyads", vc_formula=parts, re_formula="1")
    fit = other.fit(reml=True, method=["powell", "lbfgs"])
    found = log_time_model(times, **given(labels), slopes="dyad")
    theirs = [fit.fe_params[name] for name in ("Intercept", "h", "c", "h:c", "np.log(order)")]
    errors = [fit.bse_fe[name] for name in ("Intercept", "h", "c", "h:c", "np.log(order)")]
    assert [found.effect(name).estimate.value for name in COLUMNS] == pytest.approx(theirs, rel=1e-4)
    assert [found.effect(name).error for name in COLUMNS] == pytest.approx(errors, rel=2e-3)
    assert variances(found)["dyad"] == pytest.approx(fit.cov_re.iloc[0, 0], rel=5e-3)
    assert [variances(found)["performer"], variances(found)["haptics by dyad"]] == pytest.approx(fit.vcomp, rel=5e-3)
    assert found.diagnostics is not None
    assert found.diagnostics.residuals == pytest.approx(np.sort(fit.resid / np.std(fit.resid)), abs=5e-3)


def restricted(log: NDArray[np.float64], labels: Labels, parts: dict[str, float]) -> tuple[float, NDArray[np.float64]]:
    """The restricted log-likelihood and the covariance of the effects, from explicit matrices over all trials."""
    h, x = labels["haptics"] - 0.5, columns(labels)
    dyad = np.unique(labels["dyads"], return_inverse=True)[1]
    indicators = {"dyad": np.eye(dyad.max() + 1)[dyad], "performer": np.eye(people(labels).max() + 1)[people(labels)]}
    indicators |= {f"haptics by {name}": z * h[:, None] for name, z in indicators.items()}
    covariance = parts["residual"] * np.eye(len(log))
    covariance += sum(max(0.0, parts[name]) * z @ z.T for name, z in indicators.items())
    inverse = np.linalg.inv(covariance)
    information = x.T @ inverse @ x
    left = log - x @ np.linalg.solve(information, x.T @ inverse @ log)
    logs = np.linalg.slogdet(covariance)[1] + np.linalg.slogdet(information)[1]
    return -0.5 * (logs + left @ inverse @ left), np.linalg.inv(information)


@pytest.mark.parametrize("seed", range(4))
def test_estimates_maximise_the_restricted_likelihood(seed: int) -> None:
    labels = plan(4, 6)
    log = np.log(times_of(labels, Truth(dyad_slope=0.05 * seed, performer_slope=0.05), seed))
    found = log_time_model(np.exp(log), **given(labels), slopes="performer")
    parts = variances(found)
    best, covariance = restricted(log, labels, parts)
    for name in parts:
        for step in (-0.02, 0.02):
            other = parts | {name: parts[name] + step * max(parts[name], 0.1 * parts["residual"])}
            assert restricted(log, labels, other)[0] <= best + 1e-6, name
    errors = [found.effect(name).error for name in COLUMNS]
    assert errors == pytest.approx(np.sqrt(np.diag(covariance)), rel=1e-4)
    combined = np.array([0.0, 1.0, 0.0, 0.5, 0.0])
    assert found.effect("haptics, dyadic").error == pytest.approx(np.sqrt(combined @ covariance @ combined), rel=1e-4)


@pytest.mark.slow
def test_log_time_model_recovers_true_parameters() -> None:
    labels, truth = plan(30, 10), Truth()
    found = log_time_model(times_of(labels, truth, 7), **given(labels))
    assert found.converged
    for name, true in zip(COLUMNS, truth.effects, strict=True):
        effect = found.effect(name)
        assert abs(effect.estimate.value - true) < 4 * effect.error, name
    deviations = {component.name: component.deviation for component in found.components}
    assert deviations["residual"] == pytest.approx(truth.residual, rel=0.07)
    assert deviations["dyad"] == pytest.approx(truth.dyad, rel=0.5)
    assert deviations["performer"] == pytest.approx(truth.performer, rel=0.5)
    assert 0.02 < deviations["haptics by dyad"] + deviations["haptics by performer"] < 0.4


@pytest.mark.slow
def test_z_intervals_of_four_dyads_are_too_narrow() -> None:
    labels, truth = kept(plan(4, 4), plan(4, 4)["dyadic"]), Truth(dyad_slope=0.5)
    hits = {"t": 0, "z": 0}
    for seed in range(120):
        times = times_of(labels, truth, seed)
        effect = log_time_model(times, **given(labels)).effect("haptics")
        off = abs(effect.estimate.value - (truth.effects[1] + 0.5 * truth.effects[3]))
        hits["t"] += effect.estimate.high - effect.estimate.value >= off
        hits["z"] += stats.norm.ppf(0.975) * effect.error >= off
    # Normal slopes, nearly: t holds 0.95, z with the spread of four holds 0.855; three standard errors of 120 draws.
    assert hits["t"] / 120 > 0.95 - 0.06
    assert hits["z"] / 120 < 0.855 + 0.08


@pytest.mark.slow
def test_random_slopes_increase_the_standard_error() -> None:
    labels = plan(6, 20)
    times = times_of(labels, Truth(dyad_slope=0.3, performer_slope=0.3), 3)
    without, dyad, performer = (log_time_model(times, **given(labels), slopes=s) for s in ("none", "dyad", "performer"))
    assert without.effect("haptics").error < 0.5 * dyad.effect("haptics").error
    assert dyad.effect("haptics x configuration").error < 0.5 * performer.effect("haptics x configuration").error
    assert [len(model.components) for model in (without, dyad, performer)] == [3, 4, 5]


# --- marginal models ---------------------------------------------------------------------------------------------


def mancl_derouen(labels: Labels, values: NDArray[np.float64], model: Model, power: float, alpha: float = 0.0) -> Any:
    """The Mancl-DeRouen covariance from explicit matrices; `power` is 1 for counts and 2 for shares."""
    x = columns(labels)
    coefficients = np.array([model.effect(name).estimate.value for name in COLUMNS])
    linear = x @ coefficients
    mean = np.exp(linear) if power == 1 else 1.0 / (1.0 + np.exp(-linear))
    variance = mean + alpha * mean**2 if power == 1 else mean * (1.0 - mean)
    slope = mean if power == 1 else variance
    weighted = []
    for dyad in np.unique(labels["dyads"]):
        own = labels["dyads"] == dyad
        d, s, n = slope[own, None] * x[own], np.sqrt(variance[own]), own.sum()
        working = s[:, None] * s * (np.eye(n) + model.correlation * (1.0 - np.eye(n)))
        weighted.append((d, np.linalg.inv(working), (values - mean)[own]))
    bread = np.linalg.inv(sum(d.T @ inverse @ d for d, inverse, _ in weighted))
    meat = np.zeros((x.shape[1],) * 2)
    for d, inverse, residual in weighted:
        leverage = d @ bread @ d.T @ inverse
        score = d.T @ inverse @ np.linalg.solve(np.eye(len(residual)) - leverage, residual)
        meat += np.outer(score, score)
    return bread @ meat @ bread


@pytest.mark.evidence("truth", count_model)
def test_standard_errors_of_counts_equal_mancl_derouen() -> None:
    labels = plan(5, 8)
    counts = counts_of(labels, Truth(), 1)
    found = count_model(counts, **given(labels))
    errors = [found.effect(name).error for name in COLUMNS]
    assert errors == pytest.approx(np.sqrt(np.diag(mancl_derouen(labels, counts, found, 1))), rel=1e-6)
    assert found.effect("haptics").free == 4.0


@pytest.mark.evidence("truth", share_model)
def test_standard_errors_of_shares_equal_mancl_derouen() -> None:
    labels = plan(5, 12)
    failed = failures_of(labels, Truth(), 1)
    found = share_model(failed, **given(labels))
    errors = [found.effect(name).error for name in COLUMNS]
    assert errors == pytest.approx(np.sqrt(np.diag(mancl_derouen(labels, failed, found, 2))), rel=1e-6)


@pytest.mark.evidence("independent", count_model, by="statsmodels")
def test_dyads_of_one_trial_give_a_generalised_linear_model() -> None:
    labels = plan(8, 3)
    labels["dyads"] = labels["performers"] = np.arange(len(labels["order"]))
    counts, failed = counts_of(labels, Truth(), 2), failures_of(labels, Truth(), 2)
    for values, model, family in (
        (counts, count_model, families.Poisson()),
        (failed, share_model, families.Binomial()),
    ):
        other = GLM(values, columns(labels), family=family).fit()
        found = model(values, **given(labels))
        assert [found.effect(name).estimate.value for name in COLUMNS] == pytest.approx(other.params, rel=1e-5)


def test_modelled_means_of_conditions_equal_the_observed_means() -> None:
    labels = plan(4, 9)
    labels["order"] = np.ones_like(labels["order"])
    counts = counts_of(labels, Truth(), 3)
    found = count_model(counts, **given(labels))
    at = {name: found.effect(name).estimate.value for name in COLUMNS[:4]}
    assert len(found.cells) == 4
    for cell in found.cells:
        felt, two = dict(cell.levels)["haptics"] == "on", dict(cell.levels)["configuration"] == "dyadic"
        h, c = felt - 0.5, two - 0.5
        log = at["intercept"] + h * at["haptics"] + c * at["configuration"] + h * c * at["haptics x configuration"]
        own = (labels["haptics"] == felt) & (labels["dyadic"] == two)
        assert np.exp(log) == pytest.approx(cell.mean, rel=1e-6)
        assert (cell.mean, cell.trials, cell.dyads) == (pytest.approx(counts[own].mean()), own.sum(), 4)
    bimanual, dyadic = ((np.array([c.mean for c in found.cells])[i + 1] / found.cells[i].mean) for i in (0, 2))
    assert found.effect("haptics, bimanual").ratio.value == pytest.approx(bimanual, rel=1e-6)
    assert found.effect("haptics, dyadic").ratio.value == pytest.approx(dyadic, rel=1e-6)


def test_over_dispersion_is_estimated_and_used() -> None:
    labels = plan(12, 20)
    calm = Truth(dyad=0.0, performer=0.0, dyad_slope=0.0, performer_slope=0.0)
    mean = np.exp(explained(labels, calm, 1))
    source = np.random.default_rng(1)
    plain = count_model(source.poisson(mean), **given(labels))
    wild_counts = source.poisson(mean * source.gamma(2.0, 0.5, len(mean)))
    wild, negative = (count_model(wild_counts, **given(labels), family=f) for f in ("poisson", "negative_binomial"))
    assert plain.dispersion == pytest.approx(1.0, abs=4 * np.sqrt(2 / plain.trials))
    assert wild.dispersion > 2.0
    assert negative.alpha == pytest.approx(0.5, abs=0.1)
    assert (wild.name, negative.name) == ("Poisson GEE", "negative binomial GEE")
    errors = [negative.effect(name).error for name in COLUMNS]
    written = mancl_derouen(labels, wild_counts.astype(float), negative, 1, negative.alpha)
    assert errors == pytest.approx(np.sqrt(np.diag(written)), rel=1e-6)
    steady = np.round(mean)
    fallen_back = count_model(steady, **given(labels), family="negative_binomial")
    assert fallen_back.name == "Poisson GEE"
    assert any("not overdispersed" in note for note in fallen_back.notes)


@pytest.mark.slow
@every_model
def test_effects_of_many_dyads_are_recovered(model: Any, sample: Any) -> None:
    labels, truth = plan(40, 8), Truth(dyad=0.1, performer=0.05, dyad_slope=0.05, performer_slope=0.05)
    found = model(sample(labels, truth, 11), **given(labels))
    for name, true in zip(COLUMNS[1:], truth.effects[1:], strict=True):
        effect = found.effect(name)
        assert abs(effect.estimate.value - true) < 4 * effect.error, name
        assert effect.error < 0.5
    assert not any("dyads:" in note for note in found.notes)


# --- invariances -------------------------------------------------------------------------------------------------


@pytest.mark.evidence("properties", log_time_model, of="unit")
def test_changing_the_unit_of_time_shifts_only_the_intercept() -> None:
    labels = plan(4, 8)
    times = times_of(labels, Truth(), 5)
    seconds, milliseconds = log_time_model(times, **given(labels)), log_time_model(1000.0 * times, **given(labels))
    first, second = seconds.effect("intercept"), milliseconds.effect("intercept")
    assert second.estimate.value - first.estimate.value == pytest.approx(np.log(1000.0))
    assert second.ratio.high == pytest.approx(1000.0 * first.ratio.high, rel=1e-6)
    assert numbers(milliseconds)[1:] == pytest.approx(numbers(seconds)[1:], rel=1e-4, abs=1e-7)
    assert variances(milliseconds) == pytest.approx(variances(seconds), rel=1e-4, abs=1e-8)


@pytest.mark.evidence("properties", log_time_model, count_model, share_model, of="order")
@pytest.mark.slow
@every_model
def test_models_do_not_depend_on_names_or_row_order(model: Any, sample: Any) -> None:
    labels = plan(5, 10)
    values = sample(labels, Truth(), 6)
    by = np.random.default_rng(1).permutation(len(values))
    renamed = kept(labels, by)
    renamed["dyads"] = np.array([{"D00": 7, "D01": 3, "D02": 9, "D03": 1, "D04": 5}[d] for d in renamed["dyads"]])
    renamed["performers"] = np.char.add("P", renamed["performers"].astype(str))
    one, other = model(values, **given(labels)), model(values[by], **given(renamed))
    assert numbers(other) == pytest.approx(numbers(one), rel=2e-3, abs=1e-5)
    assert one.notes == other.notes
    assert one.cells == tuple(replace(cell, mean=pytest.approx(cell.mean)) for cell in other.cells)


@every_model
def test_performers_are_nested_within_dyads(model: Any, sample: Any) -> None:
    labels = plan(4, 8)
    values = sample(labels, Truth(), 7)
    alone = model(values, **given(labels | {"performers": people(labels)}))
    assert numbers(model(values, **given(labels))) == pytest.approx(numbers(alone), rel=1e-6, abs=1e-9)
    assert alone.performers == 12


@pytest.mark.evidence("properties", log_time_model, count_model, share_model, of="mirror")
@every_model
def test_swapping_conditions_reverses_the_sign_of_effects(model: Any, sample: Any) -> None:
    labels = plan(4, 10)
    values = sample(labels, Truth(), 8)
    one, other = model(values, **given(labels)), model(values, **given(labels | {"haptics": ~labels["haptics"]}))
    for name, sign in zip(COLUMNS, (1, -1, 1, -1, 1), strict=True):
        value = one.effect(name).estimate.value
        assert other.effect(name).estimate.value == pytest.approx(sign * value, rel=1e-3, abs=1e-5)
        assert other.effect(name).error == pytest.approx(one.effect(name).error, rel=1e-3)


@every_model
def test_t_and_z_intervals_differ_only_in_their_quantile(model: Any, sample: Any) -> None:
    labels = plan(4, 10)
    values = sample(labels, Truth(), 9)
    t, z = (model(values, **given(labels), interval=interval, level=0.9).effect("haptics") for interval in ("t", "z"))
    assert (t.estimate.value, t.error) == (z.estimate.value, z.error)
    assert t.estimate.high - t.estimate.value == pytest.approx(stats.t.ppf(0.95, 3) * t.error)
    assert z.estimate.high - z.estimate.value == pytest.approx(stats.norm.ppf(0.95) * z.error)
    assert t.p == pytest.approx(2 * stats.t.sf(abs(t.estimate.value) / t.error, 3))
    assert (t.estimate.method, z.estimate.method, t.estimate.level) == ("t, 3 df", "z", 0.9)
    assert (t.ratio.value, t.ratio.low) == pytest.approx((np.exp(t.estimate.value), np.exp(t.estimate.low)))


# --- what is missing, and what cannot be ---------------------------------------------------------------------------


@pytest.mark.evidence("disturbance", log_time_model, count_model, share_model, of="holes")
@every_model
def test_missing_values_are_left_out_and_counted(model: Any, sample: Any) -> None:
    labels = plan(4, 10)
    values = sample(labels, Truth(), 10)
    gone = np.random.default_rng(2).random(len(values)) < 0.1
    found = model(np.where(gone, np.nan, values), **given(labels))
    assert numbers(found) == pytest.approx(numbers(model(values[~gone], **given(kept(labels, ~gone)))))
    assert (found.left_out, found.trials) == (gone.sum(), (~gone).sum())


@every_model
def test_single_dyad_has_estimates_and_no_intervals(model: Any, sample: Any) -> None:
    labels = plan(1, 20)
    values = sample(labels, Truth(), 11)
    found = model(values, **given(labels))
    assert found.fitted
    assert np.isfinite([effect.estimate.value for effect in found.effects]).all()
    assert np.isnan([(e.estimate.low, e.estimate.high, e.error, e.p) for e in found.effects]).all()
    assert any(note.startswith("one dyad") for note in found.notes)
    if model is log_time_model:
        least = np.linalg.lstsq(columns(labels), np.log(values), rcond=None)[0]
        assert [found.effect(name).estimate.value for name in COLUMNS] == pytest.approx(least)


@every_model
def test_missing_configuration_is_noted(model: Any, sample: Any) -> None:
    labels = kept(plan(4, 12), ~plan(4, 12)["dyadic"])
    found = model(sample(labels, Truth(), 12), **given(labels))
    assert found.fitted
    for name in ("configuration", "haptics x configuration", "haptics, dyadic"):
        assert np.isnan([found.effect(name).estimate.value, found.effect(name).error, found.effect(name).p]).all()
    assert np.isfinite(found.effect("haptics").p)
    assert sum("these trials cannot identify it" in note for note in found.notes) >= 2
    assert [cell.label for cell in found.cells] == [f"haptics {felt}, configuration bimanual" for felt in ("off", "on")]


@every_model
def test_empty_cell_gives_no_interaction(model: Any, sample: Any) -> None:
    full = plan(4, 12)
    labels = kept(full, ~(full["dyadic"] & full["haptics"]))
    found = model(sample(labels, Truth(), 13), **given(labels))
    assert np.isfinite([found.effect("haptics").p, found.effect("configuration").p]).all()
    assert np.isnan(found.effect("haptics x configuration").estimate.value)
    assert len(found.cells) == 3


@every_model
def test_too_few_trials_are_not_fitted(model: Any, sample: Any) -> None:
    for labels in (kept(plan(2, 2), slice(0, 0)), kept(plan(2, 2), slice(0, 1))):
        found = model(sample(labels, Truth(), 14), **given(labels))
        assert not found.fitted
        assert not found.converged
        assert np.isnan(numbers(found)).all()
        assert any("too few" in note for note in found.notes)


def test_times_without_residual_variance_are_not_fitted() -> None:
    labels = plan(3, 4)
    for times in (np.full(len(labels["order"]), 2.5), np.exp(columns(labels) @ Truth().effects)):
        found = log_time_model(times, **given(labels))
        assert not found.fitted
        assert any("no variation" in note for note in found.notes)


@pytest.mark.parametrize(
    ("model", "value", "what"),
    [(share_model, 0.0, "none failed"), (share_model, 1.0, "all failed"), (count_model, 0.0, "nothing was counted")],
)
def test_condition_without_variation_uses_firth_estimates(model: Any, value: float, what: str) -> None:
    labels = plan(4, 20)
    values = failures_of(labels, Truth(), 15)
    empty = labels["dyadic"] & labels["haptics"]
    values[empty] = value
    found = model(values, **given(labels))
    assert found.fitted
    assert found.converged
    assert "Firth's penalised likelihood" in found.name
    assert any(f"{what} in one condition (haptics on, configuration dyadic)" in note for note in found.notes)
    effect = found.effect("haptics, dyadic")
    ends = effect.estimate.low, effect.estimate.value, effect.estimate.high
    assert np.isfinite(ends).all()
    assert ends == tuple(sorted(ends))
    assert (effect.estimate.value < 0.0) == (value == 0.0)
    assert effect.estimate.method == "profile, 3 df"
    assert effect.p < 0.1
    assert found.dispersion >= 1.0
    assert found.cells[3].mean == value


@pytest.mark.parametrize("model", [share_model, count_model])
def test_outcomes_without_any_event_are_not_fitted(model: Any) -> None:
    labels = plan(4, 20)
    found = model(np.zeros(len(labels["order"])), **given(labels))
    assert not found.fitted
    assert np.isnan(numbers(found)).all()
    assert any("in any condition, so conditions cannot be compared" in note for note in found.notes)


@pytest.mark.slow
def test_firth_p_agrees_with_its_interval_and_dispersion_widens_it() -> None:
    labels = plan(6, 20)
    values = failures_of(labels, Truth(), 15)
    values[labels["dyadic"] & labels["haptics"]] = 0.0
    calm = share_model(values, **given(labels))
    for effect in calm.effects:
        assert (effect.p < 0.05) == (effect.estimate.low > 0.0 or effect.estimate.high < 0.0), effect.name
    often = values.copy()
    often[labels["dyads"] == "D00"] = 1.0 - (labels["order"][labels["dyads"] == "D00"] % 5 == 0)
    often[labels["dyadic"] & labels["haptics"]] = 0.0
    wild = share_model(often, **given(labels))
    assert wild.dispersion > 2.0 * calm.dispersion
    width = [one.effect("haptics").estimate.high - one.effect("haptics").estimate.low for one in (calm, wild)]
    assert width[1] > width[0]


@pytest.mark.slow
def test_level_without_failures_is_detected_among_other_factors() -> None:
    labels = plan(6, 12)
    arguments = with_masses(labels)["categorical"]
    values = failures_of(labels, Truth(), 15)
    heavy = arguments["factors"][2].values == "heavy"
    values[heavy & labels["haptics"]] = 0.0
    found = share_model(values, **arguments)
    assert any("none failed in one condition (haptics on, mass heavy)" in note for note in found.notes)
    assert np.isfinite(found.effect("haptics, heavy").estimate.low)


def test_single_trials_give_no_random_effect_of_performers() -> None:
    labels = kept(plan(8, 2), plan(8, 2)["order"] == 1)
    labels = kept(labels, labels["haptics"])
    found = log_time_model(times_of(labels, Truth(), 16), **given(labels))
    assert list(variances(found)) == ["dyad", "configuration by dyad", "residual"]
    assert [note for note in found.notes if "no random effect" in note] == [
        "performer: no random effect, because these trials cannot identify it"
    ]


@pytest.mark.parametrize(("level", "dyadic"), [("dyadic", True), ("bimanual", False)])
def test_effects_that_differ_at_one_level_get_a_slope_there(level: str, dyadic: bool) -> None:
    labels = plan(8, 12)
    truth = Truth(dyad_slope=0.0, performer_slope=0.0)
    dyads = np.unique(labels["dyads"], return_inverse=True)[1]
    more = (
        np.random.default_rng(2).normal(0.0, 0.6, 8)[dyads] * (labels["haptics"] - 0.5) * (labels["dyadic"] == dyadic)
    )
    found = log_time_model(times_of(labels, truth, 5) * np.exp(more), **given(labels))
    slope = f"haptics by dyad, {level}"
    assert [name for name in variances(found) if "dyad, " in name] == [slope]
    assert np.sqrt(variances(found)[slope]) == pytest.approx(0.6, rel=0.5)
    errors = {at: found.effect(f"haptics, {at}").by("Kenward-Roger").error for at in ("dyadic", "bimanual")}
    other = {"dyadic": "bimanual", "bimanual": "dyadic"}[level]
    assert errors[level] > 2.0 * errors[other]


def test_slopes_are_left_out_while_the_fit_does_not_converge(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(fitting, "STEPS", 1)
    labels = plan(5, 6)
    found = log_time_model(times_of(labels, Truth(), 4), **given(labels))
    assert list(variances(found)) == ["dyad", "performer", "residual"]
    gone = [note for note in found.notes if note.endswith("left out, because the fit with it did not converge")]
    assert len(gone) == 5
    assert not found.converged
    assert found.notes[0] == NOT_CONVERGED


def test_warnings_are_reported_as_notes() -> None:
    labels = plan(1, 8)
    found = share_model((labels["order"] <= 3).astype(float), **given(labels))
    assert any(note.startswith("statsmodels: Perfect separation") for note in found.notes)
    assert len(set(found.notes)) == len(found.notes)


@pytest.mark.slow
def test_zero_variances_of_random_effects_are_fitted_and_noted() -> None:
    truths = [
        Truth(dyad=0.0, performer=0.0, dyad_slope=0.0, performer_slope=0.0),
        Truth(performer=0.0, dyad_slope=0.0, performer_slope=0.0),
        Truth(dyad=0.0, dyad_slope=0.0, performer_slope=0.0),
        Truth(dyad_slope=0.0, performer_slope=0.0),
    ]
    without = 0
    for seed in range(48):
        labels = plan(2 + seed % 5, 6)
        found = log_time_model(times_of(labels, truths[seed % 4], seed), **given(labels))
        assert found.fitted
        assert found.converged
        assert np.isfinite(numbers(found)).all()
        noted = {note.partition(":")[0] for note in found.notes if note.endswith("its variance is estimated as 0")}
        assert noted == {name for name, variance in variances(found).items() if variance == 0.0}
        without += bool(noted)
    assert without > 36


def test_times_constant_within_performers_are_not_fitted() -> None:
    labels = plan(4, 6)
    found = log_time_model(np.exp(explained(labels, Truth(), 3)), **given(labels))
    assert not found.fitted
    assert "not fitted: there is no variation of times beyond effects, dyads and performers" in found.notes


def test_effect_seen_in_a_single_dyad_has_no_interval() -> None:
    full = plan(3, 8)
    labels = kept(full, (full["dyads"] == "D00") | ~full["dyadic"])
    found = count_model(counts_of(labels, Truth(), 18), **given(labels))
    assert {"configuration: identified by a single dyad"} < set(found.notes)
    assert any(note.startswith("no intervals") for note in found.notes)
    assert np.isfinite(found.effect("configuration").estimate.value)
    assert np.isnan([effect.error for effect in found.effects]).all()
    mixed = log_time_model(times_of(labels, Truth(), 18), **given(labels))
    assert "configuration: identified by a single dyad" in mixed.notes
    assert np.isfinite(mixed.effect("configuration").error)


@every_model
def test_invalid_input_is_named(model: Any, sample: Any) -> None:
    labels = plan(2, 3)
    values = sample(labels, Truth(), 19)
    with pytest.raises(ValueError, match="haptics: one for each of"):
        model(values, **given(labels | {"haptics": np.array([True])}))
    with pytest.raises(ValueError, match="order: trial numbers from 1"):
        model(values, **given(labels | {"order": labels["order"] - 1}))
    with pytest.raises(ValueError, match="expected, found -1"):
        model(np.where(values == values[0], -1.0, values), **given(labels))
    with pytest.raises(ValueError, match="no effect 'sex'"):
        model(values, **given(labels)).effect("sex")


@pytest.mark.parametrize("family", ["poisson", "negative_binomial"])
@pytest.mark.parametrize("count", [2.5, 2.0**53 + 2.0, 1e200, 1e300])
def test_values_that_are_no_counts_are_named(family: Any, count: float) -> None:
    labels = plan(2, 3)
    counts = counts_of(labels, Truth(), 19)
    counts[3] = count
    with pytest.raises(ValueError, match=r"whole numbers from 0 to 2\^53 are expected, found " + re.escape(str(count))):
        count_model(counts, **given(labels), family=family)


@pytest.mark.parametrize("family", ["poisson", "negative_binomial"])
def test_largest_counts_are_modelled(family: Any) -> None:
    labels = plan(4, 3)
    found = count_model(np.full(len(labels["order"]), MOST), **given(labels), family=family)
    assert found.fitted
    assert all(cell.mean == MOST for cell in found.cells)


def test_effects_include_satterthwaite_and_kenward_roger_inference() -> None:
    labels = plan(4, 10)
    found = log_time_model(times_of(labels, Truth(), 9), **given(labels), slopes="performer")
    effect = found.effect("configuration")
    satterthwaite, kenward_roger = effect.by("Satterthwaite"), effect.by("Kenward-Roger")
    assert satterthwaite.error == effect.error <= kenward_roger.error
    assert effect.free == 3.0 < satterthwaite.free < 20.0
    assert satterthwaite.p == pytest.approx(
        2 * stats.t.sf(abs(effect.estimate.value) / effect.error, satterthwaite.free)
    )
    assert satterthwaite.estimate.method == f"t, {satterthwaite.free:.1f} df (Satterthwaite)"
    assert satterthwaite.ratio.low == pytest.approx(np.exp(satterthwaite.estimate.low))
    with pytest.raises(
        ValueError, match="configuration: no inference by 'Wald', expected one of Satterthwaite, Kenward"
    ):
        effect.by("Wald")
    counted = count_model(counts_of(labels, Truth(), 9), **given(labels)).effect("haptics")
    assert counted.others == ()


def test_satterthwaite_note_warns_of_zero_variances() -> None:
    labels = plan(4, 6)
    truth = Truth(dyad_slope=0.0, performer_slope=0.0)
    singular = [
        log_time_model(times_of(labels, truth, seed), **given(labels), slopes="performer") for seed in range(12)
    ]
    without = [
        one for one in singular if not variances(one)["haptics by dyad"] + variances(one)["haptics by performer"]
    ]
    assert without
    for one in without:
        effect = one.effect("haptics")
        assert effect.by("Satterthwaite").free > 100.0
        assert effect.by("Kenward-Roger").free < 10.0
        assert AT_ZERO in one.notes


# --- any factors -------------------------------------------------------------------------------------------------


def with_masses(labels: Labels) -> dict[str, Any]:
    """Models of haptics x configuration x mass, whose mass rotates over trials: numeric and categorical."""
    grams = np.array([100.0, 200.0, 400.0])[labels["order"] % 3]
    named = np.array(["light", "middle", "heavy"])[labels["order"] % 3]
    arguments = given(labels)
    numeric, categorical = (
        FixedFactor("mass", grams, numeric=True, unit="g"),
        FixedFactor("mass", named, ("light", "middle", "heavy")),
    )
    return {"numeric": arguments | {"factors": (*arguments["factors"], numeric)}} | {
        "categorical": arguments | {"factors": (*arguments["factors"], categorical)}
    }


@every_model
def test_every_factor_of_a_study_is_a_model_term(model: Any, sample: Any) -> None:
    labels = plan(6, 12)
    arguments = with_masses(labels)["categorical"]
    found = model(sample(labels, Truth(), 30), **arguments)
    assert found.fitted
    masses = [f"mass: {level} vs light" for level in ("middle", "heavy")]
    others = [f"{name} x {mass}" for name in ("haptics", "configuration") for mass in masses]
    simple = ["haptics, bimanual", "haptics, dyadic", *(f"haptics, {level}" for level in ("light", "middle", "heavy"))]
    names = {effect.name for effect in found.effects if np.isfinite(effect.p)}
    assert {*COLUMNS, *masses, *others, *simple} <= names
    assert found.equation.split(" = ")[1].startswith(
        "intercept + haptics x configuration + haptics x mass + configuration x mass + b log(trial)"
    )
    assert len(found.cells) == 12


def test_numeric_and_categorical_factor_effects_are_recovered() -> None:
    labels = plan(8, 12)
    every = with_masses(labels)
    grams = every["numeric"]["factors"][2].values
    times = times_of(labels, Truth(residual=0.02), 31) * np.exp(0.002 * grams)
    line, each = (log_time_model(times, **every[kind]) for kind in ("numeric", "categorical"))
    assert line.effect("mass per g").estimate.value == pytest.approx(0.002, rel=0.05)
    assert each.effect("mass: middle vs light").estimate.value == pytest.approx(0.2, rel=0.05)
    assert each.effect("mass: heavy vs light").estimate.value == pytest.approx(0.6, rel=0.05)
    ends = line.effect("haptics, mass 100 g").estimate.value, line.effect("haptics, mass 400 g").estimate.value
    slope = line.effect("haptics x mass per g").estimate.value
    assert ends[1] - ends[0] == pytest.approx(300.0 * slope, abs=1e-9)
    assert {"mass by dyad", "mass by performer"} <= set(variances(line))


@every_model
def test_changing_the_reference_level_changes_only_signs(model: Any, sample: Any) -> None:
    labels = plan(6, 12)
    arguments = with_masses(labels)["categorical"]
    haptics, configuration, mass = arguments["factors"]
    turned = FixedFactor("mass", mass.values, ("heavy", "light", "middle"))
    values = sample(labels, Truth(), 32)
    one = model(values, **arguments)
    other = model(values, **arguments | {"factors": (haptics, configuration, turned)})
    before, after = one.effect("mass: heavy vs light"), other.effect("mass: light vs heavy")
    assert after.estimate.value == pytest.approx(-before.estimate.value, abs=1e-5)
    assert after.error == pytest.approx(before.error, rel=1e-3)
    assert other.effect("haptics").estimate.value == pytest.approx(one.effect("haptics").estimate.value, abs=1e-5)
    assert other.effect("haptics").error == pytest.approx(one.effect("haptics").error, rel=1e-3)


@every_model
def test_factor_between_dyads_costs_a_degree_of_freedom(model: Any, sample: Any) -> None:
    labels = plan(6, 12)
    group = FixedFactor("group", np.where(np.unique(labels["dyads"], return_inverse=True)[1] % 2, "trained", "novice"))
    arguments = given(labels)
    values = sample(labels, Truth(), 33)
    found = model(values, **arguments | {"factors": (*arguments["factors"], group)})
    assert found.effect("group").free == 4.0
    assert not any(name.startswith("group by") for name in variances(found))
    alone = model(values, **arguments | {"factors": (group,)})
    assert [effect.name for effect in alone.effects] == ["intercept", "group", "log trial"]


def test_undeclared_levels_and_duplicate_factors_are_named() -> None:
    labels = plan(2, 3)
    arguments, times = given(labels), times_of(labels, Truth(), 34)
    haptics = arguments["factors"][0]
    other = FixedFactor("haptics", haptics.values, ("off", "full"))
    with pytest.raises(ValueError, match="haptics: one of off, full is expected, found on"):
        log_time_model(times, **arguments | {"factors": (other,)})
    with pytest.raises(ValueError, match="a name of its own"):
        log_time_model(times, **arguments | {"factors": (haptics, haptics)})
    holes = FixedFactor("mass", np.where(labels["order"] == 1, np.nan, 1.0), numeric=True)
    with pytest.raises(ValueError, match="mass: a number for each trial is expected, found nan"):
        log_time_model(times, **arguments | {"factors": (holes,)})


# --- residuals ---------------------------------------------------------------------------------------------------


def test_normal_residuals_follow_a_straight_q_q_line() -> None:
    labels = plan(4, 40)
    found = log_time_model(times_of(labels, Truth(), 20), **given(labels)).diagnostics
    assert found is not None
    assert np.corrcoef(found.quantiles, found.residuals)[0, 1] > 0.997
    assert (found.residuals.mean(), found.residuals.std()) == pytest.approx((0.0, 1.0), abs=1e-6)
    n = len(found.residuals)
    assert abs(found.skewness) < 4 * np.sqrt(6 / n)
    assert abs(found.kurtosis) < 4 * np.sqrt(24 / n)
    assert max(abs(found.spread), abs(found.successive)) < 4 / np.sqrt(n)


@pytest.mark.slow
def test_diagnostics_detect_autocorrelation_skew_and_unequal_spread() -> None:
    labels = plan(4, 40)
    common = explained(labels, Truth(effects=(1.5, -0.1, 1.2, 0.0, -0.1)), 21)
    source = np.random.default_rng(21)
    streaks = source.normal(0, 0.4, len(common))
    for i in np.flatnonzero(labels["order"] > 1):
        streaks[i] += 0.6 * streaks[i - 1]
    skewed = source.exponential(0.4, len(common))
    louder = source.normal(0, 0.4, len(common)) * np.where(labels["dyadic"], 3.0, 1.0)
    found = [log_time_model(np.exp(common + x), **given(labels)).diagnostics for x in (streaks, skewed, louder)]
    assert all(one is not None for one in found)
    assert found[0].successive == pytest.approx(0.6, abs=0.1)
    assert found[1].skewness == pytest.approx(2.0, abs=0.5)
    assert found[2].spread > 0.3
    by = np.random.default_rng(0).permutation(len(common))
    mixed = log_time_model(np.exp(common + streaks)[by], **given(kept(labels, by))).diagnostics
    assert mixed.successive == pytest.approx(found[0].successive, abs=1e-3)


@pytest.mark.slow
def test_statistics_import_without_statsmodels_and_pandas() -> None:
    program = (
        "import sys; sys.modules['statsmodels'] = sys.modules['pandas'] = None\n"
        "from netboard.analysis.statistics import contrasts, effects, estimates, factors"
    )
    done = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=False)
    assert (done.returncode, done.stderr) == (0, "")
