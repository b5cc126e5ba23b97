"""Kinematics of the Novint Falcon: encoder counts to grip position, and force to arm torques.

The Falcon is a delta robot: three arms swing about axes fixed to the base, and each carries a parallelogram that holds
the grip. Seen along its own axis an arm is a two-link chain whose second link appears shorter the further the grip is
out of the arm's plane. The lengths are named as in Stamper's thesis (University of Maryland, 1997, PhD 97-4), to which
the Falcon adds the offsets f and s. Their values, and those of the encoders, are those of libnifalcon.

All quantities are in the Falcon's own frame: x right, y up, z towards the person who holds the grip [m].

The inverse kinematics have a closed form. The forward kinematics have none, because of the offsets d and e, and are
solved by Newton's method from the previous position. The search rejects poses that the arms could only reach with
inverted elbows.
"""

from math import acos, atan2, cos, hypot, isfinite, nan, pi, radians, sin, sqrt

from netboard.base.compiled import kernel

Vector = tuple[float, float, float]

# Lengths of the mechanism [m].
A = 0.060  # arm, from its axis to the elbow
B = 0.1025  # long side of the parallelogram
C = 0.01443  # from the grip's centre to its joints, along the arm
D = E = 0.01125  # from either end of the parallelogram to its joint
F = -0.025  # from the grip's centre to its joints, across the arm
R = 0.0400  # from the centre of the base to an arm's axis, along the arm
S = -0.02309  # the same, across the arm

TILT = pi / 12
"""The arms stand at 90, -30 and -150 degrees, all rotated by this angle [rad]."""

_COS = (cos(pi / 2 + TILT), cos(-pi / 6 + TILT), cos(-5 * pi / 6 + TILT))
_SIN = (sin(pi / 2 + TILT), sin(-pi / 6 + TILT), sin(-5 * pi / 6 + TILT))

COUNTS = 320 * 4
"""Encoder counts per motor turn: 320 slots with four edges each [1]."""

GEAR = 0.01425 / 0.110
"""Arm turns per motor turn: diameter of the motor shaft over that of the arm's cable drum [1]."""

ANGLE_PER_COUNT = 2 * pi / COUNTS * GEAR
"""Arm angle per encoder count: 0.0364 degrees [rad]."""

ANGLE_AT_ZERO = radians(35.0)
"""Angle of an arm whose homed encoder reads zero [rad]."""

CENTRE: Vector = (0.0, 0.0, 0.115)
"""Centre of the largest cube in which the mechanism is far from singular [m]."""

REACH = 0.04
"""Half the side of that cube; inside it, torques for the same force differ by a factor of at most 6.4 [m]."""

MAX_ANGLE = radians(120.0)
"""Largest arm angle in either direction; larger ones mean invalid encoder values [rad]."""

TOLERANCE = 1e-13
"""Newton step below which the search ends; one count moves the grip by 4e-5 m [m]."""

MAX_STEPS = 30
"""Limit of Newton steps; three are usual when starting from the previous position [1]."""

MAX_STEP = 0.02
"""Longest Newton step [m]."""


def angles_of(encoders: tuple[int, int, int]) -> Vector:
    """Return the angles of the three arms from their homed encoders [rad].

    An arm at 0 points away from the axis of the base, at 90 degrees towards the person.
    """
    first, second, third = encoders
    return (
        ANGLE_AT_ZERO + ANGLE_PER_COUNT * first,
        ANGLE_AT_ZERO + ANGLE_PER_COUNT * second,
        ANGLE_AT_ZERO + ANGLE_PER_COUNT * third,
    )


def encoders_at(angles: Vector) -> tuple[int, int, int]:
    """Return the three homed encoder counts at these arm angles [1]; the inverse of `angles_of`, rounded."""
    first, second, third = (round((angle - ANGLE_AT_ZERO) / ANGLE_PER_COUNT) for angle in angles)
    return first, second, third


@kernel
def inverse(place: Vector) -> Vector:
    """Return the arm angles for a grip position; NaN where an arm does not reach [rad]."""
    return _swing(0, place), _swing(1, place), _swing(2, place)


@kernel
def _swing(leg: int, place: Vector) -> float:
    """Return the angle of one arm: of the two solutions of its chain, the one with the elbow outside."""
    x, y, z = place
    along = _COS[leg] * x + _SIN[leg] * y - R + C
    across = _COS[leg] * y - _SIN[leg] * x - S + F
    rest = B * B - across * across
    if rest <= 0.0:
        return nan
    link = D + E + sqrt(rest)
    far = hypot(along, z)
    if far == 0.0:
        return nan
    share = (far * far + A * A - link * link) / (2 * A * far)
    if abs(share) > 1.0:
        return nan
    return atan2(z, along) - acos(share)


