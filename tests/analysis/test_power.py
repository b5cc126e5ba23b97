"""Power of contrasts: the closed form of a paired t test, Wilson's interval, and clear errors."""

from math import gamma, sqrt
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from scipy import stats
from statsmodels.stats.power import TTestPower
from statsmodels.stats.proportion import proportion_confint
from typer.testing import CliRunner

from netboard.analysis.cohort.power import PERMUTATION, T_TEST, Differences, Rate, differences, powers
from netboard.analysis.cohort.report import Assumptions, flat, sentence, write
from netboard.analysis.statistics.contrasts import condition_contrast
from netboard.base.errors import ConfigError, RecordingError
from netboard.services.cli import app

ASSUMED = Assumptions("short", "0.1.0", "a" * 64, 1, 400, 24, 0.05, [("kp", "1/s2", 2.0, 1.5, 2.5)])
MEAN, SD = 0.3, 0.5


def drawn(ratio: bool = False) -> Differences:
    gaps = np.random.default_rng(7).normal(MEAN, SD, (400, 24))
    return Differences("peaks", "on vs off", "1", ratio, gaps)


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
    found = {one.test: one for one in powers([Differences("m", "c", "s", False, gaps)], [8])}
    own = condition_contrast(
        [*gaps[0], *np.zeros(8)], [*range(8)] * 2, [True] * 8 + [False] * 8, np.random.default_rng(0), name="c"
    )
    assert found[T_TEST].power.value == (own.t.p <= 0.05)
    assert found[PERMUTATION].power.value == (own.permutation.p <= 0.05)
    assert found[T_TEST].effect == pytest.approx(own.difference.value)


def test_interval_width_of_ratios_is_a_ratio() -> None:
    (plain, _), (ratio, _) = (list(powers([drawn(kind)], [8])) for kind in (False, True))
    assert ratio.effect == pytest.approx(np.exp(plain.effect))
    assert ratio.width == pytest.approx(np.exp(plain.width))
    assert (ratio.power, ratio.false_positives) == (plain.power, plain.false_positives)


@pytest.mark.parametrize(("hits", "total"), [(0, 10), (7, 10), (200, 200)])
def test_monte_carlo_interval_equals_wilson(hits: int, total: int) -> None:
    found = Rate.of(hits, total)
    assert (found.low, found.high) == pytest.approx(proportion_confint(hits, total, method="wilson"), abs=1e-12)


def groups(dyads: int) -> pd.DataFrame:
    rows = [
        (f"D{dyad:02d}", force, group) for dyad in range(1, dyads + 1) for force in ("on", "off") for group in (1, 2)
    ]
    table = pd.DataFrame(rows, columns=["dyad", "condition", "group"]).assign(performer="P", trials=30, attempts=30)
    names = ("falls", "movements", "peaks", "cooperative", "competitive", "single", "still", "delay_20")
    return table.assign(**dict.fromkeys(names, 1.0), log_completion=table["group"] * (table["condition"] == "on"))


def test_fewer_trials_use_the_first_groups() -> None:
    asked = [{"name": "on vs off", "first": ["on"], "second": ["off"]}]
    for trials, expected in ((0, 1.5), (30, 1.0), (60, 1.5)):
        (time,) = (one for one in differences([groups(3)], asked, trials) if one.measure == "completion time")
        assert time.gaps == pytest.approx(np.full((1, 3), expected))
    with pytest.raises(ConfigError, match="--trials: found 45, expected a multiple of 30"):
        differences([groups(3)], asked, 45)


def test_results_state_their_assumptions(tmp_path: Path) -> None:
    found = list(powers([drawn()], [4, 24]))[::2]
    text = sentence(found, ASSUMED)
    assert text.startswith(f"With 24 dyads, a paired t test of peaks (on vs off; difference {found[1].effect:.3g})")
    assert "400 virtual studies of the plan short with 24 simulated dyads each" in text
    assert "below 0.8" in sentence(found[:1], ASSUMED)
    write(tmp_path, found, ASSUMED)
    table = pd.read_csv(tmp_path / "power.csv")
    assert table["power"].tolist() == [flat(one)["power"] for one in found]
    assert (tmp_path / "power.png").read_bytes().startswith(b"\x89PNG")
    with pytest.raises(RecordingError, match=r"power.csv: already exists"):
        write(tmp_path, found, ASSUMED)


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
