"""Taylor coefficients of a movement of the scene, by recursion from order to order (automatic differentiation).

Every term of the equations in `netboard.physics.scene.models` is a sum or a product, sine and cosine of the tilt, or a
law of friction. Therefore the coefficients of the rates up to order n give those of the state of order n + 1 (Jorba and
Zou, A software package for the numerical integration of ODEs by means of high-order Taylor methods, Experimental
Mathematics 14, 2005, section 2). A table has one row for each series, and its columns are the orders: ``x(t) = x[0] +
x[1] t + x[2] t^2 + ...``. The arithmetic is strict, as in `models`.

Lagrange's equations are used in the form in which the derivatives of whole products replace most of their terms. With
``w = p' - r theta'`` of each ball, W, P and Q the sums of w, p and p^2, and F that of friction,

    (M + n m) z'' + m (W s + P s')' = force
    ((I + m Q) theta')' + m c P (z'' + g) = torque + m r theta'^2 P - r F
    w' = e (p theta'^2 - s (g + z'') - F / m)

which has eleven products for each order, not twenty. The terms of order n with z'' and theta'' of order n have the
inertia of the start of the step, so one inverse of two by two serves all orders.
"""

from typing import Any

import numpy as np
from numba import types
from numpy.typing import NDArray

from netboard.base.compiled import inlined, specialised
from netboard.base.tables.friction import COLUMNS, WORK_ROWS
from netboard.base.tables.scene import FRICTION
from netboard.physics.arithmetic.vectors import State, dot, places, speeds, total
from netboard.physics.scene.models import inertia, solved, turned
from netboard.physics.scene.parameters import Parts, SceneNumbers

MAX_ORDER = COLUMNS - 2
"""Highest order of a table [1]."""

Table = NDArray[np.float64]
"""Coefficients of all series, `COLUMNS` for each: a constant, so that compiled code finds them without arithmetic."""

(
    LEFT,  # drive of the left hand
    RIGHT,  # and of the right one
    SINE,  # of the tilt
    COSINE,
    SWING,  # rate of the sine
    TURN,  # what the cosine turns into a torque
    LIFT,  # acceleration of heave
    SPIN,  # square of the rate of tilt
    ARM,  # horizontal distance of the balls from the board's centre, summed
    SQUARE,  # sum of p^2
    PLACE,  # sum of p
    SLIDE,  # sum of w
    LOAD,  # normal force of a ball on the board
    HEIGHT,  # z, the first row of the state
    HEAVE,  # vz
    TILT,  # theta
    OMEGA,
    BALL,  # p of the first ball
) = range(0, 18 * COLUMNS, COLUMNS)
"""Rows of a table, by the place of their coefficient of order 0; rows of friction follow the state."""

STATE, NEXT = HEIGHT, COLUMNS
"""First row of the state; from a row to the next."""


def table_of(length: int) -> Table:
    """Return an empty table for a scene."""
    balls = length // 2 - 2
    return np.zeros(STATE + (length + balls * (1 + WORK_ROWS * len(FRICTION))) * COLUMNS)


@inlined
def larger_of(one: float, other: float) -> float:
    """Return the larger of two speeds [SI].

    Parameters
    ----------
    one, other : float
        The speeds [SI].
    """
    return max(one, other)


@inlined
def begin_series(x: State, side: float, parts: Parts, scene: np.void, table: Table) -> tuple[float, float, float]:
    """Write the coefficients of order 0, except those of the drives; return the inertia [kg, kg m, kg m2].

    Parameters
    ----------
    side : float
        Sign of the cosine of the tilt during the step [1].
    """
    for i in range(len(x)):
        table[STATE + i * NEXT] = x[i]
    s, c = turned(x[2], parts)
    table[SINE], table[COSINE], table[SWING] = s, c, x[3] * c
    table[LOAD] = scene["m"] * scene["g"] * side * c
    p = places(x)
    table[PLACE], table[SQUARE] = total(p), dot(p, p)
    table[SLIDE] = total(speeds(x)) - len(p) * scene["ball_height"] * x[3]
    if parts.lagrangian:
        return inertia(x, s, c, parts, scene)
    return scene["M"], 0.0, scene["I"]


