"""A solver under comparison with one setting, to run and to time.

Every solver gets the same problem. What the hands do costs more to evaluate than the physics, so that it is told apart:
a solver that evaluates them itself says how often, one that reads them from a table how often it would have to.
"""

from collections.abc import Callable
from dataclasses import dataclass
from importlib.util import find_spec
from math import nan
from time import perf_counter

from netboard.benchmarks.physics.problem import Array

OURS = "netboard"


@dataclass(frozen=True)
class Solution:
    """A solver's solution of a problem.

    - `states` (shape (n, 6)): at every `stride`-th of `Problem.times` [SI].
    - `calls`: how often the hands were evaluated, or read from a table [1].
    """

    states: Array
    stride: int
    steps: int
    calls: int


@dataclass(frozen=True)
class Contender:
    """A solver with one setting.

    - `solve`: solves the problem, once, and keeps the states: for the error.
    - `inputs`: `bare` evaluates the hands; otherwise it reads them from a table, or they do not change.
    - `alone`: as many steps without any hands, where the cost of the hands cannot be told apart otherwise.
    - `dense`: solves it and keeps the states at all of `Problem.times`, where the method can.
    - `input_ns`: cost of evaluating the hands once, where it is not that of compiled code [ns].
    """

    family: str
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
    """Return how long a call takes."""
    start = perf_counter()
    run()
    return perf_counter() - start


def installed(*modules: str) -> bool:
    """Say whether modules can be imported."""
    return all(find_spec(module) is not None for module in modules)
