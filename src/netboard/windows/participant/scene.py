"""The `DisplayPicture` of a display: geometry of board, ball and styluses, texts and colours. Pure: no Qt, no clock.

Points are in metres: x right, y up, origin at the centre of the level board. Equal pictures look the same, so a display
redraws only when the picture changes. For that, points are rounded to `GRAIN`, well below a pixel.
`netboard.windows.participant.screens` decides what is drawn when, and writes the texts.

A picture can show only what the view contains: without the partner's hand or the ball in it, they cannot be drawn.
Colours are from the colour-blind-safe Okabe-Ito palette, and differ in brightness too.
"""

import math
from dataclasses import dataclass, replace
from enum import Enum

from netboard.base.config import Config
from netboard.base.looks import BLUE, DARK, ORANGE, SKY, VERMILION, WHITE, YELLOW
from netboard.base.tables.scene import Geometry
from netboard.stage.view import View

GRAIN = 2e-5
"""Grid to which points are rounded [m]: about 1/30 of a pixel in a window, 1/10 on a 4K screen."""

CURSOR_RADIUS = 0.011
"""Radius of a stylus cursor as drawn [m]."""

HANDLE_RADIUS = 0.005
"""Radius of a control point on the board as drawn [m]."""

STRIPE = 0.86, 0.09
"""Length and width of the stripe of a rolling ball, in its diameters [1]."""

MARGIN = 1.15
"""Width of the scene, in lengths of the board [1]."""

BAR_HALF, BAR_TOP, BAR_BOTTOM = 0.10, -0.062, -0.070
"""The bar that fills while the board is level: half its length, its top and bottom below the level board [m]."""

ARROW_AT, ARROW_CLEAR, ARROW_LENGTH, ARROW_WIDTH = 0.060, 0.014, 0.042, 0.040
"""Arrow at an end that is too low or high: distance to the board's end and surface, length, width [m]."""

TEXT_SHARE = 0.24
"""Share of the height reserved for text, above and below the board's range [1]."""

Point = tuple[float, float]


class PictureState(Enum):
    """Overall state of a picture; it selects the colours."""

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
    """Colours by role, as ``#rrggbb``."""

    # background to cursor, guide: parts of the scene; the edge outlines the board
    background: str = DARK.background
    board: str = "#78828f"
    edge: str = DARK.detail
    target: str = BLUE
    ball: str = ORANGE
    cursor: str = WHITE
    # hint, fill: arrows that show where an end must go; progress while the board is level or the ball is in the target
    hint: str = YELLOW
    fill: str = DARK.good
    guide: str = DARK.line
    # headline, detail, quiet: text: the main line, the line below, and small text
    headline: str = DARK.text
    detail: str = DARK.detail
    quiet: str = DARK.quiet


_ACTIVE = Colours()
_MUTED = Colours(
    board="#454d57", edge="#5d6671", target="#15354a", ball="#7d6224", cursor="#8b95a1", headline="#c3cad2"
)

COLOURS: dict[PictureState, Colours] = {
    PictureState.WAIT: _MUTED,
    PictureState.LEVEL: _ACTIVE,
    PictureState.RUN: _ACTIVE,
    PictureState.HOLD: Colours(target=SKY, fill=WHITE),
    PictureState.SUCCESS: Colours(target=DARK.good, headline=DARK.good),
    PictureState.FAIL: Colours(ball=VERMILION),
    PictureState.PAUSED: _MUTED,
    PictureState.FINISHED: _MUTED,
    PictureState.LOST: Colours(headline=YELLOW),
}
"""The colours of each picture state."""

PILOT_BACK, PILOT_INK = DARK.pilot, DARK.on_pilot
"""Background and text of the band that marks a pilot run; nothing else on the screen looks like it."""


