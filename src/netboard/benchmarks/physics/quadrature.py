"""Tables of the multistep and collocation methods: nodes, basis polynomials and their integrals, in decimals."""

import math
from collections.abc import Sequence
from decimal import Decimal, localcontext

import numpy as np
from numpy.typing import NDArray

from netboard.physics.methods.phi import DIGITS, phi_decimals, weighted_sum


def cardinals(points: Sequence[Decimal]) -> list[list[Decimal]]:
    """Return the Lagrange basis polynomials of different points, from the constant term up."""
    result = []
    with localcontext() as context:
        context.prec = DIGITS
        for own in points:
            terms, scale = [Decimal(1)], Decimal(1)
            for other in points:
                if other != own:
                    terms = [a - other * b for a, b in zip([Decimal(0), *terms], [*terms, Decimal(0)], strict=True)]
                    scale *= own - other
            result.append([term / scale for term in terms])
    return result


def integrals(
    a: NDArray[np.float64], h: float, end: Decimal, polynomials: Sequence[Sequence[Decimal]]
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return the response of a linear system, in part of a step, to its state and to forces polynomial in time.

    The polynomials are coefficients from the constant term up, for the time in lengths of the step. Every float is the
    nearest one to ``e^(end h a)`` and to the integrals of ``e^((end h - t) a)`` times each polynomial, from 0 to end h.
    """
    degree, n = len(polynomials[0]), len(a)
    with localcontext() as context:
        context.prec = DIGITS
        span = end * Decimal(h)
        phis = phi_decimals(a, span, degree)
        # The integral with t^k is k! (end h)^(k + 1) phi_(k + 1).
        factors = [span]
        for k in range(1, degree):
            factors.append(factors[-1] * end * k)
        pushes = np.empty((len(polynomials), n, n))
        for q, polynomial in enumerate(polynomials):
            weights = [(f * x, m) for f, x, m in zip(factors, polynomial, phis[1:], strict=True)]
            pushes[q] = np.array(weighted_sum(weights, Decimal(0)), dtype=np.float64)
    return np.array(phis[0], dtype=np.float64), pushes


def gauss_nodes(count: int) -> list[Decimal]:
    """Return the Gauss-Legendre nodes on (0, 1) to `DIGITS` digits, rising, by Newton's method."""
    nodes = []
    with localcontext() as context:
        context.prec = DIGITS
        for i in range(count):
            x = Decimal(-math.cos(math.pi * (i + 0.75) / (count + 0.5)))
            for _ in range(7):
                below, here = Decimal(1), x
                for k in range(2, count + 1):
                    below, here = here, ((2 * k - 1) * x * here - (k - 1) * below) / k
                x -= here * (x * x - 1) / (count * (x * here - below))
            nodes.append((1 + x) / 2)
    return nodes
