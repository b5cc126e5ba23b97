"""Every method that can run a scene offline, by name and with one interface, for comparisons.

A study asks a method at which times it needs the hands, evaluates their drives there, and prepares the run. It then
calls and times the integration alone.
"""

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from netboard.benchmarks.physics.collocation import prepare_collocation
from netboard.benchmarks.physics.multistep import MULTISTEP, prepare_multistep
from netboard.benchmarks.physics.quadrature import gauss_nodes
from netboard.physics.arithmetic.vectors import State
from netboard.physics.methods.catalogue import METHODS, NUMBER, Method
from netboard.physics.methods.march import make_grid, make_march
from netboard.physics.scene.parameters import Parts

Array = NDArray[np.float64]


class Prepare(Protocol):
    """Prepares a run and returns a function that does it."""

    def __call__(
        self, x: State, hands: Array, h: float, parts: Parts, scene: NDArray[Any], every: int = 1
    ) -> Callable[[], Array]:
        """Prepare the run from a first state, hands and steps of h; keep the state after each `every` steps."""
        ...


@dataclass(frozen=True)
class Offline:
    """A method, for runs of equal steps.

    - `nodes`: where in a step it asks for the hands, in lengths of the step [1].
    - `prepare`: ``prepare(x, hands, h, parts, scene, every)`` returns a function without arguments that does the run
      and returns an array of shape (n // every + 1, length): the first state and that after each `every` steps.
    - `chained`: its only node is the end of a step, which is the start of the next: the hands have shape (n + 1, 2).
    """

    name: str
    order: int
    nodes: tuple[float, ...]
    prepare: Prepare
    chained: bool = False

    def times(self, n: int, h: float) -> Array:
        """Return when it needs the hands, shape (n, nodes) or (n + 1,), for the drives that `prepare` takes [s]."""
        starts = np.arange(n + 1, dtype=np.float64)
        return np.asarray(h * (starts if self.chained else starts[:-1, np.newaxis] + self.nodes), np.float64)

    def suits(self, parts: Parts) -> bool:
        """Return whether it can run a scene."""
        return not (self.chained and parts.stops) and not (self.name == "exact" and parts.tilts)


def _prepare_one_step(
    method: Method, x: State, hands: Array, h: float, parts: Parts, scene: NDArray[Any], every: int = 1
) -> Callable[[], Array]:
    """Prepare a run of a one-step method."""
    n, hands = len(hands), np.ascontiguousarray(hands)
    grid = make_grid(method.name, np.full(n, h), np.ones(n, np.int64), parts, len(x), scene)
    march, out = make_march(NUMBER[method.name], parts), np.empty((n + 1, len(x)))

    def run() -> Array:
        march(x, hands, grid.lengths, grid.counts, grid.kinds, grid.tables, scene, out)
        return out[::every]

    return run


OFFLINE = (
    *(Offline(m.name, m.order, m.nodes, partial(_prepare_one_step, m)) for m in METHODS),
    *(Offline(m.name, m.order, (1.0,), partial(prepare_multistep, m.name), chained=True) for m in MULTISTEP),
    *(
        Offline(f"collocation{count}", 2 * count, tuple(float(c) for c in gauss_nodes(count)), prepare_collocation)
        for count in (4, 8)
    ),
)
"""All of them; the order of collocation is that at the ends of the steps, and shows where no transient is faster."""
