"""Columns of cells are read by strict rules, thousands at a time as one by one."""

from math import inf, isnan, nan

import numpy as np
import pytest

from netboard.recording.importing.cells import Rule, WrongCell, numbers_in, plain_rows, whole_numbers_in

LITERALS = ["1_1", "0.0_1", "٣", "0x10", "True", "1 2", "1,5", "1e", "infinity"]
NUMBERS: dict[Rule, dict[str, float]] = {
    "measured": {"1.5": 1.5, "-2E-3": -2e-3, " 7 ": 7, "": nan, "NaN": nan, "nan": nan},
    "complete": {"1.5": 1.5, "-2E-3": -2e-3, " 7 ": 7},
    "exported": {"1.5": 1.5, "-2e-03": -2e-3, "nan": nan, "inf": inf, "-inf": -inf},
}
WRONG_NUMBERS: dict[Rule, list[str]] = {
    "measured": [*LITERALS, "inf", "-inf", "1e999", "NA"],
    "complete": [*LITERALS, "inf", "nan", "", "1e999"],
    "exported": [*LITERALS, "", "1e999"],
}
WHOLE: dict[Rule, dict[str, int]] = {
    "measured": {"3": 3, "-1": -1, "3.0": 3, "": 0, "nan": 0, " 4": 4},
    "exported": {"3": 3, "-1": -1, str(2**63 - 1): 2**63 - 1},
}
WRONG_WHOLE: dict[Rule, list[str]] = {
    "measured": [*LITERALS, "1.5", "1e3", "2.01921E+12", str(2**63), "inf"],
    "exported": [*LITERALS, "3.0", "1e3", "2.01921E+12", str(2**63), "", "nan"],
}
SLOW = {"measured": "nan ", "complete": "1\t", "exported": "1\t"}
"""A cell that is not plain, with which a column is read cell by cell."""


@pytest.mark.parametrize("rule", NUMBERS)
@pytest.mark.parametrize("slow", [False, True])
def test_numbers_are_read(rule: Rule, slow: bool) -> None:
    for word, value in NUMBERS[rule].items():
        found = numbers_in([word, SLOW[rule]] if slow else [word], rule)[0]
        assert found == value or (isnan(found) and isnan(value)), word


@pytest.mark.parametrize("rule", NUMBERS)
@pytest.mark.parametrize("slow", [False, True])
def test_wrong_numbers_are_refused_with_their_place(rule: Rule, slow: bool) -> None:
    for word in WRONG_NUMBERS[rule]:
        with pytest.raises(WrongCell) as wrong:
            numbers_in([SLOW[rule] if slow else "1", word], rule)
        assert wrong.value.place == 1, word


@pytest.mark.parametrize("rule", WHOLE)
@pytest.mark.parametrize("slow", [False, True])
def test_whole_numbers_are_read(rule: Rule, slow: bool) -> None:
    for word, value in WHOLE[rule].items():
        assert whole_numbers_in([word, "1\t"] if slow else [word], rule)[0] == value, word


@pytest.mark.parametrize("rule", WHOLE)
@pytest.mark.parametrize("slow", [False, True])
def test_wrong_whole_numbers_are_refused_with_their_place(rule: Rule, slow: bool) -> None:
    for word in WRONG_WHOLE[rule]:
        with pytest.raises(WrongCell) as wrong:
            whole_numbers_in(["1\t" if slow else "1", word], rule)
        assert wrong.value.place == 1, word


def test_columns_of_a_parquet_file_follow_the_same_rules() -> None:
    assert whole_numbers_in(np.array([1.0, nan, 3.0]), "measured").tolist() == [1, 0, 3]
    assert numbers_in(np.array([1, 2]), "complete").tolist() == [1.0, 2.0]
    assert whole_numbers_in([1, None, 2.0], "measured").tolist() == [1, 0, 2]
    assert isnan(numbers_in([None, 1.5], "measured")[0])
    for cells in (np.array([1.5]), np.array([1e16]), np.array([inf]), [True]):
        with pytest.raises(WrongCell):
            whole_numbers_in(cells, "measured")
    for column in (np.array([1.0, nan]), [1, None]):
        with pytest.raises(WrongCell):
            whole_numbers_in(column, "exported")
    with pytest.raises(WrongCell):
        numbers_in(np.array([1.0, nan]), "complete")
    with pytest.raises(WrongCell):
        numbers_in(np.array([1.0, inf], np.float32), "measured")


@pytest.mark.parametrize("separator", [",", ";", "\t"])
def test_plain_lines_are_read_as_their_cells_one_by_one(separator: str) -> None:
    cells = ["1.5", "-2E-3", " 7 ", "+.5", "5.", "1e-400", "0.1234567890123456789"]
    lines = [separator.join(cells) + "\r\n", "\n", separator.join(reversed(cells))]
    found = plain_rows(lines, separator)
    assert found is not None
    assert found.tolist() == [list(map(float, cells)), list(map(float, reversed(cells)))]


@pytest.mark.parametrize("word", [*WRONG_NUMBERS["complete"], "1e5e", "--1", "1.2.3", "- 1", "1+1", ".", "e5", " "])
def test_line_with_a_wrong_cell_is_not_read_as_plain(word: str) -> None:
    assert plain_rows(["1;2\n", f"3;{word}\n"], ";") is None


def test_rows_of_another_length_are_not_read_as_plain() -> None:
    assert plain_rows(["1,2\n", "3\n"], ",") is None
