"""Exponential Adams methods of orders 2 to 7 for long smooth runs: one or two evaluations of N per step.

With ``x' = A x + N(x, t)`` the linear part is solved exactly, and N is extrapolated by the polynomial through its
values at the last grid points (Adams-Bashforth). The predictor-corrector pair (PECE) then evaluates N at the prediction
and corrects it (Adams-Moulton). The first steps are computed by collocation at the grid points, so a run needs the
hands on its grid only.

The methods assume smooth hands and a smooth scene: for raw input, and for balls that meet stops, use a one-step method.
Not for recordings: products and sums are fused. A state is one vector with the tilt first, because the next evaluation
depends on the tilt first.
"""

from collections.abc import Callable
from dataclasses import dataclass
from decimal import Decimal
from functools import cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

from netboard.base.compiled import borrowed, fast, relaxed
from netboard.benchmarks.physics.collocation import ROUNDING
from netboard.benchmarks.physics.quadrature import cardinals, integrals
from netboard.physics.arithmetic.simd import listed, width_of, written
from netboard.physics.arithmetic.vectors import State
from netboard.physics.methods.semilinear import kicked_rows, known_of, remainder
from netboard.physics.scene.linear import scene_matrix
from netboard.physics.scene.parameters import Parts

Array = NDArray[np.float64]

_FIRST = 8
"""Grid points whose states are computed together at the start, with a higher order than the method [1]."""

_SWEEPS = 100
"""Most iterations at the start [1]."""


@dataclass(frozen=True)
class Multistep:
    """A multistep method.

    - `past`: number of values of N from which it predicts, including the newest [1].
    - `corrector`: number of values of N in the corrector, including that at the prediction; 0 without one [1].
    """

    name: str
    order: int
    past: int
    corrector: int = 0


MULTISTEP = (
    Multistep("etd_ab2", 2, 2),
    Multistep("etd_ab4", 4, 4),
    Multistep("etd_ab6", 6, 6),
    Multistep("etd_pece6", 7, 6, 7),
)
"""The multistep methods under comparison."""


def _write_flow(n: int, _: int, width: int) -> str:
    terms = [f"lanes_at(flow, {j * width}, {width}) * x[{j}]" for j in range(n)]
    return "(" + " + ".join(terms[::2]) + ") + (" + " + ".join(terms[1::2]) + ")"


def _write_pushed(count: int, _: int, width: int) -> str:
    """Write a sum as three chains, each with the newest values last."""
    terms = [f"lanes_at(push, {q * width}, {width}) * past[{q}]" for q in range(count - 1, -1, -1)]
    return " + ".join("(" + " + ".join(terms[c::3]) + ")" for c in range(min(3, count)))


_flow = written("x, flow, width", _write_flow)
"""State vector after the linear part of a step."""

_pushed = written("past, push, width", _write_pushed)
"""Contribution of the values of N."""

_taken = written("lanes, x", lambda _, n: listed([f"lane(lanes, {(j - 2) % n})" for j in range(n)]))
"""State as a tuple, from its vector."""

_spread = written(
    "rate, width, known",
    lambda n, width, known: listed([f"gathered((), {width}) + rate[{j}]" for j in kicked_rows(n, known)]),
)
"""The rows in which N is not 0, each in all lanes."""

_shifted = written(
    "rest, past", lambda k, count: listed([f"rest[{q}]" for q in range(k)] + [f"past[{q}]" for q in range(count - k)])
)
"""History of N with a new value first, without the oldest."""

_with = written(
    "rest, past", lambda k, count: listed([f"rest[{q}]" for q in range(k)] + [f"past[{q}]" for q in range(count)])
)
"""History of N with a new value first."""

_row = written("states, i, length", lambda _, __, n: listed([f"states[i, {j}]" for j in range(n)]))
"""State as a tuple, from an array."""

_blank = written("count, width", lambda count, width: listed([f"gathered((), {width})"] * count))
"""History of zeros."""

_remainder = relaxed(remainder, {})


@cache
def _make_start(PARTS: Parts, LENGTH: int) -> Callable[..., None]:
    """Compile the collocation of the first states."""

    @fast
    def start(x: State, hands: Any, bound: float, a: Any, flows: Any, pushes: Any, scene: Any, states: Any) -> None:
        one, tables, rests = scene[0], (borrowed(a), 0), np.zeros((_FIRST, LENGTH))
        for i in range(_FIRST):
            for j in range(LENGTH):
                states[i, j] = x[j]
        for _ in range(_SWEEPS):
            change = 0.0
            for i in range(_FIRST):
                rest = _remainder(_row(states, i, LENGTH), hands[i, 0], hands[i, 1], tables, PARTS, one)
                for j in range(LENGTH):
                    change = max(change, abs(rest[j] - rests[i, j]))
                    rests[i, j] = rest[j]
            if change <= bound:
                break
            for i in range(1, _FIRST):
                for j in range(LENGTH):
                    total = 0.0
                    for k in range(LENGTH):
                        total += flows[i, j, k] * x[k]
                    for k in range(1, LENGTH, 2):
                        for q in range(_FIRST):
                            total += pushes[i, q, j, k] * rests[q, k]
                    states[i, j] = total

    return start


