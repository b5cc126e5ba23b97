"""A thousand million steps through random scenes with random hands: nothing may turn infinite, no energy come from nowhere.

Scenes are drawn from all that a configuration may say, and kept if the automatic choice steps them by RK4, once a tick.
Hands rest, wave, jump, tremble, are quantised and freeze, and are held between samples in any of the ways there are. A
thousand dyads go on at once (`netboard.methods.batch`).

After every step the energy of what the hands do not hold, with the couplings' springs as if from the board to the
ground, must have changed by the work of the drives u through the board's ends, less what the dampers take: ``E' = u vz
- c vz^2 + ...``. That can be at most ``u^2 / 4c`` for each hand, whatever the board does: the bound on what hands put in.
"""

import math
from collections.abc import Callable
from dataclasses import dataclass, field, replace
from functools import cache, partial
from time import perf_counter
from typing import Any

import numpy as np
from numpy.typing import NDArray

from netboard.compiled import fast, inlined, loosened
from netboard.config import Physics
from netboard.errors import ConfigError
from netboard.methods.batch import (
    LANES,
    anywhere,
    column_at,
    in_blocks,
    make_batch,
    numbers_at,
    out_of_blocks,
    scene_blocks,
)
from netboard.methods.choice import TILTS, choose
from netboard.methods.stability import stiffness
from netboard.physics.energy import flows, stored
from netboard.physics.models import rates, turned
from netboard.physics.scene import Parts, pack_scene, parts_of, state_length
from netboard.physics.trig import sincos
from netboard.physics.vectors import plus
from netboard.studies.results import Part, Value, Verdict
from netboard.studies.stability_maps import Tell, board_matrix
from netboard.tick import TICK_SECONDS

Array = NDArray[np.float64]

KINDS = {
    "paper": Physics(),
    "paper, no ball": Physics(balls=0),
    "paper, one hand": Physics(coupling="left", b_z=0.1, b_theta=0.01),
    "lagrangian": Physics(model="lagrangian"),
    "lagrangian, two balls that roll": Physics(model="lagrangian", balls=2, ball_inertia=0.4, ball_height=0.02),
    "lagrangian, stops": Physics(model="lagrangian", ball_stop=0.35),
}

DYADS = 16 * LANES
"""Simulations at once [1]."""

BETWEEN = 100
"""Ticks from check to check [1]."""

RUN_AWAY = 0.5
"""A ball farther than this from the centre is put back there [m]."""

MOST_TURN = 0.1
"""No method follows a board that turns farther in a step [rad]."""

RANGE = 0.075
"""Styluses stay within +- this [m]."""

LARGEST_ACCELERATION = 50.0
"""As in the live tick [m/s2]."""

BALANCE = 0.05
"""The most that the energy may be off, as a share of the flows [1]."""

LEAST_FLOW = 1e-9
"""Flows that sum up to less between two checks are not looked at closely [J]."""

_rates, _flows, _stored = (loosened(text, {sincos: anywhere}) for text in (rates, flows, stored))
_turned, _plus = loosened(turned, {sincos: anywhere}), loosened(plus, {})

# What a hand is made of: a wave and a tremor round a place, and how it is sampled and held.
PLACE, SIZE, RATE, COS, SIN, TURN_COS, TURN_SIN, TREMOR, SHAKE_COS, SHAKE_SIN = range(10)
QUANTUM, FROZEN, GOES_ON, BENDS, LAST_Z, LAST_VZ = range(10, 16)
HAND = 16

_LARGEST_TILT = max(TILTS)

SHAKE = 2.0 * math.pi * 100.0
_SHAKE_COS, _SHAKE_SIN = math.cos(SHAKE * TICK_SECONDS), math.sin(SHAKE * TICK_SECONDS)

THROUGH, SUPPLY, GROWTH, WRONG, BEYOND = range(5)
SUMS = 5
"""Magnitudes of the flows, the bound on what hands put in, growth, growth that is not work [J]; states beyond [1]."""


