"""The functions phi_0 ... phi_k of a matrix, from which every exponential method is made.

``phi_0(B) = e^B`` and ``phi_k(B) = integral over s from 0 to 1 of e^((1 - s) B) s^(k - 1) / (k - 1)!``: what a linear
system does with its state, and with a force that grows with the power k - 1 of the time.

Method: balancing by powers of two, scaling, Taylor's series, and squaring (B. Skaflestad, W. M. Wright, "The scaling
and modified squaring method for matrix functions related to the exponential", Appl. Numer. Math. 59, 2009). A series
without scaling loses every digit when stiffness or damping is a thousand times the usual one. All in plain arithmetic,
in one order: recordings verify to the bit, so the tables must be the same on every machine.
"""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from netboard.compiled import kernel

_TERMS = 18
"""Terms of the series: with a norm of one half the next is below 1e-21."""

_LARGEST = 1e30
"""Matrices with larger elements are given up: the result is NaN."""


@kernel
def _norm(b: Any) -> float:
    """Return the largest sum of magnitudes in a column."""
    largest = 0.0
    for j in range(len(b)):
        column = 0.0
        for i in range(len(b)):
            column += abs(b[i, j])
        largest = max(largest, column)
    return largest


@kernel
def _balance(b: Any, d: Any) -> None:
    """Make rows and columns of a matrix alike in size, by powers of two, which cost no digit (Parlett and Reinsch).

    b becomes D^-1 b D, D the diagonal matrix of d.
    """
    n = len(b)
    for _ in range(64):
        done = True
        for i in range(n):
            column, row = 0.0, 0.0
            for j in range(n):
                if j != i:
                    column += abs(b[j, i])
                    row += abs(b[i, j])
            if column == 0.0 or row == 0.0:
                continue
            factor, before = 1.0, column + row
            while 2.0 * column < row:
                factor, column, row = 2.0 * factor, 2.0 * column, 0.5 * row
            while column >= 2.0 * row:
                factor, column, row = 0.5 * factor, 0.5 * column, 2.0 * row
            if column + row < 0.95 * before:
                done = False
                d[i] *= factor
                for j in range(n):
                    b[j, i] *= factor
                    b[i, j] *= 1.0 / factor
        if done:
            return


@kernel
def _add_product(out: Any, a: Any, b: Any) -> None:
    """Add the product of two matrices, from the first term of each sum to the last."""
    n = len(a)
    for i in range(n):
        for j in range(n):
            total = 0.0
            for k in range(n):
                total += a[i, k] * b[k, j]
            out[i, j] += total


@kernel
def _series(b: Any, out: Any) -> None:
    """Set phi_0 ... phi_k of a small matrix: the last by its series, each other from the one after it."""
    n, last = len(b), len(out) - 1
    inverse = np.ones(last + 1)  # 1 / k!
    for k in range(1, last + 1):
        inverse[k] = inverse[k - 1] / k
    # Horner's scheme: phi_k = (1 + B / (k + 1) (1 + B / (k + 2) (...))) / k!
    top, product = np.eye(n), np.empty((n, n))
    for term in range(_TERMS, 0, -1):
        product[:] = 0.0
        _add_product(product, b, top)
        for i in range(n):
            for j in range(n):
                top[i, j] = product[i, j] / (last + term)
            top[i, i] += 1.0
    for i in range(n):
        for j in range(n):
            out[last, i, j] = top[i, j] * inverse[last]
    for k in range(last - 1, -1, -1):
        out[k] = 0.0
        _add_product(out[k], b, out[k + 1])
        for i in range(n):
            out[k, i, i] += inverse[k]


@kernel
def _double(phis: Any) -> None:
    """Set phi_k of twice the matrix: 2^k phi_k(2B) = phi_0 phi_k + phi_1 / (k-1)! + ... + phi_k / 0!, all of B."""
    n, last = phis.shape[1], len(phis) - 1
    first = phis[0].copy()
    product = np.empty((n, n))
    for k in range(last, -1, -1):  # those below are needed as they were
        product[:] = 0.0
        _add_product(product, first, phis[k])
        weight, scale = 1.0, 1.0
        for j in range(k, 0, -1):
            for i in range(n):
                for m in range(n):
                    product[i, m] += weight * phis[j, i, m]
            weight /= k - j + 1
            scale *= 0.5
        for i in range(n):
            for m in range(n):
                phis[k, i, m] = scale * product[i, m]


@kernel
def phi(a: NDArray[np.float64], h: float, last: int) -> NDArray[np.float64]:
    """Return phi_0 ... phi_k of ``h a``, the same bits on every machine.

    Parameters
    ----------
    a : ndarray of float64, shape (n, n)
        Matrix of a linear system x' = a x, C-contiguous [SI].
    h : float
        Length of a step [s].
    last : int
        Number k of the last function [1].

    Returns
    -------
    ndarray of float64, shape (k + 1, n, n)
        The functions; NaN if the matrix is not finite or beyond every scale [SI].
    """
    n = len(a)
    b, d, out = np.empty((n, n)), np.ones(n), np.zeros((last + 1, n, n))
    for i in range(n):
        for j in range(n):
            b[i, j] = h * a[i, j]
            if not abs(b[i, j]) <= _LARGEST:
                out[:] = np.nan
                return out
    _balance(b, d)
    size, halvings = _norm(b), 0
    while size > 0.5:
        size *= 0.5
        halvings += 1
        for i in range(n):
            for j in range(n):
                b[i, j] *= 0.5
    _series(b, out)
    for _ in range(halvings):
        _double(out)
    for k in range(last + 1):
        for i in range(n):
            for j in range(n):
                out[k, i, j] *= d[i] / d[j]
    return out
