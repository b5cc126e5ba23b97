"""What can be drawn, and where the board and all that is on it are. Pure: no Qt, no clock.

A `Picture` is points in metres (x right, y up, origin at the board's neutral centre), words and colours. Two equal
pictures look the same on the screen, so a display redraws only when the picture is another one; for that, points are
rounded to `GRAIN`, well below a pixel. `netboard.windows.participant.screens` says what is drawn when, and writes the
words.

Rules that hold here: what a view does not contain (the partner's hand, a ball) cannot be drawn. Colours are from the
Okabe-Ito palette, which colour-blind people can tell apart, and differ in brightness too.
"""

import math
from dataclasses import dataclass, replace
from enum import Enum

from netboard.base.config import Config
from netboard.base.tables.scene import Geometry
from netboard.stage.view import View

GRAIN = 2e-5
"""Points are rounded to this [m]; some 1/30 of a pixel in a window, 1/10 on a 4K screen."""

CURSOR_RADIUS = 0.011
"""Radius of a stylus cursor as drawn [m]."""

HANDLE_RADIUS = 0.005
"""Radius of the mark of a control point on the board as drawn [m]."""

MARGIN = 1.15
"""Room for the board, in lengths of the board [1]."""

BAR_HALF, BAR_TOP, BAR_BOTTOM = 0.10, -0.062, -0.070
"""The bar that fills while the board is level: half its length and where it is, below the level board [m]."""

ARROW_AT, ARROW_CLEAR, ARROW_LENGTH, ARROW_WIDTH = 0.060, 0.014, 0.042, 0.040
"""The arrow at an end that is too low or too high: from the end of the board, from its surface, length, width [m]."""

TEXT_SHARE = 0.24
"""Share of the height left to words, above and below the board's reach [1]."""

Point = tuple[float, float]


class Mood(Enum):
    """What the whole picture says."""

    WAIT = "wait"
    LEVEL = "level"
    RUN = "run"
    HOLD = "hold"
    SUCCESS = "success"
    FAIL = "fail"
    PAUSED = "paused"
    FINISHED = "finished"
    LOST = "lost"


@dataclass(frozen=True, slots=True)
class Colours:
    """One colour a role, as ``#rrggbb``.

    Attributes
    ----------
    background, board, edge, target, ball, cursor, guide : str
        What they say; the edge outlines the board and marks its control points.
    hint, fill : str
        Arrows that say where an end must go; what fills while the board is level or the ball in the target.
    headline, detail, quiet : str
        Words: the main line, the line below, and the small ones.
    """

    background: str = "#11151a"
    board: str = "#78828f"
    edge: str = "#aeb7c2"
    target: str = "#0072b2"
    ball: str = "#e69f00"
    cursor: str = "#ffffff"
    hint: str = "#f0e442"
    fill: str = "#2fc79b"
    guide: str = "#4b5663"
    headline: str = "#e8ecf0"
    detail: str = "#aeb7c2"
    quiet: str = "#6d7885"


_ACTIVE = Colours()
_MUTED = Colours(
    board="#454d57", edge="#5d6671", target="#15354a", ball="#7d6224", cursor="#8b95a1", headline="#c3cad2"
)

COLOURS: dict[Mood, Colours] = {
    Mood.WAIT: _MUTED,
    Mood.LEVEL: _ACTIVE,
    Mood.RUN: _ACTIVE,
    Mood.HOLD: Colours(target="#56b4e9", fill="#f2f8fc"),
    Mood.SUCCESS: Colours(target="#2fc79b", headline="#2fc79b"),
    Mood.FAIL: Colours(ball="#d55e00"),
    Mood.PAUSED: _MUTED,
    Mood.FINISHED: _MUTED,
    Mood.LOST: Colours(headline="#f0e442"),
}
"""The colours of each mood."""

PILOT_BACK, PILOT_INK = "#f0e442", "#000000"
"""The band that marks a pilot run, and its letters: like nothing else on the screen."""


@dataclass(frozen=True, slots=True)
class Grip:
    """What is drawn of a player's own hand.

    Attributes
    ----------
    mark : tuple of points
        Ends of the bar at the height of the pointer; empty for none [m].
    spring : tuple of points
        Corners of the spring from pointer to stylus; empty for none [m].
    arrow : tuple of points
        Corners of the arrow of the force; empty for none [m].
    label_at : point
        Middle of that label [m].
    """

    hint: tuple[str, str]
    mark: tuple[Point, ...] = ()
    spring: tuple[Point, ...] = ()
    arrow: tuple[Point, ...] = ()
    label: str = ""
    label_at: Point = (0.0, 0.0)


@dataclass(frozen=True, slots=True)
class Picture:
    """What is drawn.

    Attributes
    ----------
    extent : tuple of float
        Width and height of what is to be seen, centred on the origin [m].
    headline, detail, counter, notice : str
        Main line; completion times; number of the trial; what is to be done, or what the set-up wants said.
    pilot : str
        The mark of a pilot run; empty for a real one.
    board : tuple of points
        Corners of the board; empty for none [m].
    target : tuple of points
        Corners of the target strip; empty for none [m].
    handles : tuple of points
        Control points of the board [m].
    ball : point or None
        Centre of the ball [m].
    ball_radius : float
        Radius of the ball [m].
    cursors : tuple of points
        The styluses this participant may see [m].
    guide : float or None
        Half length of the line that shows where level is, at the height of the origin [m].
    fill : tuple of points
        Corners of the part of the target that says how long the ball has been there; empty for none [m].
    bar, level : tuple of points
        Corners of the bar for the time for which the board must be level, and of its part that is over [m].
    arrows : tuple of tuples of points
        Corners of the arrows at the ends that are not level [m].
    patch : bool or None
        Whether the patch for a photodiode is white; None for no patch.
    grip : Grip or None
        The player's own hand; None where nobody plays (`netboard.windows.participant.grip` makes it).
    """

    mood: Mood
    colours: Colours
    extent: tuple[float, float]
    headline: str = ""
    detail: str = ""
    counter: str = ""
    notice: str = ""
    text: str = ""
    pilot: str = ""
    board: tuple[Point, ...] = ()
    target: tuple[Point, ...] = ()
    handles: tuple[Point, ...] = ()
    ball: Point | None = None
    ball_radius: float = 0.0
    cursors: tuple[Point, ...] = ()
    guide: float | None = None
    fill: tuple[Point, ...] = ()
    bar: tuple[Point, ...] = ()
    level: tuple[Point, ...] = ()
    arrows: tuple[tuple[Point, ...], ...] = ()
    patch: bool | None = None
    grip: Grip | None = None