@kernel
def _closure(leg: int, angle: float, place: Vector) -> tuple[float, float, float, float, float]:
    """Return the closure error of one chain and its derivatives by x, y, z and the arm's angle.

    The distance of elbow and grip joint must equal the second link's length. The error is half the difference of the
    squares [m2]; also returned are its gradient [m] and its derivative by the angle [m2/rad].
    """
    x, y, z = place
    across = _COS[leg] * y - _SIN[leg] * x - S + F
    rest = B * B - across * across
    if rest <= 0.0:
        return nan, nan, nan, nan, nan
    root = sqrt(rest)
    link = D + E + root
    p = _COS[leg] * x + _SIN[leg] * y - R + C - A * cos(angle)
    q = z - A * sin(angle)
    slant = link * across / root
    gap = 0.5 * (p * p + q * q - link * link)
    gx, gy = p * _COS[leg] - slant * _SIN[leg], p * _SIN[leg] + slant * _COS[leg]
    return gap, gx, gy, q, A * (p * sin(angle) - q * cos(angle))


@kernel
def _cross(a: Vector, b: Vector) -> Vector:
    return a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]


@kernel
def forward(angles: Vector, guess: Vector) -> Vector:
    """Return the grip position for three arm angles, by Newton's method; NaN if the search from `guess` fails [m]."""
    lost = (nan, nan, nan)
    if max(abs(angles[0]), abs(angles[1]), abs(angles[2])) > MAX_ANGLE:
        return lost
    x, y, z = guess
    for _ in range(MAX_STEPS):
        g1, ax, ay, az, t1 = _closure(0, angles[0], (x, y, z))
        g2, bx, by, bz, t2 = _closure(1, angles[1], (x, y, z))
        g3, cx, cy, cz, t3 = _closure(2, angles[2], (x, y, z))
        u, v, w = (
            _cross((bx, by, bz), (cx, cy, cz)),
            _cross((cx, cy, cz), (ax, ay, az)),
            _cross((ax, ay, az), (bx, by, bz)),
        )
        volume = ax * u[0] + ay * u[1] + az * u[2]
        if not isfinite(volume) or volume == 0.0:
            return lost
        dx = -(g1 * u[0] + g2 * v[0] + g3 * w[0]) / volume
        dy = -(g1 * u[1] + g2 * v[1] + g3 * w[1]) / volume
        dz = -(g1 * u[2] + g2 * v[2] + g3 * w[2]) / volume
        size = sqrt(dx * dx + dy * dy + dz * dz)
        share = 1.0 if size <= MAX_STEP else MAX_STEP / size
        x, y, z = x + share * dx, y + share * dy, z + share * dz
        if size < TOLERANCE:
            outside = t1 < 0.0 and t2 < 0.0 and t3 < 0.0
            return (x, y, z) if outside and z > 0.0 else lost
    return lost


@kernel
def jacobian(angles: Vector, place: Vector) -> tuple[Vector, Vector, Vector]:
    """Return the columns of the Jacobian: the derivative of the position by the angle of each arm [m/rad].

    Each chain stays closed, so for each arm gradient times motion plus derivative times turn is zero. The system is
    solved by cross products. The values grow without bound near a singular pose.
    """
    _, ax, ay, az, t1 = _closure(0, angles[0], place)
    _, bx, by, bz, t2 = _closure(1, angles[1], place)
    _, cx, cy, cz, t3 = _closure(2, angles[2], place)
    u, v, w = _cross((bx, by, bz), (cx, cy, cz)), _cross((cx, cy, cz), (ax, ay, az)), _cross((ax, ay, az), (bx, by, bz))
    volume = ax * u[0] + ay * u[1] + az * u[2]
    p, q, r = -t1 / volume, -t2 / volume, -t3 / volume
    return (p * u[0], p * u[1], p * u[2]), (q * v[0], q * v[1], q * v[2]), (r * w[0], r * w[1], r * w[2])


@kernel
def torques(angles: Vector, place: Vector, force: Vector) -> Vector:
    """Return the arm torques equivalent to a force at the grip, positive towards larger angles [N m].

    They are the transposed Jacobian times the force.
    """
    a, b, c = jacobian(angles, place)
    return (
        a[0] * force[0] + a[1] * force[1] + a[2] * force[2],
        b[0] * force[0] + b[1] * force[1] + b[2] * force[2],
        c[0] * force[0] + c[1] * force[1] + c[2] * force[2],
    )
