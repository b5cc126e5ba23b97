"""Choice of the integration method when a scene is loaded; scenes that no method can integrate stably are refused.

The stability of a step (`netboard.physics.stability.step_matrix`) is computed for the level board and tilts up to 35
degrees, with balls free and fixed, and in the Lagrangian model with balls in several places; the worst case decides.
The exponential methods are exact for the level board only. docs/decisions/0011-choosing-the-method.md gives the
reasons.
"""

import math
from collections.abc import Iterator
from dataclasses import dataclass, replace
from functools import lru_cache
from typing import Any

from netboard.base.errors import ConfigError
from netboard.base.plural import plural
from netboard.base.tables.scene import Physics, friction_rate
from netboard.physics.scene.parameters import Parts, pack_scene, parts_of
from netboard.physics.stability.step_matrix import (
    ROUNDING,
    Matrix,
    solved_matrix,
    spectral_radius,
    stiffness,
    tilted_matrix,
)

TILTS = tuple(math.radians(tilt) for tilt in (0, 35, 20))
"""Tilts examined; the other side is equivalent, with the balls on the other side [rad]."""

PLACES = (0.0, 1.0, -1.0, 0.5, -0.5, 0.25, -0.25)
"""Ball positions examined, relative to the stops, or to twice the arm of the board [1]."""

MAX_SUBSTEPS = 64
"""Largest number of steps per tick that is chosen."""

MAX_RK4_STIFFNESS = 8
"""Largest stiffness of a tick for which RK4 is chosen [1]."""

GROWTH_TOLERANCE = 1e-6
"""Tolerated growth of a mode per step of an exponential method at a constant tilt: e-fold in a million steps [1]."""

EXPONENTIAL = ("etd2rk", "etdrk4")
"""Methods that are exact for the level board and of Runge-Kutta type for the deviation of a tilted one."""

MAX_LOG_GROWTH = 700.0
"""Logarithm of the largest finite growth factor [1]."""

STIFFNESS_TOLERANCE = 1e-9
"""Rounding tolerance of the stiffness [1]."""


@dataclass(frozen=True, slots=True)
class MethodChoice:
    """Integration method of a tick.

    Attributes
    ----------
    method : str
        Word of the method in ``physics.method``.
    substeps : int
        Steps per tick [1].
    radius : float
        Spectral radius of a tick: the largest growth factor of a mode [1].
    stiffness : float
        The tick times the largest pole of the board [1].
    reason : str
        The reason, in one sentence.
    """

    method: str
    substeps: int
    radius: float
    stiffness: float
    reason: str


@lru_cache(maxsize=64)
def choose(physics: Physics, h: float) -> MethodChoice:
    """Choose the integration method of a scene; the blocks of a session usually have the same.

    Parameters
    ----------
    h : float
        Length of a tick [s].

    Raises
    ------
    ConfigError
        If the method, or every method, is unstable for this scene.
    """
    if physics.method == "exact" and physics.board != "level":
        raise ConfigError(f'physics.method = "exact": for physics.board = "level" alone, found "{physics.board}"')
    if physics.method == "exact" and friction_rate(physics) > 0:
        raise ConfigError('physics.method = "exact": for balls without friction, expected another method')
    choice = _choice(physics, h)
    if not choice.radius <= _limit(choice.method) ** choice.substeps:
        raise ConfigError(_refusal(physics, h, choice))
    return choice


def _choice(physics: Physics, h: float) -> MethodChoice:
    """Return the choice, whether or not it is stable."""
    method, substeps, stiff, reason = _plan(physics, h)
    worst = max(_radii(physics, method, h / substeps))
    radius = worst**substeps if substeps * math.log(max(worst, 1.0)) < MAX_LOG_GROWTH else math.inf
    return MethodChoice(method, substeps, radius, stiff, reason)


def _is_accepted(physics: Physics, h: float) -> bool:
    """Return whether a scene would be accepted."""
    method, substeps, *_ = _plan(physics, h)
    return _is_stable(physics, method, h / substeps)


def _plan(physics: Physics, h: float) -> tuple[str, int, float, str]:
    """Return method, number of steps, stiffness of a tick, and reason."""
    stiff = max(h * friction_rate(physics), *(stiffness(a, h) for a, _ in _cases(physics)))
    method, substeps, reason = _automatic(physics, stiff) if physics.method == "auto" else _named(physics, h)
    return method, substeps, stiff, reason


def _automatic(physics: Physics, stiff: float) -> tuple[str, int, str]:
    """Choose method and number of steps by the stiffness of a tick; return them with the reason."""
    if physics.board == "level" and friction_rate(physics) == 0:
        return "exact", max(physics.substeps, 1), "The board cannot tilt: its motion is solved exactly."
    lasts = f"A tick is {stiff:.3g} of the board's shortest time constants"
    substeps = physics.substeps or max(math.ceil(stiff - STIFFNESS_TOLERANCE), 1)
    if stiff - STIFFNESS_TOLERANCE > (substeps if physics.substeps > 0 else MAX_RK4_STIFFNESS):
        return "etdrk4", max(physics.substeps, 1), f"{lasts}, too many for rk4."
    reason = f"{lasts}: rk4 in {plural(substeps, 'step')} is stable and errs less than the sampling of the hands."
    return "rk4", substeps, reason


