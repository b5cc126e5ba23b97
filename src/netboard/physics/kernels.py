"""One millisecond of board and ball, in strict scalar arithmetic: the coupling to the hands and the RK4 step.

The paper's equations as they must be read (docs/physics.md). Rule 1: the same bits on every machine, and in plain
Python (``NUMBA_DISABLE_JIT=1``): no ``fastmath``, no fused multiply-add, no math library, one order of operations.
Rule 2: mirror images to the bit: exchange left and right and the signs of tilt and ball, and every result changes side
or sign exactly. Rule 3: nothing raises; what is not finite goes in and comes out. Rule 4: what a scene does not need is
not computed: the three steps are one text, whose flags are constants that the compiler removes.

Symbols: z, vz height of the board's centre and its rate; theta, omega tilt (+ = right end up) and its rate; p, vp ball
along the board (+ = right) and its rate; a scene is one record of `netboard.physics.scene.SCENE`. It knows no trial and
no sample: a stylus moves with constant velocity through the step.
"""

from typing import Any

from netboard.compiled import inlined, kernel
from netboard.physics.trig import sincos


@inlined
def _forces(
    z: float,
    vz: float,
    omega: float,
    s: float,
    c: float,
    left_z: float,
    left_vz: float,
    right_z: float,
    right_vz: float,
    scene: Any,
) -> tuple[float, float]:
    """Return the spring-damper forces on the board's two control points [N], given sine and cosine of the tilt."""
    arm = scene["l"] * s
    arm_rate = scene["l"] * omega * c
    left = scene["k_h"] * (left_z - (z - arm)) + scene["c_h"] * (left_vz - (vz - arm_rate))
    right = scene["k_h"] * (right_z - (z + arm)) + scene["c_h"] * (right_vz - (vz + arm_rate))
    return left, right


@kernel
def coupling(
    z: float,
    vz: float,
    theta: float,
    omega: float,
    left_z: float,
    left_vz: float,
    right_z: float,
    right_vz: float,
    scene: Any,
) -> tuple[float, float]:
    """Return the forces of the two hands on the board; the hands feel their opposites (paper eq. 1-2).

    Parameters
    ----------
    z, vz : float
        Height of the board's centre and its rate [m, m/s].
    theta, omega : float
        Tilt, + = right end up, and its rate [rad, rad/s].
    left_z, left_vz, right_z, right_vz : float
        Heights of the styluses and their rates [m, m/s].
    scene : SCENE record
        The scene.

    Returns
    -------
    left, right : float
        Forces on the board, + = up [N].
    """
    s, c = sincos(theta)
    return _forces(z, vz, omega, s, c, left_z, left_vz, right_z, right_vz, scene)


@inlined
def _accelerations(
    z: float,
    vz: float,
    theta: float,
    omega: float,
    p: float,
    left_z: float,
    left_vz: float,
    right_z: float,
    right_vz: float,
    weight: float,
    loaded: bool,
    scene: Any,
) -> tuple[float, float, float]:
    """Return the accelerations of height, tilt and ball [m/s2, rad/s2, m/s2], under this weight of the ball [N]."""
    s, c = sincos(theta)
    left, right = _forces(z, vz, omega, s, c, left_z, left_vz, right_z, right_vz, scene)
    force = (left + right) - scene["M"] * scene["g"] - scene["k_s"] * z
    torque = (right - left) * scene["l"]
    if loaded:
        force -= weight * (c * c)
        torque -= weight * p
    # Multiplied by reciprocals, which are ready long before sine and cosine are: a division would lengthen the chain.
    return force * (1.0 / scene["M"]), torque * c * (1.0 / scene["I"]), scene["ball_gravity"] * s


@inlined
def _rk4(
    z: float,
    vz: float,
    theta: float,
    omega: float,
    p: float,
    vp: float,
    left_z: float,
    left_vz: float,
    right_z: float,
    right_vz: float,
    h: float,
    weight: float,
    loaded: bool,
    rolls: bool,
    scene: Any,
) -> tuple[float, float, float, float, float, float]:
    """Return the state after one classical Runge-Kutta step; `loaded` and `rolls` must be constants at the call."""
    half, sixth = 0.5 * h, h / 6.0
    left_mid, right_mid = left_z + half * left_vz, right_z + half * right_vz
    left_end, right_end = left_z + h * left_vz, right_z + h * right_vz

    az1, ao1, ap1 = _accelerations(z, vz, theta, omega, p, left_z, left_vz, right_z, right_vz, weight, loaded, scene)
    vz2, omega2, vp2 = vz + half * az1, omega + half * ao1, vp + half * ap1
    p2 = p + half * vp if rolls else p
    az2, ao2, ap2 = _accelerations(
        z + half * vz,
        vz2,
        theta + half * omega,
        omega2,
        p2,
        left_mid,
        left_vz,
        right_mid,
        right_vz,
        weight,
        loaded,
        scene,
    )
    vz3, omega3, vp3 = vz + half * az2, omega + half * ao2, vp + half * ap2
    p3 = p + half * vp2 if rolls else p
    az3, ao3, ap3 = _accelerations(
        z + half * vz2,
        vz3,
        theta + half * omega2,
        omega3,
        p3,
        left_mid,
        left_vz,
        right_mid,
        right_vz,
        weight,
        loaded,
        scene,
    )
    vz4, omega4, vp4 = vz + h * az3, omega + h * ao3, vp + h * ap3
    p4 = p + h * vp3 if rolls else p
    az4, ao4, ap4 = _accelerations(
        z + h * vz3, vz4, theta + h * omega3, omega4, p4, left_end, left_vz, right_end, right_vz, weight, loaded, scene
    )

    if rolls:
        p += sixth * (vp + 2.0 * (vp2 + vp3) + vp4)
        vp += sixth * (ap1 + 2.0 * (ap2 + ap3) + ap4)
    return (
        z + sixth * (vz + 2.0 * (vz2 + vz3) + vz4),
        vz + sixth * (az1 + 2.0 * (az2 + az3) + az4),
        theta + sixth * (omega + 2.0 * (omega2 + omega3) + omega4),
        omega + sixth * (ao1 + 2.0 * (ao2 + ao3) + ao4),
        p,
        vp,
    )


