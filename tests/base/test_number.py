"""A number is what people mean by one; what only Python takes for one is refused."""

import math

import pytest

from netboard.base.number import number_of, whole_of

LITERALS = (
    "1_1",
    "0.0_1",
    "1e1_0",
    "٣",
    "１",
    "0x10",
    "1j",
    "True",
    "",
    " ",
    "1 2",
    "1,5",
    "--1",
    "1e",
    "e5",
    ".",
    "+",
)


@pytest.mark.parametrize("word", ["0", "-0", "+1", "007", "1.", ".5", "-1.5e-3", "2E+12", "1e308"])
def test_decimal_numbers_are_read(word: str) -> None:
    assert number_of(word) == float(word)


@pytest.mark.parametrize("word", [*LITERALS, "inf", "-inf", "nan", "infinity", "1e999", " 1"])
def test_anything_else_is_no_number(word: str) -> None:
    with pytest.raises(ValueError, match="is no finite number"):
        number_of(word)


@pytest.mark.parametrize("word", ["0", "-0", "+1", "007", "-9223372036854775808"])
def test_whole_numbers_are_read(word: str) -> None:
    assert whole_of(word) == int(word)
    assert math.isfinite(whole_of(word))


@pytest.mark.parametrize("word", [*LITERALS, "1.0", "1e3", "2.01921E+12", "nan", "1" * 20])
def test_anything_else_is_no_whole_number(word: str) -> None:
    with pytest.raises(ValueError, match="is no whole number"):
        whole_of(word)
