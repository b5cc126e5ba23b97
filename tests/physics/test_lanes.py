"""SIMD lanes give the same bits as floats and are stored at the right indices."""

from typing import Any

import numpy as np
import pytest

from netboard.base.compiled import kernel
from netboard.physics.arithmetic.simd import (
    applied,
    gathered,
    lane,
    lanes_at,
    larger,
    nearest,
    pair_at,
    put,
    smaller,
    spread,
    where_within,
    within,
)
from netboard.physics.arithmetic.written import listed, written


@kernel
def arithmetic(a: Any, b: Any, x: float, out: Any) -> None:
    one, other = lanes_at(a, 0, 8), lanes_at(b, 8, 8)
    result = (one + other) * x - one / other
    result -= 2 * other
    put(out, 0, -result)


@kernel
def conditional(a: Any, x: float, out: Any) -> None:
    result = lanes_at(a, 0, 8) if x > 0.0 else x
    put(out, 0, result)


@kernel
def moved(a: Any, out: Any) -> float:
    left, right = pair_at(a, 0, 4)
    put(out, 0, left)
    put(out, 4, spread(right, 2))
    put(out, 8, gathered((1.0, lane(right, 1)), 4))
    return lane(left, 3)


@kernel
def bounded(a: Any, bound: float) -> bool:
    return within(lanes_at(a, 0, 8), bound)


@kernel
def product(matrix: Any, a: Any, out: Any) -> None:
    put(out, 0, applied(matrix, 0, lanes_at(a, 0, 4), 8))


doubled = written("x, k", lambda n, k: listed([f"{k} * x[{i}]" for i in range(n)]))


@kernel
def twice(x: Any) -> Any:
    return doubled(x, 2)


@pytest.fixture
def values() -> Any:
    return np.random.default_rng(5).normal(size=16)


def test_lane_arithmetic_matches_float_arithmetic(values: Any) -> None:
    out = np.zeros(8)
    arithmetic(values, values, 0.3, out)
    for one, other, found in zip(values[:8].tolist(), values[8:].tolist(), out.tolist(), strict=True):
        assert found == -(((one + other) * 0.3 - one / other) - 2 * other)


@pytest.mark.parametrize("x", [1.0, -1.0])
def test_scalar_is_broadcast_to_lanes(values: Any, x: float) -> None:
    out = np.zeros(8)
    conditional(values, x, out)
    assert np.array_equal(out, values[:8] if x > 0 else [x] * 8)


@pytest.mark.slow
def test_lanes_are_loaded_from_and_stored_in_arrays(values: Any) -> None:
    out = np.zeros(12)
    assert moved(values, out) == values[6]
    assert np.array_equal(out, [*values[:8:2], *[values[5]] * 4, 1.0, values[3], 0.0, 0.0])


@pytest.mark.parametrize(
    ("worst", "expected"), [(1.0, True), (-1.0, True), (1.1, False), (-1.1, False), (np.nan, False)]
)
def test_within_requires_every_lane_in_bounds(worst: float, expected: bool) -> None:
    assert bounded(np.array([0.5, -0.2, 0.0, worst, 0.1, 0.3, 0.9, -0.9]), 1.0) is expected


def test_applied_computes_the_matrix_vector_product(values: Any) -> None:
    matrix, out = np.random.default_rng(6).normal(size=(4, 8)), np.zeros(8)
    product(matrix, values, out)
    assert out == pytest.approx(matrix.T @ values[:4], rel=1e-13)


def test_non_contiguous_array_is_rejected(values: Any) -> None:
    if hasattr(bounded, "py_func"):
        with pytest.raises(Exception, match="No implementation"):
            bounded(values[::2], 1.0)


def test_generated_code_depends_on_the_lengths_of_its_arguments() -> None:
    assert twice((1.0, 2.0, 3.0)) == (2.0, 4.0, 6.0)
    assert doubled((1.0, 2.0), 3) == (3.0, 6.0)


SPECIAL = np.array([-0.0, 0.0, -1.0, 1.0, np.inf, -np.inf, np.nan, 0.5, 2.0, -2.0, 0.0, -0.0])


@kernel
def lane_selection(a: Any, b: Any, bound: float, out: Any) -> None:
    one, other = lanes_at(a, 0, 4), lanes_at(b, 0, 4)
    put(out, 0, smaller(larger(one, -bound), bound))
    put(out, 4, larger(one, other))
    put(out, 8, smaller(one, other))
    put(out, 12, where_within(one, -other, other, one, bound))


@kernel
def rounding(values: Any, out: Any) -> None:
    put(out, 0, nearest(lanes_at(values, 0, 8)))


def test_rounded_lanes_are_those_of_round() -> None:
    values, out = np.array([-2.5, -1.5, -0.4, 0.0, 0.5, 0.51, 2.5, 1e9 + 0.5]), np.zeros(8)
    rounding(values, out)
    assert out.tobytes() == np.array([float(round(one)) for one in values.tolist()]).tobytes()


@kernel
def float_selection(a: Any, b: Any, bound: float, out: Any) -> None:
    for i in range(4):
        x, y = a[i], b[i]
        out[i] = min(max(x, -bound), bound)
        out[4 + i] = max(x, y)
        out[8 + i] = min(x, y)
        out[12 + i] = bound if x < -y or x > y else x


@pytest.mark.parametrize("bound", [0.0, 0.7, 1.0, np.inf])
def test_lane_selection_is_bit_identical_to_float_selection(bound: float) -> None:
    random = np.random.default_rng(5)
    for _ in range(300):
        a, b = random.choice(SPECIAL, 4), random.choice(SPECIAL, 4)
        found, expected = np.zeros(16), np.zeros(16)
        lane_selection(a, b, bound, found)
        float_selection(a, b, bound, expected)
        assert found.tobytes() == expected.tobytes(), (a, b)
