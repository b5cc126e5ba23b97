"""The look of the windows for operators: one style sheet made from the roles of `netboard.base.looks`.

A widget gets its role by a property: ``scale`` (size of its text), ``fill`` (background and text of a badge), ``tone``
(colour of a text on any fill). All sizes follow the letter height of the main text, and that follows the height of the
window.
"""

from PySide6.QtCore import Qt
from PySide6.QtGui import QGuiApplication, QResizeEvent
from PySide6.QtWidgets import QApplication, QWidget

from netboard.base.looks import DARK, FINE, HEADLINE, LIGHT, STRONG, THEMES, TITLE, ColourTheme, ThemeName, letters
from netboard.windows.participant.window import Window

CHOICE = "netboard theme"
"""Property of the application: the theme that was asked for."""

SCALE = {"fine": FINE, "strong": STRONG, "title": TITLE, "headline": HEADLINE}
TONES = {"plain": "text", "quiet": "quiet", "good": "good", "watch": "watch", "bad": "bad"}
"""Role of the theme that colours each tone of a text."""


def choose_theme(name: ThemeName) -> None:
    """Choose the theme of this process's windows; ``system`` follows the desktop."""
    QApplication.instance().setProperty(CHOICE, name)  # type: ignore[union-attr]  # called after it was created


def current_theme() -> ColourTheme:
    """Return the theme of this process's windows; dark where the desktop has no setting."""
    app = QApplication.instance()
    chosen = None if app is None else app.property(CHOICE)
    if chosen in THEMES:
        return THEMES[chosen]
    return LIGHT if QGuiApplication.styleHints().colorScheme() == Qt.ColorScheme.Light else DARK


def set_role(widget: QWidget, name: str, role: str) -> None:
    """Give a widget a role; nothing happens if it has it."""
    if widget.property(name) != role:
        widget.setProperty(name, role)
        widget.style().unpolish(widget)
        widget.style().polish(widget)


class StyledWindow(Window):
    """A window whose letters and colours follow its height and the theme."""

    def __init__(self) -> None:
        super().__init__()
        self._look: tuple[ColourTheme, int] | None = None
        QGuiApplication.styleHints().colorSchemeChanged.connect(self.restyle)

    def restyle(self) -> None:
        """Renew the style sheet if size of letters or theme have changed."""
        look = current_theme(), letters(self.height())
        if look != self._look:
            self._look = look
            self.setStyleSheet(style_sheet(*look))
            self.take_look(*look)

    def take_look(self, theme: ColourTheme, base: int) -> None:
        """Pass a new theme and size of letters [pixels] on to parts that the style sheet does not reach."""

    def resizeEvent(self, event: QResizeEvent) -> None:  # noqa: N802  (Qt's name)
        """Fit the letters to the window."""
        super().resizeEvent(event)
        self.restyle()


def style_sheet(theme: ColourTheme, base: int) -> str:
    """Return the style sheet of a theme for a letter height of the main text [pixels]."""
    pad, wide, edge = base // 3, round(0.7 * base), max(2, base // 8)
    corner = base // 3
    shape = f"border-radius: {corner}px; padding: {base // 5}px {wide}px;"
    sizes = "\n".join(f'*[scale="{name}"] {{ font-size: {round(share * base)}px; }}' for name, share in SCALE.items())
    tones = "\n".join(f'*[tone="{tone}"] {{ color: {getattr(theme, role)}; }}' for tone, role in TONES.items())
    fills = "\n".join(
        f'*[fill="{name}"] {{ background: {back}; color: {front}; {shape} }}'
        for name, (back, front) in fills_of(theme).items()
    )
    return f"""
QWidget {{ background: {theme.background}; color: {theme.text}; font-size: {base}px; }}
QLabel, QCheckBox {{ background: transparent; }}
QToolTip {{ background: {theme.panel}; color: {theme.text}; border: 1px solid {theme.frame}; padding: {pad}px; }}
QPushButton {{ background: {theme.raised}; border: {edge}px solid {theme.raised}; border-radius: {corner}px;
    padding: {pad}px {wide}px; }}
QPushButton:hover {{ border-color: {theme.frame}; }}
QPushButton:disabled, QPushButton[fill]:disabled {{ background: {theme.panel}; color: {theme.quiet};
    border-color: {theme.panel}; }}
QPushButton:checked {{ background: {theme.selected}; color: {theme.on_selected}; border-color: {theme.selected}; }}
QPushButton#pilot:checked {{ background: {theme.pilot}; color: {theme.on_pilot}; border-color: {theme.pilot}; }}
QLineEdit, QComboBox, QPlainTextEdit, QTableView {{ background: {theme.panel}; border: {edge}px solid {theme.frame};
    border-radius: {corner}px; padding: {base // 5}px; selection-background-color: {theme.selected};
    selection-color: {theme.on_selected}; placeholder-text-color: {theme.quiet}; }}
QComboBox QAbstractItemView {{ background: {theme.panel}; selection-background-color: {theme.selected};
    selection-color: {theme.on_selected}; }}
QComboBox::drop-down {{ border: none; width: {round(1.4 * base)}px; }}
QComboBox::down-arrow {{ image: none; }}
QScrollBar {{ background: {theme.panel}; }}
QScrollBar:vertical {{ width: {wide}px; }}
QScrollBar:horizontal {{ height: {wide}px; }}
QScrollBar::handle {{ background: {theme.frame}; border-radius: {corner}px; min-height: {2 * base}px;
    min-width: {2 * base}px; }}
QScrollBar::add-line, QScrollBar::sub-line {{ width: 0px; height: 0px; }}
QTableView {{ padding: 0px; border-color: {theme.panel}; }}
QPlainTextEdit {{ font-family: monospace; font-size: {round(FINE * base)}px; }}
QHeaderView {{ background: {theme.panel}; }}
QHeaderView::section {{ background: {theme.panel}; color: {theme.detail}; border: none; padding: {base // 5}px; }}
QCheckBox {{ border: {edge}px solid transparent; border-radius: {corner}px; padding: {base // 5}px; }}
QCheckBox::indicator {{ width: {base}px; height: {base}px; border: {edge}px solid {theme.frame};
    border-radius: {corner}px; }}
QCheckBox::indicator:checked {{ background: {theme.good}; border-color: {theme.good}; }}
QScrollArea {{ border: none; }}
*[weight="bold"] {{ font-weight: bold; }}
{sizes}
{fills}
{tones}
QPushButton[fill] {{ padding: {pad}px {wide}px; }}
QPushButton[fill="stop"] {{ border: {2 * edge}px solid {theme.focus}; font-weight: bold; }}
QPushButton[fill="stop"]:pressed {{ background: {theme.on_stop}; color: {theme.stop}; }}
QLineEdit:focus, QComboBox:focus, QPlainTextEdit:focus, QTableView:focus, QPushButton:focus, QCheckBox:focus
    {{ border-color: {theme.focus}; }}
QPushButton[fill="stop"]:focus {{ border: {2 * edge}px dashed {theme.focus}; }}
"""


def fills_of(theme: ColourTheme) -> dict[str, tuple[str, str]]:
    """Return background and text of each fill."""
    return {
        "quiet": (theme.panel, theme.quiet),
        "plain": (theme.panel, theme.text),
        "selected": (theme.selected, theme.on_selected),
        "good": (theme.good_fill, theme.on_good),
        "watch": (theme.watch_fill, theme.on_watch),
        "bad": (theme.bad_fill, theme.on_bad),
        "stop": (theme.stop, theme.on_stop),
        "pilot": (theme.pilot, theme.on_pilot),
    }
