"""Exponential collocation, for reference solutions: steps of 4 to 40 ms, cheaper than small steps of any method here.

With ``x' = A x + N(x, t)`` the state at every node of a step is ``e^(c h A) x(0)`` plus an integral of N (variation of
constants). N is interpolated by the polynomial through its values at Gauss-Legendre nodes, so the integrals are
products with precomputed matrices. The values of N are found by Picard iteration, which starts from the extrapolation
of the last step. Only N is approximated, so a fast transient of A needs no short steps.

All nodes are computed at once, one in each lane of a vector. Not for recordings: products and sums are fused.
"""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from decimal import Decimal, localcontext
from functools import cache
from typing import Any

import numpy as np
from numba import types
from numpy.typing import NDArray

from netboard.base.compiled import borrowed, fast, inlined, relaxed, specialised
from netboard.physics.arithmetic.simd import lanes_at, pair_at, put, within
from netboard.physics.arithmetic.trig import EIGHTH_TURN, sincos, small
from netboard.physics.arithmetic.vectors import State
from netboard.physics.arithmetic.written import listed, width_of, written
from netboard.physics.methods.phi import DIGITS, phi_decimals, weighted_sum
from netboard.physics.methods.semilinear import FIXED, columns_of, kicked_rows, known_of, needed_rows, remainder
from netboard.physics.scene.linear import scene_matrix
from netboard.physics.scene.models import stopped
from netboard.physics.scene.parameters import Parts

Array = NDArray[np.float64]

_SWEEPS = 40
"""Most iterations in a step [1]."""


def _write_flows(n: int, _: int, s: int, known: int) -> str:
    rows = needed_rows(n, known)
    return listed(
        [
            " + ".join(f"lanes_at(flow, {(r * n + j) * s}, {s}) * x[{j}]" for j in columns_of(i, n, known))
            for r, i in enumerate(rows)
        ]
    )


def _write_moved(n: int, _: int, __: int, ___: int, s: int, known: int) -> str:
    every, sums = kicked_rows(n, known), []
    for r, i in enumerate(needed_rows(n, known)):
        places = [(r * len(every) + q, q) for q, j in enumerate(every) if j in columns_of(i, n, known)]
        sums.append(" + ".join([f"base[{r}]", *(f"applied(push, {p * s * s}, rest[{q}], {s})" for p, q in places)]))
    return listed(sums)


def _write_expected(n: int, _: int, __: int, s: int, known: int) -> str:
    start = f"lanes_at(ahead, {s * s}, {s})"
    return listed(
        [f"applied(ahead, 0, last[{r}], {s}) + {start} * x[{i}]" for r, i in enumerate(needed_rows(n, known))]
    )


def _write_resting(n: int, s: int, known: int) -> str:
    return listed([f"gathered((), {s}) + x[{i}]" for i in needed_rows(n, known)])


def _write_whole(n: int, _: int, known: int) -> str:
    rows = needed_rows(n, known)
    return listed(
        [f"values[{rows.index(i)}]" if i in rows else f"x[{i}]" if known & FIXED and i > 3 else "0.0" for i in range(n)]
    )


def _write_ended(n: int, _: int, __: int, ___: int, s: int, width: int, known: int) -> str:
    flows = [f"lanes_at(end_flow, {j * width}, {width}) * x[{j}]" for j in range(n)]
    kicks = [f"applied(end_push, {q * s * width}, rest[{q}], {width})" for q in range(len(kicked_rows(n, known)))]
    return " + ".join(["(" + " + ".join(flows[::2]) + ")", "(" + " + ".join(flows[1::2]) + ")", *kicks])


_flows = written("x, flow, nodes, known", _write_flows)
"""e^(c h A) x(0) at all nodes, for the rows on which N depends."""

_moved = written("x, base, push, rest, nodes, known", _write_moved)
"""The same plus the integral of N."""

_expected = written("x, last, ahead, nodes, known", _write_expected)
"""The same rows, extrapolated from the last step and the state at the start."""

_resting = written("x, nodes, known", _write_resting)
"""The same rows for a state that does not change."""

_whole = written("x, values, known", _write_whole)
"""A state with lanes of all nodes; rows on which N does not depend are 0."""

_picked = written("rate, known", lambda n, known: listed([f"rate[{j}]" for j in kicked_rows(n, known)]))
"""The rows in which N is not 0."""

_ended = written("x, rest, end_flow, end_push, nodes, width, known", _write_ended)
"""The state at the end of the step, in one vector."""

_taken = written("x, end", lambda n, _: listed([f"lane(end, {i})" for i in range(n)]))
"""The same as a tuple."""

_settled = written(
    "new, old, bound", lambda n, _, __: " and ".join(f"within(new[{q}] - old[{q}], bound)" for q in range(n))
)
"""Whether nothing changed by more than a bound."""


@fast
def _far(angles: Any) -> None:
    """Set sines and cosines, in the second and the third row, of angles of any size, in the first."""
    for i in range(angles.shape[1]):
        angles[1, i], angles[2, i] = sincos(angles[0, i])


def _turned(theta: Any) -> Any:
    """Return sine and cosine of a float or of lanes."""
    if isinstance(theta, float):
        return sincos(theta)
    angles = np.empty((3, len(theta)))
    angles[0] = theta
    _far(angles)
    return angles[1], angles[2]


_small = relaxed(small, {})


@cache
def _turner_of(COUNT: int) -> Callable[..., Any]:
    """Make the function that returns the sines and cosines of some lanes."""

    @inlined
    def turned(theta: Any) -> Any:
        if within(theta, EIGHTH_TURN):
            return _small(theta, 0.0)
        angles = np.empty((3, COUNT))  # one by one: an angle is too large for the short form
        put(angles, 0, theta)
        _far(angles)
        return lanes_at(angles, COUNT, COUNT), lanes_at(angles, 2 * COUNT, COUNT)

    return turned


