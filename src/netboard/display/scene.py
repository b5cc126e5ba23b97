"""From a view to what is drawn. Pure: no Qt, no clock.

`compose` turns the newest `View` into a `Picture`: points in metres (x right, y up, origin at the board's neutral
centre), words and colours. Two equal pictures look the same on the screen, so a display redraws only when the picture
is another one; for that, points are rounded to `GRAIN`, well below a pixel.

Rules that hold here: a participant is told little and calmly; numbers appear between trials only; what a view does not
contain (the partner's hand) cannot be drawn. Colours are from the Okabe-Ito palette, which colour-blind people can
tell apart, and differ in brightness too.
"""

import math
from dataclasses import dataclass
from enum import Enum

from netboard.config import Config, Geometry
from netboard.errors import WireError
from netboard.wire.messages import View

GRAIN = 2e-5
"""Points are rounded to this [m]; some 1/30 of a pixel in a window, 1/10 on a 4K screen."""

CURSOR_RADIUS = 0.011
"""Radius of a stylus cursor as drawn [m]."""

HANDLE_RADIUS = 0.005
"""Radius of the mark of a control point on the board as drawn [m]."""

MARGIN = 1.15
"""Room for the board, in lengths of the board [1]."""

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
    headline, detail, quiet : str
        Words: the main line, the line below, and the small ones.
    """

    background: str = "#11151a"
    board: str = "#78828f"
    edge: str = "#aeb7c2"
    target: str = "#0072b2"
    ball: str = "#e69f00"
    cursor: str = "#ffffff"
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
    Mood.HOLD: Colours(target="#56b4e9"),
    Mood.SUCCESS: Colours(target="#2fc79b", headline="#2fc79b"),
    Mood.FAIL: Colours(ball="#d55e00"),
    Mood.PAUSED: _MUTED,
    Mood.FINISHED: _MUTED,
    Mood.LOST: Colours(headline="#f0e442"),
}
"""The colours of each mood."""

_PHASES: dict[str, tuple[Mood, str]] = {
    "idle": (Mood.WAIT, "Please wait"),
    "levelling": (Mood.LEVEL, "Hold the board level"),
    "running": (Mood.RUN, ""),
    "holding": (Mood.HOLD, "Keep the ball there"),
    "succeeded": (Mood.SUCCESS, "Well done"),
    "failed": (Mood.FAIL, "The ball fell off"),
    "paused": (Mood.PAUSED, "Paused"),
    "finished": (Mood.FINISHED, "Finished. Thank you"),
}


@dataclass(frozen=True, slots=True)
class Picture:
    """What is drawn.

    Attributes
    ----------
    mood : Mood
        What it says as a whole.
    colours : Colours
        The colours of that mood.
    extent : tuple of float
        Width and height of what is to be seen, centred on the origin [m].
    headline, detail, counter, notice : str
        Main line; completion times; number of the trial; what the server or the set-up wants said.
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
    """

    mood: Mood
    colours: Colours
    extent: tuple[float, float]
    headline: str = ""
    detail: str = ""
    counter: str = ""
    notice: str = ""
    board: tuple[Point, ...] = ()
    target: tuple[Point, ...] = ()
    handles: tuple[Point, ...] = ()
    ball: Point | None = None
    ball_radius: float = 0.0
    cursors: tuple[Point, ...] = ()
    guide: float | None = None


def compose(view: View | None, config: Config) -> Picture:
    """Decide what is drawn.

    Parameters
    ----------
    view : View or None
        The newest view; None before the first one.
    config : Config
        Sizes, where the control points are, and whether this is a pilot run.

    Returns
    -------
    Picture
        What to draw.

    Raises
    ------
    WireError
        If the view is in a phase that does not exist, or not finite.
    """
    if view is None:
        return blank(config, "Waiting for the experiment")
    _check(view)
    mood, headline = _PHASES[view.phase]
    geometry, reach = config.geometry, config.physics.l
    pose = _Pose(view.z, math.cos(view.theta), math.sin(view.theta))
    heights = ((-reach, view.left), (reach, view.right))
    return Picture(
        mood=mood,
        colours=COLOURS[mood],
        extent=extent(config),
        headline=headline,
        detail="" if mood in (Mood.RUN, Mood.HOLD) else _times(view),
        counter=_counter(view, config),
        notice=view.notice,
        board=_strip(pose, 0.0, geometry.board_length, geometry.board_thickness),
        target=_strip(pose, view.target, geometry.target_width, geometry.board_thickness),
        handles=(pose.place(-reach, 0.0), pose.place(reach, 0.0)),
        ball=None if view.p is None else pose.place(view.p, _ball_height(geometry)),
        ball_radius=geometry.ball_radius,
        cursors=tuple((_round(x), _round(height)) for x, height in heights if height is not None),
        guide=geometry.board_length * MARGIN / 2 if mood is Mood.LEVEL else None,
    )


def blank(config: Config, headline: str, detail: str = "", *, lost: bool = False) -> Picture:
    """Make a picture of words only.

    Parameters
    ----------
    config : Config
        Sizes, and whether this is a pilot run.
    headline, detail : str
        The words.
    lost : bool
        Whether there was something to see before.

    Returns
    -------
    Picture
        What to draw.
    """
    mood = Mood.LOST if lost else Mood.WAIT
    return Picture(mood, COLOURS[mood], extent(config), headline, detail, counter=_pilot(config))


def extent(config: Config) -> tuple[float, float]:
    """How much is to be seen, so that a board held at the limits of the styluses is still inside.

    Parameters
    ----------
    config : Config
        The whole configuration.

    Returns
    -------
    tuple of float
        Width and height [m].
    """
    geometry = config.geometry
    half = geometry.board_length / 2
    lift = max(config.task.stylus_range, min(config.task.stylus_range / config.physics.l, 1.0) * half)
    above = lift + _ball_height(geometry) + geometry.ball_radius
    return geometry.board_length * MARGIN, 2 * above / (1 - TEXT_SHARE)


@dataclass(frozen=True, slots=True)
class _Pose:
    """Height of the board's centre [m], cosine and sine of its tilt [1]."""

    z: float
    cos: float
    sin: float

    def place(self, along: float, above: float) -> Point:
        """Where a point is that lies so far along the board and so far above its middle line [m]."""
        return (
            _round(along * self.cos - above * self.sin),
            _round(self.z + along * self.sin + above * self.cos),
        )


