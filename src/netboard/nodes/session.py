"""A session: the stage of one dyad, its watch, and the ports to its peers.

A tick has a deadline, 1 ms after the one before. It is done as soon as both sides' new samples are in, at most half a
millisecond before its deadline, and else at its deadline; a side that was late the last time is not waited for. Its
simulated time is the deadline's in any case. In a tick the forces go out first; everything else comes after: keep the
tick for the logger, show it to the stations, answer whoever asks.

While nobody is on the motion channel and no trial is on there is nothing to be quick for: the ticks that have become
due are then done together, a few dozen times a second, and whoever comes wakes the session at once.
"""

import logging
import uuid
from dataclasses import asdict
from math import ceil
from typing import Any

import numpy as np

from netboard import doors, sockets
from netboard.clock import now_ns
from netboard.config import SIDES, Config, Side, resolve
from netboard.curtain import PHASE_NAMES, make_curtain, view_of
from netboard.experiment.machine import Cause, Phase
from netboard.nodes import seats
from netboard.nodes.control_port import ControlPort
from netboard.nodes.log_port import LogPort
from netboard.nodes.motion_port import MotionPort
from netboard.nodes.watch import Watch
from netboard.recording.spill import Spill, spill_path
from netboard.stage import make_stage
from netboard.tick import STATE, TICK, TICK_NS
from netboard.wire.codec import encode
from netboard.wire.messages import PROTOCOL_VERSION, EventRecord, Status, TickRecord, Welcome

log = logging.getLogger(__name__)

RING_ROWS = 64
EARLIEST_NS = TICK_NS // 2
"""A tick is done at most so long before its deadline [ns]."""

LATE_NS = TICK_NS // 2
"""A tick done later than this is counted as late [ns]."""

CATCH_UP_TICKS = 20
"""A session further behind than this moves its deadlines instead of doing its ticks in a burst [1]."""

IDLE_TICKS = 25
"""So many ticks are done together while there is nothing to be quick for [1]."""

HOUSE_TICKS = 10
CLOCKS_NS = 1_000_000_000
"""Clock probes are recorded so often [ns]."""

SAME_VIEW_TICKS = 50
"""A view that has not changed is sent again after so many ticks: a display knows that the link is alive [1]."""

FINISH_NS = 10_000_000_000
"""The loggers get this long to bring the last records to disk [ns]."""

SHUTDOWN = "shutdown"

_AT = {name: place for place, name in enumerate(TICK.names or ())}
_COMMAND, _EVENT, _PHASE = _AT["command"], _AT["event"], _AT["phase"]
_SHOWN = ("phase", "z", "theta", "p", "target", "trial", "attempt", "failures", "completion")
_SEEN = np.array([_AT[name] for name in (*_SHOWN, "left_used_z", "right_used_z")])
"""What views are made of: while these words of a row are the same, so are the views."""
_FIRST_ACTIVE, _LAST_ACTIVE = int(Phase.LEVELLING), int(Phase.FAILED)
_ALL_FINE = 3 * (seats.LIVE | seats.ARMED)
_RECORD_HEAD = encode(TickRecord(bytes(TICK.itemsize)))[: -TICK.itemsize]


