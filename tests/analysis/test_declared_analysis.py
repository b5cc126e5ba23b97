"""The declared analysis equals independent computations, by each method, within and between dyads."""

from dataclasses import replace
from itertools import product

import numpy as np
import pandas as pd
import pytest
from scipy import stats
from statsmodels.stats.anova import AnovaRM
from statsmodels.stats.multitest import multipletests

from declared_study import DECLARED, TWO, crossed_study
from made_study import made_study, random_blocks
from netboard.analysis.extraction.study import StudyData
from netboard.analysis.report.answer import answer_sentences, effect_lines, effects_grid, sensitivity_grid
from netboard.analysis.report.wording import amount
from netboard.analysis.statistics import restricted
from netboard.analysis.statistics.exact_tests import permutation_test
from netboard.analysis.topics.declared import DeclaredAnalysis, NoAnalysis, declared_analysis, equivalence_interval
from netboard.analysis.topics.primary import picture, primary


def analysed(study: StudyData) -> DeclaredAnalysis:
    found = declared_analysis(study)
    assert isinstance(found, DeclaredAnalysis)
    return found


def cells_of(study: StudyData, column: str = "completion", *, log: bool = True) -> pd.DataFrame:
    """Mean of each dyad in each combination of levels, computed from the table of trials alone."""
    rows = study.counted.assign(value=np.log(study.counted[column]) if log else study.counted[column])
    keys = ["dyad", *(name for name in rows if name.startswith("factor_"))]
    return rows.groupby(keys, as_index=False)["value"].mean()


@pytest.mark.parametrize("seed", [0, 1])
def test_effects_of_two_factors_are_those_of_an_analysis_of_variance(seed: int) -> None:
    study = crossed_study(DECLARED, TWO, seed=seed)
    cells = cells_of(study)
    table = AnovaRM(cells, "value", "dyad", within=["factor_mass", "factor_partner"]).fit().anova_table
    wide = cells.pivot(index="dyad", columns=["factor_mass", "factor_partner"], values="value")
    scores = [
        wide["heavy"].mean(axis=1) - wide["light"].mean(axis=1),
        (wide["heavy", "person"] + wide["light", "person"] - wide["heavy", "robot"] - wide["light", "robot"]) / 2,
        (wide["heavy", "person"] - wide["light", "person"]) - (wide["heavy", "robot"] - wide["light", "robot"]),
    ]
    for effect, row, own in zip(analysed(study).primary.effects, table.to_dict("records"), scores, strict=True):
        tested = effect.counts.tested
        assert tested.p == pytest.approx(row["Pr > F"], rel=1e-9)
        assert tested.statistic**2 == pytest.approx(row["F Value"], rel=1e-9)
        assert tested.free == row["Den DF"] == 5
        whole = stats.ttest_1samp(own, 0.0)
        ends = np.exp(whole.confidence_interval(0.95))
        found = effect.counts.estimate
        assert (found.value, found.low, found.high) == pytest.approx((np.exp(own.mean()), *ends), rel=1e-12)
        assert effect.size.value == pytest.approx(own.mean() / own.std() * (1 - 3 / (4 * 5 - 1)), rel=2e-3)


def test_permutation_counts_if_declared_and_its_interval_agrees_with_its_p() -> None:
    study = crossed_study(replace(DECLARED, method="permutation"), TWO, dyads=7)
    cells = cells_of(study).pivot(index="dyad", columns=["factor_mass", "factor_partner"], values="value")
    own = cells["heavy", "person"] - cells["light", "person"] - cells["heavy", "robot"] + cells["light", "robot"]
    effect = analysed(study).primary.effects[2]
    assert effect.counts.method == "permutation"
    assert effect.counts.tested.p == permutation_test(own).p
    assert {one.method for one in effect.others} == {"t", "model"}
    low, high = np.log([effect.counts.estimate.low, effect.counts.estimate.high])
    assert permutation_test(own - (low + 1e-6)).p > 0.05 >= permutation_test(own - (low - 1e-6)).p
    assert permutation_test(own - (high - 1e-6)).p > 0.05 >= permutation_test(own - (high + 1e-6)).p


def test_model_agrees_with_the_t_test_in_a_balanced_design() -> None:
    study = crossed_study(replace(DECLARED, method="model", secondary=()), TWO, trials=6)
    for effect in analysed(study).primary.effects:
        assert effect.counts.method == "model"
        t = next(one for one in effect.others if one.method == "t")
        assert effect.counts.estimate.value == pytest.approx(t.estimate.value, rel=1e-6)