@cache
def _make_run(PARTS: Parts, LENGTH: int, PAST: int, CORRECTS: bool) -> Callable[..., None]:
    """Compile a method for a kind of scene."""
    KNOWN, WIDTH = known_of(PARTS), width_of(LENGTH)
    ALL = PAST * len(kicked_rows(LENGTH, KNOWN))

    @fast
    def run(
        first: Any, hands: Any, a: Any, flow: Any, predictor: Any, corrector: Any, scene: Any, every: int, out: Any
    ) -> None:
        one, hands, tables = scene[0], borrowed(hands), (borrowed(a), 0)
        flow, predictor, corrector = borrowed(flow), borrowed(predictor), borrowed(corrector)
        past, x = _blank(ALL, WIDTH), _row(first, 0, LENGTH)
        for i in range(len(hands)):
            if i < _FIRST:
                x = _row(first, i, LENGTH)
                rest = _spread(_remainder(x, hands[i, 0], hands[i, 1], tables, PARTS, one), WIDTH, KNOWN)
            else:
                flowed = _flow(x, flow, WIDTH)
                x = _taken(flowed + _pushed(past, predictor, WIDTH), x)
                rest = _spread(_remainder(x, hands[i, 0], hands[i, 1], tables, PARTS, one), WIDTH, KNOWN)
                if CORRECTS:
                    x = _taken(flowed + _pushed(_with(rest, past), corrector, WIDTH), x)
                    rest = _spread(_remainder(x, hands[i, 0], hands[i, 1], tables, PARTS, one), WIDTH, KNOWN)
            past = _shifted(rest, past)
            if i % every == 0:
                for j in range(LENGTH):
                    out[i // every, j] = x[j]

    return run


def _packed(matrices: Array, rows: list[int], width: int) -> Array:
    """Return columns of matrices as vectors with the tilt first."""
    length = matrices.shape[-1]
    packed = np.zeros((len(matrices), len(rows), width))
    packed[:, :, :length] = np.roll(matrices, -2, axis=1)[:, :, rows].transpose(0, 2, 1)
    return packed


def _tables(method: Multistep, parts: Parts, scene: Any, length: int, h: float) -> tuple[Array, ...]:
    """Return the matrices of a method: A, flow, predictor, corrector, and flows and integrals of the start."""
    a, one = scene_matrix(parts, scene, length), Decimal(1)
    rows, width = kicked_rows(length, known_of(parts)), width_of(length)
    flow, predictor = integrals(a, h, one, cardinals([Decimal(-i) for i in range(method.past)]))
    corrector = predictor
    if method.corrector:
        _, corrector = integrals(a, h, one, cardinals([Decimal(1 - i) for i in range(method.corrector)]))
    polynomials = cardinals([Decimal(i) for i in range(_FIRST)])
    firsts = [integrals(a, h, Decimal(i), polynomials) for i in range(_FIRST)]
    return (
        np.ascontiguousarray(a.T[None, None]),
        _packed(flow[None], list(range(length)), width),
        _packed(predictor, rows, width),
        _packed(corrector, rows, width),
        np.array([flow for flow, _ in firsts]),
        np.array([pushes for _, pushes in firsts]),
    )


def prepare_multistep(
    name: str, x: State, hands: Array, h: float, parts: Parts, scene: NDArray[Any], every: int = 1
) -> Callable[[], Array]:
    """Prepare a run by a multistep method; each call of it returns the same array.

    - `hands` (shape (n + 1, 2)): drives of the left and of the right hand at the ends of the steps, the first at the
      start [N].
    """
    method = next(m for m in MULTISTEP if m.name == name)
    if parts.stops:
        raise ValueError(f"{name} needs smooth motion: take a one-step method for balls that meet stops")
    if len(hands) < _FIRST:
        raise ValueError(f"{name} needs {_FIRST - 1} steps or more, not {len(hands) - 1}")
    a, flow, predictor, corrector, flows, pushes = _tables(method, parts, scene[0], len(x), h)
    hands, first = np.ascontiguousarray(hands), np.empty((_FIRST, len(x)))
    begin, march = _make_start(parts, len(x)), _make_run(parts, len(x), method.past, method.corrector > 0)
    out = np.empty(((len(hands) - 1) // every + 1, len(x)))
    bound = ROUNDING * float(np.abs(a).max())

    def run() -> Array:
        begin(x, hands, bound, a, flows, pushes, scene, first)
        march(first, hands, a, flow, predictor, corrector, scene, every, out)
        return out

    return run
