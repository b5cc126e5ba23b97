"""Small-sample inference compared with lmerTest, pbkrtest, published examples, and closed forms.

The reference values come from R: tests/data/models/reference.R writes them.
"""

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy import stats

from netboard.analysis.statistics.factors import paper_factors
from netboard.analysis.statistics.models import log_time_model
from netboard.analysis.statistics.random_effects import mixed_model, random_effects
from netboard.analysis.statistics.restricted import Restricted, restricted_fit
from netboard.analysis.statistics.small_samples import (
    kenward_roger_covariance,
    kenward_roger_freedom,
    satterthwaite_freedom,
)

REFERENCE = json.loads((Path(__file__).parents[1] / "data" / "models" / "reference.json").read_text(encoding="utf-8"))
MAXIMAL = ("maximal", "maximal_few")
STUDIES = ("four_dyads", "eight_dyads", "singular", "alike", *MAXIMAL)
EVERY = ("sleepstudy", "sleepstudy_few", "beets", "pastes", *STUDIES)


def indicators(label: list[Any]) -> NDArray[np.float64]:
    index = np.unique(np.array(label), return_inverse=True)[1]
    return np.asarray(np.eye(index.max() + 1)[index])


def sources_of(name: str) -> tuple[dict[str, NDArray[np.float64]], list[Any]]:
    """The random effects of a reference, by lme4's names, and the independent groups."""
    table = REFERENCE[name]["table"]
    if name in STUDIES:
        dyad, performer, h = indicators(table["dyad"]), indicators(table["performer"]), np.array(table["h"])[:, None]
        if name in MAXIMAL:
            c = np.array(table["c"])[:, None]
            found = {"dyad.4 (Intercept)": dyad, "performer.1 (Intercept)": performer, "dyad.3 h": h * dyad}
            found |= {"performer h": h * performer, "dyad.2 c": c * dyad, "dyad.1 hc": h * c * dyad}
            return found | {"dyad h2": h * (c > 0.0) * dyad}, table["dyad"]
        found = {"dyad.1 (Intercept)": dyad, "performer.1 (Intercept)": performer}
        return found | {"dyad h": h * dyad, "performer h": h * performer}, table["dyad"]
    group = indicators(table["group"])
    if name.startswith("sleepstudy"):
        return {
            "Subject (Intercept)": group,
            "Subject.1 Days": np.array(table["slope"])[:, None] * group,
        }, table["group"]
    if name == "beets":
        return {"block:harvest (Intercept)": group}, table["group"]
    return {"sample (Intercept)": indicators(table["sample"]), "batch (Intercept)": group}, table["group"]


def fitted(name: str) -> tuple[Restricted, list[str]]:
    sources, groups = sources_of(name)
    reference = REFERENCE[name]
    response, columns = np.array(reference["response"]), np.array(reference["columns"])
    index = np.unique(np.array(groups), return_inverse=True)[1]
    found = restricted_fit(response, columns, list(sources.values()), index)
    assert found is not None
    return found, list(sources)


@pytest.mark.evidence("independent", restricted_fit, by="lme4")
@pytest.mark.parametrize("name", EVERY)
def test_fit_equals_that_of_lme4(name: str) -> None:
    found, names = fitted(name)
    reference = REFERENCE[name]
    assert found.likelihood == pytest.approx(reference["likelihood"], abs=1e-5)
    total = sum(reference["components"].values())
    for source, variance in zip(names, found.variances, strict=True):
        assert variance == pytest.approx(reference["components"][source], abs=1e-5 * total)
    k = len(found.coefficients)
    assert found.coefficients == pytest.approx(reference["satterthwaite"]["estimate"][:k], rel=1e-6)
    assert np.sqrt(np.diag(found.covariance)) == pytest.approx(reference["satterthwaite"]["error"][:k], rel=1e-4)
    assert (0.0 in found.variances) == reference["singular"]


@pytest.mark.evidence("independent", log_time_model, mixed_model, random_effects, by="lme4")
@pytest.mark.parametrize("name", MAXIMAL)
def test_model_of_times_has_the_maximal_structure_of_lme4(name: str) -> None:
    """The extra slope of haptics is at the configuration where lme4, too, has the higher likelihood."""
    reference, table = REFERENCE[name], REFERENCE[name]["table"]
    factors = paper_factors(np.array(table["h"]) > 0.0, np.array(table["c"]) > 0.0)
    times = np.exp(np.array(reference["response"]))
    found = log_time_model(times, table["dyad"], table["performer"], factors, table["trial"])
    names = ["dyad", "performer", "haptics by dyad", "configuration by dyad", "haptics x configuration by dyad"]
    names += ["haptics by performer", "haptics by dyad, dyadic", "residual"]
    assert [one.name for one in found.components] == names
    theirs = ("dyad.4 (Intercept)", "performer.1 (Intercept)", "dyad.3 h", "dyad.2 c", "dyad.1 hc", "performer h")
    expected = [reference["components"][one] for one in (*theirs, "dyad h2", "Residual ")]
    assert [one.variance for one in found.components] == pytest.approx(expected, abs=1e-5 * sum(expected))
    for place, effect in (
        (1, "haptics"),
        (2, "configuration"),
        (4, "haptics x configuration"),
        (-1, "haptics, dyadic"),
    ):
        own = found.effect(effect).by("Kenward-Roger")
        assert own.free == pytest.approx(reference["kenward_roger"]["free"][place], rel=1e-3)
        assert own.p == pytest.approx(reference["kenward_roger"]["p"][place], rel=2e-3, abs=1e-9)


