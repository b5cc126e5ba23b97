"""The equations of motion derived with sympy, and the kernels' source run on the same symbols.

Run without compilation (``NUMBA_DISABLE_JIT=1 python derivation.py``), the kernels are plain Python, and take symbols
as they take numbers. What they return is put into Lagrange's equations, derived here from the energies alone, and every
difference must vanish. Differences are rational functions of the symbols; one that is not identically zero almost never
vanishes at random points of many digits (Schwartz and Zippel). Prints every claim and whether it holds.
"""

import json
import random
from collections.abc import Iterator
from typing import Any

import sympy as sp

from netboard.base.tables.scene import FRICTION
from netboard.physics.scene import energy, models
from netboard.physics.scene.parameters import SCENE, Parts

# Symbols of one scene; sine and cosine of the tilt are symbols too.
s, c = sp.symbols("s c", real=True)
SYMBOLS = {name: sp.Symbol(name, positive=True) for name in SCENE.names or ()}
M, m, g, k_s, l, I = (SYMBOLS[name] for name in ("M", "m", "g", "k_s", "l", "I"))  # noqa: E741
r, restitution = SYMBOLS["ball_height"], SYMBOLS["restitution"]
beta = 1 / SYMBOLS["mass_ratio"] - 1
z, vz, theta, omega, az, ao = sp.symbols("z vz theta omega az ao", real=True)
left, right = sp.symbols("u_left u_right", real=True)

WHOLE = Parts(lagrangian=True, heaves=True, tilts=True, even=False, damped=True, loaded=True, free=True, stops=True)


def state(balls: int) -> tuple[Any, ...]:
    """A state of symbols."""
    along = [sp.symbols(f"p{i} w{i}", real=True) for i in range(balls)]
    return (z, vz, theta, omega, *(value for pair in along for value in pair))


def record(parts: Parts) -> dict[str, Any]:
    """The scene as symbols, as far as its parts leave it free."""
    values = dict(SYMBOLS)
    if parts.even:
        values |= {"k_right": values["k_left"], "c_right": values["c_left"]}
    if not parts.damped:
        values |= {"b_theta": sp.Integer(0)}
    return values


def is_zero(expression: Any) -> bool:
    """Whether an expression in the symbols vanishes, in exact arithmetic, wherever s^2 + c^2 = 1."""
    exact = sp.nsimplify(expression, rational=True)
    chance = random.Random(1)
    for _ in range(2):
        point = {symbol: sp.Rational(chance.randrange(1, 10**6), 997) for symbol in exact.free_symbols}
        half = sp.Rational(chance.randrange(1, 10**6), 10**6)  # tan(theta / 2)
        point |= {s: 2 * half / (1 + half**2), c: (1 - half**2) / (1 + half**2)}
        if exact.xreplace(point) != 0:
            return False
    return True


# --- Lagrange's equations ------------------------------------------------------------------------------------------


def ball_energies(place: Any, speed: Any, height: Any, rise: Any, tilt: Any, turn: Any, sphere: Any) -> tuple[Any, Any]:
    """Kinetic and potential energy of one ball on the board, from its position."""
    time = sp.Symbol("t")
    q, h, a = (sp.Function(name)(time) for name in "qha")
    x = q * sp.cos(a) - r * sp.sin(a)
    y = h + q * sp.sin(a) + r * sp.cos(a)
    back = {q.diff(time): speed, h.diff(time): rise, a.diff(time): turn}
    moved = (x.diff(time) ** 2 + y.diff(time) ** 2).subs(back)
    # A ball that rolls turns with the board, less p'/r: (r theta' - p')^2 stays finite where r is 0.
    kinetic = m * moved / 2 + sphere * m * (r * turn - speed) ** 2 / 2
    return tuple(e.subs({q: place, h: height, a: tilt}) for e in (kinetic, m * g * y))


def energies(parts: Parts, x: tuple[Any, ...]) -> tuple[Any, Any]:
    """Kinetic energy, and potential energy without the couplings, of the whole scene."""
    kinetic, potential = M * vz**2 / 2 + I * omega**2 / 2, M * g * z + k_s * z**2 / 2
    for place, speed in zip(x[4::2], x[5::2], strict=True):
        share = 1 if parts.free else SYMBOLS["fixed_load"]
        moved, lifted = ball_energies(place, speed if parts.free else 0, z, vz, theta, omega, beta)
        kinetic, potential = kinetic + share * moved, potential + share * lifted
    return kinetic, potential


