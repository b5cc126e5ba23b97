"""The operator's window: lamps, strips, attempts, the form, the buttons and their keys.

It shows a `State` and emits the operator's commands; it does not know the server. It is a single window without dialogs
and menus, so that every shortcut works at any time, above all the emergency stop. Commands that must not happen by
accident need a second press.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from functools import partial

from PySide6.QtCore import Qt, QTimer, Signal
from PySide6.QtGui import QColor, QKeySequence, QPalette, QShortcut
from PySide6.QtWidgets import QHBoxLayout, QLabel, QSplitter, QStackedWidget, QVBoxLayout, QWidget

from netboard.base.clock import now_ns
from netboard.base.config import SIDES, Config
from netboard.base.plural import plural
from netboard.base.tables.experiment import Block, Session
from netboard.network.protocol.control import Status, TracePoint
from netboard.network.transport import names
from netboard.nodes.ports.emergency import STOP
from netboard.nodes.server.operators import SAFE_WHEN_LATE
from netboard.task.journal.outcome import AttemptOutcome
from netboard.task.trials.exclusion import USUAL_RULE, ExclusionRule
from netboard.windows.operator import words
from netboard.windows.operator.attempts import AttemptTable
from netboard.windows.operator.changes import RecentCounts
from netboard.windows.operator.commands import CONFIRM_KEY, CONFIRMING, STOP_KEYS, OperatorCommand, refusal, unconfirmed
from netboard.windows.operator.controls import CommandBar, CommandButton, ConfirmationField, NoteField, StopPanel
from netboard.windows.operator.form import SessionForm
from netboard.windows.operator.form_fields import first_entry
from netboard.windows.operator.lamp_widget import BAD, PANEL, PLAIN, TONES, WATCH, SessionLamps, StationLamps, label
from netboard.windows.operator.lamps import ACTIVE, SESSION_LAMPS, SILENT, Limits, alarm, faded, session_lamps
from netboard.windows.operator.stations import STATION_LAMPS, station_lamps
from netboard.windows.operator.strips import StripCharts
from netboard.windows.operator.words import Tone, TonedText
from netboard.windows.participant.window import Window, application

SMALLEST = 1200, 920
"""Size of the window that shows everything [pixels]; on a smaller screen, everything is drawn smaller."""

CONFIRM_MS = 5000
"""Timeout for the second press [ms]."""

SOON_NS = 400_000_000
"""A second press within this time is ignored as accidental [ns]."""

REPLY_MS = 20_000
"""Time for which the result of a command is shown [ms]."""

BANNER_MARGINS = 30
"""Width of the banner that is not for its text [pixels]."""

TWO_LINES = 180
"""Length of advice from which its letters are smaller, so that two lines hold it [1]."""

STRIP_TURNS = 2
"""The strip charts are redrawn once per this many states [1]."""


@dataclass(frozen=True, slots=True)
class State:
    """Everything that the console shows."""

    status: Status | None = None
    silence: float = float("inf")  # time since the last status; infinite before the first [s]
    recent: RecentCounts = field(default_factory=RecentCounts)
    unconfirmed: bool = False  # whether the server has failed to confirm an emergency stop in time
    attempts: Sequence[AttemptOutcome] = ()
    points: Sequence[TracePoint] = ()
    # As the server is configured; None while unknown.
    session: Session | None = None
    block: Block | None = None
    rule: ExclusionRule = USUAL_RULE  # by which attempts do not count


class ConsoleWindow(Window):
    """The console's window."""

    commanded = Signal(str, str)

    def __init__(self, config: Config, limits: Limits, console: str) -> None:
        super().__init__()
        self.setWindowTitle("netboard console")
        palette = self.palette()
        palette.setColor(QPalette.ColorRole.Window, QColor(PLAIN.background))
        self.setPalette(palette)
        self.resize(1600, 960)
        self.state = State()
        self._limits, self._console = limits, console
        self._configured = config.session
        self._server = config.network
        self._shown = 0
        self._session = ""
        self._to_confirm: OperatorCommand | None = None
        self._asked_ns = 0
        self._confirm_timer = QTimer(self, singleShot=True, interval=CONFIRM_MS)
        self._confirm_timer.timeout.connect(self._cancel_confirmation)
        self._reply_timer = QTimer(self, singleShot=True, interval=REPLY_MS)
        self._reply_timer.timeout.connect(partial(self.say, TonedText("")))
        self._make(config)
        self._lay_out()
        self._connect()
        self.show_state(self.state)

    # --- display -----------------------------------------------------------------------------------------------

    def show_state(self, state: State) -> None:
        """Show a state; widgets that have not changed are left alone."""
        self.state = state
        status, silence = state.status, state.silence
        banner = words.banner(status)
        room = self.banner.width() - BANNER_MARGINS
        fitting = self.banner.fontMetrics().elidedText(banner.words, Qt.TextElideMode.ElideMiddle, room)
        if self.banner.text() != fitting:
            self.banner.setText(fitting)
            self.banner.setToolTip(banner.words)
            self.banner.setStyleSheet(_banner_style(banner.tone))
        _say(self.headline, words.headline(status, silence))
        _say(self.progress, TonedText(words.progress(status)))
        _say(self.block, TonedText(words.block(status), Tone.PLAIN))
        for side, line in self.rig.items():
            _say(line, words.rig(status, side, words.seated(state.session, state.block, side)))
        _say(self.commander, words.commander(status, self._console))
        named = [("", lamp) for lamp in session_lamps(status, silence, state.recent, self._limits)]
        self.session.set_lamps([lamp for _, lamp in named])
        if status is not None:
            for side in SIDES:
                lamps = station_lamps(status, state.recent, side, self._limits)
                lamps = faded(lamps) if silence > SILENT else lamps
                self.stations.set_lamps(side, lamps)
                named += [(side, lamp) for lamp in lamps]
            self._show_status(status)
        self._show_alarm(alarm(status, silence, state.recent, state.unconfirmed), words.worst(named))
        for button in (*self.bar.buttons, self.stop.release):
            button.allow(self._refusal(button.command))

    def _show_status(self, status: Status) -> None:
        other = status.session != self._session
        if other:
            self._session = status.session
            self.form.propose(status.name, pilot=status.pilot, session=self.state.session or self._configured)
            self.show_form(not status.opened and status.phase == "idle")
        elif status.opened and self.middle.currentWidget() is self.form:
            self.show_form(False)
        self.confirmation.show_words(unconfirmed(status))
        self.form.show_rig([self.rig[side].text() for side in SIDES], [one.words for one in status.stand_ins])
        self.table.take(self.state.attempts, self.state.rule)
        points = self.state.points
        self.note.tick = max(status.tick, points[-1].tick if points else 0)
        self._shown += 1
        self.strips.take(points, restart=other)
        if self.strips.isVisible() and self._shown % STRIP_TURNS == 0:
            self.strips.redraw()

    def _show_alarm(self, urgent: str, worst: TonedText) -> None:
        """Write the alarm across the window; without one, the next step or the worst lamp."""
        where = names.trouble(self._server.host) or f"{self._server.host}:{self._server.port}"
        shown = self.middle.currentWidget() is self.form
        line = words.advice(self.state.status, where, self.state.recent.refused, form=shown)
        if not line.words:
            line = worst
        letters = 19 if len(line.words) < TWO_LINES else 15
        plain = f"background: {PANEL}; color: {TONES[line.tone]}; {_ALARM} font-size: {letters}px;"
        look = _LOUD if urgent else plain
        if self.alarm.text() != (urgent or line.words):
            self.alarm.setText(urgent or line.words)
            self.alarm.setToolTip(urgent or line.words)
        if self.alarm.styleSheet() != look:
            self.alarm.setStyleSheet(look)

    def say(self, line: TonedText) -> None:
        """Show the result of a command for a while."""
        _say(self.reply, line)
        self._reply_timer.start()

    def show_form(self, wanted: bool) -> None:
        """Show or hide the session's form."""
        self.middle.setCurrentWidget(self.form if wanted else self.live)
        if wanted:
            self.form.show_problem("")
            self.form.texts["name"].setFocus()
        else:
            self.setFocus()

    # --- commands ----------------------------------------------------------------------------------------------

    def press(self, command: OperatorCommand) -> None:
        """Execute the command of a key or button, or show why it is not possible."""
        if command.name == "open" and self.middle.currentWidget() is self.form:
            self.show_form(False)
            return
        reason = self._refusal(command)
        if reason:
            self._cancel_confirmation()
            self.say(TonedText(f"{command.label}: {reason}", Tone.WATCH))
        elif command.confirm and self._to_confirm is not command:
            self._ask(command)
        elif not command.confirm or now_ns() - self._asked_ns >= SOON_NS:
            self._cancel_confirmation()
            self._do(command)

    def _refusal(self, command: OperatorCommand) -> str:
        """Return why a command is not possible now; a silent server would refuse most of them, as late."""
        lost = self.state.silence > SILENT and command.name not in SAFE_WHEN_LATE
        return refusal(command, None if lost else self.state.status, self._console)

    def _do(self, command: OperatorCommand) -> None:
        match command.name:
            case "open":
                self.show_form(True)
            case "note":
                self.note.toggle()
            case "confirm":
                self.confirmation.setFocus()
            case "repeat" | "veto":
                self._repeat(command)
            case _:
                self.commanded.emit(command.name, "")

    def _repeat(self, command: OperatorCommand) -> None:
        """Send the command for the selected trial, if it is one of this block, or for the last."""
        marked, status = self.table.marked, self.state.status
        if marked is not None and status is not None and marked.block != status.block:
            over = f"{command.label}: trial {marked.trial} belongs to block {marked.block}, which is over"
            self.say(TonedText(over, Tone.WATCH))
            return
        self.commanded.emit(command.name, "" if marked is None else str(marked.trial))

    def _ask(self, command: OperatorCommand) -> None:
        """Start to wait for the second press."""
        self._cancel_confirmation()
        self._to_confirm, self._asked_ns = command, now_ns()
        self._confirm_timer.start()
        self._button(command).ask(True)
        lost = self.state.status.lost if self.state.status is not None and command.name in ("end", "next") else ()
        loss = f"; {plural(len(lost), 'lost trial')} will not be repeated (to repeat: Ctrl+F9)" if lost else ""
        self.say(TonedText(f"{command.label}: to confirm, press {command.key} once more{loss}", Tone.WATCH))

    def _cancel_confirmation(self) -> None:
        self._confirm_timer.stop()
        if self._to_confirm is not None:
            self._button(self._to_confirm).ask(False)
            self._to_confirm = None
            self.say(TonedText(""))

    def _button(self, command: OperatorCommand) -> CommandButton:
        return next(button for button in (*self.bar.buttons, self.stop.release) if button.command is command)

    # --- Qt ----------------------------------------------------------------------------------------------------

    def ask_again(self) -> bool:
        """Ask for a second close while a block is running."""
        running = self.state.status is not None and self.state.status.phase in ACTIVE
        if running:
            self.say(TonedText("The block continues without this window. Close it once more to leave.", Tone.WATCH))
        return running

    def _make(self, config: Config) -> None:
        self.banner = label("", 19, Tone.PLAIN, bold=True)
        self.banner.setAlignment(Qt.AlignmentFlag.AlignCenter)
        self.banner.setFixedHeight(40)
        self.headline = label("", 46, Tone.PLAIN, bold=True)
        self.progress, self.block = label("", 22, Tone.PLAIN, bold=True), label("", 17, Tone.PLAIN)
        self.rig = {side: label("", 12, Tone.PLAIN) for side in SIDES}
        self.alarm = label("", 20, Tone.PLAIN, bold=True)
        self.alarm.setFixedHeight(48)
        self.alarm.setWordWrap(True)
        self.stop, self.bar = StopPanel(), CommandBar()
        self.session = SessionLamps(SESSION_LAMPS)
        self.stations = StationLamps(STATION_LAMPS, SIDES)
        self.strips, self.table = StripCharts(config), AttemptTable()
        self.form = SessionForm(first_entry(config.session))
        self.note, self.confirmation = NoteField(), ConfirmationField()
        self.reply, self.commander = label("", 13, Tone.QUIET), label("", 13, Tone.QUIET)
        self.live = QSplitter(Qt.Orientation.Horizontal)
        self.middle = QStackedWidget()

    def _lay_out(self) -> None:
        lines = QVBoxLayout()
        for line in (self.headline, self.progress, self.block):
            line.setMinimumWidth(1)  # a long line must not make the window wider
            lines.addWidget(line)
        top = _row((lines, 1), (self.stop, 0))
        self.live.addWidget(self.strips)
        self.live.addWidget(self.table)
        self.live.setSizes([480, 580])
        for page in (self.live, self.form):
            self.middle.addWidget(page)
        self.stations.setFixedWidth(458)
        for line in (self.banner, self.alarm, self.reply, *self.rig.values()):
            line.setMinimumWidth(1)
        rows = QVBoxLayout(self)
        rows.setContentsMargins(10, 0, 10, 8)
        rows.setSpacing(6)
        rows.addWidget(self.banner)
        rows.addLayout(top)
        rows.addLayout(_row(*((line, 1) for line in self.rig.values())))
        rows.addWidget(self.alarm)
        rows.addWidget(self.session)
        rows.addLayout(_row((self.stations, 0), (self.middle, 1)), 1)
        rows.addLayout(_row((self.confirmation, 1), (self.note, 1)))
        rows.addWidget(self.bar)
        rows.addLayout(_row((self.reply, 1), (self.commander, 0)))

    def _connect(self) -> None:
        for button in (*self.bar.buttons, self.stop.release):
            press = partial(self.press, button.command)
            button.clicked.connect(lambda _checked, press=press: press())
            self._key(button.command.key, press)
        self._key(CONFIRM_KEY, partial(self.press, CONFIRMING))
        stops = [self._key(key, self._stop) for key in STOP_KEYS]
        self.stop.stopped.connect(self._stop)
        arrows = [self._key(key, partial(self.table.step, by)) for key, by in (("Up", -1), ("Down", 1))]
        self._keys_of_form = (stops[-1], *arrows)
        application().focusChanged.connect(self._lend_keys)
        self._key("F11", lambda: self.showNormal() if self.isFullScreen() else self.showFullScreen())
        self.note.written.connect(lambda note: self.commanded.emit("note", note))
        self.form.filled.connect(lambda answers: self.commanded.emit("open", answers))
        for confirmed in (self.form.confirmed, self.confirmation.written):
            confirmed.connect(lambda said: self.commanded.emit("confirm", said))
        self.form.dismissed.connect(lambda: self.show_form(False))

    def _stop(self) -> None:
        self._cancel_confirmation()
        self.commanded.emit(STOP, "")

    def _lend_keys(self, _before: QWidget | None, now: QWidget | None) -> None:
        """Let Space and the arrows type, tick and choose while a field of the form has the focus."""
        for shortcut in self._keys_of_form:
            shortcut.setEnabled(now is None or not self.form.isAncestorOf(now))

    def _key(self, key: str, do: Callable[[], None]) -> QShortcut:
        shortcut = QShortcut(QKeySequence(key), self, autoRepeat=False, context=Qt.ShortcutContext.ApplicationShortcut)
        shortcut.activated.connect(do)
        return shortcut