@kernel
def rk4_free(
    z: float,
    vz: float,
    theta: float,
    omega: float,
    p: float,
    vp: float,
    left_z: float,
    left_vz: float,
    right_z: float,
    right_vz: float,
    h: float,
    scene: Any,
) -> tuple[float, float, float, float, float, float]:
    """Return the state one RK4 step later, with the ball rolling (paper eq. 3-5).

    Parameters
    ----------
    z, vz : float
        Height of the board's centre and its rate [m, m/s].
    theta, omega : float
        Tilt, + = right end up, and its rate [rad, rad/s].
    p, vp : float
        Ball along the board, + = right, and its rate [m, m/s].
    left_z, left_vz, right_z, right_vz : float
        Heights of the styluses at the start of the step, and their rates all through it [m, m/s].
    h : float
        Length of the step [s].
    scene : SCENE record
        The scene.

    Returns
    -------
    z, vz, theta, omega, p, vp : float
        The state at the end of the step [m, m/s, rad, rad/s, m, m/s].
    """
    weight = scene["m"] * scene["g"]
    return _rk4(z, vz, theta, omega, p, vp, left_z, left_vz, right_z, right_vz, h, weight, True, True, scene)


@kernel
def rk4_fixed(
    z: float,
    vz: float,
    theta: float,
    omega: float,
    p: float,
    vp: float,
    left_z: float,
    left_vz: float,
    right_z: float,
    right_vz: float,
    h: float,
    scene: Any,
) -> tuple[float, float, float, float, float, float]:
    """Return the state one RK4 step later, with the ball fixed at p (reading B2).

    Its weight loads the board if the scene says so; its own equation is not integrated.

    Parameters
    ----------
    z, vz : float
        Height of the board's centre and its rate [m, m/s].
    theta, omega : float
        Tilt, + = right end up, and its rate [rad, rad/s].
    p, vp : float
        Where the ball is fixed; what its rate is said to be is ignored [m, m/s].
    left_z, left_vz, right_z, right_vz : float
        Heights of the styluses at the start of the step, and their rates all through it [m, m/s].
    h : float
        Length of the step [s].
    scene : SCENE record
        The scene.

    Returns
    -------
    z, vz, theta, omega, p, vp : float
        The state at the end of the step, p as it was and vp zero [m, m/s, rad, rad/s, m, m/s].
    """
    weight = scene["m"] * scene["g"] * scene["fixed_load"]
    return _rk4(z, vz, theta, omega, p, 0.0, left_z, left_vz, right_z, right_vz, h, weight, True, False, scene)


@kernel
def rk4_bare(
    z: float,
    vz: float,
    theta: float,
    omega: float,
    p: float,
    vp: float,
    left_z: float,
    left_vz: float,
    right_z: float,
    right_vz: float,
    h: float,
    scene: Any,
) -> tuple[float, float, float, float, float, float]:
    """Return the state one RK4 step later, of a board without a ball.

    Parameters
    ----------
    z, vz : float
        Height of the board's centre and its rate [m, m/s].
    theta, omega : float
        Tilt, + = right end up, and its rate [rad, rad/s].
    p, vp : float
        Handed back as they are [m, m/s].
    left_z, left_vz, right_z, right_vz : float
        Heights of the styluses at the start of the step, and their rates all through it [m, m/s].
    h : float
        Length of the step [s].
    scene : SCENE record
        The scene.

    Returns
    -------
    z, vz, theta, omega, p, vp : float
        The state at the end of the step [m, m/s, rad, rad/s, m, m/s].
    """
    return _rk4(z, vz, theta, omega, p, vp, left_z, left_vz, right_z, right_vz, h, 0.0, False, False, scene)
