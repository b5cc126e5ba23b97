"""A scene: the constants of board, ball and couplings as the kernels read them, one packed record.

A scene that the live tick cannot hold is turned down here, before anybody sits in front of it.
"""

from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from netboard.config import Physics
from netboard.errors import ConfigError
from netboard.physics.stability import is_stable, spectral_radius
from netboard.tick import TICK_SECONDS

SCENE = np.dtype(
    [
        ("M", "<f8"),  # mass of the board [kg]
        ("m", "<f8"),  # mass of the ball [kg]
        ("g", "<f8"),  # gravitational acceleration [m/s2]
        ("k_h", "<f8"),  # stiffness of the coupling between stylus and board [N/m]
        ("c_h", "<f8"),  # its damping [N s/m]
        ("k_s", "<f8"),  # stiffness of the spring from the board's centre to the origin [N/m]
        ("l", "<f8"),  # control point to the board's centre [m]
        ("I", "<f8"),  # moment of inertia of the board [kg m2]
        ("ball_gravity", "<f8"),  # what multiplies sin(theta) in the ball's equation: -g downhill, +g as printed [m/s2]
        ("fixed_load", "<f8"),  # share of a fixed ball's weight that loads the board [1]
    ]
)
"""One scene."""

_SAME_NAME = ("M", "m", "g", "k_h", "c_h", "k_s", "l", "I")


def _packed(physics: Physics) -> NDArray[Any]:
    """Return the record of a scene, whether or not a step can hold it."""
    scene = np.zeros(1, SCENE)
    for name in _SAME_NAME:
        scene[name] = getattr(physics, name)
    scene["ball_gravity"] = -physics.g if physics.ball_sign == "downhill" else physics.g
    scene["fixed_load"] = 1.0 if physics.fixed_ball == "loads_board" else 0.0
    return scene


def pack_scene(physics: Physics) -> NDArray[Any]:
    """Return the scene of a configuration, for the kernels.

    Parameters
    ----------
    physics : Physics
        The configuration's table.

    Returns
    -------
    ndarray of SCENE, shape (1,)
        The packed record, SI units.

    Raises
    ------
    ConfigError
        If the live step cannot hold the board between the hands.
    """
    scene = _packed(physics)
    if not is_stable(scene[0], TICK_SECONDS):
        growth = spectral_radius(scene[0], TICK_SECONDS)
        raise ConfigError(
            f"physics.k_h = {physics.k_h:g}, physics.c_h = {physics.c_h:g}: too stiff for a board of "
            f"M = {physics.M:g} kg, I = {physics.I:g} kg m2 in steps of {TICK_SECONDS * 1e3:g} ms: each step would "
            f"multiply its motion by {growth:.3g} (spectral radius; at most 1 is stable); "
            f"accepted: {_accepted(physics)}"
        )
    return scene


def _accepted(physics: Physics) -> str:
    """Return, in words, changes of the couplings that the live step can hold."""
    offers = [_softened(physics, keys) for keys in (("c_h",), ("k_h",), ("k_h", "c_h"), ("k_h", "c_h", "k_s"))]
    return next(offer for offer in (" or ".join(filter(None, offers[:2])), *offers[2:]) if offer)


def _softened(physics: Physics, keys: tuple[str, ...]) -> str:
    """Return the largest values that the live step can hold, scaling these keys alone; empty if there are none."""

    def scaled(scale: float) -> dict[str, Any]:
        return {key: scale * getattr(physics, key) for key in keys}

    def holds(scale: float) -> bool:
        return is_stable(_packed(replace(physics, **scaled(scale)))[0], TICK_SECONDS)

    if not holds(0.0):
        return ""
    good, bad = 0.0, 1.0
    while bad - good > 1e-3:
        middle = (good + bad) / 2
        good, bad = (middle, bad) if holds(middle) else (good, middle)
    # Rounded down to three digits or so, that what is offered is accepted.
    return ", ".join(f"physics.{key} = {0.99 * value:.3g}" for key, value in scaled(good).items())
