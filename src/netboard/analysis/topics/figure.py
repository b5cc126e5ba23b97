"""Figures and their common style: colour-blind-safe colours and editable fonts.

Figures need no screen and no global state: `new_figure` returns an independent figure.
"""

from dataclasses import dataclass
from io import BytesIO
from textwrap import fill
from typing import TYPE_CHECKING, Any
from weakref import WeakKeyDictionary

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure


WIDTH = 7.0
"""Width of a full-page figure [in]."""

DPI = 200
"""Resolution of PNG files."""

BLUE, ORANGE, GREEN, PINK, SKY, VERMILION, YELLOW, BLACK = (
    "#0072B2",
    "#E69F00",
    "#009E73",
    "#CC79A7",
    "#56B4E9",
    "#D55E00",
    "#F0E442",
    "#000000",
)
"""Colours of Okabe and Ito, distinguishable with any colour vision."""

COLOURS = {"bimanual": BLUE, "dyadic": VERMILION}
"""Colour of each configuration, in all figures."""

CLASS_COLOURS = {"cooperative": GREEN, "competitive": VERMILION, "single": ORANGE, "still": "#D9D9D9"}
"""Colour of each movement class, in all figures."""

STYLE: Any = {
    "font.size": 8.0,
    "axes.titlesize": 8.5,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.linewidth": 0.6,
    "lines.linewidth": 1.2,
    "legend.frameon": False,
    "legend.fontsize": 7.5,
    "svg.fonttype": "none",
    "svg.hashsalt": "netboard",
    "pdf.fonttype": 42,
    "figure.constrained_layout.use": True,
}
"""Differences from matplotlib's defaults."""


@dataclass(frozen=True, slots=True)
class Picture:
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
    def shown(self) -> "Figure":
        """The figure, or title and caption in its place."""
        return self.figure or _in_words(self.title, self.caption)


def _in_words(title: str, caption: str) -> "Figure":
    """Return a figure that shows text only."""
    import matplotlib as mpl
    from matplotlib.figure import Figure

    with mpl.rc_context(STYLE):
        figure = Figure(figsize=(WIDTH, 1.2))
        figure.text(0.02, 0.95, title, va="top", weight="bold")
        figure.text(0.02, 0.72, fill(caption, 110), va="top")
    return figure


def new_figure(height: float, columns: int = 1, rows: int = 1, width: float = WIDTH) -> "tuple[Figure, list[Axes]]":
    """Return a new figure with its axes."""
    import matplotlib as mpl
    from matplotlib.figure import Figure

    with mpl.rc_context(STYLE):
        figure = Figure(figsize=(width, height))
        axes = figure.subplots(rows, columns, squeeze=False)
    return figure, list(axes.ravel())


_written: "WeakKeyDictionary[Figure, dict[str, bytes]]" = WeakKeyDictionary()
"""Files of each figure still in use: an analysis needs them for its folder and its report."""


def as_bytes(figure: "Figure", kind: str) -> bytes:
    """Return a figure as a file; it is written only once."""
    import matplotlib as mpl

    files = _written.setdefault(figure, {})
    if not files:  # the layout is computed once, for all kinds
        with mpl.rc_context(STYLE):
            figure.draw_without_rendering()
            figure.set_layout_engine("none")
    if kind not in files:
        files[kind] = _file(figure, kind)
    return files[kind]


def _file(figure: "Figure", kind: str) -> bytes:
    import matplotlib as mpl

    undated = {"svg": {"Date": None}, "pdf": {"CreationDate": None}, "png": {"Software": None}}
    with mpl.rc_context(STYLE), BytesIO() as file:
        figure.savefig(file, format=kind, dpi=DPI, metadata=undated[kind])
        return file.getvalue()
