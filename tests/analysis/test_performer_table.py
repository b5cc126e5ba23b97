"""One row for each performer in each condition, from that performer's trials only."""

from dataclasses import replace

import numpy as np
import pytest

from made_study import Block, made_study, times
from netboard.analysis.extraction.settings import Readings
from netboard.analysis.extraction.study import StudyData, study_of
from netboard.analysis.topics.performers import PEOPLE, people_of
from netboard.analysis.topics.result import cached
from rehearsed_study import measured, rehearse

pytestmark = pytest.mark.slow


@pytest.fixture(scope="module")
def study(tmp_path_factory: pytest.TempPathFactory) -> StudyData:
    where = tmp_path_factory.mktemp("study")
    rehearse(where)
    return study_of(measured(where, Readings()), Readings())


def test_table_lists_all_performers_with_their_partners(study: StudyData) -> None:
    people = people_of(study)
    assert list(people) == [field.name for field in (*PEOPLE, *study.factor_fields)]
    assert set(people["factor_haptics"]) == {"on", "off"}
    assert len(people) == 8
    alone = people[people["configuration"] == "bimanual"]
    assert dict(zip(alone["performer"], alone["partner"], strict=True)) == {
        "D01A": "D01B",
        "D01B": "D01A",
        "D02A": "D02B",
        "D02B": "D02A",
    }
    assert set(people.loc[people["configuration"] == "dyadic", "partner"]) == {""}


def test_row_summarises_the_performers_own_trials(study: StudyData) -> None:
    for row in people_of(study).to_dict("records"):
        chosen = (study.trials["performer"] == row["performer"]) & (study.trials["condition"] == row["condition"])
        own = study.trials[chosen]
        done = own[own["outcome"] == "success"]
        assert row["trials"] == len(done) == 3
        assert row["attempts"] - row["falls"] == len(done)
        np.testing.assert_allclose(row["completion"], np.mean(done["completion"]))
        np.testing.assert_allclose(row["log_completion"], np.mean(np.log(done["completion"])))
        np.testing.assert_allclose(sum(row[n] for n in ("cooperative", "competitive", "single", "still")), 1)
        signed = study.movements[(study.movements["performer"] == row["performer"]) & (study.movements["counts"] == 1)]
        signed = signed[signed["condition"] == row["condition"]]["delay_20"].to_numpy()
        np.testing.assert_allclose(row["signed_delay_20"], np.nanmean(signed))
        np.testing.assert_allclose(row["delay_20"], np.nanmean(np.abs(signed)))


def test_failed_attempts_add_time_if_configured() -> None:
    trials = [
        {"trial": 1, "attempt": 1, "outcome": "fell", "duration": 4.0, "completion": np.nan},
        {"trial": 1, "attempt": 2, "duration": 4.5, "completion": 3.0},
        {"trial": 2, "attempt": 1, "duration": 4.5, "completion": 3.0},
    ]
    study = made_study([Block("D01", "D01", "dyadic", "none", trials)], 'summaries.time="all_attempts"')
    (row,) = people_of(study).to_dict("records")
    assert (row["completion"], row["completion_median"]) == (5.0, 5.0)
    assert row["completion_sd"] == pytest.approx(np.sqrt(8))


def test_participant_in_two_dyads_has_a_partner_in_each() -> None:
    study = made_study(
        [
            Block(dyad, performer, "bimanual", "none", times(3))
            for dyad, both in (("D01", ("P1", "P2")), ("D02", ("P1", "P3")))
            for performer in both
        ]
    )
    people = people_of(study)
    assert list(zip(people["dyad"], people["performer"], people["partner"], strict=True)) == [
        ("D01", "P1", "P2"),
        ("D01", "P2", "P1"),
        ("D02", "P1", "P3"),
        ("D02", "P3", "P1"),
    ]


def test_excluded_trials_are_in_no_mean(study: StudyData) -> None:
    cached = study.trials["counts"] * (study.trials["trial"] > 2)
    fewer = people_of(replace(study, trials=study.trials.assign(counts=cached)))
    assert set(fewer["trials"]) == {1}
    assert (fewer["completion"] == fewer["completion_median"]).all()
    assert fewer["completion_sd"].isna().all()


def test_costly_results_are_computed_once_per_study(study: StudyData) -> None:
    asked: list[StudyData] = []
    find = cached(lambda one: asked.append(one) or len(asked))  # type: ignore[func-returns-value]
    other = replace(study)
    assert [find(study), find(study), find(other), find(study), find(other)] == [1, 1, 2, 1, 2]


def test_results_of_another_process_are_adopted(study: StudyData) -> None:
    asked: list[StudyData] = []
    find = cached(lambda one: asked.append(one) or "computed")  # type: ignore[func-returns-value]
    assert find.kept(study) is None
    find.adopt(study, "adopted")
    assert (find(study), find.kept(study), find(replace(study))) == ("adopted", "adopted", "computed")
    assert len(asked) == 1