@fast
def move_hands(hand: Any, side: int, scenes: Any, out: Any) -> None:
    """Move one hand of every dyad on by a tick, and write the polynomials of its drive.

    Parameters
    ----------
    hand : ndarray of float64, shape (blocks, HAND, LANES)
        The hands; moved on in place [SI].
    side : int
        0 for the left one, 1 for the right one [1].
    scenes : ndarray of float64, shape (blocks, numbers, LANES)
        The scenes [SI].
    out : ndarray of float64, shape (blocks, 8, LANES)
        The polynomials [N, N/s, N/s2, N/s3].
    """
    h, done = TICK_SECONDS, np.empty((9, LANES))
    for b in range(len(hand)):
        for j in range(LANES):
            scene = numbers_at(scenes, b, j)
            k = scene["k_left"] if side == 0 else scene["k_right"]
            c = scene["c_left"] if side == 0 else scene["c_right"]
            cos, sin = hand[b, COS, j], hand[b, SIN, j]
            turn_cos, turn_sin = hand[b, TURN_COS, j], hand[b, TURN_SIN, j]
            cos, sin = cos * turn_cos - sin * turn_sin, sin * turn_cos + cos * turn_sin
            shake_cos, shake_sin = hand[b, SHAKE_COS, j], hand[b, SHAKE_SIN, j]
            shake_cos, shake_sin = (
                shake_cos * _SHAKE_COS - shake_sin * _SHAKE_SIN,
                shake_sin * _SHAKE_COS + shake_cos * _SHAKE_SIN,
            )
            size, tremor = hand[b, SIZE, j], hand[b, TREMOR, j]
            z = hand[b, PLACE, j] + size * sin + tremor * shake_sin
            vz = size * hand[b, RATE, j] * cos + tremor * SHAKE * shake_cos
            beyond = abs(z) > RANGE
            z = (RANGE if z > 0.0 else -RANGE) if beyond else z
            vz = 0.0 if beyond else vz
            last_z, last_vz, quantum = hand[b, LAST_Z, j], hand[b, LAST_VZ, j], hand[b, QUANTUM, j]
            coarse = np.floor(z / (quantum if quantum > 0.0 else 1.0) + 0.5) * quantum
            vz = (coarse - last_z) / h if quantum > 0.0 else vz
            z = coarse if quantum > 0.0 else z
            frozen = hand[b, FROZEN, j] > 0.0
            z, vz = last_z if frozen else z, 0.0 if frozen else vz
            az = (vz - last_vz) / h
            az = LARGEST_ACCELERATION if az > LARGEST_ACCELERATION else az
            az = -LARGEST_ACCELERATION if az < -LARGEST_ACCELERATION else az
            az *= hand[b, BENDS, j]
            goes_on = hand[b, GOES_ON, j]
            done[0, j], done[1, j], done[2, j], done[3, j] = cos, sin, shake_cos, shake_sin
            done[4, j], done[5, j] = z, vz
            done[6, j] = k * z + c * vz
            done[7, j] = goes_on * (k * vz + c * az)
            done[8, j] = goes_on * (0.5 * k * az)
        for j in range(LANES):
            hand[b, COS, j], hand[b, SIN, j] = done[0, j], done[1, j]
            hand[b, SHAKE_COS, j], hand[b, SHAKE_SIN, j] = done[2, j], done[3, j]
            hand[b, LAST_Z, j], hand[b, LAST_VZ, j] = done[4, j], done[5, j]
            for n in range(3):
                out[b, 4 * side + n, j] = done[6 + n, j]


@inlined
def _middle(u: Any, t: float) -> tuple[float, float]:
    """Return both drives at a time."""
    return u[0] + t * (u[1] + t * u[2]), u[4] + t * (u[5] + t * u[6])


@inlined
def _held(x: Any, parts: Parts, scene: Any) -> float:
    """Return the energy, with the couplings' springs to the ground."""
    kept = _stored(x, 0.0, 0.0, parts, scene)
    return kept[0] + kept[1] + kept[2] + kept[3] + kept[4]


@inlined
def _power(x: Any, left: float, right: float, parts: Parts, scene: Any) -> tuple[float, float, float]:
    """Return the power of all flows, the sum of their magnitudes, and the most that they can be."""
    s, c = _turned(x[2], parts)
    arm_rate = scene["l"] * x[3] * c
    pushed, turned_ = left * (x[1] - arm_rate), right * (x[1] + arm_rate)
    flow = _flows(x, 0.0, 0.0, 0.0, 0.0, parts, scene)
    lost = flow[2] + flow[3] + flow[4]
    size = abs(pushed) + abs(turned_) - lost + abs(flow[5])
    c_left, c_right = scene["c_left"], scene["c_right"]
    most = (0.25 * left * left / c_left if c_left > 0.0 else 0.0) + (
        0.25 * right * right / c_right if c_right > 0.0 else 0.0
    )
    return pushed + turned_ + lost + flow[5], size, most + flow[5]


@inlined
def _farthest(x: Any, length: int) -> float:
    """Return how far the farthest ball is from the centre [m]."""
    far = 0.0
    for i in range(4, length, 2):
        far = abs(x[i]) if abs(x[i]) > far else far
    return far


