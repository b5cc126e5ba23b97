"""Every public function of the analysis has a mark with its evidence, and every mark is valid."""

from collections import Counter

import pytest
from analysis_evidence import DETAILS, KINDS, WITHOUT, all_evidence, public_functions, table
from hypothesis import settings

PROFILE = settings.default
"""That in force where the modules of this folder are imported."""

FUNCTIONS = [f"{module}.{name}" for module, names in public_functions().items() for name in names]
EVIDENCE = all_evidence()
KNOWN = {(one.function, one.kind) for one in EVIDENCE}


@pytest.mark.parametrize("function", FUNCTIONS)
def test_a_function_has_its_evidence(function: str) -> None:
    has = {kind for kind in KINDS if {(function, kind)} & (KNOWN | WITHOUT.keys())}
    assert has & {"truth", "independent"}, "what it returns is held against nothing"
    assert "properties" in has, "nothing is known of what must not matter to it"
    assert "disturbance" in has, "nothing is known of what noise and holes do to it"


def test_marks_are_of_functions_and_in_the_words_that_there_are() -> None:
    for one in EVIDENCE:
        assert one.function in FUNCTIONS, one
        assert set(one.words) <= set(KINDS[one.kind]), one
        assert bool(one.words) == (one.kind in DETAILS), one
    assert [one for one, count in Counter(EVIDENCE).items() if count > 1] == []


def test_nothing_is_excused_that_is_shown() -> None:
    assert WITHOUT.keys() & KNOWN == set()
    assert {function for function, _ in WITHOUT} <= set(FUNCTIONS)


def test_the_table_has_a_row_for_each_function() -> None:
    assert [line.split("`")[1] for line in table().splitlines() if line.startswith("| **`")] == [
        function.partition(".")[2] for function in FUNCTIONS
    ]


def test_examples_are_the_same_each_time() -> None:
    assert PROFILE.derandomize
    assert PROFILE.database is None
