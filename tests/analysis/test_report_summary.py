"""The sentences of the summary agree with the numbers and exist only for data of the study."""

from collections.abc import Mapping
from pathlib import Path

import pandas as pd
import pytest

from made_study import SMALL, made_study, random_blocks
from netboard.analysis.extraction.settings import parse
from netboard.analysis.extraction.study import study_of
from netboard.analysis.report.numbers import after, between, unit_of, written
from netboard.analysis.report.summary import THEMES, Main, few, summary
from netboard.analysis.topics.everything import results_of
from netboard.analysis.topics.result import Result, table_of
from netboard.analysis.topics.units import read_in
from rehearsed_study import measured, rehearse

NAN = float("nan")
PAIRS = [(theme.topic, quantity) for theme in THEMES for quantity in theme.quantities]


def row(value: float, low: float = NAN, high: float = NAN, **columns: object) -> Result:
    usual: dict[str, object] = {
        "topic": "contrasts",
        "quantity": "completion time: ratio",
        "group": "dyadic, haptics on vs off",
        "unit": "1",
        "interval": "95 % t" if low == low else "",  # noqa: PLR0124  # NaN differs from itself
        "n": 4,
        "of": "dyad",
    }
    return Result(value=value, low=low, high=high, **(usual | columns))  # type: ignore[arg-type]


def summary_of(*results: Result) -> Main:
    (only,) = summary(table_of(results), {})
    return only


@pytest.fixture(scope="module")
def study_results() -> dict[str, pd.DataFrame]:
    """All results of a made-up study, by the setting of its variance."""
    return {
        kind: results_of(made_study(random_blocks(), *SMALL, f'summaries.variance="{kind}"'))
        for kind in ("each", "generalised")
    }


@pytest.mark.slow
@pytest.mark.parametrize(("topic", "quantity"), PAIRS)
def test_study_has_all_quantities_of_the_summary(
    topic: str, quantity: str, study_results: Mapping[str, pd.DataFrame]
) -> None:
    found = study_results["generalised" if "generalised" in quantity else "each"]
    mine = found[(found["topic"] == topic) & (found["quantity"] == quantity)]
    assert mine["value"].notna().any()


def test_every_sentence_and_column_of_the_summary_is_used(study_results: Mapping[str, pd.DataFrame]) -> None:
    for found in study_results.values():
        shown = {one.picture: one for one in summary(found, {})}
        assert list(shown) == [theme.picture for theme in THEMES]
        for theme in THEMES:
            patterns = {
                s.lead.partition("{")[0] for s in theme.patterns if s.none and (s.quantity in set(found.quantity))
            }
            assert all(any(text.startswith(lead) for text in shown[theme.picture].sentences) for lead in patterns)
            headings = [one.title for one in theme.headings if set(one.quantities) & set(found["quantity"])]
            columns = [column.title.partition(" [")[0] for column in shown[theme.picture].table.columns]
            assert columns == ["Group", *headings, "n"]
            assert all(cell for line in shown[theme.picture].table.rows for cell in (line[0], line[-1]))


@pytest.mark.slow
def test_rehearsed_study_has_a_summary_of_every_topic(tmp_path: Path) -> None:
    rehearse(tmp_path, blocks=(1, 2, 3, 4, 9, 10), trials=4)
    readings = parse("", overrides=("summaries.ends=1", "summaries.group=3"))
    found = results_of(study_of(measured(tmp_path, readings), readings))
    for theme in THEMES:
        for quantity in theme.quantities:
            there = ((found["topic"] == theme.topic) & (found["quantity"] == quantity)).any()
            assert there == ("generalised" not in quantity)
    assert [one.picture for one in summary(found, {})] == [theme.picture for theme in THEMES]


def test_ratio_is_compared_with_one() -> None:
    found = summary_of(
        row(1.1021, 1.0182, 1.1929, group="bimanual, haptics on vs off"), row(0.93434, 0.77152, 1.1315)
    ).sentences
    assert found == (
        "With haptics on, bimanual trials took 1.10 times as long as with haptics off (95 % t: 1.02 to 1.19, "
        "4 dyads). The whole interval is above 1.",
        "With haptics on, dyadic trials took 0.93 times as long as with haptics off (95 % t: 0.77 to 1.13, 4 dyads). "
        "The data are compatible with no difference (1) and with every other value in the interval.",
    )


def test_single_dyad_has_no_interval() -> None:
    (found,) = summary_of(row(0.9, n=1)).sentences
    assert found.endswith("haptics off (1 dyad). There is no confidence interval, so its uncertainty is unknown.")


@pytest.mark.parametrize(
    ("dyads", "least"), [(4, "within dyads is 0.125, so no such test"), (16, "within dyads is 0.000031."), (17, "")]
)
def test_smallest_p_is_stated_while_tests_are_exact(dyads: int, least: str) -> None:
    assert least in few(dyads)
    assert (" p " in few(dyads)) == bool(least)


