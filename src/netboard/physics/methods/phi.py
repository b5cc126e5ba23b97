"""The functions phi_0 ... phi_k of a matrix, on which exponential methods are based.

``phi_0(B) = e^B`` and ``phi_k(B) = integral over s from 0 to 1 of e^((1 - s) B) s^(k - 1) / (k - 1)!``: what a linear
system makes of its state, and of a force that grows with the power k - 1 of the time.

Method: scaling, Taylor's series, squaring (B. Skaflestad, W. M. Wright, "The scaling and modified squaring method for
matrix functions related to the exponential", Appl. Numer. Math. 59, 2009), in decimal arithmetic of sixty digits and
more. Squaring loses digits, and many of them where stiffness or damping is a thousand times the usual one; here enough
are left for every float to be the nearest one. Recordings verify to the bit, and decimals are alike on every machine.
"""

from collections.abc import Sequence
from decimal import Decimal, localcontext

import numpy as np
from numpy.typing import NDArray

Matrix = Sequence[Sequence[Decimal]]

DIGITS = 60
"""Decimal digits of the result after the losses of squaring [1]."""

_TERMS = 40
"""Terms of the series; at a norm of one half the next is below 1e-61 of the sum."""


def _product(a: Matrix, b: Matrix) -> list[list[Decimal]]:
    """Return the product of two matrices, most elements of which may be 0."""
    result = []
    for row in a:
        total = [Decimal(0)] * len(b)
        for factor, other in zip(row, b, strict=True):
            if factor:
                total = [t + factor * x if x else t for t, x in zip(total, other, strict=True)]
        result.append(total)
    return result


def weighted_sum(terms: Sequence[tuple[Decimal, Matrix]], diagonal: Decimal) -> list[list[Decimal]]:
    """Return a linear combination of matrices and the identity.

    Parameters
    ----------
    terms : sequence of tuple of Decimal and matrix
        Each matrix with its factor.
    diagonal : Decimal
        Factor of the identity.
    """
    n = len(terms[0][1])
    result = [[diagonal if i == j else Decimal(0) for j in range(n)] for i in range(n)]
    for weight, matrix in terms:
        result = [[t + weight * x for t, x in zip(*rows, strict=True)] for rows in zip(result, matrix, strict=True)]
    return result


def _series(b: Matrix, inverses: Sequence[Decimal]) -> list[list[list[Decimal]]]:
    """Return phi_0 ... phi_k of a small matrix: the last by its series, each other from the one after it."""
    last, one = len(inverses) - 1, Decimal(1)
    top = weighted_sum([(Decimal(0), b)], one)
    for term in range(_TERMS, 0, -1):
        top = weighted_sum([(one / (last + term), _product(b, top))], one)
    phis = [weighted_sum([(inverses[last], top)], Decimal(0))]
    for inverse in inverses[-2::-1]:
        phis.insert(0, weighted_sum([(one, _product(b, phis[0]))], inverse))
    return phis


def _doubled(phis: Sequence[Matrix], inverses: Sequence[Decimal]) -> list[list[list[Decimal]]]:
    """Return phi_k of twice the matrix: 2^k phi_k(2B) = phi_0 phi_k + phi_1 / (k-1)! + ... + phi_k / 0!, all of B."""
    result = []
    for k in range(len(phis)):
        scale = Decimal(1) / 2**k
        terms: list[tuple[Decimal, Matrix]] = [(scale, _product(phis[0], phis[k]))]
        terms += [(scale * inverses[k - j], phis[j]) for j in range(1, k + 1)]
        result.append(weighted_sum(terms, Decimal(0)))
    return result


def phi_decimals(a: NDArray[np.float64], h: Decimal, last: int) -> list[list[list[Decimal]]]:
    """Return phi_0 ... phi_k of ``h a``, good to `DIGITS` digits of the largest element of each.

    Parameters
    ----------
    a : ndarray of float64, shape (n, n)
        Matrix of a linear system x' = a x, finite [SI].
    h : Decimal
        Step size [s].
    last : int
        Number k of the last function [1].
    """
    size = float(h) * float(np.abs(a).sum(axis=0).max())
    halvings = max(0, int(np.ceil(np.log2(size))) + 1) if size > 0 else 0
    with localcontext() as context:
        context.prec = DIGITS + halvings
        inverses = [Decimal(1)]
        for k in range(1, last + 1):
            inverses.append(inverses[-1] / k)
        step = h / 2**halvings
        phis = _series([[step * Decimal(float(x)) for x in row] for row in a], inverses)
        for _ in range(halvings):
            phis = _doubled(phis, inverses)
    return phis


def phi(a: NDArray[np.float64], h: float, last: int) -> NDArray[np.float64]:
    """Return phi_0 ... phi_k of ``h a``, the same bits on every machine.

    Parameters
    ----------
    a : ndarray of float64, shape (n, n)
        Matrix of a linear system x' = a x [SI].
    last : int
        Number k of the last function [1].

    Returns
    -------
    ndarray of float64, shape (k + 1, n, n)
        The functions; NaN if the matrix is not finite [SI].
    """
    if not (np.isfinite(a).all() and np.isfinite(h)):
        return np.full((last + 1, *a.shape), np.nan)
    return np.array(phi_decimals(a, Decimal(h), last), dtype=np.float64)
