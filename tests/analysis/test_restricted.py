"""Restricted likelihoods, against explicit matrices of all trials, closed forms, and another library."""

import warnings
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from statsmodels.regression.mixed_linear_model import MixedLM, MixedLMParams, VCSpec

from netboard.analysis.statistics.restricted import LARGEST, Restricted, restricted_fit

Array = NDArray[np.float64]
Study = tuple[Array, Array, list[Array], NDArray[np.int64]]


def study(seed: int, deviations: tuple[float, ...] = (0.0,) * 4, dyads: int = 4, trials: int = 4) -> Study:
    """Draw three performers of each dyad, with haptics on and off: response, columns, sources and dyads.

    `deviations` are those of dyads, of performers, and of the effect of haptics on each; that of trials is 0.4.
    """
    source = np.random.default_rng(seed)
    dyad, role, felt, trial = (index.ravel() for index in np.indices((dyads, 3, 2, trials)))
    h, c = felt - 0.5, (role == 2) - 0.5
    columns = np.column_stack([np.ones(len(h)), h, c, h * c, np.log(trial + 1.0)])
    indicators = [np.eye(dyads)[dyad], np.eye(3 * dyads)[3 * dyad + role]]
    sources = [*indicators, *(h[:, None] * one for one in indicators)]
    chance = sum(z @ source.normal(0, s, z.shape[1]) for z, s in zip(sources, deviations, strict=True))
    noise = source.normal(0, 0.4, len(h))
    return columns @ [1.5, -0.1, 0.2, -0.15, -0.1] + chance + noise, columns, sources, dyad


def fitted(given: Study) -> Restricted:
    found = restricted_fit(*given)
    assert found is not None
    assert found.converged
    return found


def explicit_fit(given: Study, variances: Any, residual: float) -> tuple[float, Array, Array]:
    """Return the likelihood, coefficients and covariance, from explicit matrices over all trials."""
    y, x, sources, _ = given
    covariance = residual * np.eye(len(y)) + sum(s * z @ z.T for s, z in zip(variances, sources, strict=True))
    inverse = np.linalg.inv(covariance)
    information = x.T @ inverse @ x
    coefficients = np.linalg.solve(information, x.T @ inverse @ y)
    left = y - x @ coefficients
    logs = np.linalg.slogdet(covariance)[1] + np.linalg.slogdet(information)[1]
    free = len(y) - x.shape[1]
    likelihood = -0.5 * (free * np.log(2 * np.pi) + logs + left @ inverse @ left)
    return float(likelihood), coefficients, np.linalg.inv(information)


def statsmodels_fits(given: Study) -> tuple[Any, list[Any]]:
    """The model of statsmodels, and its fits by several methods, without those that fail."""
    y, x, sources, dyads = given
    groups = range(dyads.max() + 1)
    own = [[z[dyads == group] for group in groups] for z in sources]
    own = [[z[:, z.any(axis=0)] for z in matrices] for matrices in own]
    labels = [[[str(i) for i in range(z.shape[1])] for z in matrices] for matrices in own]
    names = [f"source {i}" for i in range(len(sources))]
    model = MixedLM(y, x, groups=dyads, exog_vc=VCSpec(names, labels, own))
    start = MixedLMParams(x.shape[1], 0, len(sources))
    start.fe_params, start.vcomp, start.cov_re = np.zeros(x.shape[1]), np.full(len(sources), 0.05), np.empty((0, 0))
    fits = []
    for method in ("powell", "lbfgs"):
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            try:
                fits.append(model.fit(reml=True, method=method, start_params=start))
            except np.linalg.LinAlgError:
                continue
    return model, fits


NULLS = [(0.0,) * 4, (0.2, 0.0, 0.0, 0.0), (0.0, 0.1, 0.0, 0.0), (0.2, 0.1, 0.0, 0.0), (0.2, 0.1, 0.1, 0.0)]


