"""The phi functions of matrices of any norm, compared with multiple-precision arithmetic."""

import math
from decimal import Decimal
from typing import Any

import mpmath
import numpy as np
import pytest
from scipy.integrate import quad
from scipy.linalg import expm
from trajectories import scene_of

from evidence.physics.collocation import cardinals, gauss_nodes, integrals
from netboard.physics.methods.phi import phi, phi_decimals
from netboard.physics.scene.linear import scene_matrix

KINDS: dict[str, dict[str, Any]] = {
    "paper": {},
    "one hand": {"coupling": "left", "model": "lagrangian", "ball_height": 0.03},
    "no hand": {"coupling": "none"},
}
STIFF = [(1.0, 1.0), (1000.0, 1.0), (1.0, 1000.0), (1000.0, 1000.0)]


def matrix_of(k: float = 1.0, c: float = 1.0, **values: Any) -> Any:
    """A of a scene, with stiffer couplings than its configuration allows."""
    scene = scene_of(**values)
    record = scene.record.copy()
    for side in ("left", "right"):
        record[f"k_{side}"] *= k
        record[f"c_{side}"] *= c
    return scene_matrix(scene.parts, record, scene.length)


def augmented(b: Any, last: int) -> Any:
    """A matrix whose exponential has phi_0 ... phi_k of `b` in its first rows."""
    n = len(b)
    large = np.zeros((n * (last + 1), n * (last + 1)))
    large[:n, :n] = b
    large[: n * last, n:] += np.eye(n * last)
    return large


@pytest.mark.parametrize("values", KINDS.values(), ids=KINDS)
def test_phi_agrees_with_the_matrix_exponential_of_scipy(values: dict[str, Any]) -> None:
    a = matrix_of(**values)
    found = np.hstack(list(phi(a, 1e-3, 4)))
    expected = expm(augmented(1e-3 * a, 4))[: len(a)]
    assert np.allclose(found, expected, rtol=1e-13, atol=1e-13 * np.abs(expected).max(axis=1, keepdims=True))


@pytest.mark.slow
@pytest.mark.parametrize(("k", "c"), STIFF)
@pytest.mark.parametrize("block", [slice(0, 2), slice(2, 6)], ids=["heave", "tilt"])
def test_phi_elements_are_correctly_rounded(k: float, c: float, block: slice) -> None:
    b, n = matrix_of(k, c)[block, block], block.stop - block.start
    with mpmath.workdps(60):
        power = mpmath.matrix(augmented(np.zeros((n, n)), 2).tolist())
        power[:n, :n] = mpmath.matrix(b.tolist()) * mpmath.mpf(1e-3)
        exact = mpmath.expm(power)
        for number, found in enumerate(phi(b, 1e-3, 2)):
            for i in range(n):
                for j in range(n):
                    assert found[i, j] == float(exact[i, number * n + j])


@pytest.mark.parametrize("x", [-6e4, -625.0, -1.0, -1e-9, 0.0, 1e-9, 1.0, 40.0])
def test_phi_of_scalars_is_accurate_at_any_magnitude(x: float) -> None:
    found = phi(np.array([[x]]), 1.0, 3)[:, 0, 0]
    with mpmath.workdps(60):
        for k in range(4):
            series = mpmath.hyp1f1(1, k + 1, x) / math.factorial(k)
            assert found[k] == pytest.approx(float(series), rel=1e-15, abs=0.0)


@pytest.mark.parametrize(("k", "c"), STIFF)
def test_phi_functions_satisfy_their_recurrence(k: float, c: float) -> None:
    a = matrix_of(k, c)
    phis = phi_decimals(a, Decimal("0.001"), 4)
    for number in range(4):
        for i in range(6):
            for j in range(6):
                before = sum(Decimal(float(a[i, m])) * phis[number + 1][m][j] for m in range(6)) / 1000
                before += Decimal(i == j) / math.factorial(number)
                assert abs(before - phis[number][i][j]) < Decimal("1e-20")


@pytest.mark.parametrize("value", [math.nan, math.inf])
def test_phi_of_a_non_finite_matrix_is_nan(value: float) -> None:
    assert np.isnan(phi(np.array([[0.0, value], [0.0, 0.0]]), 1e-3, 2)).all()


@pytest.mark.parametrize("count", [1, 4, 7, 8, 16])
def test_gauss_nodes_agree_with_numpy(count: int) -> None:
    expected = (1 + np.polynomial.legendre.leggauss(count)[0]) / 2
    assert np.array(gauss_nodes(count), dtype=np.float64) == pytest.approx(expected, rel=1e-14)


def test_each_cardinal_polynomial_is_one_at_its_node_and_zero_at_others() -> None:
    points = gauss_nodes(8)
    for i, polynomial in enumerate(cardinals(points)):
        for j, point in enumerate(points):
            value = sum(term * point**power for power, term in enumerate(polynomial))
            assert abs(value - (i == j)) < Decimal("1e-22")


@pytest.mark.parametrize("end", ["0.25", "1", "5"])
def test_integrals_agree_with_numerical_quadrature(end: str) -> None:
    a, h = matrix_of()[2:, 2:], 4e-3
    polynomials = cardinals([Decimal(0), Decimal(-1), Decimal(-2)])
    flow, pushes = integrals(a, h, Decimal(end), polynomials)
    span = float(end) * h
    assert flow == pytest.approx(expm(span * a), rel=1e-12, abs=1e-12)

    def integrand(t: float, i: int, j: int, terms: Any) -> float:
        return float(expm((span - t) * a)[i, j] * np.polynomial.polynomial.polyval(t / h, terms))

    for polynomial, push in zip(polynomials, pushes, strict=True):
        terms = [float(term) for term in polynomial]
        for i, j in ((0, 1), (1, 1), (3, 1)):
            value, _ = quad(integrand, 0.0, span, (i, j, terms), epsrel=1e-12)
            assert push[i, j] == pytest.approx(value, rel=1e-10, abs=1e-17)
