"""The operator's window: lamps, strips, attempts, the form, the buttons and their keys.

It shows a `State` and emits the operator's commands; it does not know the server. It is a single window without dialogs
and menus, so that every shortcut works at any time, above all the emergency stop. Commands that must not happen by
accident need a second press.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from functools import partial

from PySide6.QtCore import Qt, QTimer, Signal
from PySide6.QtGui import QKeySequence, QShortcut
from PySide6.QtWidgets import QHBoxLayout, QLayout, QSplitter, QStackedWidget, QVBoxLayout, QWidget

from netboard.base.clock import now_ns
from netboard.base.config import SIDES, Config
from netboard.base.looks import GAP, ColourTheme
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
from netboard.windows.operator.lamp_widget import SessionLamps, StationLamps, label, say
from netboard.windows.operator.lamps import ACTIVE, SESSION_LAMPS, SILENT, Limits, alarm, faded, session_lamps
from netboard.windows.operator.stations import STATION_LAMPS, station_lamps
from netboard.windows.operator.strips import StripCharts
from netboard.windows.operator.words import Tone, TonedText
from netboard.windows.participant.window import application
from netboard.windows.style import StyledWindow, set_role

SMALLEST = 1200, 720
"""Size of the window that shows everything [pixels]; on a smaller screen, everything is drawn smaller."""

CONFIRM_MS = 5000
"""Timeout for the second press [ms]."""

SOON_NS = 400_000_000
"""A second press within this time is ignored as accidental [ns]."""

REPLY_MS = 20_000
"""Time for which the result of a command is shown [ms]."""

STATIONS_WIDTH, ALARM_HEIGHT = 33.0, 3.2
"""Width of the stations' lamps, and height of the line for alarm and advice, in letter heights of the main text [1]."""

SHARES = 400, 600
"""Widths of strip charts and table, in relation to each other [1]."""

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


class ConsoleWindow(StyledWindow):
    """The console's window."""

    commanded = Signal(str, str)

    def __init__(self, config: Config, limits: Limits, console: str) -> None:
        super().__init__()
        self.setWindowTitle("netboard console")
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
        self.resize(1600, 900)
        self.show_state(self.state)

    def take_look(self, theme: ColourTheme, base: int) -> None:
        """Fit what the style sheet does not reach to the theme and the letter height [pixels]."""
        self.stations.setFixedWidth(round(STATIONS_WIDTH * base))
        self.alarm.setFixedHeight(round(ALARM_HEIGHT * base))
        self.strips.take_look(theme, base)
        self.table.take_look(base)
        self.rows.setSpacing(round(GAP * base))
        self.live.setSizes(list(SHARES))
        for widget in (*self.session.widgets, *(lamp for lamps in self.stations.columns.values() for lamp in lamps)):
            widget.update()

    # --- display -----------------------------------------------------------------------------------------------

    def show_state(self, state: State) -> None:
        """Show a state; widgets that have not changed are left alone."""
        self.state = state
        status, silence = state.status, state.silence
        banner = words.banner(status)
        self._show_banner(banner)
        say(self.progress, TonedText(words.progress(status)))
        say(self.block, TonedText(words.block(status)))
        say(self.ahead, TonedText(words.ahead(status), Tone.QUIET))
        for side in SIDES:
            say(self.rig[side], words.rig(status, side, words.seated(state.session, state.block, side)))
        say(self.commander, words.commander(status, self._console))
        named = [("", lamp) for lamp in session_lamps(status, silence, state.recent, self._limits)]
        self.session.set_lamps([lamp for _, lamp in named])
        if status is not None:
            for side in SIDES:
                lamps = station_lamps(status, state.recent, side, self._limits)
                lamps = faded(lamps) if silence > SILENT else lamps
                self.stations.set_lamps(side, lamps)
                named += [(side, lamp) for lamp in lamps]
            self._show_status(status)
        say(self.badge, words.badge(status, silence, [lamp for _, lamp in named]), "fill")
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
        self.form.show_rig(
            [self.rig[side].text().replace("\n", "   ") for side in SIDES], [one.words for one in status.stand_ins]
        )
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
        say(self.alarm, TonedText(urgent, Tone.BAD) if urgent else line, "fill" if urgent else "tone")
        set_role(self.alarm, "fill", "bad" if urgent else "plain")
        set_role(self.alarm, "scale", "title" if urgent else "")

    def _show_banner(self, banner: TonedText) -> None:
        """Write the banner; what does not fit is left out in the middle."""
        room = self.banner.width() - 3 * self.banner.fontMetrics().height()
        fitting = self.banner.fontMetrics().elidedText(banner.words, Qt.TextElideMode.ElideMiddle, room)
        say(self.banner, TonedText(fitting), "fill")
        self.banner.setToolTip(banner.words)
        set_role(self.banner, "fill", BANNERS.get(banner.tone, "plain"))

    def say(self, line: TonedText) -> None:
        """Show the result of a command for a while."""
        say(self.reply, line)
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
        self.banner, self.badge = label("", "strong", bold=True), label("", "headline", bold=True)
        for centred in (self.banner, self.badge):
            centred.setAlignment(Qt.AlignmentFlag.AlignCenter)
        self.badge.setWordWrap(True)
        self.progress, self.block = label("", "title", bold=True), label("", "strong")
        self.ahead = label("", tone=Tone.QUIET)
        self.alarm = label("", bold=True)
        self.alarm.setWordWrap(True)
        self.stop, self.bar = StopPanel(), CommandBar()
        self.session = SessionLamps(SESSION_LAMPS)
        self.stations = StationLamps(STATION_LAMPS, SIDES)
        self.rig = self.stations.seats
        self.strips, self.table = StripCharts(config), AttemptTable()
        self.form = SessionForm(first_entry(config.session))
        self.note, self.confirmation = NoteField(), ConfirmationField()
        self.reply, self.commander = label("", tone=Tone.QUIET), label("", tone=Tone.QUIET)
        self.live = QSplitter(Qt.Orientation.Horizontal)
        self.middle = QStackedWidget()

    def _lay_out(self) -> None:
        lines = QVBoxLayout()
        lines.setSpacing(0)
        for line in (self.progress, self.block, self.ahead):
            line.setMinimumWidth(1)  # a long line must not make the window wider
            lines.addWidget(line)
        top = _row((self.badge, 5), (lines, 9), (self.stop, 0))
        self.live.addWidget(self.strips)
        self.live.addWidget(self.table)
        self.live.setChildrenCollapsible(False)
        for page in (self.live, self.form):
            self.middle.addWidget(page)
        for line in (self.banner, self.badge, self.alarm, self.reply):
            line.setMinimumWidth(1)
        rows = self.rows = QVBoxLayout(self)
        rows.setSizeConstraint(QLayout.SizeConstraint.SetNoConstraint)  # a smaller window has smaller letters
        rows.setContentsMargins(10, 0, 10, 8)
        rows.addWidget(self.banner)
        rows.addLayout(top)
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


BANNERS = {Tone.PLAIN: "selected", Tone.WATCH: "pilot", Tone.BAD: "bad", Tone.QUIET: "quiet"}
"""Fill of the banner by its tone: a pilot is black on yellow, so that nobody takes it for a real session."""


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
