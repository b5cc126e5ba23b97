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
from netboard.methods.lanes import lane, lanes_at, pair_at, put, spread, within
from netboard.methods.phi import DIGITS, phi_decimals
from netboard.methods.semilinear import EVEN, FIXED, PAPER, blocks, kicks, remainder
from netboard.physics.linear import scene_matrix
from netboard.physics.models import stopped
from netboard.physics.scene import Parts
from netboard.physics.trig import EIGHTH_TURN, sincos, small
from netboard.physics.vectors import State

Array = NDArray[np.float64]

_SWEEPS = 40
"""Most sweeps in a step [1]."""


def known_of(parts: Parts) -> int:
    """Return what is known of a scene, for the products."""
    fixed = parts.loaded and not parts.free
    return EVEN * parts.even + FIXED * fixed + PAPER * (not parts.lagrangian)


def _rows(length: int, known: int) -> list[int]:
    """Return which rows of a state N depends on: by the paper, not on how fast balls roll, and on heave only if uneven."""
    rows = [i for block, _ in blocks(length, known) for i in block]
    if known & PAPER:
        rows = [i for i in rows if i < 4 or i % 2 == 0]
        if known & EVEN:
            rows = [i for i in rows if i > 1]
    return rows


def _kicks(length: int, known: int) -> list[int]:
    """Return in which rows N is something other than 0."""
    return sorted(j for _, columns in blocks(length, known) for j in kicks(columns))


def _kicked(row: int, length: int, known: int) -> list[int]:
    """Return which of them meet a row."""
    return sorted(j for block, columns in blocks(length, known) if row in block for j in kicks(columns))


def _columns(row: int, length: int, known: int) -> list[int]:
    return [j for block, columns in blocks(length, known) if row in block for j in columns]


def _written(arguments: str, expression: str) -> Any:
    return eval(f"lambda {arguments}: {expression}", {"lanes_at": lanes_at, "spread": spread, "lane": lane})


def _added(terms: list[str], chains: int) -> str:
    """Write a sum as a few shorter ones, which the processor does side by side."""
    return " + ".join("(" + " + ".join(terms[i::chains]) + ")" for i in range(min(chains, len(terms))))


def _flows(x, flow, nodes, known): ...


@specialised(_flows)
def _write_flows(x: Any, flow: Any, nodes: Any, known: Any) -> Any:
    n, s, flags = x.count, nodes.literal_value, known.literal_value
    rows = [
        " + ".join(f"lanes_at(flow, {(r * n + j) * s}, {s}) * x[{j}]" for j in _columns(i, n, flags))
        for r, i in enumerate(_rows(n, flags))
    ]
    return _written("x, flow, nodes, known", f"({', '.join(rows)},)")


def _pushed(base, push, rest, x, nodes, known): ...


@specialised(_pushed)
def _write_pushed(base: Any, push: Any, rest: Any, x: Any, nodes: Any, known: Any) -> Any:
    n, s, flags = x.count, nodes.literal_value, known.literal_value
    every = _kicks(n, flags)
    k = len(every)
    rows = []
    for r, i in enumerate(_rows(n, flags)):
        terms = [f"base[{r}]"]
        for c in _kicked(i, n, flags):
            q = every.index(c)
            terms += [f"lanes_at(push, {((r * k + q) * s + j) * s}, {s}) * spread(rest[{q}], {j})" for j in range(s)]
        rows.append(_added(terms, 4))
    return _written("base, push, rest, x, nodes, known", f"({', '.join(rows)},)")


def _expected(x, last, ahead, nodes, known): ...


@specialised(_expected)
def _write_expected(x: Any, last: Any, ahead: Any, nodes: Any, known: Any) -> Any:
    n, s, flags = x.count, nodes.literal_value, known.literal_value
    rows = []
    for r, i in enumerate(_rows(n, flags)):
        terms = [f"lanes_at(ahead, {j * s}, {s}) * spread(last[{r}], {j})" for j in range(s)]
        terms.append(f"lanes_at(ahead, {s * s}, {s}) * x[{i}]")
        rows.append(_added(terms, 3))
    return _written("x, last, ahead, nodes, known", f"({', '.join(rows)},)")


def _like(x, ahead, nodes, known): ...


