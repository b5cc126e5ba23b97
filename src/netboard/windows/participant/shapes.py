"""The parts of a `DisplayPicture`, in painting order. Pure: no Qt, no clock.

Shapes are in metres of the scene; panels and text are in pixels of the window. Parts are values that compare equal, so
the widget repaints only where two frames have different parts.
"""

from dataclasses import dataclass

from netboard.base.looks import BLACK, PINK, WHITE
from netboard.windows.participant.scene import (
    CURSOR_RADIUS,
    HANDLE_RADIUS,
    PILOT_BACK,
    PILOT_INK,
    Colours,
    DisplayPicture,
    Grip,
    Point,
)

LINES = {"headline": (0.075, 0.052), "detail": (0.140, 0.034), "notice": (0.900, 0.034), "counter": (0.955, 0.024)}
"""Middle and letter height of each line of text, in heights of the window [1]."""

ALONE = {"headline": 0.46, "detail": 0.54}
"""Middles of the lines when there is only text, in heights of the window [1]."""

ABOVE_TEXT = {"headline": 0.18, "detail": 0.26}
"""Middles of the lines above instructions, in heights of the window [1]."""

TEXT_TOP, TEXT_BOTTOM, TEXT_WIDTH, TEXT_HEIGHT = 0.32, 0.87, 0.68, 0.036
"""Top, bottom, width and largest letter height of the instructions, relative to the window [1]."""

TEXT_MARGIN = 4
"""Margin around the instructions [pixels]."""

BAND = 0.042
"""Height of the band that marks a pilot run, at the top, in heights of the window [1]."""

PATCH = 0.09
"""Side of the photodiode patch, in the lower right corner, in heights of the window [1]."""

FORCE = PINK
"""Colour of the player's spring and force arrow; from the Okabe-Ito palette, like the other colours."""

HINTS = (0.805, 0.845)
"""Vertical centres of the two lines of instructions for a player, in heights of the window [1]."""

HINT_HEIGHT, HINT_WIDTH = 0.026, 0.019
"""Largest letter height of these two lines, in heights and in widths of the window [1]."""

LABEL_HEIGHT = 0.034
"""Letter height of the force label, in heights of the window [1]."""

SMALLEST_LETTERS = 8
"""Smallest letter height [pixels]."""


@dataclass(frozen=True, slots=True)
class Shape:
    """A polygon, a line or a disc in metres of the scene."""

    points: tuple[Point, ...]  # corners, or the centre of a disc [m]
    radius: float = 0.0  # radius of a disc; 0 for a polygon or a line [m]
    fill: str = ""
    edge: str = ""
    width: float = 0.0  # width of the edge [pixels]
    # closed, dashed: whether it is a polygon rather than a line; whether the edge is dashed
    closed: bool = True
    dashed: bool = False


@dataclass(frozen=True, slots=True)
class Panel:
    """A filled rectangle: left, top, width and height [pixels], and its colour."""

    place: tuple[float, float, float, float]
    fill: str


@dataclass(frozen=True, slots=True)
class TextLine:
    """A line of text centred on a point."""

    words: str
    middle: Point  # centre of the line [pixels]
    letters: int  # size of the font [pixels]
    colour: str
    bold: bool = False


@dataclass(frozen=True, slots=True)
class Text:
    """Instructions: wrapped, centred paragraphs in a column: left, top, width and height [pixels]."""

    words: str
    place: tuple[float, float, float, float]
    letters: int  # largest size of the font; a long text gets smaller letters [pixels]
    colour: str


Part = Shape | Panel | TextLine | Text


def shapes_of(picture: DisplayPicture) -> list[Shape]:
    """List the shapes of a picture, from back to front."""
    c, half = picture.colours, picture.guide
    guide = () if half is None else ((-half, 0.0), (half, 0.0))
    shapes = [
        Shape(guide, edge=c.guide, width=2, closed=False, dashed=True),
        Shape(picture.board, fill=c.board, edge=c.edge, width=1.5),
        Shape(picture.target, fill=c.target, edge=c.target, width=1.5),
        Shape(picture.fill, fill=c.fill),
        *(Shape((at,), HANDLE_RADIUS, fill=c.background) for at in picture.handles),
        Shape(picture.bar, fill=c.background, edge=c.detail, width=1.5),
        Shape(picture.level, fill=c.fill),
        *(Shape(arrow, fill=c.hint) for arrow in picture.arrows),
        Shape(() if picture.ball is None else (picture.ball,), picture.ball_radius, fill=c.ball),
        Shape(picture.stripe, fill=c.background),
        *(Shape((at,), CURSOR_RADIUS, edge=c.cursor, width=3) for at in picture.cursors),
        *(_grip_shapes(picture.grip) if picture.grip is not None else ()),
    ]
    return [shape for shape in shapes if shape.points]


def words_of(picture: DisplayPicture, width: int, height: int, label_at: Point) -> list[Panel | TextLine | Text]:
    """List the text and panels of a picture, from back to front; sizes in pixels."""
    c = picture.colours
    inks = {"headline": c.headline, "detail": c.detail, "notice": c.detail, "counter": c.quiet}
    places = {} if picture.board else ABOVE_TEXT if picture.text else ALONE
    band, side = round(BAND * height), round(PATCH * height)
    found: list[Panel | TextLine | Text] = [
        TextLine(getattr(picture, name), (width / 2, places.get(name, middle) * height), _letters(size * height), ink)
        for (name, ink), (middle, size) in zip(inks.items(), LINES.values(), strict=True)
    ]
    column = ((1 - TEXT_WIDTH) / 2 * width, TEXT_TOP * height, TEXT_WIDTH * width, (TEXT_BOTTOM - TEXT_TOP) * height)
    found.append(Text(picture.text, column, _letters(TEXT_HEIGHT * min(height, width / 1.4)), c.headline))
    if picture.pilot:
        found.append(Panel((0, 0, width, band), PILOT_BACK))
        found.append(TextLine(picture.pilot, (width / 2, band / 2), _letters(0.7 * band), PILOT_INK, bold=True))
    if picture.patch is not None:
        found.append(Panel((width - side, height - side, side, side), WHITE if picture.patch else BLACK))
    if picture.grip is not None:
        hint = _letters(min(HINT_HEIGHT * height, HINT_WIDTH * width))
        found.append(TextLine(picture.grip.label, label_at, _letters(LABEL_HEIGHT * height), FORCE))
        lines = zip(picture.grip.hint, HINTS, strict=True)
        found += [TextLine(words, (width / 2, middle * height), hint, Colours().detail) for words, middle in lines]
    return [part for part in found if isinstance(part, Panel) or part.words]


def _grip_shapes(grip: Grip) -> tuple[Shape, ...]:
    """Shapes of the player's spring, the mark of the pointer and the force arrow."""
    return (
        Shape(grip.spring, edge=FORCE, width=2, closed=False),
        Shape(grip.mark, edge=Colours().headline, width=4, closed=False),
        Shape(grip.arrow, fill=FORCE),
    )


def _letters(size: float) -> int:
    return max(SMALLEST_LETTERS, round(size))
