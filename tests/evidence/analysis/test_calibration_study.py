"""False positive rate and power of the tests in simulated studies: p-values, random errors and tables."""

import numpy as np
import pytest
from numpy.typing import NDArray

from evidence.analysis import calibration
from evidence.analysis.calibration import (
    DYADS,
    EFFECT,
    EFFECT_SIZES,
    ERRORS,
    METHODS,
    QUICK,
    STUDIES,
    TERMS,
    TRIALS,
    VARIATIONS,
    Setting,
    coverage,
    differences_part,
    effect_sizes_part,
    p_of_differences,
    settings,
    share,
    simulated,
    table_part,
    variations_part,
)
from netboard.analysis.statistics.contrasts import paired_t_test
from netboard.analysis.statistics.effect_sizes import hedges_factor, paired_effect
from netboard.analysis.statistics.exact_tests import permutation_test
from netboard.analysis.statistics.factors import paper_factors
from netboard.analysis.statistics.models import log_time_model


@pytest.mark.parametrize(("errors", "variation"), [("normal", ""), ("skewed", ""), ("normal", "haptics, dyadic")])
def test_p_values_equal_those_of_the_analysis(errors: str, variation: str) -> None:
    setting, seed = Setting(4, errors, 0.3, variation), (3, 1)
    found = simulated(setting, 2, seed)
    rng = np.random.default_rng(seed)
    dyad, performer, haptics_on, trial = (index.ravel() for index in np.indices((4, 3, 2, TRIALS)))
    for number in range(2):
        times = calibration._drawn(rng, setting)
        for place, effect in enumerate((0.0, EFFECT)):
            log = times.ravel() + effect * (haptics_on - 0.5)
            factors = paper_factors(haptics_on == 1, performer == 2)
            model = log_time_model(np.exp(log), dyad, performer, factors, trial + 1)
            haptics = model.effect("haptics")
            expected = [haptics.p, *(haptics.by(method).p for method in METHODS[1:3])]
            assert found[place, 0, :3, number] == pytest.approx(expected, rel=1e-4)
            levels = times.mean(axis=3) + effect * np.array([-0.5, 0.5])
            gaps = 0.5 * (levels[:, :2].mean(axis=1) + levels[:, 2]) @ np.array([-1.0, 1.0])
            assert found[place, 0, 3, number] == pytest.approx(paired_t_test(gaps).p)
            assert found[place, 0, 4, number] == pytest.approx(permutation_test(gaps).p)
        model = log_time_model(np.exp(times.ravel()), dyad, performer, factors, trial + 1)
        for term, name in enumerate(TERMS):
            assert found[0, term, 2, number] == pytest.approx(model.effect(name).by("Kenward-Roger").p, rel=1e-4)


def test_studies_depend_only_on_the_seed() -> None:
    setting = Setting(4, "t4", 0.08)
    one, again, other = (simulated(setting, 2, seed) for seed in ((1, 0), (1, 0), (1, 100)))
    assert np.array_equal(one, again)
    assert not np.array_equal(one, other)


@pytest.mark.parametrize("errors", list(ERRORS))
def test_errors_have_variance_one_and_mean_zero(errors: str) -> None:
    drawn = ERRORS[errors](np.random.default_rng(1), (400_000,))
    assert drawn.mean() == pytest.approx(0.0, abs=0.01)
    assert drawn.std() == pytest.approx(1.0, abs=0.05)


def test_successive_trials_are_correlated_under_ar_errors() -> None:
    rng = np.random.default_rng(2)
    times = np.concatenate([calibration._drawn(rng, Setting(16, "AR(.5)", 0.0)) for _ in range(8)])
    left = times - times.mean(axis=3, keepdims=True)
    assert (left[..., 1:] * left[..., :-1]).mean() / (left**2).mean() == pytest.approx(0.45, abs=0.06)


@pytest.mark.parametrize("true", [0.0, 1.5])
def test_coverage_counts_the_intervals_that_cover_the_true_effect(true: float) -> None:
    drawn = np.random.default_rng((4, round(10 * true))).normal(true, 1.0, (60, 4))
    found = [paired_effect(own, correction="hedges") for own in drawn]
    shrunk = [(hedges_factor(3) * one.low, hedges_factor(3) * one.high) for one in found]
    expected = sum(one.low <= true <= one.high for one in found), sum(low <= true <= high for low, high in shrunk)
    assert coverage(4, true, 60) == expected


def test_effect_sizes_have_their_nominal_coverage() -> None:
    part = effect_sizes_part(4000)
    assert part.holds
    assert len(part.rows) == len(DYADS) * len(EFFECT_SIZES)


@pytest.mark.slow
def test_permutation_test_is_liberal_for_skewed_differences_only() -> None:
    skewed, normal = (p_of_differences(8, errors, 3000, (1,))[1] for errors in ("skewed", "normal"))
    assert (skewed <= 0.05).mean() > 0.12
    assert (normal <= 0.05).mean() == pytest.approx(0.047, abs=0.016)
    assert "skewed" in {row[1] for row in differences_part(400).rows}


def effects_of_dyads(setting: Setting, seed: int) -> dict[str, NDArray[np.float64]]:
    levels = calibration._drawn(np.random.default_rng(seed), setting).mean(axis=3)
    alone, both, felt = levels[:, :2].mean(axis=1), levels[:, 2], np.array([-1.0, 1.0])
    gain = both - alone
    return dict(zip(VARIATIONS, (gain.mean(axis=1), gain @ felt, both @ felt, alone @ felt), strict=False))


def test_variations_change_what_dyads_differ_in() -> None:
    """Over 3000 dyads an effect has the standard deviation of its setting in addition to that without it."""
    without = effects_of_dyads(Setting(3000, "normal", 0.0), 1)
    for variation in VARIATIONS[:4]:
        own = effects_of_dyads(Setting(3000, "normal", 0.0, variation), 2)[variation]
        assert own.std() == pytest.approx(np.hypot(0.3, without[variation].std()), rel=0.05)
    unequal = calibration._drawn(np.random.default_rng(9), Setting(300, "normal", 0.0, VARIATIONS[-1]))
    spread = unequal.std(axis=3).mean(axis=(0, 2))
    assert spread == pytest.approx([0.3, 0.3, 0.8], rel=0.05)


def test_table_of_variations_has_a_row_for_each_effect_and_claims_the_highest_rate() -> None:
    counts = {setting: np.full((2, len(TERMS), len(METHODS)), 100.0) for setting in settings()}
    part = variations_part(counts, 2000)
    assert len(part.rows) == len(DYADS) * len(VARIATIONS) * len(TERMS)
    assert part.holds
    assert not variations_part({setting: found + 40 for setting, found in counts.items()}, 2000).holds


def test_table_has_a_row_for_each_setting_and_confidence_intervals() -> None:
    counts = {setting: np.full((2, len(TERMS), len(METHODS)), 100.0) for setting in settings()}
    part = table_part(counts, 2000, 0, 0)
    assert len(part.rows) == len(DYADS) * len(ERRORS) * 2
    assert part.rows[0] == (4, "normal", "0.08", *(["0.050 (0.041-0.060)"] * 5))
    assert part.holds
    assert share(0, 60) == "0.000 (0.000-0.060)"
    assert not table_part({setting: found + 100 for setting, found in counts.items()}, 2000, 0, 0).holds
    assert QUICK < STUDIES
