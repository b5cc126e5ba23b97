"""Models of a study: their terms are the results, and a model that cannot be fitted reports why."""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from scipy import stats

from made_modern import modern_blocks, modern_study
from made_study import Block, declared, made_study, times
from netboard.analysis.extraction.settings import Readings
from netboard.analysis.extraction.study import StudyData, study_of
from netboard.analysis.statistics import restricted
from netboard.analysis.statistics.factors import paper_factors
from netboard.analysis.statistics.models import log_time_model
from netboard.analysis.topics.models import Fits, fits, picture
from netboard.analysis.topics.result import table_of
from netboard.base.tables.experiment import Design


def _columns(study: StudyData) -> tuple[Any, ...]:
    rows = study.counted
    return (
        *(rows[name] for name in ("completion", "dyad", "performer")),
        paper_factors(rows["haptics"] == 1, rows["configuration"] == "dyadic"),
        rows["order"],
    )


def change_times(row: dict[str, float], configuration: str, force: str, dyad: int) -> None:
    """Haptics make dyadic trials 1.5 times as fast; dyads differ in speed."""
    row["completion"] *= (1.0 / 1.5 if (configuration, force) == ("dyadic", "full") else 1.0) * 1.3 ** (dyad % 3)


@pytest.fixture(scope="module")
def found() -> Fits:
    return fits(modern_study(modern_blocks(seed=5, dyads=6, trials=12, change=change_times)))


def test_reported_terms_equal_those_of_the_models(found: Fits) -> None:
    study = modern_study(modern_blocks(seed=5, dyads=6, trials=12, change=change_times))
    model = log_time_model(*_columns(study))
    table = table_of(found.results).set_index(["quantity", "group"])
    for name in ("haptics", "configuration", "haptics x configuration", "haptics, bimanual", "haptics, dyadic"):
        row, effect = table.loc[("completion time: ratio", name)], model.effect(name)
        assert (row["value"], row["low"], row["high"]) == (effect.ratio.value, effect.ratio.low, effect.ratio.high)
        assert table.loc[("completion time: p", name), "value"] == effect.p
        for other in effect.others:
            row = table.loc[(f"completion time: ratio, {other.method}", name)]
            assert (row["value"], row["low"], row["high"]) == (other.ratio.value, other.ratio.low, other.ratio.high)
            assert row["interval"] == f"95 % {other.estimate.method}"
            assert table.loc[(f"completion time: p, {other.method}", name), "value"] == other.p
    assert table.loc[("completion time: ratio", "haptics, dyadic"), "value"] == pytest.approx(1 / 1.5, rel=0.1)
    assert table.loc[("completion time: at the first trial", "intercept"), "unit"] == "s"
    practice = table.loc[("completion time: exponent of practice", "log trial")]
    assert practice["low"] <= 0.0 <= practice["high"]