_ALARM = "border-radius: 6px; padding: 0 14px;"
_LOUD = f"background: {BAD}; color: white; border-radius: 6px; padding: 0 14px; font-size: 27px;"


def _banner_style(tone: Tone) -> str:
    """Return the style of the banner; a pilot is black on yellow, so that nobody takes it for a real session."""
    if tone is Tone.WATCH:
        return f"background: #f0e442; color: {PLAIN.background}; border: 5px dashed {WATCH};"
    if tone is Tone.BAD:
        return f"background: {BAD}; color: white;"
    back = PLAIN.target if tone is Tone.PLAIN else PANEL
    return f"background: {back}; color: {TONES[tone] if tone is Tone.QUIET else 'white'};"


def _say(where: QLabel, line: TonedText) -> None:
    """Write a line to a label if it has changed."""
    look = f"color: {TONES[line.tone]};"
    if where.text() != line.words:
        where.setText(line.words)
        where.setToolTip(line.words)
    if where.styleSheet() != look:
        where.setStyleSheet(look)


def _row(*parts: tuple[QWidget | QVBoxLayout, int]) -> QHBoxLayout:
    """Lay out widgets side by side, each with its stretch factor."""
    row = QHBoxLayout()
    row.setSpacing(12)
    for part, share in parts:
        if isinstance(part, QWidget):
            row.addWidget(part, share)
        else:
            row.addLayout(part, share)
    return row