@inlined
def extend_series(
    n: int, x: State, mass: tuple[float, float, float], side: float, parts: Parts, numbers: SceneNumbers, table: Table
) -> float:
    """Write the coefficients of order n + 1 from those up to order n; return the largest speed among them [SI].

    The drives are known up to order n. Speeds are those of heave, tilt (of its control points) and balls.

    Parameters
    ----------
    n : int
        Highest order that the table has, from 0 [1].
    x : tuple of float
        State at the start: the coefficients of order 0 [SI].
    mass : tuple of float
        Result of `begin_series` [kg, kg m, kg m2].
    side : float
        As for `begin_series` [1].
    """
    r, place = 1.0 / (n + 1), 0.0
    table[HEIGHT + n + 1], table[TILT + n + 1] = r * table[HEAVE + n], r * table[OMEGA + n]
    for p in range(BALL, STATE + len(x) * NEXT, 2 * NEXT):
        table[p + n + 1] = r * table[p + NEXT + n]
        place += table[p + n + 1]
    table[PLACE + n + 1] = place
    if parts.resisted:
        _write_friction(n, len(x), parts, numbers, table)
    if parts.lagrangian:
        az, ao = _lagrangian(n, r, x, mass, parts, numbers, table)
    else:
        az, ao = _paper(n, r, len(x), parts, numbers, table)
    table[HEAVE + n + 1], table[OMEGA + n + 1] = r * az, r * ao
    table[SWING + n + 1] += r * ao * table[COSINE]
    table[LOAD + n + 1] = numbers.m * numbers.g * side * table[COSINE + n + 1]
    size: float = larger_of(abs(r * az), numbers.l * abs(r * ao))
    if parts.free:
        for p in range(BALL, STATE + len(x) * NEXT, 2 * NEXT):
            size = larger_of(size, abs(table[p + NEXT + n + 1]))
    return size


def _write_friction(n: int, length: int, parts: Parts, numbers: SceneNumbers, table: Table) -> None:
    """Write the coefficients of order n of the friction of each ball, the sum of all laws."""
    balls = length // 2 - 2
    for ball in range(balls):
        force, vp = 0.0, BALL + (2 * ball + 1) * NEXT
        for i, (key, law) in enumerate(FRICTION.items()):
            if parts.friction[i]:
                work = STATE + (length + balls + (ball * len(FRICTION) + i) * WORK_ROWS) * NEXT
                force += law.series(n, getattr(numbers, key), table, vp, LOAD, work)
        table[STATE + (length + ball) * NEXT + n] = force


_LAWS = {f"law{i}": inlined(law.series) for i, law in enumerate(FRICTION.values())}


@specialised(_write_friction)
def _friction(n: types.Type, length: types.Type, parts: types.Type, numbers: types.Type, table: types.Type) -> Any:
    """Write the sum of all laws; the compiler removes those that the scene lacks."""
    lines = ["def write(n, length, parts, numbers, table):", " balls = length // 2 - 2", " for ball in range(balls):"]
    lines += ["  force, vp = 0.0, BALL + (2 * ball + 1) * NEXT"]
    for i, key in enumerate(FRICTION):
        work = f"STATE + (length + balls + (ball * {len(FRICTION)} + {i}) * {WORK_ROWS}) * NEXT"
        lines += [f"  if parts.friction[{i}]:", f"   force += law{i}(n, numbers.{key}, table, vp, LOAD, {work})"]
    lines += ["  table[STATE + (length + ball) * NEXT + n] = force"]
    known: dict[str, Any] = {**_LAWS, "STATE": STATE, "BALL": BALL, "NEXT": NEXT, "LOAD": LOAD, "__name__": __name__}
    exec("\n".join(lines), known)
    return known["write"]


@inlined
def _hands(n: int, parts: Parts, numbers: SceneNumbers, table: Table) -> tuple[float, float]:
    """Return the force on a board without balls and weight, and the difference of the hands' forces, of order n [N]."""
    left, right, z, vz = table[LEFT + n], table[RIGHT + n], table[HEIGHT + n], table[HEAVE + n]
    arm, arm_rate = numbers.l * table[SINE + n], numbers.l * table[SWING + n]
    k, d = numbers.k_left + numbers.k_right, numbers.c_left + numbers.c_right
    force = (left + right) - (k + numbers.k_s) * z - (d + numbers.b_z) * vz
    turn = (right - left) - k * arm - d * arm_rate
    if not parts.even:
        k, d = numbers.k_right - numbers.k_left, numbers.c_right - numbers.c_left
        force -= k * arm + d * arm_rate
        turn -= k * z + d * vz
    return force, turn


