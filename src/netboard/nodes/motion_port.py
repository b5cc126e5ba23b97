"""The server's end of the motion channel: two seats, one for each side's agent.

A seat holds the newest sample of its agent, in server time, and what is known of the link: gaps, age, clock. Whoever
says hello for a side takes the seat (a restarted agent takes over from itself; a second agent is refused while the
first one is alive). Nothing here waits.
"""

from collections.abc import Callable
from typing import Any

import numpy as np

from netboard import sockets
from netboard.config import SIDES, Side
from netboard.errors import WireError
from netboard.nodes.refusals import Refusals
from netboard.wire.codec import decode, encode
from netboard.wire.messages import (
    Beat,
    ClockRecord,
    Force,
    Goodbye,
    Hello,
    Message,
    Safeguard,
    Stylus,
    Welcome,
)
from netboard.wire.session import ClockEstimator, SequenceGuard, admit

MOST_FRAMES = 64
"""Frames taken in one tick: whoever sends more must not hold it up [1]."""

SANE_NS = 2**60
"""Stamps beyond this, 36 years, are nonsense, and their arithmetic would leave 64 bits [ns]."""

BEAT_TICKS = 4
"""Without forces every so many ticks a beat is sent: often enough that nothing counts as stale [1]."""


class Seat:
    """One side's agent as the server sees it."""

    def __init__(self, side: Side) -> None:
        self.side = side
        self.hello: Hello | None = None
        self.agent = b""
        self.sample: Stylus | None = None
        self.stamp_ns = 0
        self.heard_ns = 0
        self.safeguards = 0
        self.guard = SequenceGuard()
        self.clock = ClockEstimator()
        self.probe: tuple[int, int, int, int] | None = None

    def sit(self, agent: bytes, hello: Hello, now_ns: int) -> None:
        """Take the seat: nothing of an agent before is kept."""
        self.hello, self.agent, self.heard_ns = hello, agent, now_ns
        self.sample, self.safeguards, self.probe = None, 0, None
        self.guard, self.clock = SequenceGuard(), ClockEstimator()

    def leave(self) -> None:
        """Nobody sits here any more."""
        self.hello, self.agent, self.sample = None, b"", None

    def take(self, stylus: Stylus, received_ns: int) -> None:
        """Take a sample: the newest wins, the link is measured."""
        stamps = (stylus.stamp_ns, stylus.force_sent_ns, stylus.force_received_ns, stylus.sent_ns)
        if max(map(abs, stamps)) > SANE_NS or not self.guard.fresh(stylus.seq):
            return
        self.heard_ns = received_ns
        self.safeguards |= stylus.safeguards
        if stylus.force_tick >= 0:
            self.probe = (stylus.force_sent_ns, stylus.force_received_ns, stylus.sent_ns, received_ns)
            self.clock.add(*self.probe)
        self.sample = stylus
        self.stamp_ns = self.clock.to_server(stylus.stamp_ns) if self.clock.known else received_ns

    def live(self, now_ns: int, timeout_ns: int) -> bool:
        """Whether there is a finite sample that is neither too old nor from the future, and the agent still speaks."""
        sample = self.sample
        if sample is None or now_ns - self.heard_ns >= timeout_ns or abs(now_ns - self.stamp_ns) >= timeout_ns:
            return False
        return bool(np.isfinite(sample.z + sample.vz))

    @property
    def armed(self) -> bool:
        """Whether the device may give forces, as the newest sample says."""
        return self.sample is not None and bool(self.sample.safeguards & Safeguard.ARMED)

    def fill(self, row: Any, live: bool) -> None:
        """Write the sample to a row of `netboard.tick.TICK`."""
        side, sample = self.side, self.sample
        row[f"{side}_live"] = live
        if sample is None:
            row[f"{side}_seq"] = -1
            return
        row[f"{side}_seq"] = sample.seq
        row[f"{side}_stamp_ns"] = self.stamp_ns
        row[f"{side}_sent_z"] = sample.z
        row[f"{side}_sent_vz"] = sample.vz
        row[f"{side}_x"] = sample.x
        row[f"{side}_y"] = sample.y
        row[f"{side}_rendered"] = sample.rendered
        row[f"{side}_safeguards"] = self.safeguards
        row[f"{side}_buttons"] = sample.buttons
        row[f"{side}_loop_ns"] = sample.loop_ns
        self.safeguards = 0