def test_answer_of_a_model_that_did_not_converge_says_so_beside_p(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(restricted, "STEPS", 1)
    study = crossed_study(replace(DECLARED, method="model", secondary=()), TWO, trials=6)
    found = analysed(study)
    beside = "(the fit did not converge)"
    assert all(beside in line for line in effect_lines(found.primary))
    text = " ".join(answer_sentences(found))
    assert all(f"p = {amount(one.counts.tested.p)} {beside}" in text for one in found.primary.effects)
    assert all(beside in str(row) for row in effects_grid(found.primary).rows)
    others = sensitivity_grid(found.primary)
    assert others is not None
    assert not any(beside in str(row) for row in others.rows)
    named = [row.quantity for row in primary(study).results if row.quantity.startswith("completion time: p, model")]
    assert named == [f"completion time: p, model of all trials {beside}"] * 3


def test_factor_between_dyads_is_tested_between_them() -> None:
    declared = replace(DECLARED, contrast="age: old vs young x mass: heavy vs light", secondary=())
    levels = {"age": ("young", "old"), "mass": ("light", "heavy")}
    study = crossed_study(declared, levels, dyads=9, between=["age"])
    wide = cells_of(study).pivot(index=["dyad", "factor_age"], columns="factor_mass", values="value")
    old, young = wide.xs("old", level="factor_age"), wide.xs("young", level="factor_age")
    main, within, both = analysed(study).primary.effects
    for effect, score in ((main, lambda x: x.mean(axis=1)), (both, lambda x: x["heavy"] - x["light"])):
        expected = stats.ttest_ind(score(old), score(young))
        assert effect.counts.tested.p == pytest.approx(expected.pvalue, rel=1e-9)
        assert effect.counts.tested.statistic == pytest.approx(expected.statistic, rel=1e-9)
    gaps = [(one["heavy"] - one["light"]).to_numpy() for one in (old, young)]
    spread = sum(((one - one.mean()) ** 2).sum() for one in gaps) / 7
    t = (gaps[0].mean() + gaps[1].mean()) / 2 / np.sqrt(spread * (1 / len(gaps[0]) + 1 / len(gaps[1])) / 4)
    assert within.counts.tested.statistic == pytest.approx(t, rel=1e-9)


def test_another_factor_is_averaged_over_its_levels() -> None:
    levels = TWO | {"gain": ("weak", "strong")}
    study = crossed_study(replace(DECLARED, contrast="partner: person vs robot"), levels)
    own = cells_of(study).groupby(["dyad", "factor_partner"])["value"].mean().unstack()
    (effect,) = analysed(study).primary.effects
    assert effect.counts.tested.p == pytest.approx(stats.ttest_1samp(own["person"] - own["robot"], 0).pvalue, rel=1e-9)


def test_dyad_without_a_condition_is_left_out_and_named() -> None:
    study = crossed_study(DECLARED, TWO)
    gone = (study.trials["dyad"] == "D02") & (study.trials["factor_mass"] == "heavy")
    lacking = replace(study, trials=study.trials.assign(counts=study.trials["counts"].where(~gone, 0)))
    found = analysed(lacking).primary
    assert found.left_out == ("D02",)
    assert "left out, because a value is missing in a compared condition: D02" in found.notes
    assert found.effects[0].counts.estimate.n == 5


def test_interaction_is_the_gate_of_all_other_declared_effects() -> None:
    found = analysed(crossed_study(DECLARED, TWO))
    assert found.contrast.name == "mass: heavy vs light x partner: person vs robot"
    assert found.contrast.adjusted == found.contrast.counts.tested.p
    p = [one.counts.tested.p for one in found.secondary_effects]
    assert len(p) == 2 + 2 * 3
    expected = np.maximum(found.contrast.counts.tested.p, multipletests(p, method="holm")[1])
    assert [one.adjusted for one in found.secondary_effects] == pytest.approx(expected)
    assert found.least_adjusted == 0.0
    peaks = found.secondary[0].effects[0]
    assert peaks.counts.scale == "difference"


def test_answer_begins_with_the_primary_contrast_and_adjusts_the_others() -> None:
    found = analysed(crossed_study(DECLARED, TWO))
    first, second, *_, gate, _, assumed, _ = answer_sentences(found)
    assert assumed.startswith("The test assumes that the effects of dyads are normal; if they are strongly skewed")
    assert first.startswith("Primary contrast. Interaction: ")
    assert "adjusted p" not in first
    assert second.startswith("Secondary. ")
    other = found.primary.effects[1]
    assert f"p = {amount(other.counts.tested.p)}, adjusted p = {amount(other.adjusted)}" in second
    assert gate.startswith(
        "The primary contrast is tested at the full level of 5\N{NO-BREAK SPACE}%. The other 8 declared tests"
    )
    table = effects_grid(found.primary)
    place = [column.title for column in table.columns].index("p, adjusted")
    assert [row[place] for row in table.rows] == [amount(one.adjusted) for one in found.primary.effects[::-1]]
    assert [row[1] for row in table.rows] == ["primary", "secondary", "secondary"]


def test_secondary_effect_that_only_its_own_p_supports_is_not_said_to_be_shown() -> None:
    """Its own interval lies on one side of no effect, but the gate is closed."""
    study = crossed_study(DECLARED, TWO)
    slow = study.trials["factor_mass"] == "heavy"
    slower = study.trials["completion"].where(~slow, 6.0 * study.trials["completion"])
    found = analysed(replace(study, trials=study.trials.assign(completion=slower)))
    main = found.primary.effects[0]
    assert main.counts.tested.p < 0.05 < found.contrast.adjusted <= main.adjusted
    assert main.counts.estimate.low > 1.0
    (text,) = [one for one in answer_sentences(found) if "(mass: heavy over light) was" in one]
    assert text.endswith("But the adjusted p is above the level, so no effect remains possible.")
    assert "remain compatible" not in text


def test_equivalence_interval_has_twice_the_level_less_one() -> None:
    study = crossed_study(DECLARED, TWO)
    effect = analysed(study).primary.effects[0]
    found = equivalence_interval(effect)
    expected = np.exp(stats.ttest_1samp(effect.scores[0], 0).confidence_interval(0.9))
    assert found.level == pytest.approx(0.9)
    assert (found.low, found.high) == pytest.approx(tuple(expected), rel=1e-9)


@pytest.mark.parametrize(
    ("changes", "why"),
    [
        ({"primary": "speed"}, 'it cannot be computed: there is no measure "speed"'),
        ({"contrast": "age: old vs young"}, "it cannot be computed: no recording has the factor age"),
        ({"contrast": "mass: heavy vs middle"}, 'it cannot be computed: found level "middle" of mass'),
    ],
)
def test_declaration_that_does_not_fit_the_recordings_gives_the_reason(changes: dict[str, str], why: str) -> None:
    found = declared_analysis(crossed_study(replace(DECLARED, **changes), TWO, dyads=2))  # type: ignore[arg-type]
    assert isinstance(found, NoAnalysis)
    assert found.why.startswith(why)


def test_study_without_a_declaration_has_no_primary_result_but_a_figure() -> None:
    study = made_study(random_blocks())
    assert primary(study).results == ()
    assert declared_analysis(study) == NoAnalysis("none is declared")
    assert "No primary outcome is declared" in picture(study).caption


def test_different_declarations_do_not_count() -> None:
    study = crossed_study(DECLARED, TWO)
    other = study.blocks["declaration"].where(study.blocks["dyad"] != "D01", "").to_list()
    some = replace(study, blocks=study.blocks.assign(declaration=other))
    assert isinstance(declared_analysis(some), DeclaredAnalysis)
    own = study.blocks["declaration"].str.replace("completion time", "SPARC")
    changed = study.blocks["declaration"].where(study.blocks["dyad"] != "D01", own)
    two = replace(study, blocks=study.blocks.assign(declaration=changed))
    assert declared_analysis(two) == NoAnalysis("the recordings declare 2 different ones")


def test_results_say_which_method_counts() -> None:
    rows = [
        one for one in primary(crossed_study(DECLARED, TWO)).results if one.quantity.startswith("completion time: p")
    ]
    roles = ["secondary test, primary outcome"] * 2 + ["primary contrast"]
    kinds = ("declared method", "sensitivity analysis", "sensitivity analysis")
    expected = [f"{role}, {kind}" for role in roles for kind in kinds]
    assert [one.note.partition(";")[0] for one in rows if "adjusted" not in one.quantity] == expected
    adjusted = [one for one in rows if "adjusted" in one.quantity]
    assert len(adjusted) == 2
    assert all(one.note.endswith("over all 8 secondary tests") for one in adjusted)
    tested = [one.note for one in rows if "adjusted" not in one.quantity]
    assert all("strongly skewed (log-normal)" in note or "skewed distribution (log-normal)" in note for note in tested)


def test_figure_shows_every_dyad_in_every_condition() -> None:
    figure = picture(crossed_study(DECLARED, TWO, dyads=5)).figure
    assert figure is not None
    dyads = {f"D0{k}" for k in range(1, 6)}
    points = sum(len(line.get_xdata()) for line in figure.axes[0].lines if str(line.get_label())[1:] in dyads)
    assert points == 5 * len(list(product(*TWO.values())))