@dataclass(frozen=True, slots=True)
class Grip:
    """What is drawn of a player's own hand when it is played with a pointer."""

    hint: tuple[str, str]
    asks: bool = False  # whether the hint asks the player for something, before which nothing begins
    mark: tuple[Point, ...] = ()  # ends of the bar at the height of the pointer; empty for none [m]
    spring: tuple[Point, ...] = ()  # corners of the spring from pointer to stylus; empty for none [m]
    arrow: tuple[Point, ...] = ()  # corners of the force arrow; empty for none [m]
    label: str = ""
    label_at: Point = (0.0, 0.0)  # centre of the arrow's label [m]


@dataclass(frozen=True, slots=True)
class DisplayPicture:
    """Everything that a display draws."""

    state: PictureState
    colours: Colours
    extent: tuple[float, float]  # width and height of the visible scene, centred on the origin [m]
    # headline, detail, counter, notice: main line; completion times; trial number; what to do, or a notice
    headline: str = ""
    detail: str = ""
    counter: str = ""
    notice: str = ""
    text: str = ""
    pilot: str = ""  # label of a pilot run; empty for a real one
    board: tuple[Point, ...] = ()  # corners of the board; empty for none [m]
    target: tuple[Point, ...] = ()  # corners of the target strip; empty for none [m]
    handles: tuple[Point, ...] = ()  # control points of the board [m]
    ball: Point | None = None  # centre of the ball [m]
    ball_radius: float = 0.0  # radius of the ball [m]
    stripe: tuple[Point, ...] = ()  # corners of the stripe that shows how the ball rolls; empty for none [m]
    cursors: tuple[Point, ...] = ()  # the styluses that this participant may see [m]
    guide: float | None = None  # half length of the line that shows the level position, at the height of the origin [m]
    # corners of the filled part of the target: the elapsed share of the hold time; empty for none [m]
    fill: tuple[Point, ...] = ()
    # bar, level: corners of the progress bar for the time that the board must stay level, and of its filled part [m]
    bar: tuple[Point, ...] = ()
    level: tuple[Point, ...] = ()
    arrows: tuple[tuple[Point, ...], ...] = ()  # corners of the arrows at ends that are not level [m]
    patch: bool | None = None  # whether the patch for a photodiode is white; None for no patch
    # the player's own hand, from `netboard.windows.participant.grip`; None unless this display is played
    grip: Grip | None = None


def with_board(picture: DisplayPicture, view: View, config: Config) -> DisplayPicture:
    """Add board, ball, target and styluses to a picture."""
    geometry, reach = config.geometry, config.physics.l
    pose = _Pose(view.z, math.cos(view.theta), math.sin(view.theta))
    heights = ((-reach, view.left), (reach, view.right))
    held = view.share * geometry.target_width if view.phase == "holding" else 0.0
    levelling = picture.state is PictureState.LEVEL
    thickness = geometry.board_thickness
    return replace(
        picture,
        board=_strip(pose, 0.0, geometry.board_length, thickness),
        target=() if view.p is None else _strip(pose, view.target, geometry.target_width, thickness),
        fill=_strip(pose, view.target, held, thickness) if held > 0 and view.p is not None else (),
        handles=(pose.place(-reach, 0.0), pose.place(reach, 0.0)),
        ball=None if view.p is None else pose.place(view.p, _ball_height(geometry)),
        ball_radius=geometry.ball_radius,
        stripe=() if view.p is None or config.display.ball == "plain" else _stripe(pose, view, geometry),
        cursors=tuple((to_grain(x), to_grain(height)) for x, height in heights if height is not None),
        guide=geometry.board_length * MARGIN / 2 if levelling else None,
        bar=_bar(1.0) if levelling else (),
        level=_bar(view.share) if levelling and view.share > 0 else (),
        arrows=_arrows(view, pose, config) if levelling else (),
    )


