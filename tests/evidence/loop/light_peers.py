"""Lightweight peers for many dyads at once: all agents in one process, all loggers and displays in another.

They use the real protocol over real sockets, so that the server does all its work; the peers themselves compute almost
nothing. An agent sends a sample every millisecond and lets the server set its phase; both hands move up and down
together, or rest. A logger acknowledges its records and keeps only the tick jitter. Frames are counted from a given
time on.
"""

import sys
import time
from collections import Counter
from collections.abc import Iterable
from dataclasses import replace
from heapq import heapreplace
from importlib.metadata import version
from math import cos, pi, sin
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from netboard.base.clock import CATCH_UP_TICKS, now_ns
from netboard.base.compiled import kernel, machine_code
from netboard.base.config import SIDES, Config, Side, parse
from netboard.base.process.realtime import Priority, cpus_for, io_priority, prepare, steady_loop
from netboard.base.process.resources import NAME
from netboard.base.safeguards import Safeguard
from netboard.base.terminal.logs import log_to_stderr
from netboard.base.tick import TICK, TICK_NS
from netboard.benchmarks.harness.workers import serve
from netboard.benchmarks.loop.timing import skipped_ticks
from netboard.devices.contract.device import Reading
from netboard.network import keys
from netboard.network.protocol.codec import decode, encode
from netboard.network.protocol.joining import HELLO_INTERVAL_NS, Hello, Ping, Pong, Welcome
from netboard.network.protocol.messages import PROTOCOL_VERSION
from netboard.network.protocol.records import LogAck, LogBatch, LogRequest, TickRecord
from netboard.network.transport import channels, fastpath, sockets
from netboard.nodes.agent.agent_runs import phase_shift
from netboard.nodes.agent.motion_link import BEAT, FORCE, NEWER, MotionLink, send_sample, wait_for_answer
from netboard.task.trials.state_machine import is_active

HEIGHT, FREQUENCY = 0.005, 0.5
"""Amplitude and frequency of a moving hand [m, Hz]."""

RECEIVE_DELAY_NS = 400_000
"""Delay from sending a sample to polling for its force [ns]."""

CHECK_INTERVAL_NS = 2_000_000
"""Interval at which loggers and displays poll [ns]."""

FREE_SPACE = 10**12
"""Free space that these loggers report [bytes]."""

_SEND, _RECEIVE = 0, 1
_RECORD_HEAD = encode(TickRecord(bytes(TICK.itemsize)))[: -TICK.itemsize]


@kernel
def _send_moving(fast: Any, sample: Any, link: Any, seq: int, z: float, vz: float, safeguards: int) -> int:
    """Send a sample of a hand that moves up and down, read now."""
    stamp_ns = fastpath.now_ns(fast)
    return send_sample(fast, sample, link, seq, stamp_ns, 0.0, 0.0, z, 0.0, 0.0, vz, 0, safeguards, 0.0)


@kernel
def _take_answers(fast: Any, frame: Any, link: Any) -> tuple[int, int]:
    """Take all answers that have come; return their number, and why none follows, as `wait_for_answer` does."""
    count, came = 0, NEWER
    while came == NEWER:
        came = wait_for_answer(fast, frame, link, 0)
        count += came == NEWER
    return count, came


