"""What a robot knows of ball and board from the views: a Kalman filter of the ball, and rates of the board.

The ball is ``p'' = -slope tilt + w`` with the tilt seen and white noise w; its position is seen at each view. The gains
are those of the stationary filter at the view rate. Between two views, ball and board are extrapolated to now. The view
of a tick arrives `view_delay` after it.

Rule 1: a view with a value that is not finite, or beyond `PLAUSIBLE`, is as no view.
Rule 2: a ball that is fixed has no velocity, and one that is released begins at rest.
"""

from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import solve_discrete_are

from netboard.base.compiled import inlined
from netboard.base.config import Config, Side
from netboard.base.tick import TICK_SECONDS
from netboard.participants.robots.robot import RobotParameters, view_ticks
from netboard.physics.scene.parameters import load_mass, pack_scene, parts_of
from netboard.task.trials.state_machine import is_active, is_free

SMOOTHING = 3.0
"""Views over which the rates of the board are low-passed [1]."""

PLAUSIBLE = 10.0
"""Values of a view beyond this are not those of a board [m, rad]."""

BOARD = np.dtype(
    [
        ("sign", "<f8"),  # side of its hand: -1 left, 1 right
        ("l", "<f8"),  # control point to the board's centre [m]
        ("slope", "<f8"),  # acceleration of the ball, downhill, over the tilt [m/s2]
        ("k_h", "<f8"),  # stiffness of a virtual coupling [N/m]
        ("k_s", "<f8"),  # stiffness of the spring at the board's centre [N/m]
        ("carried", "<f8"),  # weight that each coupling carries with both hands at height 0 [N]
        ("rest", "<f8"),  # height of the board then [m]
        ("ball_weight", "<f8"),  # weight of the ball that loads the board [N]
        ("max_tilt", "<f8"),  # largest wanted tilt [rad]
        ("view_delay", "<f8"),  # from a tick to the view of it [s]
        ("stale", "<f8"),  # age of a view that is too old [s]
        ("gains", "<f8", (2,)),  # of the ball's position and velocity by a seen position [1, 1/s]
    ]
)
"""What a robot knows of scene and views."""

SIGHT = np.dtype(
    [
        ("time", "<f8"),  # of the newest view; NaN or 0 before the first [s]
        ("views", "<i8"),  # number of views so far
        ("fresh", "<i8"),  # 1: a view came in this tick
        ("free", "<i8"),  # 1: the ball is free
        ("active", "<i8"),  # 1: a trial is under way
        ("target", "<f8"),  # centre of the target; as all below, in coordinates of its side [m]
        ("z", "<f8"),  # height of the board's centre, at the newest view [m]
        ("tilt", "<f8"),  # [rad]
        ("z_rate", "<f8"),  # [m/s]
        ("tilt_rate", "<f8"),  # [rad/s]
        ("ball", "<f8"),  # [m]
        ("ball_rate", "<f8"),  # [m/s]
        ("integral", "<f8"),  # acceleration by which a ball that has stopped is moved on [m/s2]
        ("age", "<f8"),  # time since the tick of the newest view [s]
        # The same, extrapolated to now.
        ("z_now", "<f8"),
        ("tilt_now", "<f8"),
        ("ball_now", "<f8"),
        ("ball_rate_now", "<f8"),
    ]
)
"""State of a robot's sight."""


def ball_gains(parameters: RobotParameters, period: float) -> NDArray[np.float64]:
    """Return the gains of the stationary Kalman filter of the ball for a view in each period [1, 1/s].

    ``x' = F x``, ``F = [[1, T], [0, 1]]``, with the noise of a white acceleration that is constant in a period.
    """
    advance = np.array([[1.0, period], [0.0, 1.0]])
    push = np.array([[0.5 * period**2], [period]])
    noise = parameters.ball_noise**2 * push @ push.T
    seen, variance = np.array([[1.0, 0.0]]), np.array([[parameters.sight_noise**2]])
    spread = solve_discrete_are(advance.T, seen.T, noise, variance)
    return np.asarray((spread @ seen.T / (seen @ spread @ seen.T + variance))[:, 0], np.float64)


