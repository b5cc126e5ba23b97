"""The visual language of all windows, reports and figures: colours by role, sizes of text, spacing. Pure: no Qt.

Colours are those of Okabe and Ito, which can be told apart with any colour vision, or shades of them that are legible
as text. A `ColourTheme` gives each role a colour; text has a contrast of at least 4.5 to what is behind it, marks and
frames at least 3 (WCAG 2.2, level AA), which a test computes. No state is shown by colour alone.
"""

from dataclasses import dataclass
from typing import Any, Literal

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

WHITE = "#FFFFFF"

ThemeName = Literal["system", "light", "dark"]
"""ColourTheme of a window; ``system``: that of the desktop."""


@dataclass(frozen=True, slots=True)
class ColourTheme:
    """Colours by role, as ``#rrggbb``; ``on_`` names the text on a fill."""

    # Surfaces: the window; panels, tables and fields on it; buttons; what is selected.
    background: str
    panel: str
    raised: str
    selected: str
    on_selected: str
    # Lines: decoration, and frames of what can be used; the frame of what has the keyboard.
    line: str
    frame: str
    focus: str
    # Text: the main one, a secondary one, labels, and what leads elsewhere.
    text: str
    detail: str
    quiet: str
    link: str
    # States as text, and as the fill of a badge or lamp.
    good: str
    watch: str
    bad: str
    good_fill: str
    on_good: str
    watch_fill: str
    on_watch: str
    bad_fill: str
    on_bad: str
    # The emergency stop, and the band of a pilot run: nothing else looks like them.
    stop: str
    on_stop: str
    pilot: str
    on_pilot: str
    # Lines of plots, in this order where they have no role of their own: left, right, board, ball.
    left: str
    right: str
    board: str
    ball: str
    # Pale fills of a report: cool and warm cells, and notices.
    cool: str
    warm: str
    notice: str

    @property
    def series(self) -> tuple[str, ...]:
        """The colours of the lines of a plot."""
        return self.left, self.right, self.board, self.ball


DARK = ColourTheme(
    background="#11151A",
    panel="#1B2129",
    raised="#2B3541",
    selected=BLUE,
    on_selected=WHITE,
    line="#4B5663",
    frame="#84909D",
    focus=WHITE,
    text="#E8ECF0",
    detail="#AEB7C2",
    quiet="#9AA5B1",
    link=SKY,
    good="#2FC79B",
    watch=ORANGE,
    bad="#FF8A47",
    good_fill="#123A30",
    on_good="#43D3A9",
    watch_fill=ORANGE,
    on_watch="#11151A",
    bad_fill="#B84A00",
    on_bad=WHITE,
    stop="#C8102E",
    on_stop=WHITE,
    pilot=YELLOW,
    on_pilot=BLACK,
    left=SKY,
    right=PINK,
    board=WHITE,
    ball=ORANGE,
    cool="#12354A",
    warm="#4A2A12",
    notice="#4A3A08",
)
"""The dark theme; the participants' displays always have its colours."""

LIGHT = ColourTheme(
    background=WHITE,
    panel="#F1F4F6",
    raised="#E2E7EC",
    selected=BLUE,
    on_selected=WHITE,
    line="#D0D6DC",
    frame="#717C88",
    focus=BLACK,
    text="#1A1A1A",
    detail="#414A54",
    quiet="#545D67",
    link=BLUE,
    good="#006B4E",
    watch="#7F5200",
    bad="#A33F00",
    good_fill="#D3EDE4",
    on_good="#00523B",
    watch_fill=ORANGE,
    on_watch="#11151A",
    bad_fill="#B84A00",
    on_bad=WHITE,
    stop="#C8102E",
    on_stop=WHITE,
    pilot=YELLOW,
    on_pilot=BLACK,
    left=BLUE,
    right="#A8437F",
    board=BLACK,
    ball=VERMILION,
    cool="#E3F0F8",
    warm="#FBEADE",
    notice="#FFF3CD",
)
"""The light theme; figures and printed reports always have its colours."""

THEMES = {"light": LIGHT, "dark": DARK}

FINE, BODY, STRONG, TITLE, HEADLINE = 0.88, 1.0, 1.15, 1.4, 2.0
"""The type scale of windows, in letter heights of the main text [1]."""

GAP = 0.4
"""Space between the parts of a window, in letter heights of the main text [1]."""

LEAST_LETTERS, MOST_LETTERS, ROWS = 13, 44, 54
"""Smallest and largest letter height of the main text [pixels], and how many of it a window is high [1]."""


def letters(height: float) -> int:
    """Return the letter height of the main text in a window of this height [pixels]."""
    return round(max(LEAST_LETTERS, min(MOST_LETTERS, height / ROWS)))


PRINT_FINE, PRINT_SMALL, PRINT_BODY, PRINT_TITLE = 6.5, 7.0, 8.0, 8.5
"""The type scale of figures [pt]."""

FAINT, PALE, LIGHT_GREY, GREY, DARK_GREY = "#F3F3F3", "#D9D9D9", "#BBBBBB", "#888888", "#555555"
"""Greys of figures: bands; areas; single dyads; lines of reference; a second hand."""

RAMP = ("#A0A0A0", "#757575", "#4A4A4A", BLACK)
"""Greys of an ordered quantity, from low to high."""

MANY = (
    *(VERMILION, BLUE, GREEN, PINK, ORANGE, SKY, BLACK),
    *("#999999", "#17BECF", "#8C564B", "#9467BD", "#BCBD22", YELLOW),
)
"""Colours of many kinds, the frequent ones first; only the first seven can be told apart with any colour vision."""

FIGURE_STYLE: Any = {
    "font.size": PRINT_BODY,
    "axes.titlesize": PRINT_TITLE,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.linewidth": 0.6,
    "lines.linewidth": 1.2,
    "legend.frameon": False,
    "legend.fontsize": PRINT_SMALL,
    "svg.fonttype": "none",
    "svg.hashsalt": "netboard",
    "pdf.fonttype": 42,
    "figure.constrained_layout.use": True,
}
"""The style of figures: differences from matplotlib's defaults."""


def luminance(colour: str) -> float:
    """Return the relative luminance of a colour, as WCAG 2.2 defines it [1]."""
    channels = (int(colour[start : start + 2], 16) / 255 for start in (1, 3, 5))
    linear = (one / 12.92 if one <= 0.04045 else ((one + 0.055) / 1.055) ** 2.4 for one in channels)
    return sum(share * one for share, one in zip((0.2126, 0.7152, 0.0722), linear, strict=True))


def contrast(one: str, other: str) -> float:
    """Return the contrast ratio of two colours, as WCAG 2.2 defines it [1]."""
    dark, light = sorted((luminance(one), luminance(other)))
    return (light + 0.05) / (dark + 0.05)
