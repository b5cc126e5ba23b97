"""Power of contrasts: the closed form of a paired t test, Wilson's interval, and clear errors."""

from dataclasses import asdict, replace
from math import gamma, sqrt
from pathlib import Path
from typing import get_args

import numpy as np
import pandas as pd
import pytest
from scipy import stats
from statsmodels.stats.power import TTestPower
from statsmodels.stats.proportion import proportion_confint
from typer.testing import CliRunner

from made_study import made_study, random_blocks
from netboard.analysis.cohort.decisions import CohortDecision
from netboard.analysis.cohort.power import (
    PERMUTATION,
    T_TEST,
    Differences,
    PowerRate,
    Scale,
    differences,
    levels_of_cohort,
    powers,
)
from netboard.analysis.cohort.report import Assumptions, draw, flat, parts, sentence, write
from netboard.analysis.cohort.rows import group_rows
from netboard.analysis.statistics.contrasts import condition_contrast
from netboard.analysis.topics.contrasts import comparisons, questions_of
from netboard.base.errors import ConfigError
from netboard.services.cli import app

UNDECLARED = CohortDecision("t", (), (), 0, "none")
ASSUMED = Assumptions("short", "0.1.0", "a" * 64, 1, 400, 24, 0.05, [("kp", "1/s2", 2.0, 1.5, 2.5)], UNDECLARED)
MEAN, SD = 0.3, 0.5


def drawn(scale: Scale = "difference") -> Differences:
    gaps = np.random.default_rng(7).normal(MEAN, SD, (400, 24))
    return Differences("peaks", "on vs off", "1", scale, gaps)