def hands(scene: dict[str, Any]) -> tuple[Any, Any]:
    """Forces of the hands on the board, as the paper prints them."""
    sine, cosine = sp.sin(theta), sp.cos(theta)
    return tuple(
        u - scene[f"k_{side}"] * (z + sign * l * sine) - scene[f"c_{side}"] * (vz + sign * l * omega * cosine)
        for u, side, sign in ((left, "left", -1), (right, "right", 1))
    )


def coordinates(parts: Parts, x: tuple[Any, ...]) -> list[tuple[Any, Any, Any, Any]]:
    """Each moving coordinate, its rate, the generalised force on it, and its index."""
    scene = record(parts)
    f_left, f_right = hands(scene)
    found = []
    if parts.heaves:
        found.append((z, vz, f_left + f_right - scene["b_z"] * vz, 0))
    if parts.tilts:
        found.append((theta, omega, (f_right - f_left) * l * sp.cos(theta) - scene["b_theta"] * omega, 2))
    if parts.free:
        drag = scene["b_p"] if parts.resisted else sp.Integer(0)
        found += [(x[i], x[i + 1], -drag * x[i + 1], i) for i in range(4, len(x), 2)]
    return found


def constrained(parts: Parts, expression: Any) -> Any:
    """An expression in the kernels' sine and cosine, with the constraints of the board applied."""
    if not parts.heaves:
        expression = expression.subs(vz, 0)
    if not parts.tilts:
        return expression.subs({theta: 0, omega: 0})
    return expression.subs({sp.sin(theta): s, sp.cos(theta): c})


def constrained_state(parts: Parts, x: tuple[Any, ...]) -> tuple[Any, ...]:
    """The state with zero rates for the constrained coordinates."""
    gone = {1: parts.heaves, 2: parts.tilts, 3: parts.tilts}
    return tuple(value if gone.get(i, True) else sp.Integer(0) for i, value in enumerate(x))


def lagrange(parts: Parts, balls: int) -> bool:
    """Whether the kernel's rates satisfy Lagrange's equations of the scene."""
    x = state(balls)
    kinetic, potential = energies(parts, x)
    out = models.rates(constrained_state(parts, x), left, right, parts, record(parts))
    moving = coordinates(parts, x)
    good = all(is_zero(constrained(parts, out[i] - rate)) for _, rate, _, i in moving)
    held = {0, 2, *range(4, 4 + 2 * balls, 2)} - {i for *_, i in moving}
    good &= all(out[i + 1] == 0 for i in held)
    rates_of = {q: rate for q, rate, _, _ in moving} | {rate: out[i + 1] for _, rate, _, i in moving}
    for q, rate, force, _ in moving:
        momentum = kinetic.diff(rate)
        change = sum(momentum.diff(variable) * value for variable, value in rates_of.items())
        good &= is_zero(constrained(parts, change - (kinetic - potential).diff(q) - force))
    return good


def paper(parts: Parts, balls: int) -> bool:
    """Whether the kernel's rates are the paper's equations 3 to 5, with our additions."""
    x, scene = state(balls), record(parts)
    out = models.rates(constrained_state(parts, x), left, right, parts, scene)
    f_left, f_right = hands(scene)
    load = 1 if parts.free else SYMBOLS["fixed_load"]
    weight = load * m * g
    cosine = sp.cos(theta)
    heave = f_left + f_right - M * g - balls * weight * cosine**2 - k_s * z - scene["b_z"] * vz
    turn = (f_right - f_left) * l * cosine - weight * sum(x[4::2]) * cosine - scene["b_theta"] * omega
    roll = SYMBOLS["ball_gravity"] * sp.sin(theta)
    wanted = [vz, heave / M if parts.heaves else sp.S(0), omega, turn / I if parts.tilts else sp.S(0)]
    drag = SYMBOLS["mass_ratio"] * SYMBOLS["b_p"] / m if parts.resisted else sp.S(0)
    for speed in x[5::2]:
        wanted += [speed, roll - drag * speed] if parts.free else [sp.S(0), sp.S(0)]
    return all(is_zero(constrained(parts, a - b)) for a, b in zip(out, wanted, strict=True))


