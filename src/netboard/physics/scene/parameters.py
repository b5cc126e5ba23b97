"""Parameters of a scene, packed for the kernels.

They come from the table ``[physics]`` of the configuration. `SCENE` holds the numbers. `Parts` says which terms the
equations have: kernels are compiled for a `Parts`, and compute no other terms.
"""

from collections import namedtuple
from typing import Any, NamedTuple

import numpy as np
from numba import types
from numpy.typing import NDArray

from netboard.base.compiled import specialised
from netboard.base.tables.declared import number_of, require, words_of
from netboard.base.tables.scene import FRICTION, Physics

SCENE = np.dtype(
    [
        ("M", "<f8"),  # mass of the board [kg]
        ("m", "<f8"),  # mass of each ball [kg]
        ("g", "<f8"),  # gravitational acceleration [m/s2]
        ("k_left", "<f8"),  # stiffness of the coupling between left stylus and board [N/m]
        ("c_left", "<f8"),  # its damping [N s/m]
        ("k_right", "<f8"),  # stiffness of the right coupling [N/m]
        ("c_right", "<f8"),  # its damping [N s/m]
        ("k_s", "<f8"),  # stiffness of the spring from the board's centre to the origin [N/m]
        ("l", "<f8"),  # control point to the board's centre [m]
        ("I", "<f8"),  # moment of inertia of the board [kg m2]
        ("b_z", "<f8"),  # damping of the board's heave [N s/m]
        ("b_theta", "<f8"),  # damping of its tilt [N m s/rad]
        ("ball_gravity", "<f8"),  # paper's model: acceleration of a ball over sin(theta), - is downhill [m/s2]
        ("mass_ratio", "<f8"),  # mass over effective mass of a ball: 1 slides, 5/7 a solid sphere rolls [1]
        ("ball_height", "<f8"),  # height of a ball's centre above the board [m]
        ("fixed_load", "<f8"),  # share of a fixed ball's weight that loads the board [1]
        ("stop", "<f8"),  # where stops turn a ball back, from the board's centre [m]
        ("restitution", "<f8"),  # share of its speed that a stop gives back [1]
        *((key, "<f8") for key in FRICTION),  # coefficients of the laws of friction (netboard.base.tables.friction)
    ]
)
"""One scene."""

SceneNumbers = Any
"""The same numbers as a named tuple. Compiled code reads them once, but those of a record again after each store."""

_NAMES: tuple[str, ...] = SCENE.names or ()
_SceneNumbers: Any = namedtuple("_SceneNumbers", _NAMES)  # type: ignore[misc]


def numbers_of(scene: np.void) -> SceneNumbers:
    """Return the numbers of a scene as a named tuple [SI]."""
    return _SceneNumbers(*scene.tolist())


@specialised(numbers_of)
def _numbers_of(scene: types.Type) -> Any:
    """Write the tuple."""
    fields = ", ".join(f'scene["{name}"]' for name in _NAMES)
    return eval(f"lambda scene: _SceneNumbers({fields})", {"_SceneNumbers": _SceneNumbers, "__name__": __name__})


class Parts(NamedTuple):
    """Structure of a scene: compile-time constants of the kernels.

    Attributes
    ----------
    lagrangian : bool
        Lagrange's equations; otherwise the paper's.
    heaves, tilts : bool
        Degrees of freedom of the board.
    even : bool
        Both couplings have the same parameters.
    damped : bool
        The tilt is damped (b_theta).
    loaded : bool
        There are balls.
    free : bool
        The balls can move; otherwise they are fixed to the board.
    stops : bool
        The board has stops for balls.
    resisted : bool
        There is friction between balls and board.
    friction : tuple of bool
        Which laws of friction apply, in the order of `netboard.base.tables.scene.FRICTION`.
    """

    lagrangian: bool
    heaves: bool
    tilts: bool
    even: bool
    damped: bool
    loaded: bool
    free: bool
    stops: bool
    resisted: bool = False
    friction: tuple[bool, ...] = (False,) * len(FRICTION)


_SAME_NAME = ("M", "m", "g", "k_s", "l", "I", "b_z", "b_theta", "ball_height", "restitution", *FRICTION)


def pack_scene(physics: Physics) -> NDArray[Any]:
    """Pack the parameters of a scene for the kernels: ndarray of SCENE, shape (1,) [SI]."""
    scene = np.zeros(1, SCENE)
    for name in _SAME_NAME:
        scene[name] = getattr(physics, name)
    for side in ("left", "right"):
        if physics.coupling in (side, "both"):
            scene[f"k_{side}"], scene[f"c_{side}"] = physics.k_h, physics.c_h
    scene["mass_ratio"] = 1.0 / (1.0 + physics.ball_inertia)
    scene["ball_gravity"] = scene["mass_ratio"] * (-physics.g if physics.ball_sign == "downhill" else physics.g)
    scene["fixed_load"] = 1.0 if physics.fixed_ball == "loads_board" else 0.0
    scene["stop"] = physics.ball_stop
    return scene


_KNOWN: dict[str, tuple[str, ...]] = {
    "model": ("paper", "lagrangian"),
    "board": ("free", "hinged", "level"),
    "coupling": ("both", "left", "right", "none"),
    "ball_sign": ("downhill", "printed"),
    "fixed_ball": ("loads_board", "carried"),
}
"""Words that the functions below know."""

for _key, _words in _KNOWN.items():
    require(f"[physics] {_key} in netboard/physics/scene/parameters.py", _words, words_of(Physics, _key))


def parts_of(physics: Physics, free: bool = True) -> Parts:
    """Return the structure of a scene.

    Raises
    ------
    ConfigError
        If the scene has an unknown word.
    """
    for key, words in _KNOWN.items():
        number_of(getattr(physics, key), words, f"[physics] {key}")
    loaded = physics.balls > 0
    friction = tuple(loaded and free and getattr(physics, key) > 0 for key in FRICTION)
    return Parts(
        lagrangian=physics.model == "lagrangian",
        heaves=physics.board != "hinged",
        tilts=physics.board != "level",
        even=physics.coupling in ("both", "none"),
        damped=physics.b_theta > 0 and physics.board != "level",
        loaded=loaded,
        free=loaded and free,
        stops=loaded and free and physics.ball_stop > 0,
        resisted=any(friction),
        friction=friction,
    )


def state_length(physics: Physics) -> int:
    """Return the length of the state vector of a scene: four for the board and two for each ball [1]."""
    return 4 + 2 * physics.balls


def load_mass(parts: Parts, scene: np.void) -> float:
    """Return the part of a ball's mass that loads the board; 0 without balls [kg]."""
    if not parts.loaded:
        return 0.0
    return float(scene["m"]) * (1.0 if parts.free else float(scene["fixed_load"]))
