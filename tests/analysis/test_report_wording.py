"""Numbers and names in a report are formatted correctly."""

import math
import unicodedata

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from netboard.analysis.report.numbers import written
from netboard.analysis.report.trials import _path
from netboard.analysis.report.wording import amount, css_text, decimals, plural, visible


@pytest.mark.parametrize(
    ("value", "text"),
    [
        (0.0, "0"),
        (5, "5"),
        (4320, "4,320"),
        (3.6149, "3.61"),
        (-0.0364, "−0.0364"),
        (12345.678, "12,346"),
        (0.000195, "0.000195"),
        (1.5e-9, "1.50 × 10^−9"),
        (float("nan"), "–"),
        (-math.inf, "−∞"),
        (np.int64(7), "7"),
    ],
)
def test_amounts_are_formatted(value: float, text: str) -> None:
    assert amount(value) == text


@pytest.mark.parametrize("p", [1.5e-9, 4.9e-7])
def test_tiny_p_is_not_written_as_zero(p: float) -> None:
    row = {"quantity": "completion time: p", "group": "haptics", "unit": "1", "interval": ""}
    text, *_ = written({**row, "value": p, "low": math.nan, "high": math.nan})
    base, power = text.replace("−", "-").split(" × 10^")
    assert float(f"{base}e{power}") == pytest.approx(p, rel=0.005)


def test_number_that_rounds_to_zero_has_no_sign() -> None:
    assert amount(-0.001, 1) == "0.0"


def test_positive_limit_of_a_wide_interval_is_not_written_as_zero() -> None:
    row = {"quantity": "completion time: ratio", "group": "haptics on vs off", "unit": "1", "interval": "95 % t"}
    assert written({**row, "value": 0.79, "low": 0.0224, "high": 27.9}) == ("0.79", "0.02", "27.90")
    assert written({**row, "value": 1.26, "low": 0.0, "high": 27.9})[1] == "0.0"


def test_largest_number_determines_the_decimals() -> None:
    assert decimals(0.003, -0.4, 0.5) == 3
    assert decimals(float("nan")) == 0
    assert decimals(1e-12) == 6


def test_counted_nouns_have_their_plural() -> None:
    assert [plural(1, "dyad"), plural(4, "dyad"), plural(2, "person")] == ["1 dyad", "4 dyads", "2 people"]


@pytest.mark.slow
@given(st.text())
def test_visible_text_has_no_invisible_characters(text: str) -> None:
    shown = visible(text)
    assert {unicodedata.category(c) for c in shown if c not in "\n\t"} & {"Cc", "Cf", "Cs", "Zl", "Zp"} == set()
    shown.encode("utf-8")
    assert visible(shown) == shown


@given(st.text())
def test_text_cannot_end_a_css_string(text: str) -> None:
    inside = css_text(text)[1:-1]
    assert not set(inside) & set("\"'<>\n")


def points_of(d: str) -> list[tuple[int, int]]:
    """The points of an SVG path with a start and relative steps."""
    start, _, steps = d.removeprefix("M").partition("l")
    numbers = [int(word) for word in steps.replace("-", " -").split()]
    points = [tuple(int(word) for word in start.split())]
    for dx, dy in zip(numbers[::2], numbers[1::2], strict=True):
        points.append((points[-1][0] + dx, points[-1][1] + dy))
    return points  # type: ignore[return-value]


@given(st.lists(st.tuples(st.integers(1, 3), st.integers(-4, 4)), min_size=1, max_size=40))
def test_svg_path_passes_through_all_points(steps: list[tuple[int, int]]) -> None:
    x, y = (np.cumsum([0, *(step[k] for step in steps)]) for k in (0, 1))
    drawn = points_of(_path(x, y))
    assert drawn[0] == (x[0], y[0])
    assert drawn[-1] == (x[-1], y[-1])
    assert set(drawn) <= set(zip(x.tolist(), y.tolist(), strict=True))
    np.testing.assert_array_equal(np.interp(x, *np.array(drawn).T), y)


def test_single_point_has_no_svg_path() -> None:
    assert _path(np.array([3]), np.array([4])) == ""