def impact(parts: Parts, balls: int) -> bool:
    """Whether the impact at a stop conserves momentum: one impulse between ball and board, along the board."""
    x, scene = state(balls), record(parts)
    before = constrained_state(parts, x)
    struck = len(x) - 2
    after = models._reflected(before, balls - 1, parts, scene)
    kinetic, _ = energies(parts, x)
    jump = {rate: after[i + 1] - before[i + 1] for _, rate, _, i in coordinates(parts, x)}
    good = is_zero(after[struck + 1] + restitution * before[struck + 1])
    for q, rate, _, _ in coordinates(parts, x):
        # Momentum is linear in the rates; the impulse is the change of the last ball's momentum.
        change = sum(kinetic.diff(rate).diff(other) * by for other, by in jump.items())
        good &= q == x[struck] or is_zero(constrained(parts, change))
    lost = kinetic - kinetic.subs(dict(zip(x, after, strict=True)), simultaneous=True)
    good &= is_zero(constrained(parts, lost).subs(restitution, 1))
    return good


def energy_balance(parts: Parts, balls: int) -> bool:
    """Whether the stored energy changes by the sum of the flows, and the Lagrangian model adds none."""
    x, scene = constrained_state(parts, state(balls)), record(parts)
    at = sp.symbols("left_z right_z left_vz right_vz", real=True)
    u_left = scene["k_left"] * at[0] + scene["c_left"] * at[2]
    u_right = scene["k_right"] * at[1] + scene["c_right"] * at[3]
    out = models.rates(x, u_left, u_right, parts, scene)
    stored = sum(energy.stored(x, at[0], at[1], parts, scene))
    change = stored.diff(at[0]) * at[2] + stored.diff(at[1]) * at[3]
    change += (stored.diff(s) * c - stored.diff(c) * s) * out[2]
    for i, variable in enumerate(x):
        if variable.is_Symbol and i != 2:
            change += stored.diff(variable) * out[i]
    flows = energy.flows(x, at[0], at[2], at[1], at[3], parts, scene)
    left_over = change - sum(flows)
    if not parts.tilts:
        left_over = left_over.subs({s: 0, c: 1})
    return is_zero(left_over) and (not parts.lagrangian or flows.model == 0)


# --- claims ----------------------------------------------------------------------------------------------------------

KINDS = {
    "free": WHOLE,
    "even": WHOLE._replace(even=True, damped=False),
    "hinged": WHOLE._replace(heaves=False, even=True),
    "level": WHOLE._replace(tilts=False, damped=False, even=True),
    "viscous": WHOLE._replace(resisted=True, friction=tuple(key == "b_p" for key in FRICTION)),
    "fixed": WHOLE._replace(free=False),
    "fixed, hinged": WHOLE._replace(free=False, heaves=False),
    "fixed, level": WHOLE._replace(free=False, tilts=False, damped=False),
    "bare": WHOLE._replace(free=False, loaded=False),
}


def claims() -> Iterator[tuple[str, bool]]:
    """Every claim, and whether it holds."""
    for name, parts in KINDS.items():
        for balls in (1, 2) if parts.loaded else (0,):
            printed = parts._replace(lagrangian=False)
            yield f"Lagrange's equations, {name}, {balls}", lagrange(parts, balls)
            yield f"the paper's equations, {name}, {balls}", paper(printed, balls)
            yield f"energy by Lagrange, {name}, {balls}", energy_balance(parts, balls)
            yield f"energy by the paper, {name}, {balls}", energy_balance(printed, balls)
            if parts.free and parts.even:
                yield f"an impact by Lagrange, {name}, {balls}", impact(parts, balls)
    yield "the paper's equations are not Lagrange's", not lagrange(WHOLE._replace(lagrangian=False), 1)
    yield "Lagrange's equations are not the paper's", not paper(WHOLE, 1)


if __name__ == "__main__":
    models.sincos = lambda angle: (s, c)  # type: ignore[assignment]
    print(json.dumps(dict(claims())))  # noqa: T201