def study_with_zero_variances(seed: int) -> Study:
    """Draw a study in which some variances are 0, of 4 to 6 dyads."""
    return study(seed, NULLS[seed % len(NULLS)], dyads=4 + seed % 3)


# --- the largest likelihood --------------------------------------------------------------------------------------


@pytest.mark.slow
@pytest.mark.evidence("independent", restricted_fit, by="statsmodels")
def test_fits_with_zero_variances_are_never_worse_than_statsmodels() -> None:
    gains, zeros = [], 0
    for seed in range(20):
        given = study_with_zero_variances(seed)
        found = fitted(given)
        zeros += 0.0 in found.variances
        gains += [found.likelihood - max(fit.llf for fit in statsmodels_fits(given)[1])]
    assert min(gains) >= -1e-6
    assert zeros > 15
    # It is the same likelihood: statsmodels comes close to its maximum, though not by every method in every study.
    assert np.median(gains) < 1e-3


@pytest.mark.slow
def test_fitted_variances_maximise_the_likelihood() -> None:
    source = np.random.default_rng(0)
    for seed in range(5):
        given = study_with_zero_variances(seed)
        found = fitted(given)
        here = explicit_fit(given, found.variances, found.residual)[0]
        assert found.likelihood == pytest.approx(here, abs=1e-8)
        for _ in range(20):
            near = np.array(found.variances) * np.exp(source.normal(0, 0.3, 4))
            far = found.residual * 10.0 ** source.uniform(-3, 1, 4) * (source.random(4) < 0.5)
            for variances in (near, far, near + 0.01 * far):
                residual = found.residual * np.exp(source.normal(0, 0.05))
                assert explicit_fit(given, variances, residual)[0] <= here + 1e-9


@pytest.mark.parametrize("seed", range(3))
def test_effects_equal_generalised_least_squares(seed: int) -> None:
    given = study(seed, (0.3, 0.2, 0.0, 0.1), dyads=5)
    found = fitted(given)
    _, coefficients, covariance = explicit_fit(given, found.variances, found.residual)
    assert found.coefficients == pytest.approx(coefficients, rel=1e-9)
    assert found.covariance == pytest.approx(covariance, rel=1e-9)


@pytest.mark.slow
def test_nonzero_variances_equal_those_of_statsmodels() -> None:
    given = study(2, (0.8, 0.6, 0.6, 0.5), dyads=8)
    found = fitted(given)
    best = max(statsmodels_fits(given)[1], key=lambda fit: fit.llf)
    assert min(found.variances) > 0.01
    assert best.llf == pytest.approx(found.likelihood, abs=1e-4)
    assert best.vcomp == pytest.approx(found.variances, rel=0.02)
    assert best.fe_params == pytest.approx(found.coefficients, rel=1e-3)
    model = statsmodels_fits(given)[0]
    ratios = MixedLMParams(5, 0, 4)
    ratios.fe_params, ratios.cov_re = found.coefficients, np.empty((0, 0))
    ratios.vcomp = np.array(found.variances) / found.residual
    assert model.loglike(ratios) == pytest.approx(found.likelihood, abs=1e-7)


@pytest.mark.evidence("truth", restricted_fit)
@pytest.mark.parametrize(("deviation", "is_zero"), [(0.0, True), (0.5, False)])
def test_balanced_single_source_equals_anova_truncated_at_0(deviation: float, is_zero: bool) -> None:
    groups = np.repeat(np.arange(6), 8)
    source = np.random.default_rng(4)
    y = 1.0 + source.normal(0, deviation, 6)[groups] + source.normal(0, 0.3, 48)
    cells = y.reshape(6, 8)
    between, within = 8 * cells.mean(axis=1).var(ddof=1), cells.var(axis=1, ddof=1).mean()
    assert (between < within) == is_zero
    found = fitted((y, np.ones((48, 1)), [np.eye(6)[groups]], groups))
    total = y.var(ddof=1)
    expected = (0.0, total, total / 48) if is_zero else ((between - within) / 8, within, between / 48)
    assert (*found.variances, found.residual, found.covariance[0, 0]) == pytest.approx(expected, rel=1e-8, abs=1e-15)
    assert (found.variances[0] == 0.0) == is_zero
    assert found.coefficients == pytest.approx([y.mean()])