@inlined
def _is_beyond(x: Any, length: int, scene: Any) -> bool:
    """Tell whether the board tilts or turns farther, or a ball is farther out, than the choice of a method looks at."""
    slow = abs(x[3]) * TICK_SECONDS <= MOST_TURN
    return not (slow and abs(x[2]) <= _LARGEST_TILT and _farthest(x, length) <= 2.0 * scene["l"])


@cache
def make_audit(PARTS: Parts, LENGTH: int) -> Callable[[Array, Array, Array, Array, Array], None]:
    """Compile the audit of a step's energy.

    Parameters
    ----------
    PARTS : Parts
        What the scenes have.
    LENGTH : int
        Length of a state [1].

    Returns
    -------
    callable
        ``audit(before, after, hands, scenes, sums)`` adds to `sums`, of shape (blocks, SUMS, LANES), what the step from
        one state to the other did. Flows are integrated by Simpson's rule, with the cubic between both states.
    """

    @fast
    def audit(before: Any, after: Any, hands: Any, scenes: Any, sums: Any) -> None:
        h, done = TICK_SECONDS, np.empty((SUMS, LANES))
        for b in range(len(before)):
            for j in range(LANES):
                scene = numbers_at(scenes, b, j)
                x0, x1, u = column_at(before, b, j, LENGTH), column_at(after, b, j, LENGTH), column_at(hands, b, j, 8)
                left, right = _middle(u, 0.5 * h)
                last_left, last_right = _middle(u, h)
                r0, r1 = _rates(x0, u[0], u[4], PARTS, scene), _rates(x1, last_left, last_right, PARTS, scene)
                middle = _plus(_plus(_plus(_plus(x0, -0.5, x0), 0.5, x1), 0.125 * h, r0), -0.125 * h, r1)
                a, a_size, a_most = _power(x0, u[0], u[4], PARTS, scene)
                m, m_size, m_most = _power(middle, left, right, PARTS, scene)
                e, e_size, e_most = _power(x1, last_left, last_right, PARTS, scene)
                work = h / 6.0 * (a + 4.0 * m + e)
                growth = _held(x1, PARTS, scene) - _held(x0, PARTS, scene)
                struck = PARTS.stops and _farthest(x1, LENGTH) >= scene["stop"]
                done[THROUGH, j] = h / 6.0 * (a_size + 4.0 * m_size + e_size)
                done[SUPPLY, j] = h / 6.0 * (a_most + 4.0 * m_most + e_most)
                done[GROWTH, j] = growth
                done[WRONG, j] = 0.0 if struck else growth - work
                done[BEYOND, j] = 1.0 if _is_beyond(x1, LENGTH, scene) else 0.0
            for k in range(SUMS):
                for j in range(LANES):
                    sums[b, k, j] += done[k, j]

    return audit


# --- what is drawn -----------------------------------------------------------------------------------------------


def _spread(rng: np.random.Generator, low: float, high: float) -> float:
    """Draw a number of any magnitude in a range."""
    return float(np.exp(rng.uniform(math.log(low), math.log(high))))


def draw_scene(rng: np.random.Generator, kind: Physics) -> Physics:
    """Draw a scene that the automatic choice steps by RK4, once a tick.

    Parameters
    ----------
    rng : Generator
        Where chance comes from.
    kind : Physics
        What it has; its numbers are drawn anew.

    Returns
    -------
    Physics
        The scene.
    """
    while True:
        physics = replace(
            kind,
            M=_spread(rng, 1e-3, 3.0),
            m=_spread(rng, 1e-3, 1.0),
            g=rng.uniform(0.0, 20.0),
            k_h=_spread(rng, 10.0, 1e4),
            c_h=_spread(rng, 0.01, 50.0),
            k_s=_spread(rng, 0.1, 1e3),
            l=_spread(rng, 0.05, 1.0),
            I=_spread(rng, 1e-5, 1.0),
            ball_height=rng.uniform(0.0, 0.2) if kind.ball_height > 0.0 else 0.0,
            restitution=rng.uniform(0.0, 1.0) if kind.ball_stop > 0.0 else 0.0,
            b_z=_spread(rng, 1e-3, 5.0) if kind.b_z > 0.0 else 0.0,
            b_theta=_spread(rng, 1e-5, 0.5) if kind.b_theta > 0.0 else 0.0,
        )
        if stiffness(board_matrix(physics), TICK_SECONDS) < 1.0 and _is_chosen(physics):
            return physics


def _is_chosen(physics: Physics) -> bool:
    """Tell whether a scene is stepped by RK4, once a tick."""
    try:
        choice = choose(physics, TICK_SECONDS)
    except ConfigError:
        return False
    return (choice.method, choice.substeps) == ("rk4", 1)