@inlined
def _paper(n: int, r: float, length: int, parts: Parts, numbers: SceneNumbers, table: Table) -> tuple[float, float]:
    """Return the accelerations of heave and tilt of order n by the paper's equations; write those of the balls."""
    weight = 0.0
    force, turn = _hands(n, parts, numbers, table)
    if n == 0:
        force -= numbers.M * numbers.g
    if parts.loaded:
        weight = numbers.m * numbers.g * (1.0 if parts.free else numbers.fixed_load)
    table[TURN + n] = numbers.l * turn - weight * table[PLACE + n]
    torque, level = 0.0, 0.0
    if parts.tilts:
        fall, swing = 0.0, 0.0
        for k in range(1, n + 1):
            fall += table[OMEGA + k] * table[SINE + n - k]
            swing += table[OMEGA + k] * table[COSINE + n + 1 - k]
            level += table[COSINE + k] * table[COSINE + n - k]
            torque += table[TURN + k - 1] * table[COSINE + n + 1 - k]
        fall += table[OMEGA] * table[SINE + n]
        level += table[COSINE] * table[COSINE + n]
        torque += table[TURN + n] * table[COSINE]
        table[SINE + n + 1], table[COSINE + n + 1] = r * table[SWING + n], -(r * fall)
        table[SWING + n + 1] = swing + table[OMEGA] * table[COSINE + n + 1]
    elif n == 0:
        level = 1.0
    if parts.loaded:
        force -= (length // 2 - 2) * weight * level
    if parts.damped:
        torque -= numbers.b_theta * table[OMEGA + n]
    if parts.free:
        for ball in range(length // 2 - 2):
            ap = numbers.ball_gravity * table[SINE + n]
            if parts.resisted:
                ap -= numbers.mass_ratio * (1.0 / numbers.m) * table[STATE + (length + ball) * NEXT + n]
            table[BALL + (2 * ball + 1) * NEXT + n + 1] = r * ap
    az = force * (1.0 / numbers.M) if parts.heaves else 0.0
    return az, torque * (1.0 / numbers.I) if parts.tilts else 0.0


@inlined
def _lagrangian(
    n: int,
    r: float,
    x: State,
    mass: tuple[float, float, float],
    parts: Parts,
    numbers: SceneNumbers,
    table: Table,
) -> tuple[float, float]:
    """Return the accelerations of heave and tilt of order n by Lagrange's equations; write those of the balls."""
    force, turn = _hands(n, parts, numbers, table)
    table[TURN + n] = numbers.l * turn
    torque, fall, swing = 0.0, 0.0, 0.0
    for k in range(1, n + 1):
        fall += table[OMEGA + k] * table[SINE + n - k]
        swing += table[OMEGA + k] * table[COSINE + n + 1 - k]
        torque += table[TURN + k - 1] * table[COSINE + n + 1 - k]
    fall += table[OMEGA] * table[SINE + n]
    torque += table[TURN + n] * table[COSINE]
    if parts.tilts:
        table[SINE + n + 1], table[COSINE + n + 1] = r * table[SWING + n], -(r * fall)
        table[SWING + n + 1] = swing + table[OMEGA] * table[COSINE + n + 1]
    if n == 0:
        force -= numbers.M * numbers.g
    if parts.damped:
        torque -= numbers.b_theta * table[OMEGA + n]
    if parts.loaded and parts.free:
        more, turning, along = _free_balls(n, r, x, parts, numbers, table)
        force, torque = force + more, torque + turning
    elif parts.loaded:
        more, turning = _fixed_balls(n, x, parts, numbers, table)
        force, torque = force + more, torque + turning
    az, ao = solved(mass[0], mass[1], mass[2], force, torque, parts)
    table[LIFT + n] = az
    if parts.free:
        for vp in range(BALL + NEXT, STATE + len(x) * NEXT, 2 * NEXT):
            rolled = numbers.mass_ratio * (table[vp + n + 1] - table[SINE] * az)
            table[vp + n + 1] = r * (rolled + numbers.ball_height * ao)
        slid = numbers.mass_ratio * (along - (len(x) // 2 - 2) * table[SINE] * az)
        table[SLIDE + n + 1] = r * slid
    return az, ao


@inlined
def _free_balls(
    n: int, r: float, x: State, parts: Parts, numbers: SceneNumbers, table: Table
) -> tuple[float, float, float]:
    """Return what balls add to the force and the torque of order n, without accelerations of order n.

    Write the force along the board on each ball over its mass, in the row of its speed; return its sum, too.
    """
    m, g, balls = numbers.m, numbers.g, len(x) // 2 - 2
    # All sums in one loop; their terms with coefficients that it makes, or that are known already, stand outside.
    arm, spin, sliding, swaying, lifted, lifting, turning = 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
    table[LIFT + n] = 0.0
    for k in range(1, n + 1):
        arm += table[PLACE + k] * table[COSINE + n - k]
        spin += table[OMEGA + k] * table[OMEGA + n - k]
        sliding += table[SLIDE + k] * table[SINE + n + 1 - k]
        swaying += table[SWING + k] * table[PLACE + n + 1 - k]
        lifted += table[LIFT + k] * table[ARM + n - k]
        lifting += table[LIFT + k] * table[SINE + n - k]
        turning += table[OMEGA + k] * table[SQUARE + n + 1 - k]
    arm += table[PLACE] * table[COSINE + n]
    spin += table[OMEGA] * table[OMEGA + n]
    sliding += table[SLIDE] * table[SINE + n + 1]
    swaying += table[SWING] * table[PLACE + n + 1]
    table[ARM + n], table[SPIN + n] = arm, spin
    lifted += table[LIFT] * arm
    lifting += table[LIFT] * table[SINE + n]
    along, square, flung, friction = 0.0, 0.0, 0.0, 0.0
    for ball in range(balls):
        p, fling = BALL + 2 * ball * NEXT, 0.0
        for k in range(1, n + 1):
            square += table[p + k] * table[p + NEXT + n - k]
            fling += table[p + k] * table[SPIN + n - k]
        square += table[p] * table[p + NEXT + n]
        fling += table[p] * spin
        flung += fling
        fling -= g * table[SINE + n] + lifting
        if parts.resisted:
            drag = table[STATE + (len(x) + ball) * NEXT + n]
            fling -= drag * (1.0 / m)
            friction += drag
        table[p + NEXT + n + 1] = fling
        along += fling
    table[SQUARE + n + 1] = 2.0 * r * square
    turning += table[OMEGA] * table[SQUARE + n + 1]
    # SWING of order n + 1 lacks the term with the acceleration of tilt still.
    sway = (n + 1) * (sliding + swaying + table[PLACE] * table[SWING + n + 1])
    force = -m * (sway + table[SINE] * numbers.mass_ratio * along)
    if n == 0:
        force -= balls * m * g
    torque = m * (numbers.ball_height * flung - g * arm - lifted - (n + 1) * turning)
    return force, torque - numbers.ball_height * friction, along


@inlined
def _fixed_balls(n: int, x: State, parts: Parts, numbers: SceneNumbers, table: Table) -> tuple[float, float]:
    """Return what fixed balls add to the force and the torque of order n, without accelerations of order n."""
    m, g, balls = numbers.m * numbers.fixed_load, numbers.g, len(x) // 2 - 2
    place, height = table[PLACE], balls * numbers.ball_height
    arm, sinking, lifted = place * table[COSINE + n] - height * table[SINE + n], 0.0, 0.0
    table[ARM + n] = arm
    for k in range(n + 1):
        sinking += table[OMEGA + k] * table[SINE + n + 1 - k]
    for k in range(n):
        lifted += table[LIFT + k] * table[ARM + n - k]
    force = -m * (n + 1) * (place * table[SWING + n + 1] - height * sinking)
    if n == 0:
        force -= balls * m * g
    return force, -m * (g * arm + lifted)
