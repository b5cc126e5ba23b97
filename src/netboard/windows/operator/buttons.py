"""The command buttons, each labelled with its key, and the emergency stop.

No button takes the keyboard focus. Otherwise Space would press the button that was clicked last instead of the
emergency stop.
"""

from PySide6.QtCore import Qt, Signal
from PySide6.QtWidgets import QGridLayout, QPushButton, QSizePolicy, QVBoxLayout, QWidget

from netboard.network.protocol.control import Status
from netboard.windows.operator.commands import COMMANDS, RELEASING, STOP_KEYS, Command, refusal
from netboard.windows.operator.lamp_widget import PANEL, PLAIN, WATCH

STOP_RED = "#c8102e"
COLUMNS = 8
"""Buttons per row [1]."""

STYLE = f"""
QPushButton {{ background: #2b3541; color: {PLAIN.headline}; border: 1px solid {PLAIN.guide}; border-radius: 6px;
    padding: 4px; font-size: 15px; }}
QPushButton:hover {{ border-color: {PLAIN.cursor}; }}
QPushButton:disabled {{ background: {PANEL}; color: {PLAIN.quiet}; border-color: {PANEL}; }}
QPushButton[sure="true"] {{ background: {WATCH}; color: {PLAIN.background}; font-weight: bold; }}
"""

STOP_STYLE = f"""
QPushButton {{ background: {STOP_RED}; color: white; border: 4px solid white; border-radius: 12px;
    font-size: 26px; font-weight: bold; padding: 6px; }}
QPushButton:pressed {{ background: white; color: {STOP_RED}; }}
"""


class CommandButton(QPushButton):
    """The button of one command."""

    def __init__(self, command: Command) -> None:
        super().__init__()
        self.command = command
        self.setFocusPolicy(Qt.FocusPolicy.NoFocus)
        self.setSizePolicy(QSizePolicy.Policy.Expanding, QSizePolicy.Policy.Fixed)
        self.setMinimumHeight(46)
        self.setStyleSheet(STYLE)
        self.ask(False)

    def ask(self, sure: bool) -> None:
        """Ask for a second press as confirmation, or stop asking."""
        words = (
            f"{self.command.label}?\npress {self.command.key} again"
            if sure
            else f"{self.command.label}\n{self.command.key}"
        )
        if words == self.text():
            return
        self.setText(words)
        self.setProperty("sure", sure)
        self.setStyleSheet(STYLE)

    def allow(self, status: Status | None, own: str) -> None:
        """Enable the button if its command is possible now; else say why not in the tooltip."""
        reason = refusal(self.command, status, own)
        self.setEnabled(not reason)
        tip = f"{self.command.tip} ({reason})" if reason else self.command.tip
        if tip != self.toolTip():
            self.setToolTip(tip)


class StopPanel(QWidget):
    """The emergency stop, and its release.

    Signals
    -------
    stopped
        Emitted when the button goes down, not when it is released.
    """

    stopped = Signal()

    def __init__(self) -> None:
        super().__init__()
        self.button = QPushButton(f"EMERGENCY STOP\n{' or '.join(STOP_KEYS)}")
        self.button.setFocusPolicy(Qt.FocusPolicy.NoFocus)
        self.button.setSizePolicy(QSizePolicy.Policy.Expanding, QSizePolicy.Policy.Expanding)
        self.button.setMinimumSize(290, 84)
        self.button.setStyleSheet(STOP_STYLE)
        self.button.pressed.connect(self.stopped)
        self.release = CommandButton(RELEASING)
        rows = QVBoxLayout(self)
        rows.setContentsMargins(0, 0, 0, 0)
        rows.addWidget(self.button, 1)
        rows.addWidget(self.release)


class CommandBar(QWidget):
    """The buttons of all other commands."""

    def __init__(self) -> None:
        super().__init__()
        grid = QGridLayout(self)
        grid.setContentsMargins(0, 0, 0, 0)
        grid.setSpacing(6)
        self.buttons = [CommandButton(command) for command in COMMANDS]
        for place, button in enumerate(self.buttons):
            grid.addWidget(button, *divmod(place, COLUMNS))
            grid.setColumnStretch(place % COLUMNS, 1)