class LightAgent:
    """An agent without a device: the link of a real one, with fewer steps of Python."""

    def __init__(self, config: Config, side: Side, context: sockets.Context) -> None:
        where = keys.reach(config.network, f"agent.{side}")
        self.socket = sockets.motion_agent(context, where.reach(channels.MOTION), f"agent.{side}@{NAME}")
        hello = Hello("agent", side, PROTOCOL_VERSION, NAME, version("netboard"), {})
        self.link = link = MotionLink(self.socket, hello, round(config.network.sample_timeout_ms * 1e6))
        self._seq = self._safeguards = 0
        self._send_moving = machine_code(_send_moving, link.fast, link.sample, link.state, 0, 0.0, 0.0, 0)
        self._take_answers = machine_code(_take_answers, link.fast, link.frame, link.state)

    def send(self, z: float, vz: float) -> None:
        """Send a sample, or a greeting before the server has answered."""
        link = self.link
        if link.answer_ns:
            self._send_moving(link.fast, link.sample, link.state, self._seq, z, vz, self._safeguards)
        else:
            link.send(self._seq, Reading(now_ns(), 0.0, 0.0, z, 0.0, 0.0, vz, 0, True), 0, 0.0)
        self._seq += 1

    def receive(self, counts: Counter[str]) -> None:
        """Process the received frames."""
        link = self.link
        while True:
            count, came = self._take_answers(link.fast, link.frame, link.state)
            counts["forces" if link.kind == FORCE else "beats"] += count
            if came != fastpath.NOTHING:
                counts["beats"] += link.handle_found(came)
            if link.kind == BEAT:
                self._safeguards = int(Safeguard.ARMED) if link.may_arm else 0
            if came == fastpath.NOTHING:
                return


class LightDyad:
    """Two agents that move as one."""

    def __init__(self, config: Config, context: sockets.Context, *, moving: bool) -> None:
        self.agents = [LightAgent(config, side, context) for side in SIDES]
        self._height = HEIGHT if moving else 0.0

    def send(self, at_ns: int) -> None:
        """Send both samples."""
        angle = 2 * pi * FREQUENCY * (at_ns * 1e-9)
        z, vz = self._height * sin(angle), self._height * 2 * pi * FREQUENCY * cos(angle)
        for agent in self.agents:
            agent.send(z, vz)

    def receive(self, counts: Counter[str]) -> int:
        """Process the frames of both agents; return the phase delay of the next samples [ns]."""
        for agent in self.agents:
            agent.receive(counts)
        return phase_shift(min(agent.link.lead_ns for agent in self.agents))


