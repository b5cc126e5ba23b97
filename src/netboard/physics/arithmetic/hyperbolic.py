"""Hyperbolic tangent that gives the same bits everywhere: IEEE additions, multiplications and divisions in one order.

The argument is divided by `HALVINGS` powers of two, where Lambert's continued fraction of tanh (1768), cut off after
seven terms, is good to less than one ulp. The double-angle formula, which damps errors, brings it back::

    tanh(2 x) = 2 tanh(x) / (1 + tanh(x)^2)

Rule 1: nothing raises; NaN gives NaN, and an argument beyond `SATURATED` gives 1 with its sign, to the last bit.
"""

from math import isnan

from netboard.base.compiled import inlined

SATURATED = 20.0
"""Beyond this, tanh is 1 in float64 [1]."""

HALVINGS = 5
_SCALE = 1.0 / 2**HALVINGS


@inlined
def tanh(x: float) -> float:
    """Return the hyperbolic tangent of a number, within 1e-15 [1].

    Parameters
    ----------
    x : float
        Any number [1].
    """
    y = min(max(x, -SATURATED), SATURATED) * _SCALE
    s = y * y
    top = 135135.0 + s * (17325.0 + s * (378.0 + s))
    t = y * top / (135135.0 + s * (62370.0 + s * (3150.0 + s * 28.0)))
    for _ in range(HALVINGS):
        t = (t + t) / (1.0 + t * t)
    return x if isnan(x) else t  # min and max take no notice of NaN