def draw_hands(rng: np.random.Generator, hand: Array, share: float) -> None:
    """Give some hands something else to do; those of them that change place jump.

    Parameters
    ----------
    rng : Generator
        Where chance comes from.
    hand : ndarray of float64, shape (blocks, HAND, LANES)
        The hands; changed in place [SI].
    share : float
        Which share of them [1].
    """
    shape = (len(hand), LANES)
    rate, phase = 2.0 * np.pi * rng.uniform(0.2, 5.0, shape), rng.uniform(0.0, 2.0 * np.pi, (2, *shape))
    hold = rng.integers(0, 3, shape)
    drawn = np.zeros((len(hand), LAST_Z, LANES))
    drawn[:, PLACE] = rng.uniform(-RANGE, RANGE, shape)
    drawn[:, SIZE] = rng.uniform(0.0, 0.05, shape) * (rng.random(shape) < 0.8)
    drawn[:, RATE] = rate
    drawn[:, COS], drawn[:, SIN] = np.cos(phase[0]), np.sin(phase[0])
    drawn[:, TURN_COS], drawn[:, TURN_SIN] = np.cos(rate * TICK_SECONDS), np.sin(rate * TICK_SECONDS)
    drawn[:, TREMOR] = rng.uniform(0.0, 0.002, shape) * (rng.random(shape) < 0.2)
    drawn[:, SHAKE_COS], drawn[:, SHAKE_SIN] = np.cos(phase[1]), np.sin(phase[1])
    drawn[:, QUANTUM] = np.exp(rng.uniform(math.log(2e-5), math.log(2e-3), shape)) * (rng.random(shape) < 0.25)
    drawn[:, FROZEN] = rng.random(shape) < 0.05
    drawn[:, GOES_ON], drawn[:, BENDS] = hold > 0, hold > 1
    renewed = (rng.random(shape) < share)[:, None, :]
    hand[:, :LAST_Z] = np.where(renewed, drawn, hand[:, :LAST_Z])


# --- soaking -----------------------------------------------------------------------------------------------------


@dataclass
class Tally:
    """What came of checks.

    Attributes
    ----------
    checks : int
        How many [1].
    lost : int
        States that were not finite [1].
    excess : float
        Most growth of energy beyond what hands can put in, as a share of the flows [1].
    wrong : float
        Most energy that came or went other than by the flows, as a share of them [1].
    """

    checks: int = 0
    lost: int = 0
    excess: float = -math.inf
    wrong: float = 0.0

    def take(self, x: Array, sums: Array) -> None:
        """Check simulations.

        Parameters
        ----------
        x : ndarray of float64, shape (n, length)
            Their states [SI].
        sums : ndarray of float64, shape (n, SUMS)
            What their last steps did.
        """
        fine = np.isfinite(x).all(axis=1) & np.isfinite(sums).all(axis=1)
        self.checks += len(x)
        self.lost += int(np.count_nonzero(~fine))
        flowed = sums[fine, THROUGH] + LEAST_FLOW
        self.excess = max(self.excess, float(np.max((sums[fine, GROWTH] - sums[fine, SUPPLY]) / flowed, initial=-1.0)))
        self.wrong = max(self.wrong, float(np.max(np.abs(sums[fine, WRONG]) / flowed, initial=0.0)))


@dataclass
class Soaked:
    """What came of one kind of scene.

    Attributes
    ----------
    steps, restarts : int
        How many [1].
    within, beyond : Tally
        While the board stayed within the tilts and balls within the places that the choice of a method looks at, and
        while they did not.
    seconds : float
        How long it took [s].
    """

    steps: int = 0
    restarts: int = 0
    within: Tally = field(default_factory=Tally)
    beyond: Tally = field(default_factory=Tally)
    seconds: float = 0.0