def test_p_values_of_a_fit_that_did_not_converge_say_so(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(restricted, "STEPS", 1)
    study = modern_study(modern_blocks(seed=5, dyads=6, trials=12, change=change_times))
    table = table_of(fits(study).results)
    p = table.loc[table["quantity"].str.startswith("completion time: p"), "quantity"]
    assert len(p)
    assert p.str.endswith(" (the fit did not converge)").all()
    others = table[~table["quantity"].str.startswith("completion time")]
    assert not others["quantity"].str.contains("converge").any()
    notes = table.loc[table["quantity"] == "completion time: ratio", "note"]
    assert notes.str.contains("the fit did not converge").all()
    drawn = picture(study)
    assert drawn.caption.count("(the fit did not converge)") == 1


def test_intercept_has_no_p_value(found: Fits) -> None:
    """Its null hypothesis would be a first trial of 1 s, and so depend on the unit of time."""
    table = table_of(found.results)
    of_intercept = table[table["group"] == "intercept"]["quantity"]
    assert len(of_intercept)
    assert not of_intercept.str.contains(": p").any()


def test_notes_do_not_contradict_the_degrees_of_freedom_of_a_named_method(found: Fits) -> None:
    table = table_of(found.results)
    named = table[(table["quantity"] == "completion time: ratio, Satterthwaite") & (table["group"] == "configuration")]
    assert "5 df" not in named["interval"].item()
    assert "6 dyads: t has 5 degrees of freedom, unless a small-sample method is named" in named["note"].item()


def test_kurtosis_of_normal_residuals_is_named_as_excess(found: Fits) -> None:
    """Normal residuals have a kurtosis of 3 and an excess kurtosis of 0."""
    checks = table_of(found.results).set_index("quantity")["value"]
    assert checks["completion time: residual excess kurtosis"] == pytest.approx(
        stats.kurtosis(np.asarray(found.fits[0].model.diagnostics.residuals), fisher=False) - 3.0
    )


def test_random_effects_and_assumptions_are_reported(found: Fits) -> None:
    table = table_of(found.results)
    assert (table["n"] > 0).all()
    deviations = table[table["quantity"] == "completion time: SD on the log scale"].set_index("group")
    assert deviations.loc["residual", "value"] == pytest.approx(0.4, rel=0.15)
    assert table["note"].str.contains("Assumptions:").any()


@pytest.mark.parametrize("seed", range(6))
def test_zero_variances_keep_the_model_and_are_noted(seed: int) -> None:
    found = fits(modern_study(modern_blocks(seed, dyads=4, trials=12)))
    model = found.fits[0].model
    assert model.fitted
    assert model.converged
    *slopes, extra, residual = [component.name for component in model.components]
    expected = ["haptics by dyad", "configuration by dyad", "haptics x configuration by dyad", "haptics by performer"]
    assert slopes == ["dyad", "performer", *expected]
    assert extra in ("haptics by dyad, dyadic", "haptics by dyad, bimanual")
    assert residual == "residual"
    assert any(note.endswith("its variance is estimated as 0") for note in model.notes)
    table = table_of(found.results)
    notes = table.loc[table["quantity"] == "completion time: ratio", "note"]
    assert notes.str.startswith(f"linear mixed model, REML: {model.equation}; ").all()


def test_trial_with_zero_duration_is_left_out() -> None:
    blocks = modern_blocks(seed=5, dyads=3)
    first = replace(blocks[0], trials=[{**blocks[0].trials[0], "completion": 0.0}, *blocks[0].trials[1:]])
    assert fits(modern_study([first, *blocks[1:]])).fits[0].model.left_out == 1


def test_study_without_falls_reports_that_they_are_not_fitted(found: Fits) -> None:
    table = table_of(found.results)
    falls = table[table["quantity"].str.startswith("falls per attempt: ratio of odds")]
    assert len(falls)
    assert falls["value"].isna().all()
    assert falls["note"].str.contains("not fitted").all()


def test_falls_absent_from_one_condition_have_a_finite_odds_ratio() -> None:
    fell = {"outcome": "fell"}
    blocks = modern_blocks(dyads=6, trials=8)
    some = [
        one
        if (one.configuration, one.force) == ("dyadic", "full")
        else Block(
            one.dyad, one.performer, one.configuration, one.force, [fell, *one.trials[:3], fell, *one.trials[3:]]
        )
        for one in blocks
    ]
    found = fits(modern_study(some))
    assert "Firth" in found.fits[2].model.name
    table = table_of(found.results).set_index(["quantity", "group"])
    row = table.loc[("falls per attempt: ratio of odds", "haptics, dyadic")]
    assert 0.0 < row["low"] < row["value"] < row["high"] < 1.0
    assert row["interval"] == "95 % profile, 5 df"
    assert "none failed in one condition (haptics on, configuration dyadic)" in row["note"]


def falls_of(number: int) -> StudyData:
    """Six dyads with some falls, in the first dyads' bimanual trials with haptics on."""
    blocks, left = list(modern_blocks(dyads=6, trials=8)), number
    for place, one in enumerate(blocks):
        if left and (one.configuration, one.force) == ("bimanual", "full"):
            blocks[place], left = replace(one, trials=[{"outcome": "fell"}, *one.trials]), left - 1
    return modern_study(blocks)


def test_one_fall_is_too_few_for_the_effects_of_a_model() -> None:
    study = falls_of(1)
    model = fits(study).fits[2].model
    assert not model.fitted
    (why,) = [note for note in model.notes if note.startswith("not estimated")]
    assert why == (
        f"not estimated, because only 1 of {model.trials} attempts failed: each of the 5 effects needs at least one"
    )
    shown = picture(study)
    assert shown.figure is not None
    legend = shown.figure.axes[0].get_legend()
    assert legend is not None
    words = [text.get_text() for text in legend.get_texts()]
    assert words == [
        "completion time, ratio",
        "velocity peaks, ratio",
        "falls per attempt, ratio of odds: cannot be estimated",
    ]
    assert "Model of falls per attempt: not" in shown.caption
    assert "1 of" in shown.caption


def test_interval_of_few_falls_ends_with_an_arrow_at_the_end_of_the_axis() -> None:
    study = falls_of(6)
    model = fits(study).fits[2].model
    assert "Firth" in model.name
    assert any(one.ratio.low < 0.01 or one.ratio.high > 100.0 for one in model.effects if one.name != "intercept")
    shown = picture(study)
    assert shown.figure is not None
    low, high = shown.figure.axes[0].get_xlim()
    assert 1e-3 < low < high < 1e3
    assert {line.get_marker() for line in shown.figure.axes[0].lines} & {"<", ">"}
    assert "arrow: the interval goes beyond" in shown.caption


def test_attempt_has_the_number_of_its_trial() -> None:
    fell = {"outcome": "fell"}
    blocks = modern_blocks(dyads=6, trials=8)
    some = [
        Block(one.dyad, one.performer, one.configuration, one.force, [fell, *one.trials[:3], fell, *one.trials[3:]])
        for one in blocks
    ]
    model = fits(modern_study(some)).fits[2].model
    assert model.fitted
    assert model.trials == len(blocks) * 10
    assert model.effect("haptics").ratio.value == pytest.approx(1.0)


def test_robots_are_left_out_and_each_force_is_a_level() -> None:
    blocks = modern_blocks(dyads=3, trials=4, forces=("full", "partner_only", "none"))
    robot = Block("D01", "D01", "dyadic", "full", times(3.0, 3.0), right_by="robot")
    found = fits(modern_study([*blocks, robot]))
    assert found.notes == ("2 trials with a robot or a still hand are left out",)
    names = {effect.name for effect in found.fits[0].model.effects}
    assert {"haptics: haptics on vs haptics off", "haptics: partner's force vs haptics off"} <= names
    assert found.fits[0].model.trials == 3 * 3 * 3 * 4


@pytest.mark.parametrize("force", ["full", "none"])
def test_single_condition_of_one_dyad_reports_what_is_missing(force: str) -> None:
    found = fits(made_study([Block("D01", "D01", "dyadic", force, times(3.0, 4.0, 5.0))]))
    table = table_of(found.results)
    assert np.isnan(table.loc[table["group"] == "haptics", "value"]).all()
    assert (table.loc[table["value"].isna(), "note"] != "").all()


@pytest.mark.parametrize("name", ["haptics", "configuration", "order"])
def test_factor_of_the_study_may_have_a_name_that_the_model_uses(name: str) -> None:
    """The force does not determine the level, so the factor is a term of its own."""
    levels, found = {"off": "none", "weak": "full", "full": "full"}, []
    for dyad in ("D01", "D02", "D03"):
        for number, (level, force) in enumerate(levels.items(), start=1):
            design = Design(factors={name: level}, levels={name: (*levels,)})
            block = Block(dyad, dyad, "dyadic", force, times(*(number + 0.1 * k for k in range(6))))
            found.append(declared(block, len(found) + 1, design))
    model = fits(study_of(found, Readings())).fits[0].model
    assert model.fitted
    own = name if name == "configuration" else f"factor {name}"
    assert any(one.name.startswith(own) and np.isfinite(one.ratio.value) for one in model.effects)