def _named(physics: Physics, h: float) -> tuple[str, int, str]:
    """Return the configured method with the configured or required number of steps, and the reason."""
    substeps = physics.substeps or _enough(physics, h) or MAX_SUBSTEPS
    reason = f"Named in the configuration: {physics.method} in {plural(substeps, 'step')} is stable."
    return physics.method, substeps, reason


def _enough(physics: Physics, h: float) -> int:
    """Return the smallest stable number of steps of the configured method; 0 above `MAX_SUBSTEPS`."""
    return next((n for n in range(1, MAX_SUBSTEPS + 1) if _is_stable(physics, physics.method, h / n)), 0)


def _is_stable(physics: Physics, method: str, h: float) -> bool:
    """Return whether a step size is stable."""
    return all(radius <= _limit(method) for radius in _radii(physics, method, h))


def _limit(method: str) -> float:
    """Return the largest spectral radius that counts as stable."""
    return 1.0 + (GROWTH_TOLERANCE if method in EXPONENTIAL else ROUNDING)


def _radii(physics: Physics, method: str, h: float) -> Iterator[float]:
    """Yield the spectral radius of a step for every case examined."""
    scene = pack_scene(physics)[0]
    for a, parts in _cases(physics):
        yield spectral_radius(method, a, h, solved_matrix(parts, scene, physics.balls, h))


def _cases(physics: Physics) -> Iterator[tuple[Matrix, Parts]]:
    """Yield the cases examined: matrix of the board and structure of the scene."""
    scene, balls = pack_scene(physics)[0], physics.balls
    reach = physics.ball_stop or 2.0 * physics.l
    free, fixed = parts_of(physics), parts_of(physics, free=False)
    heavy = physics.model == "lagrangian" and balls > 0
    for parts in (free, fixed) if heavy else (free,):
        for tilt in TILTS if parts.tilts else TILTS[:1]:
            for place in PLACES if heavy else PLACES[:1]:
                yield tilted_matrix(parts, scene, balls, tilt, place * reach), parts


def _refusal(physics: Physics, h: float, choice: MethodChoice) -> str:
    """Return why a scene is refused, and accepted alternatives."""
    more = choice.radius - 1.0
    growth = f"1 + {more:.2g}" if more < 1e-2 else f"{choice.radius:.3g}"
    named = ", ".join(f"physics.{key} = {getattr(physics, key):g}" for key in _stiffening(physics))
    return (
        f"{named}: too stiff for a board of M = {physics.M:g} kg, I = {physics.I:g} kg m2 in ticks of {h * 1e3:g} ms, "
        f"{plural(choice.substeps, 'step')} of {choice.method} each: "
        f"every tick would multiply its motion by {growth} (spectral radius; at most 1 is stable); "
        f"accepted: {', or '.join(_offers(physics, h))}"
    )


def _offers(physics: Physics, h: float) -> Iterator[str]:
    """Yield changes with which the scene would be accepted, in words."""
    if physics.substeps > 0 and physics.method != "auto":
        enough = _enough(physics, h)
        if enough > 0:
            yield f"physics.substeps = {enough}"
    for method in ("auto", "midpoint"):
        if _is_accepted(replace(physics, method=method, substeps=0), h):
            yield f'physics.method = "{method}"' + (" and physics.substeps = 0" if physics.substeps > 0 else "")
    keys = _stiffening(physics)
    singly = [_softened(physics, h, (key,)) for key in keys]
    yield from filter(None, singly if any(singly) else [_softened(physics, h, keys)])


def _stiffening(physics: Physics) -> tuple[str, ...]:
    """Return the keys that can make a board stiff: the virtual coupling, and the board's own damping if it has any."""
    return ("k_h", "c_h", *(key for key in ("b_z", "b_theta") if getattr(physics, key) > 0))


def _softened(physics: Physics, h: float, keys: tuple[str, ...]) -> str:
    """Return the largest accepted values of these keys, scaled together; empty below a thousandth."""

    def scaled(scale: float) -> dict[str, Any]:
        # Rounded to three digits before the check, so that the offered values are accepted.
        return {key: float(f"{scale * getattr(physics, key):.3g}") for key in keys}

    def holds(scale: float) -> bool:
        return _is_accepted(replace(physics, **scaled(scale)), h)

    bad = 1.0
    while not holds(bad / 2):
        bad /= 2
        if bad < 1e-3:
            return ""
    good = bad / 2
    while bad - good > 1e-2 * good:
        middle = (good + bad) / 2
        good, bad = (middle, bad) if holds(middle) else (good, middle)
    return " and ".join(f"physics.{key} = {value:g}" for key, value in scaled(good).items())
