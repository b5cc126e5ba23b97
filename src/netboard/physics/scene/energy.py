"""Stored energies and power flows of a scene, in strict arithmetic, and their integrals along a trajectory.

The flows add up exactly to the rate of the stored energy. In the Lagrangian model energy comes from the hands and is
dissipated by dampers and friction. The paper's equations are not quite those of a mechanical system; the energy that
they add is a flow of its own. Impacts at stops dissipate energy instantaneously and are in no flow, so the balance
along a trajectory lacks it. docs/explanation/physics.md derives it; `netboard.physics.scene.models` has the symbols.
"""

from collections.abc import Callable
from functools import cache
from typing import Any, NamedTuple

import numpy as np
from numpy.polynomial.polynomial import polyder, polyval
from numpy.typing import NDArray

from netboard.base.compiled import Records, inlined, kernel
from netboard.physics.arithmetic.vectors import State, affine, alike, dot, places, row, speeds, total
from netboard.physics.scene.models import friction, rates, turned
from netboard.physics.scene.parameters import Parts


class StoredEnergy(NamedTuple):
    """Stored energies; potential energy is relative to the height of the origin.

    Attributes
    ----------
    kinetic : float
        Kinetic energy of board and balls [J].
    gravity : float
        Gravitational potential energy [J].
    spring_left, spring_right : float
        Of the springs of the virtual couplings [J].
    spring_board : float
        Of the spring between board and origin [J].
    """

    kinetic: float
    gravity: float
    spring_left: float
    spring_right: float
    spring_board: float


class Powers(NamedTuple):
    """Powers, + = into the scene.

    Attributes
    ----------
    hand_left, hand_right : float
        From the left and the right hand, through their virtual couplings [W].
    damper_left, damper_right : float
        Into the dampers of the virtual couplings, never positive [W].
    damper_board : float
        Into the damping of the board's heave and tilt, never positive [W].
    model : float
        Power that the paper's equations add; 0 in the Lagrangian model [W].
    friction : float
        Into the friction between balls and board, never positive [W].
    """

    hand_left: float
    hand_right: float
    damper_left: float
    damper_right: float
    damper_board: float
    model: float
    friction: float


@inlined
def _moving(x: State, s: float, c: float, parts: Parts, scene: np.void) -> float:
    """Return the kinetic energy of the balls [J]; in the paper's model only that of their motion along the board."""
    p, vz, omega = places(x), x[1], x[3]
    m: float = scene["m"]
    mass_ratio: float = scene["mass_ratio"]
    if not parts.lagrangian:
        return 0.5 * (m / mass_ratio) * dot(speeds(x), speeds(x)) if parts.free else 0.0
    lever = scene["ball_height"] * omega
    if parts.free:
        along = affine(-lever, 1.0, speeds(x))
    else:
        m *= scene["fixed_load"]
        along = alike(-lever, p)
    lifted = s * total(along) + omega * c * total(p)
    return 0.5 * m * (dot(along, along) / mass_ratio + omega * omega * dot(p, p) + vz * (len(p) * vz + 2.0 * lifted))


@inlined
def stored(x: State, left_z: float, right_z: float, parts: Parts, scene: np.void) -> StoredEnergy:
    """Return the stored energies of the scene; their sum is its whole energy [J]."""
    s, c = turned(x[2], parts)
    z, arm = x[0], scene["l"] * s
    kinetic = 0.5 * (scene["M"] * (x[1] * x[1]) + scene["I"] * (x[3] * x[3]))
    gravity = scene["M"] * scene["g"] * z
    if parts.loaded:
        kinetic += _moving(x, s, c, parts, scene)
        weight = scene["m"] * scene["g"]
        if not parts.free:
            weight *= scene["fixed_load"]
        above = z + scene["ball_height"] * c if parts.lagrangian else z
        gravity += weight * (len(places(x)) * above + s * total(places(x)))
    left, right = left_z - (z - arm), right_z - (z + arm)
    return StoredEnergy(
        kinetic,
        gravity,
        0.5 * scene["k_left"] * (left * left),
        0.5 * scene["k_right"] * (right * right),
        0.5 * scene["k_s"] * (z * z),
    )