def soak_kind(
    kind: Physics, steps: int, seed: int, scenes: int = 256, tell: Callable[[float], object] = lambda share: None
) -> Soaked:
    """Soak one kind of scene.

    Parameters
    ----------
    kind : Physics
        What scenes have.
    steps : int
        Steps of single simulations, at the least [1].
    seed : int
        Of everything random [1].
    scenes : int
        Different scenes; each is with several pairs of hands [1].
    tell : callable
        Hears the share that is done.

    Returns
    -------
    Soaked
        What came of it.
    """
    rng = np.random.default_rng(seed)
    drawn = np.concatenate([pack_scene(draw_scene(rng, kind)) for _ in range(scenes)])
    packed = scene_blocks(np.resize(drawn, DYADS))
    parts, length = parts_of(kind), state_length(kind)
    step, audit = make_batch(parts, length, True), make_audit(parts, length)
    x = in_blocks(np.zeros((DYADS, length)))
    before, drives, sums = np.empty_like(x), np.zeros((len(x), 8, LANES)), np.zeros((len(x), SUMS, LANES))
    hands = [np.zeros((len(x), HAND, LANES)) for _ in range(2)]
    for hand in hands:
        draw_hands(rng, hand, 1.0)
        hand[:, LAST_Z] = hand[:, PLACE]
    found, begun = Soaked(), perf_counter()
    while found.steps < steps:
        for _ in range(BETWEEN):
            for side, hand in enumerate(hands):
                move_hands(hand, side, packed, drives)
            before[:] = x
            step(x, drives, packed, TICK_SECONDS)
            audit(before, x, drives, packed, sums)
            found.restarts += _restart(x)
        found.steps += BETWEEN * DYADS
        states, did = out_of_blocks(x), out_of_blocks(sums)
        beyond = did[:, BEYOND] > 0.0
        found.within.take(states[~beyond], did[~beyond])
        found.beyond.take(states[beyond], did[beyond])
        x[:] = np.where(np.isfinite(x).all(axis=1)[:, None, :], x, 0.0)
        sums[:] = 0.0
        for hand in hands:
            draw_hands(rng, hand, 0.1)
        tell(found.steps / steps)
    found.seconds = perf_counter() - begun
    return found


@fast
def _restart(x: Any) -> int:
    """Put balls that ran away back to the centre, and return of how many dyads."""
    count = 0
    for b in range(len(x)):
        for j in range(LANES):
            away = False
            for i in range(4, x.shape[1], 2):
                away |= abs(x[b, i, j]) > RUN_AWAY
            if away:
                count += 1
                x[b, 4:, j] = 0.0
    return count


def soak(steps: int, seed: int = 1, scenes: int = 256, tell: Tell = lambda text, share: None) -> Part:
    """Soak every kind of scene.

    Parameters
    ----------
    steps : int
        Steps of single simulations in all, at the least [1].
    seed : int
        Of everything random [1].
    scenes : int
        Different scenes of each kind [1].
    tell : callable
        Hears how far it is.

    Returns
    -------
    Part
        What came of it.
    """
    found = {}
    for i, (name, kind) in enumerate(KINDS.items()):
        tell(f"soak: {name}: drawing scenes", 0.0)
        share = steps // len(KINDS) + 1
        found[name] = soak_kind(kind, share, seed + i, scenes, partial(tell, f"soak: {name}"))
    rows: list[tuple[Value, ...]] = []
    for name, one in found.items():
        for where, tally in (("within", one.within), ("beyond", one.beyond)):
            rows.append((name, where, tally.checks, tally.lost, tally.excess, tally.wrong))
    done, restarts = sum(one.steps for one in found.values()), sum(one.restarts for one in found.values())
    seconds = sum(one.seconds for one in found.values())
    within, beyond = [one.within for one in found.values()], [one.beyond for one in found.values()]
    excess, wrong = max(tally.excess for tally in within), max(tally.wrong for tally in within)
    lost, checks = sum(tally.lost for tally in within), sum(tally.checks for tally in within)
    lost_beyond, worst_beyond = sum(tally.lost for tally in beyond), max(tally.excess for tally in beyond)
    degrees = math.degrees(_LARGEST_TILT)
    return Part(
        "soak",
        f"Soak: {done:.4g} steps of 1 ms in {len(KINDS) * scenes} random scenes, {seconds:.3g} s, {restarts} balls put "
        f"back; within: tilts to {degrees:.0f} deg, turns to {MOST_TURN:g} rad in a step, balls to twice the arm",
        (
            "kind of scene",
            "where",
            f"checks, each of {BETWEEN} steps [1]",
            "not finite [1]",
            "growth - what hands can put in, over flows [1]",
            "growth - flows, over flows [1]",
        ),
        rows,
        [
            Verdict("within: every state is finite", lost == 0, f"{lost} of {checks} are not"),
            Verdict(
                "within: energy grows by no more than hands can put in", excess < 0.0, f"{excess:+.2g} of the flows"
            ),
            Verdict(f"within: energy is off by less than {BALANCE:.0%} of the flows", wrong < BALANCE, f"{wrong:.2g}"),
            Verdict(
                "beyond: every state is finite, and energy grows by no more than hands can put in",
                lost_beyond == 0 and worst_beyond < 0.0,
                f"{lost_beyond} of {sum(tally.checks for tally in beyond)} are not finite, {worst_beyond:+.2g} of the flows",
            ),
        ],
    )
