"""Linear model of the whole board, as a robot takes it to be: its hand, the board, the ball, and a passive partner.

Board and ball are the scene linearised about the level board (`netboard.physics.scene.linear`), in coordinates of the
robot's side. The partner is a compliant hand: a mass, a damper, and a spring to an aim that changes at random. The
robot's hand is that of `netboard.participants.robots.robot`; its input is the speed of its equilibrium point.

The filter of a robot has the states `WATCHED`: its own hand is measured, and drives them. NumPy; not for use in a tick.
"""

from dataclasses import dataclass
from typing import Annotated, NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import expm, solve_discrete_are

from netboard.base.config import Config, Side
from netboard.base.settings import about
from netboard.base.tick import TICK_SECONDS
from netboard.participants.body.device_models import resolved
from netboard.participants.robots.robot import SOURCES, RobotParameters, view_ticks
from netboard.physics.scene.linear import scene_matrix
from netboard.physics.scene.parameters import load_mass, pack_scene, parts_of

Matrix = NDArray[np.float64]

NAMES = ("z", "vz", "tilt", "omega", "p", "vp", "partner", "partner_rate", "aim", "own", "own_rate", "target")
"""States: board, ball, the partner's hand with its aim, and the robot's hand with its equilibrium point."""

X = {name: place for place, name in enumerate(NAMES)}
"""Place of each state."""

WATCHED = 9
"""Number of states of the filter, the first ones [1]."""

SEEN = (X["z"], X["tilt"], X["p"])
"""Places of what a view shows."""

FLOOR = 1e-5
"""Standard deviation by which each state is less certain after a tick, so that the filter's equations stay regular
[SI]."""

FIXED_RATE = 10.0
"""Rate at which the velocity of a ball that is fixed vanishes in the model [1/s]."""


@dataclass(frozen=True, slots=True)
class BoardParameters(RobotParameters):
    """Parameters of the robots that model the whole board."""

    partner_mass: Annotated[float, about("mass of the partner's hand and arm", "kg", gt=0, le=10)] = 0.5
    partner_stiffness: Annotated[float, about("stiffness of the partner's hand", "N/m", gt=0, le=2000)] = 150.0
    partner_damping: Annotated[float, about("damping of the partner's hand", "N s/m", ge=0, le=200)] = 8.0
    aim_time: Annotated[
        float, about("time after which the partner's hand is expected to be back at height 0", "s", gt=0, le=100)
    ] = 2.0
    aim_sd: Annotated[
        float, about("standard deviation of the height to which the partner's hand is pulled", "m", gt=0, le=1)
    ] = 0.02
    p_scale: Annotated[float, about("distance of the ball that costs 1", "m", gt=0, le=10)] = 0.05
    vp_scale: Annotated[float, about("velocity of the ball that costs 1", "m/s", gt=0, le=10)] = 0.2
    tilt_scale_deg: Annotated[float, about("tilt that costs 1", "deg", gt=0, le=90)] = 3.0
    z_scale: Annotated[float, about("height of the board that costs 1", "m", gt=0, le=1)] = 0.02
    speed_scale: Annotated[float, about("speed of the equilibrium point that costs 1", "m/s", gt=0, le=10)] = 0.1
    largest_error: Annotated[float, about("distance to the target that the robot acts upon", "m", gt=0, le=1)] = 0.12


_ARM = "the arm of a simulated participant"
_COST = "Bryson's rule: about the largest value in a good trial"
BOARD_SOURCES = SOURCES | {
    "partner_mass": _ARM,
    "partner_stiffness": _ARM,
    "partner_damping": _ARM,
    "aim_time": "assumed: longer than a movement, so that the aim is a slow disturbance",
    "aim_sd": "the height of a hand that tilts the board by 5 deg",
    **dict.fromkeys(("p_scale", "vp_scale", "tilt_scale_deg", "z_scale", "speed_scale"), _COST),
    "largest_error": "by hand: beyond it the robot would want more than the largest tilt",
}
"""Source of the default of each parameter of robots that model the whole board."""


class BoardModel(NamedTuple):
    """The board in steps of a tick, with the ball free or fixed [SI]."""

    advance: Matrix  # of all states
    command: Matrix  # by the speed of the equilibrium point
    weight: Matrix  # by gravity
    watched: Matrix  # of the filter's states, by these, by own height and speed, and by gravity
    noise: Matrix  # covariance of what is unforeseen of the filter's states in a tick
    rest: Matrix  # states at rest with a level board, by 1, by the ball (free: the target), and by the aim