@inlined
def flows(
    x: State, left_z: float, left_vz: float, right_z: float, right_vz: float, parts: Parts, scene: np.void
) -> Powers:
    """Return the power flows of the scene; their sum is the rate of the stored energy [W]."""
    s, c = turned(x[2], parts)
    z, vz, omega = x[0], x[1], x[3]
    arm, arm_rate = scene["l"] * s, scene["l"] * omega * c
    left, left_slip = left_z - (z - arm), left_vz - (vz - arm_rate)
    right, right_slip = right_z - (z + arm), right_vz - (vz + arm_rate)
    added = 0.0
    if parts.loaded and not parts.lagrangian:
        # The board carries only c^2 of a ball's weight, and with the printed sign a ball rolls uphill.
        g, load = scene["g"], scene["m"]
        added = len(places(x)) * (g * s) * vz
        if parts.free:
            added += (g + scene["ball_gravity"] / scene["mass_ratio"]) * total(speeds(x))
        else:
            load *= scene["fixed_load"]
        added *= load * s
    heat = 0.0
    if parts.resisted:
        heat = -dot(friction(speeds(x), scene["m"] * scene["g"] * abs(c), parts, scene), speeds(x))
    return Powers(
        (scene["k_left"] * left + scene["c_left"] * left_slip) * left_vz,
        (scene["k_right"] * right + scene["c_right"] * right_slip) * right_vz,
        -scene["c_left"] * (left_slip * left_slip),
        -scene["c_right"] * (right_slip * right_slip),
        -(scene["b_z"] * (vz * vz) + scene["b_theta"] * (omega * omega)),
        added,
        heat,
    )


_GAUSS = (0.5 - 0.15**0.5, 0.5, 0.5 + 0.15**0.5)
_SHARES = np.array([5.0, 8.0, 5.0]) / 18.0
"""Nodes and weights of the Gauss-Legendre rule on 0..1."""


def _values_and_slopes(*polynomials: tuple[float, ...]) -> NDArray[np.float64]:
    """Return values and slopes of polynomials at the nodes, as an array (node, value or slope, polynomial)."""
    basis = np.array(polynomials).T
    both = np.array([polyval(_GAUSS, basis), polyval(_GAUSS, polyder(basis))])
    return np.ascontiguousarray(np.moveaxis(both, -1, 0))


# Hermite basis: polynomials for the difference of the end values, for both rates, and for both accelerations.
_QUINTIC = _values_and_slopes(
    (0.0, 0.0, 0.0, 10.0, -15.0, 6.0),
    (0.0, 1.0, 0.0, -6.0, 8.0, -3.0),
    (0.0, 0.0, 0.0, -4.0, 7.0, -3.0),
    (0.0, 0.0, 0.5, -1.5, 1.5, -0.5),
    (0.0, 0.0, 0.0, 0.5, -1.0, 0.5),
)
_CUBIC = _values_and_slopes((0.0, 0.0, 3.0, -2.0), (0.0, 1.0, -2.0, 1.0), (0.0, 0.0, -1.0, 1.0))


@inlined
def _interpolate_state(
    w: NDArray[np.float64],
    x: NDArray[np.float64],
    before: State,
    after: State,
    i: int,
    j: int,
    h: float,
    out: NDArray[np.float64],
) -> None:
    """Write coordinate j and its rate at a node of interval i, interpolated by the quintic."""
    step, start, end = x[i + 1, j] - x[i, j], h * x[i, j + 1], h * x[i + 1, j + 1]
    bend, last = (h * h) * before[j + 1], (h * h) * after[j + 1]
    out[j] = x[i, j] + (w[0, 0] * step + w[0, 1] * start + w[0, 2] * end + w[0, 3] * bend + w[0, 4] * last)
    out[j + 1] = (w[1, 0] * step + w[1, 1] * start + w[1, 2] * end + w[1, 3] * bend + w[1, 4] * last) / h