@pytest.mark.slow
@pytest.mark.parametrize("dyads", [4, 8, 24])
def test_power_of_normal_differences_equals_the_closed_form(dyads: int) -> None:
    found = {one.test: one for one in powers([drawn()], [dyads])}
    t = found[T_TEST]
    assert t.studies == 400 * (24 // dyads)
    exact = TTestPower().power(MEAN / SD, dyads, 0.05)
    assert t.power.value == pytest.approx(exact, abs=4 * sqrt(exact * (1 - exact) / t.studies))
    assert t.false_positives.value == pytest.approx(0.05, abs=4 * sqrt(0.05 * 0.95 / t.studies))
    unbiased = sqrt(2 / (dyads - 1)) * gamma(dyads / 2) / gamma((dyads - 1) / 2)
    width = 2 * stats.t.ppf(0.975, dyads - 1) * SD * unbiased / sqrt(dyads)
    assert t.width == pytest.approx(width, abs=4 * t.width_error)
    assert found[PERMUTATION].power.value == (0.0 if dyads == 4 else pytest.approx(t.power.value, abs=0.05))


def test_power_uses_the_tests_of_a_study() -> None:
    gaps = drawn().gaps[:1, :8].copy()
    gaps[0, 2] = np.nan
    found = {one.test: one for one in powers([Differences("m", "c", "s", "difference", gaps)], [8])}
    own = condition_contrast(
        [*gaps[0], *np.zeros(8)], [*range(8)] * 2, [True] * 8 + [False] * 8, np.random.default_rng(0), name="c"
    )
    assert found[T_TEST].power.value == (own.t.p <= 0.05)
    assert found[PERMUTATION].power.value == (own.permutation.p <= 0.05)
    assert found[T_TEST].effect == pytest.approx(own.difference.value)


def test_studies_of_equal_differences_reject_nothing_without_the_effect() -> None:
    """In half of the studies nobody falls, so all differences are 0; the cohort's mean is not."""
    gaps = np.zeros((40, 8))
    gaps[::2] = np.random.default_rng(3).normal(0.0, 0.1, (20, 8)) + 0.05
    own = gaps - gaps.mean()
    expected = sum(stats.ttest_1samp(one, 0.0).pvalue <= 0.05 for one in own[::2]) / 40
    signs = 1.0 - 2.0 * (np.arange(256)[:, None] >> np.arange(8) & 1)
    flipped = [np.mean(np.abs(signs @ one) >= abs(one.sum()) * (1 - 1e-12)) for one in own[::2]]
    found = {one.test: one for one in powers([Differences("falls", "c", "1", "difference", gaps)], [8])}
    assert found[T_TEST].false_positives.value == expected < 0.2
    assert found[PERMUTATION].false_positives.value == sum(p <= 0.05 for p in flipped) / 40 < 0.2


def test_equal_differences_have_no_t_test_as_in_an_analysis() -> None:
    found = {one.test: one for one in powers([Differences("m", "c", "s", "difference", np.full((2, 8), 0.1))], [8])}
    own = condition_contrast(
        [*[0.1] * 8, *np.zeros(8)], [*range(8)] * 2, [True] * 8 + [False] * 8, np.random.default_rng(0), name="c"
    )
    assert np.isnan(own.t.p)
    assert found[T_TEST].power.value == 0.0
    assert found[PERMUTATION].power.value == (own.permutation.p <= 0.05) == 1.0


def test_interval_width_of_ratios_is_a_ratio() -> None:
    (plain, _), (ratio, _) = (list(powers([drawn(scale)], [8])) for scale in get_args(Scale))
    assert ratio.effect == pytest.approx(np.exp(plain.effect))
    assert ratio.width == pytest.approx(np.exp(plain.width))
    assert (ratio.power, ratio.false_positives) == (plain.power, plain.false_positives)


@pytest.mark.parametrize(("hits", "total"), [(0, 10), (7, 10), (200, 200)])
def test_monte_carlo_interval_equals_wilson(hits: int, total: int) -> None:
    found = PowerRate.of(hits, total)
    assert (found.low, found.high) == pytest.approx(proportion_confint(hits, total, method="wilson"), abs=1e-12)


def groups(dyads: int) -> pd.DataFrame:
    rows = [
        (f"D{dyad:02d}", force, group) for dyad in range(1, dyads + 1) for force in ("on", "off") for group in (1, 2)
    ]
    table = pd.DataFrame(rows, columns=["dyad", "condition", "group"]).assign(performer="P", trials=30, attempts=30)
    table = table.assign(configuration="dyadic", partner="")
    names = ("falls", "movements", "peaks", "cooperative", "competitive", "single", "still", "delay_20")
    return table.assign(**dict.fromkeys(names, 1.0), log_completion=table["group"] * (table["condition"] == "on"))


def test_fewer_trials_use_the_first_groups() -> None:
    asked = [{"name": "on vs off", "first": ["on"], "second": ["off"]}]
    for trials, expected in ((0, 1.5), (30, 1.0), (60, 1.5)):
        (time,) = (
            one for one in differences(levels_of_cohort([groups(3)], trials), asked) if one.measure == "completion time"
        )
        assert time.gaps == pytest.approx(np.full((1, 3), expected))
    with pytest.raises(ConfigError, match="--trials: found 45, expected a multiple of 30"):
        levels_of_cohort([groups(3)], 45)


def test_virtual_study_without_trials_has_no_differences() -> None:
    """If nobody ever succeeds or falls, as with a short time limit, its table of groups is empty."""
    asked = [{"name": "on vs off", "first": ["on"], "second": ["off"]}]
    nothing, some = groups(3).iloc[:0], groups(3)
    assert differences(levels_of_cohort([nothing]), asked) == []
    for frames in ([nothing, some], [some, nothing]):
        (time,) = (one for one in differences(levels_of_cohort(frames), asked) if one.measure == "completion time")
        assert [np.isfinite(gaps).all() for gaps in time.gaps] == [len(frame) > 0 for frame in frames]


def test_differences_are_those_of_an_analysed_study_also_if_a_performer_lacks_a_condition() -> None:
    """A performer's own speed is no effect: only performers with both conditions count, as in the analysis."""
    blocks = [one for one in random_blocks(dyads=3, trials=5) if (one.performer, one.force) != ("D02A", "none")]
    study = made_study(blocks)
    found = differences(levels_of_cohort([group_rows(study, 1)] * 2), [asdict(one) for one in questions_of(study)])
    expected = {(one.measure.name, one.question.name): one.contrast for one in comparisons(study).parts}
    lacking = {"dyadic vs bimanual, haptics off", "haptics on vs off, dyadic vs bimanual"}
    assert len({one.contrast for one in found}) == 5
    for one in found:
        contrast = expected[one.measure, one.contrast]
        of_dyads = dict(zip(contrast.labels, contrast.differences, strict=True))
        gaps = [of_dyads.get(dyad, np.nan) for dyad in ("D01", "D02", "D03")]
        np.testing.assert_allclose(one.gaps, [gaps, gaps], rtol=1e-9, atol=1e-12)
        assert np.isnan(gaps[1]) == (one.contrast in lacking)


def test_results_state_their_assumptions(tmp_path: Path) -> None:
    found = list(powers([drawn()], [4, 24]))[::2]
    text = sentence(found, ASSUMED)
    assert text.startswith(f"With 24 dyads, a paired t test of peaks (on vs off; difference {found[1].effect:.3g}), ")
    assert "400 virtual studies of the plan short with 24 simulated dyads each" in text
    assert "below 0.8" in sentence(found[:1], ASSUMED)
    write(tmp_path, found, ASSUMED)
    assert "its 95 % confidence interval is" in text
    table = pd.read_csv(tmp_path / "power.csv")
    assert table["power"].tolist() == [flat(one)["power"] for one in found]
    assert (tmp_path / "power.png").read_bytes().startswith(b"\x89PNG")
    with pytest.raises(ConfigError, match=r"power.csv: already exists"):
        write(tmp_path, found, ASSUMED)


def test_sentence_names_the_number_of_dyads_whose_power_is_surely_enough() -> None:
    """A power of 0.81 from 100 studies may be one of 0.72: the how-to takes the lower limit."""
    one = replace(next(powers([drawn()], [8])), dyads=8, power=PowerRate.of(81, 100))
    two = replace(one, dyads=12, power=PowerRate.of(95, 100))
    assert one.power.low < 0.8 < two.power.low
    assert sentence([one, two], ASSUMED).startswith("With 12 dyads")
    assert "lower limit is below 0.8 with each simulated number" in sentence([one], ASSUMED)


def test_sentence_and_assumptions_say_that_a_test_cannot_reject() -> None:
    """Four dyads have 16 sign flips: p is at least 2 / 16."""
    four, eight = (replace(one) for one in list(powers([drawn()], [4, 8]))[1::2])
    assert (four.least_p, eight.least_p) == (0.125, 2 / 2**8)
    assert four.power.value == 0.0
    expected = "It cannot reject at this level: its smallest possible p is 0.125 with 4 dyads. "
    assert expected in sentence([four], ASSUMED)
    assert "cannot reject" not in sentence([eight], ASSUMED)
    about = dict(parts([four, eight], ASSUMED)[0]["rows"])
    assert (
        about["smallest possible p, exploratory permutation test, 4 dyads"]
        == "0.125; above 0.05, so the test cannot reject"
    )
    assert about["smallest possible p, exploratory permutation test, 8 dyads"] == "0.00781"


def test_sentence_gives_the_share_of_fits_that_did_not_converge() -> None:
    one = replace(next(powers([drawn()], [8])), unconverged=0.25)
    assert "In 25 % of the studies the fit did not converge. " in sentence([one], ASSUMED)
    assert flat(one)["unconverged"] == 0.25


def test_figure_says_what_its_marks_bars_and_lines_are() -> None:
    text = " ".join(draw(list(powers([drawn()], [4]))[:1], 0.01, "assumptions").get_supxlabel().split())
    assert "paired t test, exploratory, with 95 % Monte Carlo confidence intervals" in text
    assert "the significance level 0.01, and a power of 0.8" in text


def test_sentence_has_no_interval_where_there_is_none() -> None:
    """The width has no mean over one virtual study, and a permutation test has no interval."""
    one_study = Differences("peaks", "on vs off", "1", "difference", drawn().gaps[:1, :8])
    alone, _ = powers([one_study], [8])
    _, permutation = powers([drawn()], [8])
    for one in (alone, permutation):
        text = sentence([one], ASSUMED)
        assert "nan" not in text
        assert "its 95 % confidence interval" not in text
        assert f"has a power of {one.power.value:.2f}" in text


@pytest.mark.parametrize(
    ("options", "words"),
    [
        (["--dyads", "4,x"], "--dyads: found 4,x, expected whole numbers from 2"),
        (["--dyads", "1"], "--dyads: found 1"),
        (["--set", "participant.courage=1"], "courage"),
        (["--set", "participant.position_noise=-1"], "position_noise"),
        (["--cohort", "nowhere"], "nowhere: has no cohort.json"),
    ],
)
def test_invalid_options_are_refused(tmp_path: Path, options: list[str], words: str) -> None:
    done = CliRunner().invoke(app, ["power", "paper", "-o", str(tmp_path / "new"), *options])
    assert done.exit_code == 2
    assert words in done.stderr
