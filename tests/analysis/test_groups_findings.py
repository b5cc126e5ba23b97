"""Order of conditions, the unit of replication, and the setting of the time."""

import numpy as np
import pandas as pd
import pytest

from made_study import Block, made_study, times
from netboard.analysis.topics.groups import (
    comparisons,
    conditions,
    counted,
    estimate,
    estimated,
    of_dyads,
    of_performers,
    teams,
)


def test_conditions_have_a_fixed_order() -> None:
    study = made_study(
        [
            Block("D01", "D01", "dyadic", "unrelated", times(1)),
            Block("D01", "D01", "dyadic", "full", times(1), right_by="robot"),
            Block("D01", "D01", "dyadic", "full", times(1)),
            Block("D01", "D01", "dyadic", "none", times(1)),
            Block("D01", "D01A", "bimanual", "full", times(1)),
        ]
    )
    assert [one.label for one in conditions(study)] == [
        "bimanual, haptics on",
        "dyadic, haptics off",
        "dyadic, haptics on",
        "dyadic, unrelated force",
        "dyadic, robot partner, haptics on",
    ]
    assert teams(study) == ("bimanual", "dyadic", "dyadic, robot partner")


def test_dyad_value_is_the_unweighted_mean_of_its_performers() -> None:
    rows = pd.DataFrame(
        {"dyad": ["D01"] * 5 + ["D02"], "performer": ["A", "A", "A", "A", "B", "C"], "x": [1.0, 1, 1, 1, 5, 7]}
    )
    assert of_dyads(of_performers(rows, "x")).to_dict() == {"D01": 3.0, "D02": 7.0}


def test_interval_counts_only_dyads_with_a_value() -> None:
    found = estimate(pd.Series([1.0, 3.0, np.nan]), "real")
    assert (found.value, found.n, found.unit) == (2.0, 2, "dyad")
    assert found.high - found.value == pytest.approx(12.706, abs=1e-3)  # t of one degree of freedom; the SEM is 1


@pytest.mark.parametrize(
    ("values", "interval", "note"),
    [
        ([], "", "no dyad has a value"),
        ([1.0], "", "no interval from one dyad"),
        ([1, 2], "95 % t", ""),
        ([0, 0, 0], "", "no interval: every dyad has the same value, so the variation between them is unknown"),
    ],
)
def test_result_notes_why_its_interval_says_nothing(values: list[float], interval: str, note: str) -> None:
    found = estimated("topic", "quantity", "group", estimate(pd.Series(values, dtype=float), "real"), "s")
    assert (found.n, found.interval, found.note) == (len(values), interval, note)


def test_differences_use_only_dyads_with_both_conditions() -> None:
    study = made_study(
        [Block("D01", "D01", "dyadic", force, times(1)) for force in ("none", "full")]
        + [Block("D01", "D01A", "bimanual", "none", times(1))]
    )
    values = {
        "bimanual, haptics off": pd.Series({("D01", "D01A"): 1.0, ("D02", "D02A"): 2.0}),
        "dyadic, haptics off": pd.Series({("D01", "D01"): 4.0}),
        "dyadic, haptics on": pd.Series({("D01", "D01"): 3.0, ("D02", "D02"): 9.0}),
    }
    found = {group: differences.to_dict() for group, differences in comparisons(conditions(study), values)}
    assert found == {"dyadic, haptics on vs off": {"D01": -1.0}, "dyadic vs bimanual": {"D01": 3.0}}


FORCES_ALONE = [
    *(Block(dyad, f"{dyad}{who}", "bimanual", "none", times(1)) for dyad in ("D01", "D02") for who in "AB"),
    *(Block(dyad, f"{dyad}{who}", "bimanual", "full", times(1)) for dyad in ("D01", "D02") for who in "AB"),
    *(Block(dyad, dyad, "dyadic", "none", times(1)) for dyad in ("D01", "D02")),
]


def test_differences_use_the_same_performers_in_both_conditions() -> None:
    """A takes 3 s and B 9 s in all conditions; B of D01 lacks one condition."""
    slow, quick = {("D01", "D01B"): 9.0, ("D02", "D02B"): 9.0}, {("D01", "D01A"): 3.0, ("D02", "D02A"): 3.0}
    felt = {key: value for key, value in slow.items() if key[0] == "D02"}
    values = {
        "bimanual, haptics off": pd.Series(quick | slow),
        "bimanual, haptics on": pd.Series(quick | felt),
        "dyadic, haptics off": pd.Series({("D01", "D01"): 5.0, ("D02", "D02"): 5.0}),
    }
    every = conditions(made_study(FORCES_ALONE))
    found = {group: differences.to_dict() for group, differences in comparisons(every, values)}
    assert found["bimanual, haptics on vs off"] == {"D01": 0.0, "D02": 0.0}
    assert found["dyadic vs bimanual"] == {"D01": -1.0, "D02": -1.0}
    exchanged = {
        "bimanual, haptics off": values["bimanual, haptics on"],
        "bimanual, haptics on": values["bimanual, haptics off"],
    }
    found = {group: differences.to_dict() for group, differences in comparisons(every, values | exchanged)}
    assert found["dyadic vs bimanual"] == {"D02": -1.0}  # D01 is one of two people only


FAILED = [
    {"trial": 1, "attempt": 1, "outcome": "fell", "duration": 10.0},
    {"trial": 1, "attempt": 2, "completion": 2.0, "duration": 3.5},
    {"trial": 2, "attempt": 1, "completion": 3.0, "duration": 4.5},
]


@pytest.mark.parametrize(("time", "expected"), [("successful_attempt", [2.0, 3.0]), ("all_attempts", [12.0, 3.0])])
def test_failed_attempts_add_time_if_configured(time: str, expected: list[float]) -> None:
    study = made_study([Block("D01", "D01", "dyadic", "none", FAILED)], f'summaries.time="{time}"')
    assert counted(study)["completion"].tolist() == expected


def test_failed_attempts_of_an_excluded_trial_are_ignored() -> None:
    study = made_study(
        [Block("D01", "D01", "dyadic", "none", FAILED)], 'summaries.time="all_attempts"', "exclusions.warm_up=1"
    )
    assert counted(study)["completion"].tolist() == [3.0]
