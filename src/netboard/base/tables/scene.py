"""Configuration tables of the simulated scene: board, ball and their sizes.

Defaults are the paper's. `netboard.base.config` reads the tables and gives the common rules.
"""

from dataclasses import dataclass
from typing import Annotated, Literal, get_type_hints

from netboard.base.settings import FORBID_UNKNOWN_KEYS, about
from netboard.base.tables.declared import Extrapolation
from netboard.base.tables.friction import ROLLING, VISCOUS, Friction


@dataclass(frozen=True, slots=True)
class Physics:
    """The virtual board and ball, in the paper's symbols (its Table I)."""

    __pydantic_config__ = FORBID_UNKNOWN_KEYS
    M: Annotated[float, about("mass of the board", "kg", ge=1e-9, le=10)] = 0.01
    m: Annotated[float, about("mass of the ball", "kg", ge=1e-9, le=10)] = 0.05
    g: Annotated[float, about("gravitational acceleration", "m/s2", ge=0, le=30)] = 9.81
    k_h: Annotated[float, about("stiffness of the virtual coupling", "N/m", ge=0, le=10_000)] = 200.0
    c_h: Annotated[float, about("damping of the virtual coupling", "N s/m", ge=0, le=100)] = 2.0
    k_s: Annotated[float, about("stiffness of the spring from board centre to origin", "N/m", ge=0, le=10_000)] = 140.0
    l: Annotated[float, about("control point to board centre", "m", ge=1e-3, le=2)] = 0.25  # noqa: E741
    I: Annotated[float, about("moment of inertia of the board", "kg m2", ge=1e-12, le=10)] = 0.0004  # noqa: E741
    ball_sign: Annotated[
        Literal["downhill", "printed"],
        about("sign of the ball's equation: downhill (-g sin theta) or as printed in the paper (+)"),
    ] = "downhill"
    fixed_ball: Annotated[
        Literal["loads_board", "carried"],
        about("a fixed ball's weight loads the board, or is carried by the fixture (a force step at release)"),
    ] = "loads_board"
    model: Annotated[
        Literal["paper", "lagrangian"],
        about("equations of motion: the paper's, or the full Lagrangian with the ball's inertia on the board"),
    ] = "paper"
    board: Annotated[
        Literal["free", "hinged", "level"],
        about("degrees of freedom. free: heave and tilt; hinged: tilt about its fixed centre; level: heave only"),
    ] = "free"
    coupling: Annotated[Literal["both", "left", "right", "none"], about("hands that are coupled to the board")] = "both"
    coupling_at: Annotated[
        Literal["server", "both"],
        about("where the coupling force is computed: on the server, or, for long delays, in both server and agent"),
    ] = "server"
    balls: Annotated[int, about("number of balls, each of mass m; they do not collide", ge=0, le=4)] = 1
    ball_inertia: Annotated[
        float,
        about("moment of inertia of a ball over m r2: 0 slides, 0.4 rolls (solid sphere), 0.667 (hollow)", ge=0, le=1),
    ] = 0.0
    ball_height: Annotated[
        float, about("height of a ball's centre above the board, in the lagrangian model", "m", ge=0, le=0.2)
    ] = 0.0
    ball_stop: Annotated[
        float, about("distance of the ball stops from the board's centre; 0: no stops", "m", ge=0, le=2)
    ] = 0.0
    restitution: Annotated[float, about("coefficient of restitution of the ball stops", ge=0, le=1)] = 0.0
    b_p: Annotated[float, VISCOUS, about("viscous friction between ball and board", "N s/m", ge=0, le=100)] = 0.0
    rolling_resistance: Annotated[
        float, ROLLING, about("coefficient of rolling resistance of a ball: force over normal load", "1", ge=0, le=1)
    ] = 0.0
    b_z: Annotated[float, about("viscous damping of the board's heave", "N s/m", ge=0, le=100)] = 0.0
    b_theta: Annotated[float, about("viscous damping of the board's tilt", "N m s/rad", ge=0, le=100)] = 0.0
    hold: Annotated[
        Extrapolation,
        about("extrapolation of a stylus after its newest sample: zero-order hold, constant velocity or acceleration"),
    ] = "ca"
    method: Annotated[
        Literal[
            "auto", "euler", "semi_implicit", "heun", "verlet", "midpoint", "rk4", "etd2rk", "etdrk4", "dop853", "exact"
        ],
        about("numerical integrator; auto: rk4, or another where rk4 is unstable; exact: for a level board only"),
    ] = "auto"
    substeps: Annotated[int, about("steps in a tick; 0: as many as the scene needs", ge=0, le=1000)] = 0


FRICTION: dict[str, Friction] = {
    key: law
    for key, hint in get_type_hints(Physics, include_extras=True).items()
    for law in getattr(hint, "__metadata__", ())
    if isinstance(law, Friction)
}
"""The laws of friction of a ball, by their keys; a law's number is its place."""


def friction_rate(physics: Physics) -> float:
    """Return an upper bound of the rate at which friction slows a ball relative to the board; 0 without any [1/s]."""
    slope = sum(law.slope(getattr(physics, key), physics.m * physics.g) for key, law in FRICTION.items())
    mass_ratio = 1.0 / (1.0 + physics.ball_inertia)
    mobility = mass_ratio / physics.m
    if physics.model == "lagrangian":  # a force along the board moves the board, too
        mobility += physics.ball_height**2 / physics.I + mass_ratio**2 / physics.M
    return slope * mobility * physics.balls


@dataclass(frozen=True, slots=True)
class Geometry:
    """Sizes that are drawn and that end a trial."""

    __pydantic_config__ = FORBID_UNKNOWN_KEYS
    board_length: Annotated[float, about("length of the board", "m", gt=0, le=5)] = 0.700
    board_thickness: Annotated[float, about("height of the board as drawn", "m", gt=0, le=1)] = 0.050
    ball_radius: Annotated[float, about("radius of the ball as drawn", "m", gt=0, le=1)] = 0.025
    target_distance: Annotated[float, about("target centre to board centre", "m", gt=0, le=2)] = 0.150
    target_width: Annotated[float, about("width of the target", "m", gt=0, le=1)] = 0.070
