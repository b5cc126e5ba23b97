"""Every public function of the analysis has tests marked as its evidence, and every mark is valid."""

from collections import Counter

import pytest
from analysis_evidence import DETAILS, KINDS, WITHOUT, all_evidence, public_functions, table
from hypothesis import settings

PROFILE = settings.default
"""The profile that is active when the modules of this folder are imported."""

FUNCTIONS = [f"{module}.{name}" for module, names in public_functions().items() for name in names]
EVIDENCE = all_evidence()
KNOWN = {(one.function, one.kind) for one in EVIDENCE}


@pytest.mark.parametrize("function", FUNCTIONS)
def test_every_public_function_has_evidence(function: str) -> None:
    has = {kind for kind in KINDS if {(function, kind)} & (KNOWN | WITHOUT.keys())}
    mark = f"mark a test in tests/analysis with it: @pytest.mark.evidence(KIND, {function.partition('.')[2]})"
    assert has & {"truth", "independent"}, f"no test against a known truth or an independent program; {mark}"
    assert "properties" in has, f"no test of its properties; {mark}"
    assert "disturbance" in has, f"no test of noise or missing samples; {mark}"


def test_evidence_marks_name_known_functions_and_details() -> None:
    for one in EVIDENCE:
        assert one.function in FUNCTIONS, one
        assert set(one.words) <= set(KINDS[one.kind]), one
        assert bool(one.words) == (one.kind in DETAILS), one
    assert [one for one, count in Counter(EVIDENCE).items() if count > 1] == []


def test_functions_with_evidence_are_not_exempt() -> None:
    assert WITHOUT.keys() & KNOWN == set()
    assert {function for function, _ in WITHOUT} <= set(FUNCTIONS)


def test_evidence_table_has_a_row_for_each_function() -> None:
    assert [line.split("`")[1] for line in table().splitlines() if line.startswith("| **`")] == [
        function.partition(".")[2] for function in FUNCTIONS
    ]


def test_hypothesis_examples_are_reproducible() -> None:
    assert PROFILE.derandomize
    assert PROFILE.database is None
