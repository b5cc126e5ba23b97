"""Largest latency of views with which a network steers stably, by linearisation where the ball rests in the target.

The light board follows the hands at once, beside a partner who is still, or who does the same at the other end. With
the height h of the hand above rest, the tilt is ``c h / l`` with c = 1/2 or 1, and the ball accelerates by ``-slope``
times it. Between two decisions the speed s of the hand is constant, so its motion is a polynomial in time. What the
network sees is late; what it feels is not. One matrix takes the state from a decision to the next: its eigenvalues say
whether the loop is stable. Limits of speed and force are left out.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from netboard.base.tick import TICK_SECONDS
from netboard.physics.stability.delayed_coupling import ROUNDING, furthest

Array = NDArray[np.float64]

LONGEST = 120
"""Longest latency considered [ms]."""


class RestingBoard(NamedTuple):
    """What the hand does to the board, in coordinates of its side.

    ``tilt``, ``z``, ``load``: tilt and height of the board, and force on the hand, over the height of the hand
    [rad/m, 1, N/m]. ``slope``: acceleration of the ball, downhill, over the tilt [m/s2].
    """

    tilt: float
    z: float
    load: float
    slope: float


class NetworkGains(NamedTuple):
    """Derivatives of the decided speed, in SI units, by what it depends on."""

    ball: float
    ball_rate: float
    tilt: float
    tilt_rate: float
    z: float
    z_rate: float
    height: float
    load: float
    speed: float


def resting_boards(l: float, k_h: float, k_s: float, slope: float) -> tuple[RestingBoard, RestingBoard]:  # noqa: E741
    """Return the board beside a partner who is still, and beside one who does the same.

    Both couplings, of stiffness k_h, and the spring k_s at the centre are in balance: beside a hand that is still both
    carry the same force ``k_s z / 2``.
    """
    z = k_h / (2.0 * k_h + k_s) if k_h > 0.0 else 0.5
    return RestingBoard(0.5 / l, z, -0.5 * k_s * z, slope), RestingBoard(1.0 / l, 0.0, 0.0, slope)


def _advance(board: RestingBoard, time: float) -> Array:
    """Return how ball, its velocity, height and speed of the hand change in a time: matrix, shape (4, 4)."""
    a, t = -board.slope * board.tilt, time
    return np.array(
        [[1.0, t, a * t * t / 2.0, a * t**3 / 6.0], [0.0, 1.0, a * t, a * t * t / 2.0], [0, 0, 1.0, t], [0, 0, 0, 1.0]]
    )


def decision_matrix(gains: NetworkGains, board: RestingBoard, period: int, latency: int) -> Array:
    """Return the matrix from a decision to the next; ``period``, ``latency``: in ticks.

    The state: ball, velocity, height and last speed at the decision, and the same as seen, newest first.
    """
    whole, rest = divmod(latency, period)
    seen = slice(4 * (whole + 1), 4 * (whole + 2))
    size = seen.stop
    decided = np.zeros(size)
    decided[2] = gains.height + gains.load * board.load
    decided[3] = gains.speed
    decided[seen] = (
        gains.ball,
        gains.ball_rate,
        gains.tilt * board.tilt + gains.z * board.z,
        gains.tilt_rate * board.tilt + gains.z_rate * board.z,
    )
    under_way = np.zeros((4, size))
    under_way[:3, :3], under_way[3] = np.eye(3), decided
    matrix = np.zeros((size, size))
    matrix[:4] = _advance(board, period * TICK_SECONDS) @ under_way
    matrix[4:8] = _advance(board, (period - rest) * TICK_SECONDS) @ under_way
    matrix[8:, 4:-4] = np.eye(size - 8)
    return matrix


def largest_view_latency(gains: NetworkGains, boards: tuple[RestingBoard, ...], period: int) -> int:
    """Return the largest latency with which the network is stable with each board; -1 if with none [ms]."""

    def is_stable(latency: int) -> bool:
        matrices = [decision_matrix(gains, board, period, latency + 1) for board in boards]  # applies a tick later
        return all(float(np.abs(np.linalg.eigvals(matrix)).max()) <= 1.0 + ROUNDING for matrix in matrices)

    return furthest(is_stable, LONGEST)