def pack_board(config: Config, parameters: RobotParameters, side: Side) -> NDArray[Any]:
    """Return what a robot knows of scene and views, for the kernels: ndarray of BOARD, shape (1,) [SI]."""
    physics = config.physics
    scene, packed = pack_scene(physics)[0], np.zeros(1, BOARD)
    packed["sign"] = 1.0 if side == "right" else -1.0
    packed["l"], packed["k_h"], packed["k_s"] = physics.l, physics.k_h, physics.k_s
    packed["slope"] = -float(scene["ball_gravity"])
    packed["ball_weight"] = load_mass(parts_of(physics), scene) * physics.g * physics.balls
    weight = physics.M * physics.g + float(packed["ball_weight"][0])
    springs = 2.0 * physics.k_h + physics.k_s
    packed["carried"], packed["rest"] = weight * physics.k_h / springs, -weight / springs
    packed["max_tilt"] = np.radians(parameters.max_tilt_deg)
    packed["view_delay"], packed["stale"] = parameters.view_delay, parameters.stale
    packed["gains"] = ball_gains(parameters, view_ticks(config) * TICK_SECONDS)
    return packed


@inlined
def look(sight: np.void, board: np.void, observation: np.void) -> bool:
    """Take in the newest view, and extrapolate to now; return whether the robot sees a trial that is under way."""
    seen, now = observation["seen"], observation["time"]
    sight["fresh"] = 0
    shown = abs(seen["z"]) < PLAUSIBLE and abs(seen["theta"]) < PLAUSIBLE and abs(seen["target"]) < PLAUSIBLE
    newer = sight["views"] == 0 or seen["time"] > sight["time"] + 0.5 * TICK_SECONDS
    if shown and abs(seen["time"]) < np.inf and newer:
        _take(sight, board, seen)
    age = now - sight["time"] + board["view_delay"]
    if sight["views"] == 0 or not 0.0 <= age < board["stale"]:
        return False
    sight["age"] = age
    sight["z_now"] = sight["z"] + sight["z_rate"] * age
    sight["tilt_now"] = sight["tilt"] + sight["tilt_rate"] * age
    pull = -board["slope"] * sight["tilt"] if sight["free"] else 0.0
    sight["ball_now"] = sight["ball"] + age * (sight["ball_rate"] + 0.5 * age * pull)
    sight["ball_rate_now"] = sight["ball_rate"] + age * pull
    return bool(sight["active"])


@inlined
def _take(sight: np.void, board: np.void, seen: np.void) -> None:
    """Update the filter of the ball and the rates of the board by a new view."""
    sign, dt = board["sign"], seen["time"] - sight["time"]
    tilt, known = sign * seen["theta"], sight["views"] > 0 and dt < board["stale"]
    free = is_free(seen["phase"]) and abs(seen["p"]) < PLAUSIBLE
    ball = sign * seen["p"] if abs(seen["p"]) < PLAUSIBLE else 0.0
    if known:
        keep = 1.0 / SMOOTHING
        sight["z_rate"] += keep * ((seen["z"] - sight["z"]) / dt - sight["z_rate"])
        sight["tilt_rate"] += keep * ((tilt - sight["tilt"]) / dt - sight["tilt_rate"])
    else:
        sight["z_rate"] = sight["tilt_rate"] = 0.0
    if known and free and sight["free"]:
        pull = -board["slope"] * 0.5 * (sight["tilt"] + tilt)
        expected = sight["ball"] + dt * (sight["ball_rate"] + 0.5 * dt * pull)
        sight["ball"] = expected + board["gains"][0] * (ball - expected)
        sight["ball_rate"] += dt * pull + board["gains"][1] * (ball - expected)
    else:
        sight["ball"], sight["ball_rate"] = ball, 0.0
    sight["z"], sight["tilt"], sight["target"] = seen["z"], tilt, sign * seen["target"]
    sight["free"], sight["active"] = free, is_active(seen["phase"])
    sight["time"], sight["fresh"] = seen["time"], 1
    sight["views"] += 1
