"""Figures and their common style: colours and marks of conditions, means and confidence intervals.

Figures need no screen and no global state: `new_figure` and `new_mosaic` return independent figures. Colours are
distinguishable with any colour vision, and figures are readable without colour; fonts are editable. A configuration has
a colour. A haptic condition has a marker: hollow for haptics off, filled for haptics on, and other shapes for parts of
the force. Dyads are small pale points behind their mean.
"""

from collections.abc import Callable, Collection, Iterator, Mapping, Sequence
from contextvars import ContextVar
from dataclasses import dataclass
from functools import cache, wraps
from io import BytesIO
from itertools import product
from string import ascii_uppercase
from textwrap import fill
from typing import TYPE_CHECKING, Any, TypeAlias
from weakref import WeakKeyDictionary

import numpy as np
from numpy.typing import ArrayLike

from netboard.analysis.extraction.study import StudyData
from netboard.analysis.statistics.estimates import Estimate
from netboard.analysis.topics.groups import Condition, bounded, simulated, teams
from netboard.base.looks import BLACK, BLUE, FAINT, FIGURE_STYLE, GREEN, GREY, ORANGE, PALE, PINK, SKY, VERMILION
from netboard.base.plural import noun, plural
from netboard.base.tables.forces import FORCES

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure
    from matplotlib.lines import Line2D
    from matplotlib.patheffects import AbstractPathEffect

WIDTH = 7.0
"""Width of a full-page figure [in]."""

DPI = 200
"""Resolution of PNG files."""

KINDS = ("svg", "pdf", "png")
"""File formats of each figure of an analysis."""

COLOURS = {"bimanual": BLUE, "dyadic": VERMILION}
"""Colour of each configuration, in all figures."""

CLASS_COLOURS = {"cooperative": GREEN, "competitive": VERMILION, "single": ORANGE, "still": PALE}
"""Colour of each movement class, in all figures."""

STACK = ("cooperative", "single", "competitive", "still")
"""Order of the classes in stacks; dark and light ones alternate, so that neighbours also differ in grey."""

NO_EFFECT: Any = {"color": GREY, "linewidth": 0.8, "zorder": 1}
"""Style of the line at the value of no effect."""

BAND = FAINT
"""Colour of every second row of a panel with many rows."""


@dataclass(frozen=True, slots=True)
class TopicFigure:
    """A figure with title and caption; without a figure, the caption gives the reason, an error if it `failed`.

    The caption has the content in a sentence or two, with n, the unit of replication, and the meaning of bars and
    bands.
    """

    name: str
    title: str
    caption: str
    figure: "Figure | None"
    failed: bool = False

    @property
    def absent(self) -> bool:
        """Whether there is no figure."""
        return self.figure is None

    @property
    def shown(self) -> "Figure":
        """The figure, or title and caption in its place."""
        return self.figure or _in_words(self.title, self.caption)

    def file(self, kind: str) -> bytes:
        """Return the figure, or title and caption in its place, as a file."""
        return as_bytes(self.shown, kind)

    def written(self) -> "WrittenFigure":
        """Return the figure as files of all kinds."""
        shown = self.shown
        files = {kind: as_bytes(shown, kind) for kind in KINDS}
        return WrittenFigure(self.name, self.title, self.caption, files, self.absent, self.failed)


@dataclass(frozen=True, slots=True)
class WrittenFigure:
    """A `TopicFigure` as files of all kinds, as another process has drawn it."""

    name: str
    title: str
    caption: str
    files: Mapping[str, bytes]
    absent: bool
    failed: bool

    def file(self, kind: str) -> bytes:
        """Return the figure, or title and caption in its place, as a file."""
        return self.files[kind]


def _in_words(title: str, caption: str) -> "Figure":
    """Return a figure that shows text only."""
    import matplotlib as mpl
    from matplotlib.figure import Figure

    with mpl.rc_context(FIGURE_STYLE):
        figure = Figure(figsize=(WIDTH, 1.2))
        figure.text(0.02, 0.95, title, va="top", weight="bold")
        figure.text(0.02, 0.72, fill(caption, 110), va="top")
    return figure