def extent(config: Config) -> tuple[float, float]:
    """Width and height of the visible scene [m]; a board at the limits of the styluses fits in."""
    geometry = config.geometry
    half = geometry.board_length / 2
    lift = max(config.task.stylus_range, min(config.task.stylus_range / config.physics.l, 1.0) * half)
    above = lift + _ball_height(geometry) + geometry.ball_radius
    return geometry.board_length * MARGIN, 2 * above / (1 - TEXT_SHARE)


def to_grain(value: float) -> float:
    """Round a coordinate to `GRAIN`, symmetrically about zero [m]."""
    return round(value / GRAIN) * GRAIN


@dataclass(frozen=True, slots=True)
class _Pose:
    """Height of the board's centre [m], cosine and sine of its tilt [1]."""

    z: float
    cos: float
    sin: float

    def place(self, along: float, above: float) -> Point:
        """Transform a point from board coordinates, along and above its middle line, to the scene [m]."""
        return (to_grain(along * self.cos - above * self.sin), to_grain(self.z + along * self.sin + above * self.cos))


def _strip(pose: _Pose, centre: float, width: float, thickness: float) -> tuple[Point, ...]:
    """Corners of a section of the board [m]."""
    a, b, half = centre - width / 2, centre + width / 2, thickness / 2
    return tuple(pose.place(along, above) for along, above in ((a, -half), (b, -half), (b, half), (a, half)))


def _stripe(pose: _Pose, view: View, geometry: Geometry) -> tuple[Point, ...]:
    """Corners of a stripe that is upright while the ball is at the board's centre; the ball rolls without slip [m]."""
    assert view.p is not None
    turned, middle = view.p / geometry.ball_radius, _ball_height(geometry)
    across, up = math.cos(turned), math.sin(turned)
    half, wide = STRIPE[0] * geometry.ball_radius, STRIPE[1] * geometry.ball_radius
    corners = ((wide, half), (wide, -half), (-wide, -half), (-wide, half))
    return tuple(pose.place(view.p + x * across + y * up, middle - x * up + y * across) for x, y in corners)


def _bar(share: float) -> tuple[Point, ...]:
    """Corners of the bar, or of its share that has filled from the middle [m]."""
    half = to_grain(share * BAR_HALF)
    return ((-half, BAR_BOTTOM), (half, BAR_BOTTOM), (half, BAR_TOP), (-half, BAR_TOP))


def _arrows(view: View, pose: _Pose, config: Config) -> tuple[tuple[Point, ...], ...]:
    """Corners of the arrows at the ends that must go up or down to level the board [m]."""
    task, half = config.task, config.geometry.board_length / 2
    lift = view.z if abs(view.z) > task.level_height else 0.0
    tilt = half * pose.sin if abs(view.theta) > math.radians(task.level_angle_deg) else 0.0
    least = half * math.sin(math.radians(task.level_angle_deg)) / 2
    off = ((-1.0, lift - tilt), (1.0, lift + tilt))
    return tuple(
        _arrow(pose, side * (half - ARROW_AT), off < 0, config.geometry) for side, off in off if abs(off) > least
    )


def _arrow(pose: _Pose, along: float, up: bool, geometry: Geometry) -> tuple[Point, ...]:
    """Corners of an arrow that points away from the board's upper or lower side [m]."""
    way = 1.0 if up else -1.0
    x, y = pose.place(along, way * geometry.board_thickness / 2)
    base, neck, tip = ARROW_CLEAR, ARROW_CLEAR + ARROW_LENGTH / 2, ARROW_CLEAR + ARROW_LENGTH
    head, shaft = ARROW_WIDTH / 2, ARROW_WIDTH / 6
    right = ((shaft, base), (shaft, neck), (head, neck))
    left = tuple((-aside, high) for aside, high in reversed(right))
    return tuple((x + aside, y + way * high) for aside, high in (*right, (0.0, tip), *left))


def _ball_height(geometry: Geometry) -> float:
    """Height of the ball's centre above the board's middle line [m]."""
    return geometry.board_thickness / 2 + geometry.ball_radius
