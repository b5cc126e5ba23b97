"""The physics server: one loop that lets the stage run in real time.

Each millisecond it takes what the agents have sent, lets the stage do one tick, sends the forces, and only then does
everything else: keep the tick for the logger, show it to the stations, answer whoever asks. What happens is decided by
the stage and the watch; the server adds the clock and the sockets.
"""

import logging
import time
import uuid
from collections.abc import Callable
from dataclasses import asdict
from math import ceil
from typing import Any

import numpy as np

from netboard import sockets
from netboard.clock import Pacer, now_ns
from netboard.config import SIDES, Config, resolve
from netboard.curtain import PHASE_NAMES, make_curtain, view_of
from netboard.experiment.machine import Cause, Phase, is_active
from netboard.nodes.control_port import ControlPort
from netboard.nodes.log_port import LogPort
from netboard.nodes.motion_port import MotionPort
from netboard.nodes.watch import Watch
from netboard.process import steady_loop
from netboard.stage import make_stage
from netboard.tick import TICK, TICK_NS
from netboard.wire.codec import encode
from netboard.wire.messages import PROTOCOL_VERSION, EventRecord, Status, TickRecord, Welcome

log = logging.getLogger(__name__)

RING_ROWS = 64
LATE_NS = TICK_NS // 2
"""A tick that begins later than this is counted as late [ns]."""
LOG_TICKS = 10
CONTROL_TICKS = 10
CLOCK_TICKS = 1000
FINISH_NS = 10_000_000_000
"""The loggers get this long to bring the last records to disk [ns]."""
BACKLOG_LIMIT = 0.8
"""With this share of the log ring not yet on disk the trial is paused [1]."""
SHUTDOWN = "shutdown"


