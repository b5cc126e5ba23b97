"""What participants answered to "was that a person?", beside each kind of partner."""

from collections.abc import Mapping, Sequence
from dataclasses import replace

import pytest

from made_study import Block, made_study, times
from netboard.analysis.extraction.answers import answers
from netboard.analysis.extraction.study import StudyData
from netboard.analysis.statistics.detection import clustered_d_prime
from netboard.analysis.topics.recognition import ROBOTS, opinions, picture
from netboard.analysis.topics.result import table_of
from netboard.base.tables.questionnaires import ANSWERS
from netboard.network.protocol.records import EventRecord

Given = Mapping[str, Sequence[str]]
"""Answers by what moved the other end: p, a person, or r, a program."""

WORDS = {"p": "a person", "r": "a program"}


def block(dyad: str, given: Given, **changes: object) -> Block:
    """A recording whose participants answered, each another one."""
    rows = [
        {
            "participant": f"{dyad}{other}{number}",
            "station": "left",
            "other": other,
            "questionnaire": "who",
            "question": "opinion",
            "answer": WORDS[answer],
            "complete": 1,
            **changes,
        }
        for other, own in given.items()
        for number, answer in enumerate(own)
    ]
    return Block(dyad, dyad, "dyadic", "full", times(1.0, 2.0), right_by=f"{dyad}B", answers=rows)


def study() -> StudyData:
    first = block("D01", {"person": "pppr", "leader": "prrr", "game": "pprr"})
    second = block("D02", {"person": "pprr", "leader": "rrrr", "game": "pppr"})
    third = block("D03", {"person": "pppp", "leader": "ppr", "game": "pprr"})
    return made_study([first, second, third])


def test_answer_that_came_in_the_next_recording_is_about_its_own_block() -> None:
    first = block("D01", {"person": ""})
    late = {**block("D01", {"lqg": "p"}).answers[0], "participant": "P1", "block": 1}
    own = {**late, "other": "leader", "answer": WORDS["r"], "block": 2}
    second = replace(first, force="none", answers=[late, own])
    study = made_study([first, second])
    assert study.answers[["block", "force", "haptics"]].to_numpy().tolist() == [[1, "full", 1], [2, "none", 0]]
    assert {one.partner: one.share.value for one in opinions(study).parts} == {"leader": 0.0, "lqg": 1.0, ROBOTS: 0.5}


def test_answer_about_a_block_without_a_recording_has_no_condition() -> None:
    (found,) = made_study([block("D01", {"lqg": "p"}, block=7)]).answers.to_dict("records")
    assert (found["block"], found["force"], found["haptics"]) == (7, "", -1)


def test_shares_are_means_of_dyads_with_wilsons_interval() -> None:
    found = {one.partner: one for one in opinions(study()).parts}
    assert list(found) == ["person", "game", "leader", ROBOTS]
    assert found["person"].dyads == (0.75, 0.5, 1.0)
    assert found["person"].share.value == pytest.approx(0.75)
    assert found["leader"].share.value == pytest.approx((0.25 + 0.0 + 2 / 3) / 3)
    assert (found["leader"].answers, found[ROBOTS].answers) == (11, 23)
    assert found["person"].share.method == "Wilson"
    assert 0.0 < found["person"].share.low < 0.75 < found["person"].share.high < 1.0


def test_sensitivity_compares_people_with_each_kind_of_robot_and_with_all() -> None:
    found = {one.partner: one.sensitivity for one in opinions(study()).parts}
    assert found["person"] is None
    assert found["leader"] == clustered_d_prime([(3, 4, 1, 4), (2, 4, 0, 4), (4, 4, 2, 3)])
    assert found[ROBOTS] == clustered_d_prime([(3, 4, 3, 8), (2, 4, 3, 8), (4, 4, 4, 7)])


def test_without_people_there_are_shares_but_no_sensitivity() -> None:
    found = opinions(made_study([block("D01", {"lqg": "pr"}), block("D02", {"lqg": "rr"})])).parts
    assert [(one.partner, one.sensitivity) for one in found] == [("lqg", None)]


def test_last_answer_counts_and_other_questions_and_own_hands_do_not() -> None:
    changed = block("D01", {"person": "pr"}, participant="D01A")
    others = [block("D02", {"person": "p"}, question="age"), block("D03", {"own": "p"}), block("D04", {"person": "p"})]
    (found,) = opinions(made_study([changed, *others])).parts
    assert found.dyads == (0.0, 1.0)


def test_study_without_the_question_has_no_results_and_says_so() -> None:
    nothing = made_study([Block("D01", "D01", "dyadic", "full", times(1.0), right_by="D01B")])
    assert opinions(nothing).results == ()
    assert picture(nothing).figure is None
    assert "No participant was asked" in picture(nothing).caption


def test_results_have_their_intervals_and_units_of_replication() -> None:
    table = table_of(opinions(study()).results).set_index(["quantity", "group"])
    share = table.loc[('share of answers "a person"', "leader")]
    assert (share["interval"], share["n"], share["of"], share["unit"]) == ("95 % Wilson", 3, "dyad", "1")
    sensitivity = table.loc[("sensitivity d'", "person vs leader")]
    assert (sensitivity["interval"], sensitivity["n"]) == ("95 % jackknife", 3)
    assert sensitivity["low"] < sensitivity["value"] < sensitivity["high"]


def test_figure_has_a_row_for_each_partner() -> None:
    drawn = picture(study())
    assert drawn.figure is not None
    shares = drawn.figure.axes[0]
    assert [label.get_text() for label in shares.get_yticklabels()] == ["person", "game", "leader", ROBOTS]
    assert "23 answers" in drawn.caption
    assert "jackknife" in drawn.caption


def test_answers_of_a_recording_are_rows_of_its_table() -> None:
    details = {"station": "left", "block": "1", "label": "", "participant": "P1", "partner": "lqg", "complete": "true"}
    details |= {"seconds": "3.0", "who.opinion": "a program", "who.confidence": "80"}
    (opinion, confidence) = answers("one", [EventRecord(0, 1, 2, ANSWERS, details)], {})
    assert (opinion["recording"], opinion["other"], opinion["answer"]) == ("one", "lqg", "a program")
    assert (confidence["question"], confidence["value"], confidence["complete"]) == ("confidence", 80.0, 1)