@specialised(_turned)
def _turned_lanes(theta: Any) -> Any:
    """Choose the form when a kernel is compiled."""
    if isinstance(theta, types.Float):
        return lambda theta: sincos(theta)  # noqa: PLW0108  (numba takes no compiled function here)
    turned = _turner_of(theta.count)
    return lambda theta: turned(theta)  # noqa: PLW0108


_remainder = relaxed(remainder, {sincos: _turned})


@cache
def make_collocation(PARTS: Parts, LENGTH: int, NODES: int) -> Callable[..., int]:
    """Compile collocation for a kind of scene.

    Returns
    -------
    callable
        ``collocate(x, hands, bound, tables..., scene, every, out)`` fills `out`, of shape (n // every + 1, length),
        with the first state and that after each `every` steps, and returns the number of iterations; `bound` is the
        change of acceleration below which the iteration ends [SI].
    """
    KNOWN, WIDTH = known_of(PARTS), width_of(LENGTH)

    @fast
    def collocate(
        x: State,
        hands: Any,
        bound: float,
        a: Any,
        flow: Any,
        push: Any,
        ahead: Any,
        end_flow: Any,
        end_push: Any,
        scene: Any,
        every: int,
        out: Any,
    ) -> int:
        one, hands, tables = scene[0], borrowed(hands), (borrowed(a), 0)
        flow, push, ahead = borrowed(flow), borrowed(push), borrowed(ahead)
        end_flow, end_push = borrowed(end_flow), borrowed(end_push)
        for j in range(LENGTH):
            out[0, j] = x[j]
        last, sweeps = _resting(x, NODES, KNOWN), 0
        for i in range(len(hands)):
            left, right = pair_at(hands, i * (2 * NODES), NODES)
            base = _flows(x, flow, NODES, KNOWN)
            last = _expected(x, last, ahead, NODES, KNOWN)
            rest = _picked(_remainder(_whole(x, last, KNOWN), left, right, tables, PARTS, one), KNOWN)
            for _ in range(_SWEEPS):
                sweeps += 1
                last = _moved(x, base, push, rest, NODES, KNOWN)
                new = _picked(_remainder(_whole(x, last, KNOWN), left, right, tables, PARTS, one), KNOWN)
                done = _settled(new, rest, bound)
                rest = new
                if done:
                    break
            x = stopped(_taken(x, _ended(x, rest, end_flow, end_push, NODES, WIDTH, KNOWN)), PARTS, one)
            if (i + 1) % every == 0:
                for j in range(LENGTH):
                    out[(i + 1) // every, j] = x[j]
        return sweeps

    return collocate


def cardinals(points: Sequence[Decimal]) -> list[list[Decimal]]:
    """Return the Lagrange basis polynomials of different points, from the constant term up."""
    result = []
    with localcontext() as context:
        context.prec = DIGITS
        for point in points:
            terms, scale = [Decimal(1)], Decimal(1)
            for other in points:
                if other != point:
                    terms = [a - other * b for a, b in zip([Decimal(0), *terms], [*terms, Decimal(0)], strict=True)]
                    scale *= point - other
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


@dataclass(frozen=True)
class Tables:
    """Matrices of collocation for one scene and one step length.

    - `a` (shape (1, 1, n, n)): A by its columns [SI].
    - `flow` (shape (rows, n, nodes)): e^(c h A) for every node c, in the rows on which N depends [SI].
    - `push` (shape (rows, kicks, nodes, nodes)): integrals of the basis polynomials of N, for the same rows [SI].
    - `ahead` (shape (nodes + 1, nodes)): extrapolation from the nodes of the last step, and its end, to every node [1].
    - `end_flow`, `end_push` (shapes (n, width) and (kicks, nodes, width)): the same as `flow` and `push` for the end of
      the step, of all rows [SI].
    """

    a: Array
    flow: Array
    push: Array
    ahead: Array
    end_flow: Array
    end_push: Array


def make_tables(parts: Parts, scene: Any, length: int, h: float, count: int) -> Tables:
    """Return the matrices of collocation for a scene, a step length and a number of nodes."""
    known = known_of(parts)
    rows, kicks, width = needed_rows(length, known), kicked_rows(length, known), width_of(length)
    a, nodes = scene_matrix(parts, scene, length), gauss_nodes(count)
    polynomials = cardinals(nodes)
    inner = [integrals(a, h, c, polynomials) for c in nodes]
    end, ends = integrals(a, h, Decimal(1), polynomials)
    end_flow, end_push = np.zeros((length, width)), np.zeros((len(kicks), count, width))
    end_flow[:, :length], end_push[:, :, :length] = end.T, ends[:, :, kicks].transpose(2, 0, 1)
    tables = (
        a.T[None, None],
        np.stack([flow[rows] for flow, _ in inner], axis=-1),
        np.stack([pushes[:, rows][:, :, kicks].transpose(1, 2, 0) for _, pushes in inner], axis=-1),
        _continued(nodes),
        end_flow,
        end_push,
    )
    return Tables(*(np.ascontiguousarray(table) for table in tables))


def _continued(nodes: Sequence[Decimal]) -> Array:
    """Return the extrapolation from the nodes of the last step, and from 0, to the nodes."""
    with localcontext() as context:
        context.prec = DIGITS
        before = cardinals([*(c - 1 for c in nodes), Decimal(0)])
        values = [[sum(x * c**k for k, x in enumerate(polynomial)) for c in nodes] for polynomial in before]
    return np.array(values, dtype=np.float64)