def _strip(pose: _Pose, centre: float, width: float, thickness: float) -> tuple[Point, ...]:
    """Corners of a piece of the board [m]."""
    a, b, half = centre - width / 2, centre + width / 2, thickness / 2
    return tuple(pose.place(along, above) for along, above in ((a, -half), (b, -half), (b, half), (a, half)))


def _ball_height(geometry: Geometry) -> float:
    """Centre of the ball above the board's middle line [m]."""
    return geometry.board_thickness / 2 + geometry.ball_radius


def _round(value: float) -> float:
    """To the grain, symmetrically about zero [m]."""
    return round(value / GRAIN) * GRAIN


def _check(view: View) -> None:
    """Refuse what cannot be drawn: a peer that sends it breaks the protocol."""
    if view.phase not in _PHASES:
        raise WireError(f"a view in the unknown phase {view.phase!r}")
    numbers = (view.z, view.theta, view.target, view.p, view.left, view.right)
    if not all(math.isfinite(number) for number in numbers if number is not None):
        raise WireError("a view with a number that is not finite")


def _times(view: View) -> str:
    """Completion times, as the participant reads them."""
    if view.completion is None:
        return ""
    best = "" if view.best is None else f"   (best {view.best:.2f} s)"
    return f"Last {view.completion:.2f} s{best}"


def _counter(view: View, config: Config) -> str:
    """Say the number of the trial, and whether this is a pilot run."""
    trial = f"Trial {min(view.trial, view.trials)} of {view.trials}"
    return "   ".join(words for words in (trial, _pilot(config)) if words)


def _pilot(config: Config) -> str:
    """Mark a pilot run, which must not be taken for a real one."""
    return "PILOT" if config.session.pilot else ""