def run_agents(configs: Iterable[Config], context: sockets.Context, order: dict[str, Any]) -> dict[str, Any]:
    """Run all agents for a period.

    - `order`: ``from_ns``, ``until_ns``: start of the count, and end [ns]; ``moving``: whether their hands move.
    """
    dyads = [LightDyad(config, context, moving=order["moving"]) for config in configs]
    counts: Counter[str] = Counter()
    late: list[int] = []
    start_ns, measuring = now_ns() + TICK_NS, False
    events = [(start_ns + k * TICK_NS // len(dyads), k, _SEND) for k in range(len(dyads))]
    while (now := sleep_until(events[0][0])) < order["until_ns"]:
        due_ns, k, what = events[0]
        if not measuring and now >= order["from_ns"]:
            measuring = True
            counts.clear()
        if now - due_ns > CATCH_UP_TICKS * TICK_NS:
            due_ns = now
        if what == _SEND:
            dyads[k].send(now)
            heapreplace(events, (due_ns + RECEIVE_DELAY_NS, k, _RECEIVE))
            if measuring:
                late.append(now - due_ns)
        else:
            heapreplace(events, (due_ns + TICK_NS - RECEIVE_DELAY_NS + dyads[k].receive(counts), k, _SEND))
    return {"counts": counts, "late_ns": late}


def sleep_until(due_ns: int) -> int:
    """Sleep until a time unless it has passed; return the present time [ns]."""
    now = now_ns()
    if now >= due_ns:
        return now
    time.sleep((due_ns - now) * 1e-9)
    return now_ns()


class LightLogger:
    """A logger that keeps only the lateness of ticks."""

    def __init__(self, config: Config, context: sockets.Context) -> None:
        where = keys.reach(config.network, "logger")
        self.late: list[NDArray[Any]] = []
        self._socket = sockets.log_client(context, where.reach(channels.LOG), f"logger@{NAME}")
        self._hello = Hello("logger", "", PROTOCOL_VERSION, NAME, version("netboard"), {})
        self._welcomed = False
        self._greeted_ns = -HELLO_INTERVAL_NS

    def poll(self, now: int, counts: Counter[str]) -> None:
        """Process the received frames."""
        if not self._welcomed and now - self._greeted_ns >= HELLO_INTERVAL_NS:
            self._greeted_ns = now
            sockets.send(self._socket, encode(self._hello))
        while (frame := sockets.receive(self._socket)) is not None:
            match decode(frame):
                case LogBatch(first=first, records=records):
                    counts["batches"] += 1
                    counts["records"] += len(records)
                    self._keep(records)
                    sockets.send(self._socket, encode(LogAck(first + len(records), FREE_SPACE, "", 0)))
                case Ping(sent_ns=ping_ns):
                    sockets.send(self._socket, encode(Pong(ping_ns, now, now_ns())))
                case Welcome() if not self._welcomed:
                    self._welcomed = True
                    sockets.send(self._socket, encode(LogRequest(-1)))

    def _keep(self, records: tuple[bytes, ...]) -> None:
        ticks = [record[len(_RECORD_HEAD) :] for record in records if record.startswith(_RECORD_HEAD)]
        if ticks:
            rows = np.frombuffer(b"".join(ticks), TICK)
            self.late.append(np.stack([rows[name] for name in ("time_ns", "late_ns", "phase")], axis=1))


def run_watchers(configs: Iterable[Config], context: sockets.Context, order: dict[str, Any]) -> dict[str, Any]:
    """Run all loggers and displays, and count the frames they receive.

    - `order`: ``from_ns``, ``until_ns``: start of the count, and end [ns]; ``loggers``, ``displays``: whether there are
      any.
    - returns ``counts``; with loggers, of all later ticks: ``late_ns``: start after the deadline [ns];
      ``skipped_ticks``: their number [1]; ``active``: share in a trial [1].
    """
    configs = list(configs)
    loggers = [LightLogger(config, context) for config in configs if order["loggers"]]
    views = [
        sockets.view_subscriber(context, keys.reach(config.network, f"display.{side}").reach(channels.VIEW[side]))
        for config in configs
        for side in SIDES
        if order["displays"]
    ]
    counts: Counter[str] = Counter()
    measuring = False
    while (now := now_ns()) < order["until_ns"]:
        if not measuring and now >= order["from_ns"]:
            measuring = True
            counts.clear()
        for logger in loggers:
            logger.poll(now, counts)
        for view in views:
            counts["views"] += sockets.receive(view) is not None
        time.sleep(max(0.0, (now + CHECK_INTERVAL_NS - now_ns()) * 1e-9))
    return {"counts": counts, **_ticks_of(loggers, order["from_ns"])}


def _ticks_of(loggers: Iterable[LightLogger], from_ns: int) -> dict[str, Any]:
    """Summarise the timing of all ticks since a time."""
    late_ns, skipped, active = [], 0, []
    for logger in loggers:
        rows = np.concatenate([np.empty((0, 3), np.int64), *logger.late])
        rows = rows[rows[:, 0] >= from_ns]
        late_ns += rows[:, 1].tolist()
        skipped += skipped_ticks(rows[:, 0])
        active += [is_active(phase) for phase in rows[:, 2].tolist()]
    return {"late_ns": late_ns, "skipped_ticks": skipped, "active": float(np.mean(active)) if active else 0.0}


def main(role: str) -> None:
    """Run one of the two processes: each order has its own dyads."""
    log_to_stderr(role)
    prepared: dict[str, str] | None = None

    def carry_out(order: dict[str, Any]) -> dict[str, Any]:
        nonlocal prepared
        configs = [parse(Path(file).read_text(encoding="utf-8"), file) for file in order["files"]]
        if prepared is None:
            wanted = configs[0].realtime
            mine = replace(wanted, scheduling=wanted.scheduling and role == "agents")
            prepared = prepare(mine, Priority.AGENT, cpus_for("left", wanted))
            steady_loop()
        with sockets.open_context(io_priority(prepared, Priority.AGENT)) as context:
            return (run_agents if role == "agents" else run_watchers)(configs, context, order)

    serve(carry_out)


if __name__ == "__main__":
    main(sys.argv[1])