def test_effects_with_all_variances_zero_equal_least_squares() -> None:
    given = next(one for one in map(study, range(100)) if not any(fitted(one).variances))
    found = fitted(given)
    least = np.linalg.lstsq(given[1], given[0], rcond=None)
    residual = least[1][0] / (len(given[0]) - 5)
    assert found.coefficients == pytest.approx(least[0], rel=1e-9)
    assert found.residual == pytest.approx(residual, rel=1e-9)
    assert found.covariance == pytest.approx(residual * np.linalg.inv(given[1].T @ given[1]), rel=1e-9)


# --- what must not matter ----------------------------------------------------------------------------------------


@pytest.mark.evidence("properties", restricted_fit, of=("unit", "constant", "order", "mirror"))
@pytest.mark.parametrize("seed", [0, 3])
def test_fit_follows_scale_offset_and_order_of_responses(seed: int) -> None:
    given = study_with_zero_variances(seed)
    y, x, sources, dyads = given
    found = fitted(given)
    scaled = fitted((-1e3 * y + 50.0, x, sources, dyads))
    assert scaled.variances == pytest.approx([1e6 * s for s in found.variances], rel=1e-5)
    assert scaled.coefficients == pytest.approx(-1e3 * found.coefficients + 50.0 * np.eye(5)[0], rel=1e-6)
    assert scaled.covariance == pytest.approx(1e6 * found.covariance, rel=1e-5)
    by = np.random.default_rng(1).permutation(len(y))
    shuffled = fitted((y[by], x[by], [z[by] for z in sources], (dyads.max() - dyads)[by]))
    assert shuffled.likelihood == pytest.approx(found.likelihood, abs=1e-9)
    assert shuffled.variances == pytest.approx(found.variances, rel=1e-5, abs=1e-12)
    assert shuffled.coefficients == pytest.approx(found.coefficients, rel=1e-6)


def test_fit_by_unequal_groups_equals_fit_as_one_group() -> None:
    y, x, sources, dyads = study(5, (0.3, 0.2, 0.1, 0.1), dyads=5)
    kept = np.random.default_rng(2).random(len(y)) < 0.3 + 0.15 * dyads
    kept &= ~((dyads == 1) & (np.arange(len(y)) % 24 < 8))
    part: Study = (y[kept], x[kept], [z[kept] for z in sources], dyads[kept])
    apart, together = fitted(part), fitted((*part[:3], np.zeros(kept.sum(), dtype=np.int64)))
    assert apart.likelihood == pytest.approx(together.likelihood, abs=1e-9)
    assert apart.variances == pytest.approx(together.variances, rel=1e-5, abs=1e-12)
    assert apart.likelihood == pytest.approx(explicit_fit(part, apart.variances, apart.residual)[0], abs=1e-8)


# --- where there is none -----------------------------------------------------------------------------------------


def test_tiny_residuals_are_fitted_and_zero_residuals_are_not() -> None:
    y, x, sources, dyads = study(1, (0.3, 0.2, 0.2, 0.2))
    chance = np.hstack(sources)
    explained = x.sum(axis=1) + chance @ np.linspace(-1.0, 1.0, chance.shape[1]) ** 3
    small = fitted((explained + 1e-4 * (y - x @ np.linalg.lstsq(x, y, rcond=None)[0]), x, sources, dyads))
    assert small.residual == pytest.approx(0.16e-8, rel=0.5)
    assert max(small.variances) / small.residual < LARGEST
    assert restricted_fit(explained, x, sources, dyads) is None