@specialised(_like)
def _write_like(x: Any, ahead: Any, nodes: Any, known: Any) -> Any:
    n, s, flags = x.count, nodes.literal_value, known.literal_value
    rows = [f"lanes_at(ahead, 0, {s}) * 0.0 + x[{i}]" for i in _rows(n, flags)]
    return _written("x, ahead, nodes, known", f"({', '.join(rows)},)")


def _whole(values, x, known): ...


@specialised(_whole)
def _write_whole(values: Any, x: Any, known: Any) -> Any:
    n, flags = x.count, known.literal_value
    rows = _rows(n, flags)
    parts = [
        f"values[{rows.index(i)}]" if i in rows else f"x[{i}]" if i >= 4 and flags & FIXED else "0.0" for i in range(n)
    ]
    return _written("values, x, known", f"({', '.join(parts)},)")


def _picked(rest, known): ...


@specialised(_picked)
def _write_picked(rest: Any, known: Any) -> Any:
    rows = [f"rest[{j}]" for j in _kicks(len(rest), known.literal_value)]
    return _written("rest, known", f"({', '.join(rows)},)")


def _ended(x, rest, end_flow, end_push, nodes, width, known): ...


@specialised(_ended)
def _write_ended(x: Any, rest: Any, end_flow: Any, end_push: Any, nodes: Any, width: Any, known: Any) -> Any:
    n, s, w, flags = x.count, nodes.literal_value, width.literal_value, known.literal_value
    terms = [f"lanes_at(end_flow, {j * w}, {w}) * x[{j}]" for j in range(n)]
    for q in range(len(_kicks(n, flags))):
        terms += [f"lanes_at(end_push, {(q * s + j) * w}, {w}) * spread(rest[{q}], {j})" for j in range(s)]
    return _written("x, rest, end_flow, end_push, nodes, width, known", _added(terms, 4))


def _taken(lanes, x): ...


@specialised(_taken)
def _write_taken(lanes: Any, x: Any) -> Any:
    return _written("lanes, x", "(" + ", ".join(f"lane(lanes, {i})" for i in range(x.count)) + ",)")


def _alike(a, b, bound): ...


@specialised(_alike)
def _write_alike(a: Any, b: Any, bound: Any) -> Any:
    text = " and ".join(f"within(a[{i}] - b[{i}], bound)" for i in range(a.count))
    return eval(f"lambda a, b, bound: {text}", {"within": within})


_small = loosened(small, {})