def with_board(picture: Picture, view: View, config: Config) -> Picture:
    """Draw the board and all that is on it into a picture."""
    geometry, reach = config.geometry, config.physics.l
    pose = _Pose(view.z, math.cos(view.theta), math.sin(view.theta))
    heights = ((-reach, view.left), (reach, view.right))
    held = view.share * geometry.target_width if view.phase == "holding" else 0.0
    levelling = picture.mood is Mood.LEVEL
    thickness = geometry.board_thickness
    return replace(
        picture,
        board=_strip(pose, 0.0, geometry.board_length, thickness),
        target=() if view.p is None else _strip(pose, view.target, geometry.target_width, thickness),
        fill=_strip(pose, view.target, held, thickness) if held > 0 and view.p is not None else (),
        handles=(pose.place(-reach, 0.0), pose.place(reach, 0.0)),
        ball=None if view.p is None else pose.place(view.p, _ball_height(geometry)),
        ball_radius=geometry.ball_radius,
        cursors=tuple((to_grain(x), to_grain(height)) for x, height in heights if height is not None),
        guide=geometry.board_length * MARGIN / 2 if levelling else None,
        bar=_bar(1.0) if levelling else (),
        level=_bar(view.share) if levelling and view.share > 0 else (),
        arrows=_arrows(view, pose, config) if levelling else (),
    )


def extent(config: Config) -> tuple[float, float]:
    """How much is to be seen, so that a board held at the limits of the styluses is still inside."""
    geometry = config.geometry
    half = geometry.board_length / 2
    lift = max(config.task.stylus_range, min(config.task.stylus_range / config.physics.l, 1.0) * half)
    above = lift + _ball_height(geometry) + geometry.ball_radius
    return geometry.board_length * MARGIN, 2 * above / (1 - TEXT_SHARE)


def to_grain(value: float) -> float:
    """Round a coordinate, symmetrically about zero."""
    return round(value / GRAIN) * GRAIN


@dataclass(frozen=True, slots=True)
class _Pose:
    """Height of the board's centre [m], cosine and sine of its tilt [1]."""

    z: float
    cos: float
    sin: float

    def place(self, along: float, above: float) -> Point:
        """Where a point is that lies so far along the board and so far above its middle line [m]."""
        return (
            to_grain(along * self.cos - above * self.sin),
            to_grain(self.z + along * self.sin + above * self.cos),
        )


def _strip(pose: _Pose, centre: float, width: float, thickness: float) -> tuple[Point, ...]:
    """Corners of a piece of the board [m]."""
    a, b, half = centre - width / 2, centre + width / 2, thickness / 2
    return tuple(pose.place(along, above) for along, above in ((a, -half), (b, -half), (b, half), (a, half)))


def _bar(share: float) -> tuple[Point, ...]:
    """Corners of the bar, or of the share of it that has filled from its middle [m]."""
    half = to_grain(share * BAR_HALF)
    return ((-half, BAR_BOTTOM), (half, BAR_BOTTOM), (half, BAR_TOP), (-half, BAR_TOP))


def _arrows(view: View, pose: _Pose, config: Config) -> tuple[tuple[Point, ...], ...]:
    """Corners of the arrows at those ends of the board that must go up or down to make it level [m]."""
    task, half = config.task, config.geometry.board_length / 2
    lift = view.z if abs(view.z) > task.level_height else 0.0
    tilt = half * pose.sin if abs(view.theta) > math.radians(task.level_angle_deg) else 0.0
    least = half * math.sin(math.radians(task.level_angle_deg)) / 2
    off = ((-1.0, lift - tilt), (1.0, lift + tilt))
    return tuple(
        _arrow(pose, side * (half - ARROW_AT), off < 0, config.geometry) for side, off in off if abs(off) > least
    )


def _arrow(pose: _Pose, along: float, up: bool, geometry: Geometry) -> tuple[Point, ...]:
    """Corners of an arrow off the board's upper or lower side, pointing away from it [m]."""
    way = 1.0 if up else -1.0
    x, y = pose.place(along, way * geometry.board_thickness / 2)
    base, neck, tip = ARROW_CLEAR, ARROW_CLEAR + ARROW_LENGTH / 2, ARROW_CLEAR + ARROW_LENGTH
    head, shaft = ARROW_WIDTH / 2, ARROW_WIDTH / 6
    right = ((shaft, base), (shaft, neck), (head, neck))
    left = tuple((-aside, high) for aside, high in reversed(right))
    return tuple((x + aside, y + way * high) for aside, high in (*right, (0.0, tip), *left))


def _ball_height(geometry: Geometry) -> float:
    """Centre of the ball above the board's middle line [m]."""
    return geometry.board_thickness / 2 + geometry.ball_radius