def board_model(config: Config, parameters: BoardParameters, side: Side, free: bool) -> BoardModel:
    """Return the model of the whole board for a robot on a side."""
    rates, weight, push = _mechanics(config, parameters, side, free)
    whole = np.zeros((len(X) + 2, len(X) + 2))
    whole[: len(X), : len(X)], whole[: len(X), len(X)], whole[: len(X), len(X) + 1] = rates, push, weight
    step = expm(whole * TICK_SECONDS)
    own, kept = [X["own"], X["own_rate"]], slice(WATCHED)
    given = np.zeros((WATCHED + 3, WATCHED + 3))
    given[kept, kept], given[kept, WATCHED : WATCHED + 2] = rates[kept, kept], rates[kept, own]
    given[kept, WATCHED + 2] = weight[kept]
    return BoardModel(
        step[: len(X), : len(X)],
        step[: len(X), len(X)],
        step[: len(X), len(X) + 1],
        expm(given * TICK_SECONDS)[:WATCHED],
        _noise(parameters),
        _rest(rates, weight, free),
    )


def _mechanics(config: Config, parameters: BoardParameters, side: Side, free: bool) -> tuple[Matrix, Matrix, Matrix]:
    """Return rates of change by state, by gravity, and by the speed of the equilibrium point."""
    physics, device = config.physics, resolved(config.virtual)
    parts, scene = parts_of(physics, free), pack_scene(physics)[0]
    sign = 1.0 if side == "right" else -1.0
    mirror = np.diag([1.0, 1.0, sign, sign, sign, sign])
    rates, weight, push = np.zeros((len(X), len(X))), np.zeros(len(X)), np.zeros(len(X))
    rates[:6, :6] = mirror @ scene_matrix(parts, scene, 6) @ mirror
    if not free:
        rates[X["vp"], X["vp"]] = -FIXED_RATE
    load = physics.balls * load_mass(parts, scene)
    heavy = physics.M + (load if parts.lagrangian else 0.0)
    weight[X["vz"]] = -(physics.M + load) * physics.g / heavy * parts.heaves
    hands = (
        ("own", 1.0, parameters.hand_mass, parameters.hand_stiffness, parameters.hand_damping, "target"),
        ("partner", -1.0, parameters.partner_mass, parameters.partner_stiffness, parameters.partner_damping, "aim"),
    )
    for hand, way, mass, stiffness, damping, aim in hands:
        there, lever, force = "right" if way * sign > 0.0 else "left", way * physics.l, np.zeros(len(X))
        k, c = float(scene[f"k_{there}"]), float(scene[f"c_{there}"])
        force[[X[hand], X[f"{hand}_rate"]]] = k, c
        force[[X["z"], X["vz"], X["tilt"], X["omega"]]] = -k, -c, -k * lever, -c * lever
        rates[X["vz"], [X[hand], X[f"{hand}_rate"]]] += force[[X[hand], X[f"{hand}_rate"]]] / heavy * parts.heaves
        rates[X["omega"], [X[hand], X[f"{hand}_rate"]]] += (
            lever * force[[X[hand], X[f"{hand}_rate"]]] / physics.I * parts.tilts
        )
        moved = X[f"{hand}_rate"]
        rates[X[hand], moved] = 1.0
        rates[moved] -= force * config.block.haptics / (mass + device.mass)
        rates[moved, [X[hand], moved, X[aim]]] += np.array([-stiffness, -damping - device.damping, stiffness]) / (
            mass + device.mass
        )
    rates[X["aim"], X["aim"]] = -1.0 / parameters.aim_time
    push[X["target"]], push[X["own_rate"]] = 1.0, parameters.hand_damping / (parameters.hand_mass + device.mass)
    return rates, weight, push


def _noise(parameters: BoardParameters) -> Matrix:
    """Return the covariance of what is unforeseen in a tick: of the partner's aim, and of the ball's acceleration."""
    variances = np.full(WATCHED, FLOOR**2)
    variances[X["aim"]] += 2.0 * parameters.aim_sd**2 / parameters.aim_time * TICK_SECONDS
    variances[X["vp"]] += parameters.ball_noise**2 * TICK_SECONDS**2
    return np.diag(variances)


def _rest(rates: Matrix, weight: Matrix, free: bool) -> Matrix:
    """Return the states at rest with a level board: the regulator equations (Francis 1977), of the linear board."""
    given = [X["p"], X["aim"]]
    free_states = [place for place in range(len(X)) if place not in (*given, X["vp"], X["tilt"])]
    balance = [place for place in range(len(X)) if place not in (X["aim"], X["target"], X["p"], X["vp"])]
    rest = np.zeros((len(X), 3))
    known = np.column_stack((weight[balance], rates[np.ix_(balance, given)]))
    rest[free_states] = -np.linalg.lstsq(rates[np.ix_(balance, free_states)], known, rcond=None)[0]
    rest[X["p"], 1] = rest[X["aim"], 2] = 1.0
    return rest