class Session:
    """Everything the server needs for one dyad.

    Parameters
    ----------
    config : Config
        Rig and experiment.
    context : zmq.Context
        Where the sockets are made.
    door : doors.Door or None
        Where peers show their keys; None where no keys are asked for.
    autostart : bool
        Start the block as soon as everything is there.

    Attributes
    ----------
    wake_ns : int
        When the session wants to go on, if nothing comes before [ns].
    inlets : (zmq.Socket, zmq.Socket)
        Where something may come that it wants to know at once: motion, control.
    """

    def __init__(self, config: Config, context: sockets.Context, door: doors.Door | None, *, autostart: bool) -> None:
        self.session = uuid.uuid4().hex
        self.wake_ns = 0
        self._due_ns = 0
        self._door = door
        self._config = config
        self._stage = make_stage(config)
        self._stage.warm()
        self._state = self._stage.initial()
        self._phase_word = self._state.view(np.int64)[(STATE.names or ()).index("phase") :]
        self._curtain = make_curtain(config)
        self._watch = Watch(autostart)
        self._rows = np.zeros(RING_ROWS, TICK)
        self._words = self._rows.view(np.int64).reshape(RING_ROWS, -1)
        self._number = 0
        self._late_ticks = 0
        self._events = 0
        self._probes = 0
        self._clocks_ns = 0
        self._completions: list[float] = []
        self._missing: tuple[str, ...] = ()
        self._asked_to_end = False
        self._ending_until_ns = 0
        self._log_closing = False
        self._started = False
        self._gap = ""
        self._seen: dict[Side, tuple[int, bytes]] = dict.fromkeys(SIDES, (-SAME_VIEW_TICKS, b""))
        self._open(context, config)

    def _open(self, context: sockets.Context, config: Config) -> None:
        """Bind the channels."""
        network = config.network
        where = sockets.addresses(network, self._door)
        welcome = Welcome(self.session, PROTOCOL_VERSION, now_ns(), resolve(config))
        self._timeout_ns = int(network.sample_timeout_ms * 1e6)
        bound_ns = int(network.clock_bound_ms * 1e6)
        motion = sockets.motion_server(context, where.listen(sockets.MOTION))
        control = sockets.control_server(context, where.listen(sockets.CONTROL))
        ring = int(network.log_ring_s * 1000 * 1.5)
        self._motion = MotionPort(motion, welcome, self._timeout_ns, bound_ns)
        self._control = ControlPort(control, welcome, self.status)
        spill = Spill(spill_path(config, self.session), welcome, int(network.log_spill_mb * 1e6))
        self._log = LogPort(sockets.log_server(context, where.listen(sockets.LOG)), welcome, ring, spill)
        self._views = {side: sockets.view_publisher(context, where.listen(sockets.VIEW[side])) for side in SIDES}
        self._view_ticks = ceil(1000 / network.view_rate_hz)
        self._turn: dict[Side, int] = {"left": 0, "right": self._view_ticks // 2}
        self.inlets = (motion.socket, control.socket)

    # --- what the server asks ----------------------------------------------------------------------------------

    @property
    def phase(self) -> Phase:
        """Where the trial is."""
        return Phase(int(self._phase_word[0]))

    @property
    def ending(self) -> bool:
        """Whether the block is over and the loggers are being fed what is left."""
        return self._ending_until_ns > 0

    @property
    def over(self) -> bool:
        """Whether everything has been done, and the loggers have it or have had their time."""
        return self._log_closing and self._log.closed

    @property
    def everything_recorded(self) -> bool:
        """Whether every record that matters is known to be on disk."""
        return self._log.done or not self._records_expected

    @property
    def _records_expected(self) -> bool:
        return self._config.network.require_logger and self._started

    def status(self) -> Status:
        """How the session is, for operators."""
        state = self._state[0]
        now = now_ns()
        agents = tuple(f"agent.{side}" for side in SIDES if self._motion.seats[side].hello is not None)
        loggers = ("logger",) * self._log.loggers
        return Status(
            session=self.session,
            tick=self._number,
            phase=PHASE_NAMES[int(state["phase"])],
            trial=int(state["trial"]),
            trials=self._curtain.trials,
            successes=int(state["successes"]),
            failures=int(state["failures"]),
            completions=tuple(self._completions),
            late_ticks=self._late_ticks,
            waiting_for=self._missing,
            peers=(*agents, *loggers, *self._control.peers),
            notice=self._watch.notice or self._log.notice,
            links=(*self._motion.links(now), *self._log.links(now), *self._control.links(now)),
        )

    # --- what the server does ----------------------------------------------------------------------------------

    def begin(self, due_ns: int, machine: dict[str, str]) -> None:
        """Let the first tick be due at a time.

        Parameters
        ----------
        due_ns : int
            Its deadline [ns].
        machine : dict of str
            What the process was given by its machine, to be recorded.
        """
        self._due_ns = self.wake_ns = due_ns
        stepping = {name: str(value) for name, value in asdict(self._stage.choice).items()}
        self._note("session_started", {"session": self.session, **stepping, **machine})

    def stop(self) -> None:
        """Ask the session to end."""
        self._asked_to_end = True

    def go_on(self, motion: bool, control: bool) -> bool:
        """Take what has come, and do the tick that can be done; whether there may be more to take.

        The motion channel is read until nothing is left when all else is done: only then it signals again.

        Parameters
        ----------
        motion, control : bool
            Whether these channels have signalled.
        """
        if self.ending:
            return self._go_on_ending()
        idle = self._motion.empty and not self._active
        self._motion.drain(now_ns, self._due_ns, motion)
        now = now_ns()
        self._mind_the_gap(now - self._due_ns, CATCH_UP_TICKS + (IDLE_TICKS if idle else 0))
        if idle:
            self._idle_ticks(now)
        elif now >= self._due_ns or (now >= self._due_ns - EARLIEST_NS and self._motion.complete):
            self.tick(self._due_ns, now - self._due_ns)
        more = self._control.drain(now_ns()) if control else False
        more |= self._motion.drain(now_ns, self._due_ns)
        if self._asked_to_end:
            self._end()
            return False
        self._sleep()
        return more

    def _sleep(self) -> None:
        """Decide when to go on."""
        if self._motion.empty and not self._active:
            self.wake_ns = self._due_ns + (IDLE_TICKS - 1) * TICK_NS
        elif self._motion.complete:
            self.wake_ns = self._due_ns - EARLIEST_NS
        else:
            self.wake_ns = self._due_ns

    @property
    def _active(self) -> bool:
        return bool(_FIRST_ACTIVE <= self._phase_word[0] <= _LAST_ACTIVE)

    def tick(self, due_ns: int, late_ns: int) -> None:
        """Do one tick.

        Parameters
        ----------
        due_ns : int
            Its deadline [ns].
        late_ns : int
            How much later it began; negative before the deadline [ns].
        """
        number = self._number
        index = number % RING_ROWS
        words = self._words[index]
        found = self._motion.fill(words, number, due_ns, late_ns)
        active = self._active
        if not active or found != _ALL_FINE or self._control.wishes or self._gap or self._log.trouble:
            words[_COMMAND] = self._command(found)
        self._stage.advance(self._state, self._rows, number)
        if active and self._config.block.haptics:
            self._motion.force(words)
        else:
            self._motion.beat(number, now_ns())
        self._late_ticks += late_ns > LATE_NS
        self._count(1)
        if number % HOUSE_TICKS == 0:
            self._keep_house()
        else:
            self._log.listen(now_ns())

    def _idle_ticks(self, now: int) -> None:
        """Do all ticks that are due, in one go."""
        due_ns, first = self._due_ns, self._number
        count = min((now - due_ns) // TICK_NS + 1, RING_ROWS)
        if count < 1:
            return
        for number in range(first, first + count):
            self._motion.fill(self._words[number % RING_ROWS], number, due_ns + (number - first) * TICK_NS, 0)
        self._words[first % RING_ROWS, _COMMAND] = self._command(0)
        self._stage.advance(self._state, self._rows, first, count)
        self._count(count)
        self._keep_house()

    def _count(self, count: int) -> None:
        """Keep the ticks that have been done, and tell what they have brought."""
        for number in range(self._number, self._number + count):
            words = self._words[number % RING_ROWS]
            self._log.append(_RECORD_HEAD + words.tobytes())
            if words[_EVENT]:
                self._happened(self._rows[number % RING_ROWS])
        self._number += count
        self._due_ns += count * TICK_NS
        self._show((self._number - 1) % RING_ROWS)

    def _mind_the_gap(self, behind_ns: int, most_ticks: int) -> None:
        """If the loop was held up for so long that its time must be moved, note it: a trial is spoiled by it."""
        if behind_ns <= most_ticks * TICK_NS:
            return
        moved_ns = behind_ns - behind_ns % TICK_NS
        self._due_ns += moved_ns
        self._gap = f"the server stood still for {moved_ns / TICK_NS:.0f} ms"
        self._note("stood_still", {"milliseconds": f"{moved_ns / TICK_NS:.0f}"})

    def _command(self, found: int) -> Cause:
        """The command of a tick: of the operator, or of the watch over the peers."""
        return self._watch.command(self._number, self.phase, self._wish(), self._missing, self._trouble(found))

    def _wish(self) -> str:
        """Return the next wish of an operator that the watch has to look at, if there is one."""
        wishes = self._control.wishes
        if not wishes:
            return ""
        wish = wishes.pop(0)
        if wish == SHUTDOWN:
            self._asked_to_end = True
            return ""
        return wish

    def _trouble(self, found: int) -> str:
        """Why a running trial cannot go on, or nothing."""
        if self._gap:
            gap, self._gap = self._gap, ""
            return gap
        for place, side in enumerate(SIDES):
            if not found & (seats.LIVE << place):
                return f"no sample from the {side} agent"
            if not found & (seats.ARMED << place):
                return f"the {side} device is not armed"
        return self._log.trouble if self._config.network.require_logger else ""

    def _lacks(self) -> tuple[str, ...]:
        """What a block needs and is not there."""
        lacking = self._motion.lacks(now_ns())
        if self._config.network.require_logger and not self._log.loggers:
            lacking.append("the logger")
        return tuple(lacking)

    def _happened(self, row: Any) -> None:
        """Note what the stage has decided."""
        cause = Cause(int(row["event"]))
        state = self._state[0]
        self._started = self._started or cause == Cause.START
        if cause == Cause.HELD:
            self._completions.append(float(state["completion"]))
        details = {
            "from": PHASE_NAMES[int(row["phase"])],
            "to": PHASE_NAMES[int(state["phase"])],
            "trial": str(row["trial"]),
            "attempt": str(row["attempt"]),
            "target": "left" if row["target"] < 0 else "right",
        }
        if cause == Cause.HELD:
            details["completion"] = repr(float(state["completion"]))
        if self._watch.notice:
            details["notice"] = self._watch.notice
        self._note(cause.name.lower(), details)

    def _show(self, index: int) -> None:
        """Send a station what it may see, if it is its turn, somebody looks, and there is anything new."""
        for side, turn in self._turn.items():
            if self._number > turn:
                self._turn[side] = max(turn, self._number - self._view_ticks) + self._view_ticks
                self._show_to(side, index)

    def _show_to(self, side: Side, index: int) -> None:
        publisher = self._views[side]
        if not publisher.wanted():
            return
        sent_tick, sent = self._seen[side]
        seen = self._words[index, _SEEN].tobytes()
        if seen == sent and self._number - sent_tick < SAME_VIEW_TICKS:
            return
        self._seen[side] = self._number, seen
        best = min(self._completions, default=None)
        publisher.send(encode(view_of(self._curtain, self._rows[index], side, best, now_ns())))

    def _keep_house(self) -> None:
        """Do what need not be done at once: records to the loggers, clocks, who is missing."""
        now = now_ns()
        self._motion.expire(now)
        self._missing = self._lacks()
        self._control.pump(now)
        self._control.drain(now)
        if now >= self._clocks_ns:
            self._clocks_ns = now + CLOCKS_NS
            self._note_clocks()
        self._keep_records(now)

    def _keep_records(self, now: int) -> None:
        """Bring records to the loggers, and to the records whatever the ports have to tell."""
        for frame in self._control.frames:
            self._log.append(encode(frame))
        self._control.frames.clear()
        for port in (self._motion, self._control, self._log):
            for name, details in port.news:
                self._note(name, details)
            port.news.clear()
        for details in self._door.attend() if self._door is not None else ():
            self._note("refused", details)
        self._log.pump(now)

    def _note_clocks(self) -> None:
        """Record the newest clock probe of every peer."""
        for port in (self._motion, self._control, self._log):
            for probe in port.clock_records(self._probes):
                self._log.append(encode(probe))
                self._probes += 1

    def _note(self, name: str, details: dict[str, str]) -> None:
        """Record an event and tell the operator."""
        self._log.append(encode(EventRecord(self._events, self._number, now_ns(), name, details)))
        self._events += 1
        said = " ".join(f"{key}={value}" for key, value in details.items())
        log.info("%s %s", name, "".join(letter if letter.isprintable() else "?" for letter in said))

    # --- the end -----------------------------------------------------------------------------------------------

    def _end(self) -> None:
        """Stop the block, and let the loggers bring everything to disk."""
        if self.phase != Phase.FINISHED:
            self._control.wishes[:] = ["stop"]
            self.tick(self._due_ns, max(0, now_ns() - self._due_ns))
        self._motion.goodbye("the session is over")
        self._control.goodbye("the session is over")
        self._note("session_ended", {"late_ticks": str(self._late_ticks)})
        self._keep_records(now_ns())
        self._log.end()
        self._ending_until_ns = now_ns() + FINISH_NS

    def _go_on_ending(self) -> bool:
        """Feed the loggers."""
        now = now_ns()
        if not self._log_closing:
            self._keep_records(now)
            awaited = self._records_expected or self._log.loggers
            if self._log.done or not awaited or now > self._ending_until_ns:
                self._log_closing = True
                self._log.close()
        self.wake_ns = now + TICK_NS
        return False

    def close(self) -> None:
        """Close what is still open, and say what is not known to be on disk."""
        for publisher in self._views.values():
            publisher.close()
        if self._log.shortfall:
            log.error("%s", self._log.shortfall)