def new_figure(height: float, columns: int = 1, rows: int = 1) -> "tuple[Figure, list[Axes]]":
    """Return a new figure with its axes."""
    import matplotlib as mpl
    from matplotlib.figure import Figure

    with mpl.rc_context(FIGURE_STYLE):
        figure = Figure(figsize=(WIDTH, height))
        axes = figure.subplots(rows, columns, squeeze=False)
    return figure, list(axes.ravel())


_written: "WeakKeyDictionary[Figure, dict[str, bytes]]" = WeakKeyDictionary()
"""Files of each figure still in use: an analysis needs them for its folder and its report."""


def as_bytes(figure: "Figure", kind: str) -> bytes:
    """Return a figure as a file; it is written only once."""
    import matplotlib as mpl

    files = _written.setdefault(figure, {})
    if not files:  # the layout is computed once, for all kinds
        with mpl.rc_context(FIGURE_STYLE):
            figure.draw_without_rendering()
            figure.set_layout_engine("none")
    if kind not in files:
        files[kind] = _file(figure, kind)
    return files[kind]


def _file(figure: "Figure", kind: str) -> bytes:
    import matplotlib as mpl

    undated = {"svg": {"Date": None}, "pdf": {"CreationDate": None}, "png": {"Software": None}}
    with mpl.rc_context(FIGURE_STYLE), BytesIO() as file:
        figure.savefig(file, format=kind, dpi=DPI, metadata=undated[kind])
        return file.getvalue()


PARTNERS = {"robot partner": SKY, "still partner": PINK}
"""Colours of dyadic conditions with the partners of the built-in study `controls`; others have those of `MORE`."""

MORE = (VERMILION, BLUE, SKY, GREEN, ORANGE, PINK)
"""Colours of teams that differ in the levels of other factors, in order."""

_TEAMS: ContextVar[Mapping[str, str]] = ContextVar("teams", default={})  # noqa: B039  # nobody writes to it
"""Colours of such teams in the current figure."""

_MARKS = (
    ("o", "white", "--"),
    ("o", "", "-"),
    ("^", "", "-."),
    ("s", "", ":"),
    ("D", "white", (0, (5, 1, 1, 1, 1, 1))),
    ("v", "", (0, (1, 1))),
    ("P", "", (0, (5, 2))),
    ("h", "white", (0, (3, 1, 1, 1))),
)
_SHAPES = dict(zip(FORCES, _MARKS, strict=False))
"""Marker, face and line of each force condition."""

_OTHER = ("X", "", ":")

_TITLE, _LABELS = 92, 104
"""Characters of a title, and of the labels of an axis, over the full width of a figure [1]."""


@cache
def _halo() -> "list[AbstractPathEffect]":
    """Return the outline that keeps means readable on areas and among points."""
    from matplotlib.patheffects import withStroke

    return [withStroke(linewidth=2.6, foreground="white")]


@dataclass(frozen=True, slots=True)
class Look:
    """Colour, marker, marker face and line style of a condition or team."""

    colour: str
    marker: str
    face: str
    line: Any


def team_colour(team: str) -> str:
    """Return the colour of a team."""
    if team in _TEAMS.get():
        return _TEAMS.get()[team]
    configuration, _, partner = team.partition(", ")
    return PARTNERS.get(partner, COLOURS.get(configuration, BLACK))


def look_of(condition: Condition, colour: str = "") -> Look:
    """Return the style of a condition."""
    own = colour or team_colour(condition.team)
    marker, face, line = _SHAPES.get(condition.force, _OTHER)
    return Look(own, marker, face or own, line)


def team_look(team: str) -> Look:
    """Return the style of a team, over all its haptic conditions."""
    markers = {"bimanual": "o", "dyadic": "s"}
    lines = {"bimanual": "-", "dyadic": "--"}
    colour, configuration = team_colour(team), team.partition(", ")[0]
    named = configuration if team in _TEAMS.get() else team
    return Look(colour, markers.get(named, "^"), colour, lines.get(named, ":"))