@inlined
def _stylus_at(w: NDArray[np.float64], styluses: NDArray[np.float64], i: int, j: int, h: float) -> tuple[float, float]:
    """Return height and rate of the stylus in columns j and j + 1 at a node of interval i, by the cubic."""
    step, start, end = styluses[i + 1, j] - styluses[i, j], h * styluses[i, j + 1], h * styluses[i + 1, j + 1]
    z = styluses[i, j] + (w[0, 0] * step + w[0, 1] * start + w[0, 2] * end)
    return z, (w[1, 0] * step + w[1, 1] * start + w[1, 2] * end) / h


@inlined
def _rate(
    like: State, states: NDArray[np.float64], styluses: NDArray[np.float64], i: int, parts: Parts, scene: np.void
) -> State:
    """Return the rate of state i under the styluses of row i."""
    left = scene["k_left"] * styluses[i, 0] + scene["c_left"] * styluses[i, 1]
    right = scene["k_right"] * styluses[i, 2] + scene["c_right"] * styluses[i, 3]
    return rates(row(states, i, like), left, right, parts, scene)


@cache
def _make_along(PARTS: Parts) -> tuple[Callable[..., None], Callable[..., None]]:
    """Compile the energies of many states, and the work between them."""

    @kernel
    def all_stored(
        like: State,
        states: NDArray[np.float64],
        styluses: NDArray[np.float64],
        scene: Records,
        out: NDArray[np.float64],
    ) -> None:
        for i in range(len(states)):
            energies = stored(row(states, i, like), styluses[i, 0], styluses[i, 2], PARTS, scene[0])
            for j in range(len(energies)):
                out[i, j] = energies[j]

    @kernel
    def all_work(
        like: State,
        times: NDArray[np.float64],
        states: NDArray[np.float64],
        styluses: NDArray[np.float64],
        scene: Records,
        out: NDArray[np.float64],
    ) -> None:
        one, at = scene[0], np.empty((1, len(like)))
        after = _rate(like, states, styluses, 0, PARTS, one)
        for i in range(len(times) - 1):
            h = times[i + 1] - times[i]
            before, after = after, _rate(like, states, styluses, i + 1, PARTS, one)
            out[i + 1] = out[i]
            for node in range(len(_SHARES)):
                for j in range(0, len(like), 2):
                    _interpolate_state(_QUINTIC[node], states, before, after, i, j, h, at[0])
                left_z, left_vz = _stylus_at(_CUBIC[node], styluses, i, 0, h)
                right_z, right_vz = _stylus_at(_CUBIC[node], styluses, i, 2, h)
                flow = flows(row(at, 0, like), left_z, left_vz, right_z, right_vz, PARTS, one)
                for j in range(len(flow)):
                    out[i + 1, j] += _SHARES[node] * h * flow[j]

    return all_stored, all_work


def stored_along(
    states: NDArray[np.float64], styluses: NDArray[np.float64], parts: Parts, scene: NDArray[Any]
) -> NDArray[np.float64]:
    """Return the stored energies at each state, with the columns of `StoredEnergy` [J]."""
    out = np.empty((len(states), len(StoredEnergy._fields)))
    _make_along(parts)[0]((0.0,) * states.shape[1], states, styluses, scene, out)
    return out


def work_along(
    times: NDArray[np.float64],
    states: NDArray[np.float64],
    styluses: NDArray[np.float64],
    parts: Parts,
    scene: NDArray[Any],
) -> NDArray[np.float64]:
    """Return the work done through each flow since the start of a trajectory, with the columns of `Powers` [J].

    Between two states the board is interpolated by the quintic that matches positions, rates and accelerations, and a
    stylus by the cubic. A Gauss-Legendre rule of three nodes integrates the power; the error is of order six.

    Parameters
    ----------
    times : ndarray of float64, shape (n,)
        Times of the states, ascending [s].
    """
    out = np.zeros((len(states), len(Powers._fields)))
    _make_along(parts)[1]((0.0,) * states.shape[1], times, states, styluses, scene, out)
    return out
