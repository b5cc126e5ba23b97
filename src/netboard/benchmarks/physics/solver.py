"""A solver under comparison with one setting, to run and to time.

Every solver gets the same problem. To evaluate the movement of the hands costs more than the physics, so its cost is
separated: each solver counts how often it evaluates the hands, or reads them from a table.
"""

from collections.abc import Callable
from dataclasses import dataclass
from math import nan
from time import perf_counter

from netboard.benchmarks.physics.problem import Array

OURS = "netboard"


@dataclass(frozen=True)
class Solution:
    """A solver's solution of a problem.

    - `states` (shape (n, 6)): at every `stride`-th of `Problem.times` [SI].
    - `calls`: number of evaluations of the hands, or of reads from a table [1].
    """

    states: Array
    stride: int
    steps: int
    calls: int


@dataclass(frozen=True)
class Solver:
    """A solver with one setting.

    - `solve`: solves the problem once and keeps the states, for the error.
    - `bare`: solves it without keeping states, for the cost.
    - `inputs`: `bare` evaluates the hands; otherwise it reads them from a table, or they are constant.
    - `alone`: the same number of steps without hands, if their cost cannot be separated otherwise.
    - `dense`: solves the problem and keeps the states at all of `Problem.times`, if the method can.
    - `input_ns`: cost of one evaluation of the hands, if it differs from that of compiled code [ns].
    """

    library: str
    method: str
    setting: str
    solve: Callable[[], Solution]
    bare: Callable[[], object]
    inputs: bool
    alone: Callable[[], object] | None = None
    held: bool = False
    dense: Callable[[], object] | None = None
    share: float = 1.0
    input_ns: float = nan


def timed(run: Callable[[], object]) -> float:
    """Return the duration of a call [s]."""
    start = perf_counter()
    run()
    return perf_counter() - start
