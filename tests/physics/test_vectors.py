"""Arithmetic on states: compiled functions and plain Python give the same bits."""

import math
from typing import Any

import numpy as np
import pytest

from netboard.base.compiled import kernel
from netboard.physics.arithmetic.vectors import (
    affine,
    alike,
    blend,
    calm,
    dot,
    joined,
    places,
    plus,
    replaced,
    row,
    speeds,
    total,
)


def all_operations(x: Any, y: Any, w: Any, h: float, table: Any) -> Any:
    p, vp = places(x), speeds(x)
    return (
        plus(x, h, y),
        blend(x, h, (0.3, 1.7, -0.9), (x, y, w)),
        p,
        vp,
        total(p),
        dot(p, vp),
        alike(h, p),
        affine(h, 1.3, vp),
        joined(x[0], y[0], x[1], y[1], vp, p),
        replaced(x, 3, h),
        row(table, 1, x),
        calm((1e-250, -1e-300, x[2], 0.0)),
    )


compiled = kernel(all_operations)


@pytest.mark.slow
@pytest.mark.parametrize("length", [4, 6, 8, 12])
def test_compiled_and_plain_python_results_are_bit_identical(length: int) -> None:
    table = np.random.default_rng(length).normal(size=(3, length))
    x, y, w = (tuple(values) for values in table.tolist())
    assert compiled(x, y, w, 0.37, table) == all_operations(x, y, w, 0.37, table)


STATE = (1.0, 2.0, 3.0, 4.0, 5.0, 6.0, 7.0, 8.0)


def test_operations_give_the_expected_values() -> None:
    assert plus(STATE, 2.0, STATE) == tuple(3 * value for value in STATE)
    assert blend(STATE, 2.0, (0.5, 0.25), (STATE, STATE)) == tuple(2.5 * value for value in STATE)
    assert (places(STATE), speeds(STATE)) == ((5, 7), (6, 8))
    assert (total((1.0, 2.0, 4.0)), dot((1.0, 2.0), (3.0, 5.0))) == (7, 13)
    assert alike(3.0, (1.0, 2.0)) == (3, 3)
    assert affine(1.0, 2.0, (1.0, 2.0)) == (3, 5)
    assert joined(1.0, 2.0, 3.0, 4.0, (5.0, 7.0), (6.0, 8.0)) == STATE
    assert replaced(STATE, 5, 0.0) == (1, 2, 3, 4, 5, 0, 7, 8)
    assert calm((1e-201, -1e-250, 1e-199, -1.0)) == (0, 0, 1e-199, -1)
    assert row(np.array([[0.0] * 8, STATE]), 1, STATE) == STATE


def test_operations_without_balls_are_empty() -> None:
    board = STATE[:4]
    assert (places(board), speeds(board)) == ((), ())
    assert (total(()), dot((), ())) == (0, 0)
    assert joined(1.0, 2.0, 3.0, 4.0, (), ()) == board


def test_sums_are_evaluated_from_first_to_last() -> None:
    """The rounding shows the order of operations."""
    values = (1.0, 2.0**-53, 2.0**-53)
    assert total(values) == 1.0
    assert total(values[::-1]) == math.nextafter(1.0, 2.0)
    assert dot(values, (1.0, 1.0, 1.0)) == 1.0
