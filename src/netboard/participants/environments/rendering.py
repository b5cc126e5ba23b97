"""The view of a seat as an image: board, ball, target, and the heights of its own styluses. Drawn with NumPy alone.

It shows what a display shows of the same view, and nothing that the curtain hides.
"""

from math import isnan

import numpy as np
from numpy.typing import NDArray

from netboard.base.config import Config

WIDTH, HEIGHT = 480, 320
"""Size of an image [pixels]."""

_PIXELS = 600.0
"""Pixels in a metre [1/m]."""

_BACKGROUND, _BOARD, _BALL, _TARGET, _STYLUS = (
    np.array(colour, np.float64)
    for colour in ((24, 26, 30), (205, 205, 200), (240, 150, 60), (70, 150, 90), (110, 160, 230))
)
_COLUMNS, _ROWS = np.meshgrid(np.arange(WIDTH) + 0.5, np.arange(HEIGHT) + 0.5)
_X, _Y = (_COLUMNS - WIDTH / 2) / _PIXELS, (HEIGHT / 2 - _ROWS) / _PIXELS

_THICK, _BALL_RADIUS, _STYLUS_RADIUS = 0.008, 0.018, 0.009
"""Sizes of what is drawn [m]."""


def _paint(image: NDArray[np.float64], distance: NDArray[np.float64], colour: NDArray[np.float64]) -> None:
    """Paint where a distance is negative, with smooth edges [m]."""
    share = np.clip(0.5 - distance * _PIXELS, 0.0, 1.0)[..., np.newaxis]
    image += share * (colour - image)


def draw(seen: np.void, config: Config) -> NDArray[np.uint8]:
    """Return a view as an image.

    Parameters
    ----------
    seen : record of netboard.participants.policy.SEEN
        The view; NaN for what is hidden, and before the first one.
    config : Config
        The configuration of the block.

    Returns
    -------
    ndarray of uint8, shape (HEIGHT, WIDTH, 3)
        The image, RGB [1].
    """
    image = np.empty((HEIGHT, WIDTH, 3))
    image[:] = _BACKGROUND
    if not isnan(seen["time"]):
        _draw_scene(image, seen, config)
    return np.asarray(np.rint(image), np.uint8)


def _draw_scene(image: NDArray[np.float64], seen: np.void, config: Config) -> None:
    """Draw what a view shows."""
    s, c = np.sin(seen["theta"]), np.cos(seen["theta"])
    along, across = c * _X + s * (_Y - seen["z"]), -s * _X + c * (_Y - seen["z"])
    arm = config.physics.l
    _paint(image, np.maximum(np.abs(along) - arm, np.abs(across) - _THICK / 2), _BOARD)
    half = config.geometry.target_width / 2
    _paint(image, np.maximum(np.abs(along - seen["target"]) - half, np.abs(across) - _THICK / 2), _TARGET)
    if not isnan(seen["p"]):
        _paint(image, np.hypot(along - seen["p"], across - _BALL_RADIUS - _THICK / 2) - _BALL_RADIUS, _BALL)
    for name, sign in (("left", -1.0), ("right", 1.0)):
        if not isnan(seen[name]):
            _paint(image, np.hypot(_X - sign * (arm + 0.03), _Y - seen[name]) - _STYLUS_RADIUS, _STYLUS)
