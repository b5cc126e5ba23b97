"""The table of faults, and the tables of their outcomes."""

from dataclasses import replace

import pytest

from netboard.base.config import parse
from netboard.base.errors import ConfigError
from netboard.benchmarks.faults.bench import Outcome, about, parts_of, play_all
from netboard.benchmarks.faults.case import PARTS
from netboard.benchmarks.faults.cases import CASES, choose
from netboard.benchmarks.faults.rigs import tampered
from netboard.benchmarks.faults.sites import PACE, Setup
from netboard.benchmarks.harness.results import Verdict


def test_every_case_has_a_name_of_its_own_and_a_table() -> None:
    assert len({case.name for case in CASES}) == len(CASES)
    assert {case.part for case in CASES} == set(PARTS)


def test_every_case_says_what_is_done_and_what_must_happen_and_checks_it() -> None:
    assert [case.name for case in CASES if not (case.done and case.expected and case.checks)] == []


def test_no_case_changes_a_limit_of_the_safety_chain(tmp_path) -> None:
    settings, _ = tampered(tmp_path)
    for case in CASES:
        config = parse("", "test", (*settings, *PACE, *case.setup.settings))
        own = parse("", "test", ("safety.arm_time=0.2",))
        assert config.safety == own.safety


def test_cases_are_chosen_by_name_or_all_or_the_short_form() -> None:
    assert [case.name for case in choose(["flood", "disk-full"], quick=True)] == ["flood", "disk-full"]
    assert choose([], quick=False) == list(CASES)
    assert 0 < len(choose([], quick=True)) < len(CASES)
    with pytest.raises(ConfigError, match="--case flod: there is no such case"):
        choose(["flod"], quick=False)


class Impossible(Setup):
    """A site that cannot be had."""

    def refusal(self) -> str:
        return "not here"


def test_what_cannot_be_played_here_is_said(tmp_path) -> None:
    case = replace(CASES[0], setup=Impossible("nowhere"))
    (outcome,) = play_all([case], tmp_path, True, lambda _: None)
    assert (outcome.refusal, outcome.verdicts) == ("not here", ())
    (part,) = parts_of([outcome])
    assert part.rows[0][-1] == "not run"
    assert "not here" in part.verdicts[0].found


def test_a_case_holds_if_everything_does_and_the_table_tells_what_does_not() -> None:
    good, bad = Verdict("it falls", True, "after 10 ms"), Verdict("it is gentle", False, "1.2 of it")
    whole = Outcome(CASES[0], (good, good), (10.0, 60.0, 0.5, 1, 0))
    broken = Outcome(CASES[1], (good, bad))
    (part,) = parts_of([broken, whole])
    assert [row[0] for row in part.rows] == [CASES[0].name, CASES[1].name]
    assert [row[-1] for row in part.rows] == ["yes", "NO"]
    assert part.verdicts[0].found == "after 10 ms; after 10 ms"
    assert part.verdicts[1].found == "NOT it is gentle: 1.2 of it"
    assert [case["name"] for case in about([broken, whole], True)["cases"]] == [CASES[1].name, CASES[0].name]