class MotionPort:
    """Both seats and the socket.

    Parameters
    ----------
    socket : zmq.Socket
        ROUTER of the motion channel.
    welcome : Welcome
        What an agent is told first.
    timeout_ns : int
        Age at which a sample no longer counts [ns].
    """

    def __init__(self, socket: sockets.Socket, welcome: Welcome, timeout_ns: int) -> None:
        self.seats: dict[Side, Seat] = {side: Seat(side) for side in SIDES}
        self.news: list[tuple[str, dict[str, str]]] = []
        self._socket = socket
        self._welcome = encode(welcome)
        self._timeout_ns = timeout_ns
        self._by_agent: dict[bytes, Seat] = {}
        self._refusals = Refusals(socket, self.news)

    def drain(self, clock: Callable[[], int]) -> None:
        """Take what has arrived; what arrives meanwhile must not seem to come before it was sent, so each has its time.

        Parameters
        ----------
        clock : callable
            Returns the time [ns].
        """
        for _ in range(MOST_FRAMES):
            received = sockets.receive_from(self._socket)
            if received is None:
                return
            now_ns = clock()
            agent, frame = received
            try:
                message = decode(frame)
            except WireError as error:
                self._refusals.refuse(agent, str(error), now_ns)
                continue
            seat = self._by_agent.get(agent)
            if isinstance(message, Stylus) and seat is not None:
                seat.take(message, now_ns)
            else:
                self._other(agent, seat, message, now_ns)

    def fill(self, row: Any, now_ns: int) -> None:
        """Write both seats' samples to a row of `netboard.tick.TICK`."""
        for seat in self.seats.values():
            seat.fill(row, seat.live(now_ns, self._timeout_ns))

    def answer(self, row: Any, felt: bool, now_ns: int) -> None:
        """Send each agent its force, or now and then a beat where nothing is felt."""
        tick = int(row["tick"])
        if not felt and tick % BEAT_TICKS:
            return
        for side, seat in self.seats.items():
            if seat.hello is None:
                continue
            seq = seat.guard.newest
            message = Force(tick, now_ns, seq, float(row[f"{side}_force"])) if felt else Beat(tick, now_ns, seq)
            sockets.send_to(self._socket, seat.agent, encode(message))

    def clock_records(self, seq: int) -> list[ClockRecord]:
        """The newest raw probe of each agent with the estimate so far, numbered from `seq`."""
        records: list[ClockRecord] = []
        for side, seat in self.seats.items():
            if seat.probe is not None:
                clock = seat.clock
                records.append(
                    ClockRecord(seq + len(records), f"agent.{side}", *seat.probe, clock.offset_ns, clock.bound_ns)
                )
        return records

    def goodbye(self, reason: str) -> None:
        """Tell both agents that the session is over, and close."""
        for seat in self.seats.values():
            if seat.hello is not None:
                sockets.send_to(self._socket, seat.agent, encode(Goodbye(reason)))
        sockets.close_after_goodbye(self._socket)

    def _other(self, agent: bytes, seat: Seat | None, message: Message, now_ns: int) -> None:
        match message:
            case Hello():
                self._greet(agent, message, now_ns)
            case Goodbye(reason=reason) if seat is not None:
                self.news.append(("agent_left", {"side": seat.side, "reason": reason}))
                seat.leave()
                del self._by_agent[agent]
            case _ if seat is None:
                self._refusals.refuse(agent, "say hello first", now_ns)
            case _:
                self._refusals.refuse(agent, f"an agent does not send {type(message).__name__}", now_ns)

    def _greet(self, agent: bytes, hello: Hello, now_ns: int) -> None:
        try:
            admit(hello)
        except WireError as error:
            self._refusals.refuse(agent, str(error), now_ns)
            return
        if hello.role != "agent":
            self._refusals.refuse(agent, f"this is the motion channel, not one for a {hello.role}", now_ns)
            return
        seat = next(seat for seat in self.seats.values() if seat.side == hello.side)
        taken = seat.hello is not None and now_ns - seat.heard_ns < self._timeout_ns
        if taken and seat.hello is not None and seat.hello != hello:
            reason = f"the {seat.side} side already has an agent: {seat.hello.name}"
            self._refusals.refuse(agent, reason, now_ns)
            return
        if not sockets.send_to(self._socket, agent, self._welcome):
            return
        if not taken:
            self.news.append(("agent_joined", {"side": seat.side, "name": hello.name, **hello.details}))
        self._by_agent.pop(seat.agent, None)
        seat.sit(agent, hello, now_ns)
        self._by_agent[agent] = seat
