"""The hyperbolic tangent of kernels: against mpmath, at its ends, and compiled against not compiled."""

from math import inf, isnan, nan

import mpmath
import numpy as np
from numpy.typing import NDArray

from netboard.base.compiled import kernel
from netboard.physics.arithmetic.hyperbolic import tanh

VALUES = np.concatenate([np.linspace(-25.0, 25.0, 2001), np.logspace(-300, 1, 400)])


@kernel
def _all(x: NDArray[np.float64], out: NDArray[np.float64]) -> None:
    for i in range(len(x)):
        out[i] = tanh(x[i])


def test_is_the_hyperbolic_tangent_to_the_last_digits() -> None:
    out = np.zeros(len(VALUES))
    _all(VALUES, out)
    exact = np.array([float(mpmath.tanh(mpmath.mpf(x))) for x in VALUES])
    assert (np.abs(out - exact) <= 1e-15 * np.abs(exact)).all()
    assert out.tobytes() == np.array([-value for value in map(_plain, -VALUES)]).tobytes()  # odd, and the same bits


def test_ends_are_one_and_nan_stays() -> None:
    assert [_plain(x) for x in (inf, 1e300, 20.0, 0.0, -20.0, -inf)] == [1.0, 1.0, 1.0, 0.0, -1.0, -1.0]
    assert isnan(_plain(nan))


def _plain(x: float) -> float:
    """Run the function as it stands, without the compiler."""
    return float(getattr(tanh, "py_func", tanh)(x))