@pytest.mark.evidence("independent", satterthwaite_freedom, by="lmerTest")
@pytest.mark.parametrize("name", EVERY)
def test_satterthwaite_degrees_of_freedom_equal_lmertest(name: str) -> None:
    found, _ = fitted(name)
    reference = REFERENCE[name]
    free = [satterthwaite_freedom(found.moments, np.array(row)) for row in reference["contrasts"]]
    assert free == pytest.approx(reference["satterthwaite"]["free"], rel=1e-3)


@pytest.mark.evidence("independent", kenward_roger_covariance, kenward_roger_freedom, by="pbkrtest")
@pytest.mark.parametrize("name", EVERY)
def test_kenward_roger_inference_equals_pbkrtest(name: str) -> None:
    found, _ = fitted(name)
    reference = REFERENCE[name]
    rows = np.array(reference["contrasts"])
    covariance = kenward_roger_covariance(found.moments)
    errors = np.sqrt(np.einsum("ia,ab,ib->i", rows, covariance, rows))
    free = [kenward_roger_freedom(found.moments, row) for row in rows]
    assert errors == pytest.approx(reference["kenward_roger"]["error"], rel=1e-4)
    assert free == pytest.approx(reference["kenward_roger"]["free"], rel=1e-3)
    p = 2.0 * stats.t.sf(np.abs(rows @ found.coefficients) / errors, free)
    assert p == pytest.approx(reference["kenward_roger"]["p"], rel=2e-3, abs=1e-9)


# --- published examples, closed forms, invariances ---------------------------------------------------------------


@pytest.mark.evidence("truth", kenward_roger_covariance, kenward_roger_freedom, satterthwaite_freedom)
def test_sugar_beets_example_of_halekoh_and_hojsgaard() -> None:
    """J. Stat. Softw. 59:9, 2014: harvest has F = 15.21 with 1 and 2.00 degrees of freedom, p = 0.0599."""
    found, _ = fitted("beets")
    row = np.eye(len(found.coefficients))[-1]
    free = kenward_roger_freedom(found.moments, row)
    t = found.coefficients[-1] / np.sqrt(row @ kenward_roger_covariance(found.moments) @ row)
    assert t**2 == pytest.approx(15.21, abs=0.005)
    assert free == pytest.approx(2.0, abs=1e-6)
    assert satterthwaite_freedom(found.moments, row) == pytest.approx(2.0, abs=1e-6)
    assert 2.0 * stats.t.sf(abs(t), free) == pytest.approx(0.0599, abs=5e-5)


@pytest.mark.evidence("truth", kenward_roger_covariance, kenward_roger_freedom, satterthwaite_freedom)
@pytest.mark.parametrize("dyads", [3, 4, 8])
def test_both_methods_equal_the_paired_t_test_in_a_balanced_study(dyads: int) -> None:
    source = np.random.default_rng(dyads)
    dyad, felt = (index.ravel() for index in np.indices((dyads, 2, 10))[:2])
    h, units = felt - 0.5, np.eye(dyads)[dyad]
    response = source.normal(0, 1, dyads)[dyad] + source.normal(0, 0.8, dyads)[dyad] * h + source.normal(0, 0.3, len(h))
    found = restricted_fit(response, np.column_stack([np.ones(len(h)), h]), [units, h[:, None] * units], dyad)
    assert found is not None
    assert min(found.variances) > 0.0
    row = np.array([0.0, 1.0])
    means = response.reshape(dyads, 2, 10).mean(axis=2)
    expected = stats.ttest_rel(means[:, 1], means[:, 0])
    error = np.sqrt(row @ kenward_roger_covariance(found.moments) @ row)
    assert found.coefficients[1] / error == pytest.approx(expected.statistic, rel=1e-6)
    assert kenward_roger_freedom(found.moments, row) == pytest.approx(dyads - 1, rel=1e-6)
    assert satterthwaite_freedom(found.moments, row) == pytest.approx(dyads - 1, rel=1e-6)


def test_satterthwaite_with_zero_variances_equals_least_squares() -> None:
    source = np.random.default_rng(5)
    dyad = np.repeat(np.arange(4), 20)
    response = source.normal(0, 1, 80)
    response -= np.array([response[dyad == k].mean() for k in range(4)])[dyad]
    found = restricted_fit(response, np.ones((80, 1)), [np.eye(4)[dyad]], dyad)
    assert found is not None
    assert found.variances == (0.0,)
    assert satterthwaite_freedom(found.moments, np.ones(1)) == pytest.approx(79.0)
    assert kenward_roger_freedom(found.moments, np.ones(1)) == pytest.approx(3.0)


@pytest.mark.evidence(
    "properties", kenward_roger_covariance, kenward_roger_freedom, satterthwaite_freedom, of=("unit", "order")
)
@pytest.mark.parametrize("name", ["four_dyads", "eight_dyads"])
def test_degrees_of_freedom_ignore_unit_and_order_of_trials(name: str) -> None:
    sources, groups = sources_of(name)
    reference = REFERENCE[name]
    by = np.random.default_rng(1).permutation(len(groups))
    columns, index = np.array(reference["columns"])[by], np.unique(np.array(groups), return_inverse=True)[1][by]
    shuffled = [matrix[by] for matrix in sources.values()]
    other = restricted_fit(1e3 * np.array(reference["response"])[by], columns, shuffled, index)
    one = fitted(name)[0]
    assert other is not None
    assert kenward_roger_covariance(other.moments) == pytest.approx(
        1e6 * kenward_roger_covariance(one.moments), rel=1e-4, abs=1e-6
    )
    for row in np.eye(len(one.coefficients)):
        for free in (kenward_roger_freedom, satterthwaite_freedom):
            assert free(other.moments, row) == pytest.approx(free(one.moments, row), rel=1e-4)
