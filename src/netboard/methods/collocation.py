"""Exponential collocation, for runs of reference quality: steps of 4 to 40 ms, far cheaper than small steps of any other.

With ``x' = A x + N(x, t)`` the state at every node of a step is ``e^(c h A) x(0)`` and an integral of N (variation of
constants). N is taken for the polynomial through its values at Gauss's nodes, so that the integrals are products with
matrices made beforehand, and its values are found by sweeps over the nodes (Picard's iteration), from what the last step
makes one expect, until they change no more. Only N is approximated: a transient of A, however fast, costs no step.

The nodes are done at once, one in each lane of a vector. Not for recordings: products and sums are fused.
"""

from collections.abc import Callable
from dataclasses import dataclass
from decimal import Decimal, localcontext
from functools import cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

from netboard.compiled import borrowed, fast, inlined, loosened, specialised
from netboard.methods.exponential import Blocks...
