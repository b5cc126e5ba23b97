"""Sine and cosine, compared with multiple-precision arithmetic."""

import math
from decimal import Decimal, localcontext

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from netboard.physics.arithmetic.trig import MAX_ANGLE, sincos

HALF_PI = Decimal(
    "1.57079632679489661923132169163975144209858469968755291048747229615390820314310449931401741267105853399"
)


def exact(x: float) -> tuple[Decimal, Decimal]:
    """Sine and cosine of the float, by their series after an exact reduction."""
    with localcontext() as context:
        context.prec = 60
        turns = (Decimal(x) / HALF_PI).to_integral_value()
        y = Decimal(x) - turns * HALF_PI
        s, c, term = Decimal(0), Decimal(0), Decimal(1)
        for n in range(45):
            if n % 2 == 0:
                c += term if n % 4 == 0 else -term
            else:
                s += term if n % 4 == 1 else -term
            term = term * y / (n + 1)
        return [(s, c), (c, -s), (-s, -c), (-c, s)][int(turns) % 4]


def errors_in_ulp(x: float) -> list[float]:
    return [
        float(abs(Decimal(got) - true)) / math.ulp(float(true)) for got, true in zip(sincos(x), exact(x), strict=True)
    ]


def test_error_is_below_one_ulp_within_a_turn_in_both_directions() -> None:
    angles = np.random.default_rng(1).uniform(-2 * math.pi, 2 * math.pi, 1000)
    assert max(max(errors_in_ulp(float(x))) for x in angles) < 1.0


@pytest.mark.parametrize("quarter", range(-4, 5))
def test_error_is_below_one_ulp_near_multiples_of_a_quarter_turn(quarter: int) -> None:
    near = quarter * math.pi / 2
    angles = [near, math.nextafter(near, 9), math.nextafter(near, -9), near + 1e-9, near - 1e-5]
    assert max(max(errors_in_ulp(x)) for x in angles if x != 0) < 1.0


def test_error_is_below_one_ulp_at_tiny_angles_and_reduction_boundaries() -> None:
    angles = [1e-300, 1e-8, 1e-3, math.pi / 4, math.nextafter(math.pi / 4, 1), 3 * math.pi / 4]
    assert max(max(errors_in_ulp(x)) for x in angles) < 1.0


def test_error_is_below_one_ulp_up_to_the_largest_angle() -> None:
    angles = np.random.default_rng(2).uniform(-MAX_ANGLE, MAX_ANGLE, 300)
    assert max(max(errors_in_ulp(float(x))) for x in [*angles, MAX_ANGLE]) < 1.0


@given(st.floats(0, MAX_ANGLE))
def test_sine_is_odd_and_cosine_even_to_the_bit(x: float) -> None:
    s, c = sincos(x)
    assert sincos(-x) == (-s, c)


@pytest.mark.parametrize("x", [math.inf, -math.inf, math.nan, 1e300, -1e300, math.nextafter(MAX_ANGLE, 1e9)])
@pytest.mark.parametrize("function", [sincos, getattr(sincos, "py_func", sincos)])
def test_irreducible_angle_gives_nan(x: float, function: object) -> None:
    assert all(math.isnan(value) for value in function(x))  # type: ignore[operator]
