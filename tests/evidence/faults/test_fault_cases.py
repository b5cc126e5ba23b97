"""The list of fault cases, and the tables of their outcomes."""

from dataclasses import replace

import pytest

from evidence.faults.bench import CASES, Outcome, about, choose, parts_of, run_all
from evidence.faults.cases import PARTS
from evidence.faults.rigs import tampered
from evidence.faults.sites import PACE, Setup
from netboard.base.config import parse
from netboard.base.errors import ConfigError
from netboard.benchmarks.harness.results import BenchVerdict


def test_case_names_are_unique_and_every_part_has_cases() -> None:
    assert len({case.name for case in CASES}) == len(CASES)
    assert {case.part for case in CASES} == set(PARTS)


def test_every_case_states_its_fault_expectation_and_checks() -> None:
    assert [case.name for case in CASES if not (case.done and case.expected and case.checks)] == []


def test_no_case_changes_a_safety_limit(tmp_path) -> None:
    settings, _ = tampered(tmp_path)
    for case in CASES:
        config = parse("", "test", (*settings, *PACE, *case.setup.settings))
        own = parse("", "test", ("safety.arm_time=0.2",))
        assert config.safety == own.safety


def test_cases_are_selected_by_name_or_in_full_or_quick_form() -> None:
    assert [case.name for case in choose(["flood", "disk-full"], quick=True)] == ["flood", "disk-full"]
    assert choose([], quick=False) == list(CASES)
    assert 0 < len(choose([], quick=True)) < len(CASES)
    with pytest.raises(ConfigError, match="--case flod: there is no such case"):
        choose(["flod"], quick=False)


class Impossible(Setup):
    """A setup that is not available on this machine."""

    def refusal(self) -> str:
        return "not here"


def test_case_that_cannot_run_here_is_reported(tmp_path) -> None:
    case = replace(CASES[0], setup=Impossible("nowhere"))
    (outcome,) = run_all([case], tmp_path, True, lambda _: None)
    assert (outcome.refusal, outcome.verdicts) == ("not here", ())
    (part,) = parts_of([outcome])
    assert part.rows[0][-1] == "not run: not here"
    assert part.verdicts == []


def test_case_holds_if_all_checks_hold_and_the_table_names_failures() -> None:
    good, bad = BenchVerdict("it falls", True, "after 10 ms"), BenchVerdict("it is gentle", False, "1.2 of it")
    sound = Outcome(CASES[0], (good, good), (10.0, 60.0, 0.5, 1, 0))
    broken = Outcome(CASES[1], (good, bad))
    (part,) = parts_of([broken, sound])
    assert [row[0] for row in part.rows] == [CASES[0].name, CASES[1].name]
    assert [row[-1] for row in part.rows] == ["yes", "NO"]
    assert part.verdicts[0].found == "after 10 ms; after 10 ms"
    assert part.verdicts[1].found == "NOT it is gentle: 1.2 of it"
    assert [case["name"] for case in about([broken, sound], True)["cases"]] == [CASES[1].name, CASES[0].name]
