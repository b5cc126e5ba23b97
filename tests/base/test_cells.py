"""Text cells of tables: no formula, and back to the same text; and no writer or reader of tables beside this module."""

import ast
import csv
import io
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from netboard.base.files.cells import MARKED, RUNS, CsvWriter, text_cell, text_of_cell, tsv_lines

TREE = Path(__file__).parent.parent.parent
FORMULAS = (
    *('=HYPERLINK("http://x", "y")', "@SUM(1+1)", "+1+1", "-2+3", "\t=1", "\r=1", "\n=1", "＝1"),
    *("'=1", "''", "'quoted'"),
)


@pytest.mark.parametrize("text", FORMULAS)
def test_formula_becomes_a_text_that_is_read_back(text: str) -> None:
    assert not text_cell(text).startswith(RUNS)
    assert text_of_cell(text_cell(text)) == text


@pytest.mark.parametrize("text", ["", "a", "2 N", "a=b", "don't", "'a", "'tis", "ü"])
def test_other_texts_are_read_as_they_are(text: str) -> None:
    assert text_of_cell(text) == text


@given(st.text(st.characters() | st.sampled_from("'=+-@\t\r\n"), max_size=8))
def test_every_text_is_read_back(text: str) -> None:
    assert text_of_cell(text_cell(text)) == text
    assert not text_cell(text).startswith(RUNS)


def test_csv_writer_marks_texts_and_leaves_numbers() -> None:
    file = io.StringIO(newline="")
    writer = CsvWriter(file)
    writer.row(["=name", "value"])
    writer.rows([("-1", -1.5), ("a", -2)])
    writer.columns([["@x"], [-3.25]], [True, False])
    rows = list(csv.reader(io.StringIO(file.getvalue(), newline="")))
    assert rows == [["'=name", "value"], ["'-1", "-1.5"], ["a", "-2"], ["'@x", "-3.25"]]


def test_tsv_lines_mark_texts_and_leave_numbers() -> None:
    assert list(tsv_lines([("=1", -1, -0.5)], str)) == ["'=1\t-1\t-0.5\n"]


def test_first_characters_are_those_that_owasp_lists() -> None:
    assert set("=+-@\t\r\n") <= set(RUNS) < set(MARKED)


def _calls(path: Path) -> set[str]:
    """Calls in a module by which a table could be written without this module."""
    found = set()
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        if isinstance(node, ast.Call) and isinstance(node.func, ast.Attribute):
            owner = node.func.value
            if node.func.attr in ("to_csv", "write_csv", "DictWriter", "savetxt"):
                found.add(node.func.attr)
            if isinstance(owner, ast.Name) and owner.id == "csv" and node.func.attr == "writer":
                found.add("csv.writer")
            if node.func.attr == "join" and isinstance(owner, ast.Constant) and owner.value in ("\t", ";"):
                found.add(f"{owner.value!r}.join")
    return found


def test_no_other_module_writes_tables() -> None:
    modules = [path for folder in ("src", "services") for path in (TREE / folder).rglob("*.py")]
    assert len(modules) > 300
    writers = {path.relative_to(TREE).as_posix(): calls for path in modules if (calls := _calls(path))}
    assert writers == {"src/netboard/base/files/cells.py": {"csv.writer", "'\\t'.join"}}