def _colours(study: StudyData) -> dict[str, str]:
    """Return colours for teams that differ by more than configuration and partner."""
    every = teams(study)
    others = [one for one in every if one not in COLOURS and one.partition(", ")[2] not in PARTNERS]
    taken = {team_colour(one) for one in every if one not in others}
    free = [colour for colour in MORE if colour not in taken]
    return {one: free[k % len(free)] for k, one in enumerate(others)}


Drawn: TypeAlias = "tuple[Figure, str] | str"
"""What a topic draws: a figure and its caption, or the reason why there is none."""


def pictured(
    title: str, *, whole: bool = False
) -> Callable[[Callable[[StudyData], Drawn]], Callable[[StudyData], TopicFigure]]:
    """Decorate the drawing function of a topic, whose module names the figure: common style, and notes in the caption.

    Conditions are pooled to fit a figure, except in one of the `whole` study; a note names the pooled factors. Another
    note is on simulated participants.
    """

    def decorate(draw: Callable[[StudyData], Drawn]) -> Callable[[StudyData], TopicFigure]:
        @wraps(draw)
        def picture(study: StudyData) -> TopicFigure:
            import matplotlib as mpl

            shown, pooling = (study, "") if whole else bounded(study)
            chosen = _TEAMS.set(_colours(shown))
            try:
                with mpl.rc_context(FIGURE_STYLE):
                    drawn = draw(shown)
            finally:
                _TEAMS.reset(chosen)
            figure, caption = (None, drawn) if isinstance(drawn, str) else drawn
            for note in () if figure is None else (simulated(shown), pooling):
                caption = f"{caption} {note}".rstrip()
            return TopicFigure(draw.__module__.rpartition(".")[2], title, caption, figure)

        return picture

    return decorate