@fast
def _far(theta: Any, buffer: Any) -> None:
    for i in range(len(buffer) // 3):
        s, c = sincos(buffer[i])
        buffer[len(buffer) // 3 + i] = s
        buffer[2 * (len(buffer) // 3) + i] = c


def _turn(theta): ...


@specialised(_turn)
def _write_turn(theta: Any) -> Any:
    if isinstance(theta, types_float):
        return lambda theta: sincos(theta)
    count = theta.count

    def turn(theta):
        if within(theta, EIGHTH_TURN):
            return _small(theta, 0.0)
        buffer = np.empty(3 * count)
        put(buffer, 0, theta)
        _far(theta, buffer)
        return lanes_at(buffer, count, count), lanes_at(buffer, 2 * count, count)

    return turn


from numba import types

types_float = types.Float

_remainder = loosened(remainder, {sincos: _turn})


@cache
def make_collocation(PARTS: Parts, LENGTH: int, NODES: int) -> Callable[..., int]:
    KNOWN = known_of(PARTS)
    WIDTH = 4 if LENGTH <= 4 else 8 if LENGTH <= 8 else 16

    @fast
    def collocate(x, hands, bound, flow, push, ahead, end_flow, end_push, table, scene, every, out):
        one = scene[0]
        hands, table = borrowed(hands), (borrowed(table), 0)
        flow, push, ahead = borrowed(flow), borrowed(push), borrowed(ahead)
        end_flow, end_push = borrowed(end_flow), borrowed(end_push)
        for j in range(LENGTH):
            out[0, j] = x[j]
        last = _like(x, ahead, NODES, KNOWN)
        count = 0
        for i in range(len(hands)):
            left, right = pair_at(hands, i * (2 * NODES), NODES)
            base = _flows(x, flow, NODES, KNOWN)
            last = _expected(x, last, ahead, NODES, KNOWN)
            rest = _picked(_remainder(_whole(last, x, KNOWN), left, right, table, PARTS, one), KNOWN)
            for _sweep in range(_SWEEPS):
                count += 1
                last = _pushed(base, push, rest, x, NODES, KNOWN)
                new = _picked(_remainder(_whole(last, x, KNOWN), left, right, table, PARTS, one), KNOWN)
                done = _alike(new, rest, bound)
                rest = new
                if done:
                    break
            x = _taken(_ended(x, rest, end_flow, end_push, NODES, WIDTH, KNOWN), x)
            x = stopped(x, PARTS, one)
            if (i + 1) % every == 0:
                for j in range(LENGTH):
                    out[(i + 1) // every, j] = x[j]
        return count

    return collocate


@cache
def gauss_nodes(count: int) -> tuple[Decimal, ...]:
    """Return Gauss's nodes on (0, 1), to sixty digits: the roots of Legendre's polynomial, by Newton's method."""
    with localcontext() as context:
        context.prec = DIGITS
        found = []
        for i in range(count):
            x = Decimal(float(np.cos(np.pi * (i + 0.75) / (count + 0.5))))
            for _ in range(8):
                below, here = Decimal(1), x
                for k in range(2, count + 1):
                    below, here = here, ((2 * k - 1) * x * here - (k - 1) * below) / k
                x -= here * (x * x - 1) / (count * (x * here - below))
            found.append((1 - x) / 2)
    return tuple(found)


def cardinal(points: tuple[Decimal, ...]) -> list[list[Decimal]]:
    """Return the coefficients, from the constant term up, of the polynomials that are 1 at one point and 0 at the others."""
    result = []
    for own in points:
        coefficients, scale = [Decimal(1)], Decimal(1)
        for other in points:
            if other != own:
                shifted = [Decimal(0), *coefficients]
                coefficients = [a - other * b for a, b in zip(shifted, [*coefficients, Decimal(0)], strict=True)]
                scale *= own - other
        result.append([c / scale for c in coefficients])
    return result


def integrals(a: Array, h: float, c: Decimal, cards: list[list[Decimal]]) -> tuple[Array, Array]:
    """Return e^(c h A), and the integrals to c h of e^((c h - t) A) p(t / h), for each polynomial p."""
    n, degree = len(a), len(cards[0])
    step = c * Decimal(h)
    phis = phi_decimals(a, step, degree)
    weights = np.empty((len(cards), n, n))
    factor = [step]
    for k in range(1, degree):
        factor.append(factor[-1] * c * k)
    for q, card in enumerate(cards):
        w = [f * x for f, x in zip(factor, card, strict=True)]
        for i in range(n):
            for j in range(n):
                weights[q, i, j] = float(sum((wk * phis[k + 1][i][j] for k, wk in enumerate(w)), Decimal(0)))
    return np.array(phis[0], dtype=np.float64), weights


@dataclass(frozen=True)
class Tables:
    flow: Array
    push: Array
    ahead: Array
    end_flow: Array
    end_push: Array
    table: Array


def make_tables(parts: Parts, scene: Any, length: int, h: float, count: int) -> Tables:
    known = known_of(parts)
    rows, columns = _rows(length, known), _kicks(length, known)
    width = 4 if length <= 4 else 8 if length <= 8 else 16
    a = scene_matrix(parts, scene, length)
    with localcontext() as context:
        context.prec = DIGITS
        nodes = gauss_nodes(count)
        cards = cardinal(nodes)
        made = [integrals(a, h, c, cards) for c in nodes]
        end = integrals(a, h, Decimal(1), cards)
        before = cardinal((*[c - 1 for c in nodes], Decimal(0)))
        ahead = np.array([[float(sum(w * c**k for k, w in enumerate(card))) for c in nodes] for card in before])
    flow = np.stack([f[rows] for f, _ in made], axis=-1)
    push = np.stack([w[:, rows][:, :, columns].transpose(1, 2, 0) for _, w in made], axis=-1)
    end_flow, end_push = np.zeros((length, width)), np.zeros((len(columns), count, width))
    end_flow[:, :length] = end[0].T
    end_push[:, :, :length] = end[1][:, :, columns].transpose(2, 0, 1)
    return Tables(*(np.ascontiguousarray(t) for t in (flow, push, ahead, end_flow, end_push, a.T[None, None])))