def kalman_gains(config: Config, parameters: BoardParameters, model: BoardModel) -> Matrix:
    """Return the gains of the stationary filter that takes a view every few ticks, at the tick of the view."""
    advance, noise = np.eye(WATCHED), np.zeros((WATCHED, WATCHED))
    for _ in range(view_ticks(config)):
        step = model.watched[:, :WATCHED]
        advance, noise = step @ advance, step @ noise @ step.T + model.noise
    seen, error = np.eye(WATCHED)[list(SEEN)], seen_variance(config, parameters)
    unit = parameters.sight_noise**2  # the solver loses digits where all variances are tiny
    spread = solve_discrete_are(advance.T, seen.T, noise / unit, error / unit) * unit
    return np.asarray(np.linalg.solve(seen @ spread @ seen.T + error, seen @ spread).T, np.float64)


def seen_variance(config: Config, parameters: BoardParameters) -> Matrix:
    """Return the covariance of what is seen: height, tilt, ball."""
    noise = parameters.sight_noise
    return np.diag([noise**2, (noise / config.physics.l) ** 2, noise**2])


def lqr_gains(parameters: BoardParameters, model: BoardModel, free: bool) -> Matrix:
    """Return the gains of the stationary linear-quadratic regulator: of the speed by each state."""
    scales = {"z": parameters.z_scale, "tilt": np.radians(parameters.tilt_scale_deg)}
    if free:
        scales |= {"p": parameters.p_scale, "vp": parameters.vp_scale}
    kept = [place for name, place in X.items() if free or name not in ("p", "vp")]
    cost = np.zeros((len(X), len(X)))
    for name, scale in scales.items():
        cost[X[name], X[name]] = 1.0 / scale**2
    a, b = model.advance[np.ix_(kept, kept)], model.command[kept][:, None]
    price = np.array([[1.0 / parameters.speed_scale**2]])
    value = solve_discrete_are(a, b, cost[np.ix_(kept, kept)], price)
    gains = np.zeros(len(X))
    gains[kept] = np.linalg.solve(price + b.T @ value @ b, b.T @ value @ a)[0]
    return gains


class BoardDesign(NamedTuple):
    """What a robot believes of the board with the ball free, and its control."""

    model: BoardModel
    gains: Matrix
    regulator: Matrix  # of the speed by each state, with the aim's part of the rest
    delay: int  # from a tick to the view of it, in ticks
    ticks: int  # between two views


def design(config: Config, parameters: BoardParameters) -> BoardDesign:
    """Return what a robot believes and does with the ball free."""
    model = board_model(config, parameters, "right", True)
    regulator = lqr_gains(parameters, model, True)
    regulator[X["aim"]] -= regulator @ model.rest[:, 2]
    delay = round(parameters.view_delay / TICK_SECONDS)
    return BoardDesign(model, kalman_gains(config, parameters, model), regulator, delay, view_ticks(config))


def loop_growth(believed: BoardDesign, true: BoardModel, latency: int) -> float:
    """Return the spectral radius of ball, board, both hands and filter from view to view, with the ball free [1].

    Parameters
    ----------
    true : BoardModel
        The board with its true partner.
    latency : int
        Ticks by which views are later than the robot believes [1].
    """
    step, late = believed.model.watched, believed.delay + latency
    carried = np.linalg.matrix_power(step[:, :WATCHED], believed.delay) @ believed.gains
    cuts = np.cumsum([len(X), WATCHED, len(SEEN) * (late + 1)])
    states = np.eye(int(cuts[-1]) + len(SEEN) * (believed.delay + 1))
    for tick in range(believed.ticks):
        x, guess, views, guesses = np.split(states, cuts)
        x = true.advance @ x - np.outer(true.command, believed.regulator @ np.vstack((guess, x[WATCHED:])))
        guess = step[:, :WATCHED] @ guess + step[:, WATCHED : WATCHED + 2] @ x[WATCHED : WATCHED + 2]
        views = np.vstack((x[list(SEEN)], views))[: len(views)]
        guesses = np.vstack((guess[list(SEEN)], guesses))[: len(guesses)]
        if tick == 0:
            guess = guess + carried @ (views[-len(SEEN) :] - guesses[-len(SEEN) :])
        states = np.vstack((x, guess, views, guesses))
    return float(np.abs(np.linalg.eigvals(states)).max())