def new_mosaic(height: float, layout: Sequence[Sequence[str]], **options: Any) -> "tuple[Figure, dict[str, Axes]]":
    """Return a new figure with axes of different sizes."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(WIDTH, height))
    return figure, figure.subplot_mosaic([list(row) for row in layout], **options)


def panel_letters() -> Iterator[str]:
    """Yield the letters of the panels of a figure: A to Z, then AA, AB and so on."""
    yield from ascii_uppercase
    yield from map("".join, product(ascii_uppercase, repeat=2))


def titled(axes: "Axes", letter: str, text: str) -> None:
    """Set the title of a panel: a bold letter and its content."""
    place = axes.get_subplotspec()
    columns = place.get_gridspec().ncols // (place.colspan.stop - place.colspan.start) if place is not None else 1
    lines = fill(text, max(14, _TITLE // max(columns, 1)), break_long_words=False)
    axes.set_title(f"$\\bf{{{letter}}}$  {lines}", loc="left")


def draw_mean(
    axes: "Axes", at: float, mean: Estimate, look: Look, label: str, *, scale: float = 1.0, across: bool = False
) -> None:
    """Draw a mean and its interval (its label ends with ``, interval``), times `scale`; nothing without a mean."""
    if not np.isfinite(mean.value):
        return
    ends, value = np.array([mean.low, mean.high]) * scale, mean.value * scale
    if np.isfinite(ends).all():
        place = (ends, [at, at]) if across else ([at, at], ends)
        axes.plot(
            *place,
            color=look.colour,
            linewidth=1.3,
            solid_capstyle="butt",
            zorder=4,
            path_effects=_halo(),
            label=f"_{label}, interval",
        )
    point = ([value], [at]) if across else ([at], [value])
    axes.plot(
        *point,
        linestyle="none",
        marker=look.marker,
        markersize=5,
        markerfacecolor=look.face,
        markeredgecolor=look.colour,
        markeredgewidth=1.1,
        zorder=5,
        path_effects=_halo(),
        label=f"_{label}",
    )


def draw_dyads(axes: "Axes", x: ArrayLike, y: ArrayLike, colour: str, label: str, *, joined: bool = False) -> None:
    """Draw the values of single dyads behind their mean."""
    axes.plot(
        np.asarray(x, float),
        np.asarray(y, float),
        linestyle="-" if joined else "none",
        linewidth=0.6,
        marker="o",
        markersize=3.2,
        color=colour,
        alpha=0.45,
        markeredgewidth=0.0,
        zorder=3,
        label=f"_{label}",
    )


def draw_joined(
    axes: "Axes", found: Sequence[tuple[Condition, Mapping[str, float]]], at: Mapping[str, float], scale: float = 1.0
) -> None:
    """Draw the values of dyads in conditions, by dyad, times `scale`; a dyad is joined within a team."""
    for team in dict.fromkeys(condition.team for condition, _ in found):
        own = [(condition, values) for condition, values in found if condition.team == team]
        for dyad in sorted({dyad for _, values in own for dyad in values}):
            here = [(at[condition.name], scale * values[dyad]) for condition, values in own if dyad in values]
            x, y = zip(*here, strict=True)
            draw_dyads(axes, x, y, look_of(own[0][0]).colour, f"{dyad} {team}", joined=True)


def handles(looks: Sequence[Look]) -> "list[Line2D]":
    """Return the marks of a legend."""
    from matplotlib.lines import Line2D

    return [
        Line2D([], [], linestyle="none", marker=look.marker, color=look.colour, markerfacecolor=look.face, markersize=5)
        for look in looks
    ]


def beside(count: int, width: float) -> list[float]:
    """Return offsets for several items around one position."""
    return [0.0] if count == 1 else [float(x) for x in np.linspace(-width / 2, width / 2, count)]


def apart(places: Sequence[float], least: float) -> list[float]:
    """Shift label positions upwards to a minimum distance, in order and as little as possible."""
    moved: list[float] = []
    for place in places:
        moved.append(max(place, moved[-1] + least) if moved else place)
    return moved


def in_lines(condition: Condition) -> str:
    """Return the label of a condition for a narrow axis."""
    return condition.label.replace(", ", "\n")


def fit_beside(labels: Sequence[str], share: float = 1.0) -> bool:
    """Return whether labels of several lines fit beside each other on an axis with a share of the figure's width."""
    longest = max((len(line) for label in labels for line in label.splitlines()), default=0)
    return longest * len(labels) <= share * _LABELS


def span(counts: Collection[int]) -> str:
    """Return the smallest and the largest of some counts, or the one that they all are."""
    return " to ".join(f"{count}" for count in sorted({min(counts), max(counts)}))


def due_count(known: Sequence[tuple[str, int, str]], details: Sequence[int] = (), of: str = "") -> str:
    """Return a sentence with the sample sizes of names and their units of replication, once if they are equal."""
    if not known:
        return ""
    each = [f"n = {plural(count, unit)}" for _, count, unit in known]
    if len(set(each)) == 1:
        sizes = each[0] + (" in every condition" if len(each) > 1 else "")
    else:
        sizes = "; ".join(f"{name}: {n}" for (name, _, _), n in zip(known, each, strict=True))
    if details:
        sizes += f" ({span(details)} {noun(max(details), of)}{' each' if len(each) > 1 else ''})"
    return sentence(sizes) if len(set(each)) > 1 else f"{sizes}."


def sentence(words: str) -> str:
    """Return a note as a sentence."""
    return f"{words[0].upper()}{words[1:]}."


def trial_ticks(size: int, last: int) -> list[int]:
    """Return the ticks of a trial axis: the first, the last of each whole group, and otherwise the last."""
    return sorted({1, *(range(size, last + 1, size) or (last,))})


def listed(words: Sequence[str]) -> str:
    """Join words with commas, and ``and`` before the last."""
    return words[0] if len(words) == 1 else f"{', '.join(words[:-1])} and {words[-1]}"