def test_robot_partner_is_named() -> None:
    (found,) = summary_of(row(0.9, 0.8, 0.95, group="dyadic, robot partner, haptics on vs off")).sentences
    assert "dyadic trials with the robot partner took 0.90 times" in found
    assert found.endswith("The whole interval is below 1.")


def test_level_of_a_factor_is_no_partner() -> None:
    (found,) = summary_of(row(0.9, 0.8, 0.95, group="dyadic, still partner, mass light, haptics on vs off")).sentences
    assert "dyadic trials with the still partner, mass light took 0.90 times" in found
    (found,) = summary_of(row(0.9, 0.8, 0.95, group="dyadic, mass light, haptics on vs off")).sentences
    assert "dyadic trials with mass light took 0.90 times" in found


def test_level_is_stated_only_without_a_difference() -> None:
    share = {"topic": "classes", "quantity": "share of cooperative movement"}
    level = row(0.503, 0.412, 0.594, group="dyadic, haptics on", **share)
    assert summary_of(level).sentences == (
        "In the condition “dyadic, haptics on”, the share of cooperative movement was 50.3\u00a0% "
        "(95 % t: 41.2 to 59.4, 4 dyads).",
    )
    (found,) = summary_of(level, row(0.103, 0.05, 0.156, **share)).sentences
    assert (
        "was 10.3\u00a0%\u00a0points in dyadic trials (95 % t: 5.0 to 15.6, 4 dyads). The whole interval is above 0."
        in found
    )


@pytest.mark.parametrize(("count", "words"), [(1, "trial"), (30, "30 trials")])
def test_change_names_the_compared_trials(count: int, words: str) -> None:
    change = {"topic": "learning", "quantity": "change of completion time", "unit": "s"}
    (found,) = summary_of(row(-1.0, -2.0, 0.5, group=f"dyadic, last {count} vs first {count}", **change)).sentences
    assert found.startswith(f"From the first to the last {words}, completion time changed by −1.00")


def test_table_shows_first_and_last_groups_of_trials() -> None:
    spread = {"topic": "strategy", "quantity": "variance of distance", "unit": "m2"}
    groups = [f"{team}, trials {k} to {k + 29}" for team in ("bimanual", "dyadic") for k in (1, 31, 61)]
    table = summary_of(*(row(0.002, 0.001, 0.003, group=group, **spread) for group in groups)).table
    assert [line[0] for line in table.rows] == [groups[0], groups[2], groups[3], groups[5]]
    assert table.rows[0][1:] == ("2,000 (1,000 to 3,000)", "4 dyads")
    assert table.columns[1].title == "variance of distance [mm²]"


@pytest.mark.parametrize(
    ("unit", "quantity", "group", "symbol", "scale"),
    [
        ("s", "completion time", "dyadic", "s", 1),
        ("s", "delay at 20 %", "dyadic", "ms", 1000),
        ("s", "|lag|: difference", "dyadic", "ms", 1000),
        ("s", "reaction time", "dyadic", "ms", 1000),
        ("1", "|delay at 20 %|: p, Holm", "dyadic", "", 1),
        ("1", "share of stillness", "dyadic", "%", 100),
        ("1", "share of stillness", "dyadic, haptics on vs off", "% points", 100),
        ("1", "cooperative share: difference", "dyadic", "% points", 100),
        ("1", "cooperative share: g_z", "dyadic vs bimanual, haptics on", "", 1),
        ("1", "falls per attempt", "dyadic", "%", 100),
        ("1", "falls per attempt: ratio of odds", "haptics", "", 1),
        ("m", "ball along the board", "dyadic", "mm", 1e3),
        ("m2/s2", "variance of velocity", "dyadic", "mm²/s²", 1e6),
        ("N2 s", "effort", "dyadic", "N² s", 1),
        ("", "", "", "", 1),
    ],
)
def test_units_are_converted_for_readers(unit: str, quantity: str, group: str, symbol: str, scale: float) -> None:
    found = read_in(unit, quantity, group)
    assert (found.symbol, found.scale) == (symbol, scale)


@pytest.mark.parametrize(
    ("result", "text"),
    [
        (row(0.0465, 0.0387, 0.0543, quantity="delay at 20 %", unit="s"), "46.5 ms, 38.7 to 54.3"),
        (
            row(-0.00012, -0.00017, -0.00008, quantity="competitive share: difference"),
            "−0.012 % points, −0.017 to −0.008",
        ),
        (row(4.349, 0.827, 7.871, quantity="completion time", unit="s", interval="SD"), "4.35 s, ± 3.52"),
        (row(0.125, quantity="completion time: p, Holm"), "0.125, "),
        (row(0.000171, quantity="variance of distance", unit="m2"), "171 mm², "),
        (row(0.3, -0.8, 1.4, quantity="velocity peaks: difference"), "0.30, −0.80 to 1.40"),
    ],
)
def test_number_and_interval_have_the_same_decimals(result: Result, text: str) -> None:
    (mapping,) = table_of([result]).to_dict("records")
    shown = f"{written(mapping)[0]}{after(unit_of(mapping))}, {between(mapping)}"
    assert shown.replace("\u00a0", " ") == text