class Server:
    """Everything the physics server is made of.

    Parameters
    ----------
    config : Config
        Rig and experiment.
    context : zmq.Context
        Where the sockets are made.
    autostart : bool
        Start the block as soon as everything is there.
    """

    def __init__(self, config: Config, context: sockets.Context, *, autostart: bool) -> None:
        self.session = uuid.uuid4().hex
        self.everything_recorded = False
        self._config = config
        self._stage = make_stage(config)
        self._stage.warm()
        self._state = self._stage.initial()
        self._curtain = make_curtain(config)
        self._watch = Watch(autostart)
        self._rows = np.zeros(RING_ROWS, TICK)
        self._blank = np.zeros(1, TICK)[0]
        self._number = 0
        self._late_ticks = 0
        self._events = 0
        self._probes = 0
        self._completions: list[float] = []
        self._missing: tuple[str, ...] = ()
        self._shutdown = False
        self._started = False
        self._stood_still_ns = 0
        self._gap = ""
        where = sockets.addresses(config.network)
        welcome = Welcome(self.session, PROTOCOL_VERSION, now_ns(), resolve(config))
        self._timeout_ns = int(config.network.sample_timeout_ms * 1e6)
        self._motion = MotionPort(
            sockets.motion_server(context, where.listen(sockets.MOTION)), welcome, self._timeout_ns
        )
        ring = int(config.network.log_ring_s * 1000 * 1.5)
        self._log = LogPort(sockets.log_server(context, where.listen(sockets.LOG)), welcome, ring)
        self._control = ControlPort(
            sockets.control_server(context, where.listen(sockets.CONTROL)), welcome, self.status
        )
        self._views = {side: sockets.view_publisher(context, where.listen(sockets.VIEW[side])) for side in SIDES}
        self._view_ticks = ceil(1000 / config.network.view_rate_hz)

    @property
    def phase(self) -> Phase:
        """Where the trial is."""
        return Phase(int(self._state["phase"][0]))

    def status(self) -> Status:
        """How the server is, for operators."""
        state = self._state[0]
        seats = self._motion.seats
        agents = tuple(f"agent.{side}" for side in SIDES if seats[side].hello is not None)
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
            notice=self._watch.notice,
        )

    def run(self, stopping: Callable[[], bool]) -> None:
        """Tick until told to stop, then bring everything to disk and say goodbye.

        Parameters
        ----------
        stopping : callable
            Whether the process has been asked to stop.
        """
        stepping = {name: str(value) for name, value in asdict(self._stage.choice).items()}
        self._note("session_started", {"session": self.session, **stepping})
        steady_loop()
        pacer = Pacer(now_ns() + TICK_NS)
        while not (stopping() or self._shutdown):
            late_ns = pacer.wait()
            if pacer.moved_ns > self._stood_still_ns:
                self._stood_still(pacer.moved_ns)
            self.tick(pacer.due_ns, late_ns)
        if self.phase != Phase.FINISHED:
            self._control.wishes[:] = ["stop"]
            late_ns = pacer.wait()
            self.tick(pacer.due_ns, late_ns)
        self._finish()

    def tick(self, due_ns: int, late_ns: int) -> None:
        """Do one tick.

        Parameters
        ----------
        due_ns : int
            Nominal time of the tick [ns].
        late_ns : int
            How much later it began [ns].
        """
        number = self._number
        index = number % RING_ROWS
        self._rows[index] = self._blank
        row = self._rows[index]
        self._motion.drain(now_ns)
        row["tick"], row["time_ns"], row["late_ns"] = number, due_ns, late_ns
        self._motion.fill(row, due_ns)
        row["command"] = self._command(row)
        self._stage.advance(self._state, self._rows, number)
        felt = self._config.block.haptics and is_active(row["phase"])
        self._motion.answer(row, felt, now_ns())
        self._number += 1
        self._late_ticks += late_ns > LATE_NS
        self._log.append(TickRecord(row.tobytes()))
        if row["event"]:
            self._happened(row)
        if number % self._view_ticks == 0:
            self._show(row)
        if number % LOG_TICKS == 0:
            self._keep()
        if number % CONTROL_TICKS == CONTROL_TICKS // 2:
            self._control.drain(now_ns())
            self._missing = self._lacks()

    def _command(self, row: Any) -> Cause:
        """The command of this tick: of the operator, or of the watch over the peers."""
        wishes = self._control.wishes
        wish = wishes.pop(0) if wishes else ""
        if wish == SHUTDOWN:
            self._shutdown = True
            wish = ""
        return self._watch.command(self.phase, wish, self._missing, self._trouble(row))

    def _stood_still(self, moved_ns: int) -> None:
        """Note that the loop was held up for so long that its time had to be moved: the trial is spoiled."""
        held_up_ms = (moved_ns - self._stood_still_ns) / TICK_NS
        self._stood_still_ns = moved_ns
        self._gap = f"the server stood still for {held_up_ms:.0f} ms"
        self._note("stood_still", {"milliseconds": f"{held_up_ms:.0f}"})

    def _trouble(self, row: Any) -> str:
        """Why a running trial cannot go on, or nothing."""
        if self._gap:
            gap, self._gap = self._gap, ""
            return gap
        for side in SIDES:
            if not row[f"{side}_live"]:
                return f"no sample from the {side} agent"
            if not self._motion.seats[side].armed:
                return f"the {side} device is not armed"
        if self._config.network.require_logger and self._log.backlog > BACKLOG_LIMIT * self._log.ring.capacity:
            return "the logger is too far behind"
        return ""

    def _lacks(self) -> tuple[str, ...]:
        """What a block needs and is not there."""
        lacking = []
        for side in SIDES:
            seat = self._motion.seats[side]
            if not seat.live(now_ns(), self._timeout_ns):
                lacking.append(f"the {side} agent")
            elif not seat.armed:
                lacking.append(f"the {side} device to be armed")
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

    def _show(self, row: Any) -> None:
        """Send each station what it may see."""
        best = min(self._completions, default=None)
        for side, socket in self._views.items():
            view = view_of(self._curtain, row, side, best, now_ns())
            sockets.send(socket, encode(view))

    def _keep(self) -> None:
        """Bring records to the loggers."""
        if self._number % CLOCK_TICKS < LOG_TICKS:
            for probe in self._motion.clock_records(self._probes):
                self._log.append(probe)
                self._probes += 1
        for frame in self._control.frames:
            self._log.append(frame)
        self._control.frames.clear()
        self._log.pump(now_ns())
        for port in (self._motion, self._control, self._log):
            for name, details in port.news:
                self._note(name, details)
            port.news.clear()

    def _note(self, name: str, details: dict[str, str]) -> None:
        """Record an event and tell the operator."""
        self._log.append(EventRecord(self._events, self._number, now_ns(), name, details))
        self._events += 1
        log.info("%s %s", name, " ".join(f"{key}={value}" for key, value in details.items()))

    def _finish(self) -> None:
        """Bring the last records to disk, then let everybody go."""
        self._motion.goodbye("the session is over")
        self._control.goodbye("the session is over")
        self._note("session_ended", {"late_ticks": str(self._late_ticks)})
        self._keep()
        self._log.end()
        expected = self._config.network.require_logger and self._started
        until = now_ns() + FINISH_NS
        while not self._log.done and (expected or self._log.loggers) and now_ns() < until:
            self._log.pump(now_ns())
            time.sleep(TICK_NS * 1e-9)
        if not self._log.done:
            log.error("%d records are not known to be on disk: no logger took them", self._log.backlog)
        self.everything_recorded = self._log.done or not expected
