"""The server's endpoint of the motion channel, with one seat for each side's agent.

A seat holds the newest sample of its agent, in server time, and the state of the link: gaps, age, clock. An agent
registers for a side with `Hello`. A restarted agent replaces itself; a second agent is refused while the first is
alive. Nothing here waits.

No peer can hold up a tick. Compiled code keeps frames of unregistered peers, a few a second for each, and they are
handled after the tick, a few at a time. Of a registered agent, frames other than fixed-form samples are rate-limited.
"""

from collections.abc import Callable, Collection
from operator import attrgetter
from typing import Any

import numpy as np

from netboard.base.config import SIDES, Side
from netboard.base.errors import WireError
from netboard.network.protocol import fixed
from netboard.network.protocol.admission import admit
from netboard.network.protocol.clock_estimator import ClockEstimator
from netboard.network.protocol.codec import decode, encode, kind_of
from netboard.network.protocol.joining import HELLO_FIRST, Goodbye, Hello, Welcome
from netboard.network.protocol.messages import Message
from netboard.network.protocol.motion import Backfill, BackfillRequest, Beat, Stylus
from netboard.network.protocol.records import ClockRecord
from netboard.network.transport import endpoints, fastpath, sockets
from netboard.nodes.ports import samples
from netboard.nodes.ports.arrivals import Comings, News
from netboard.nodes.ports.crowd import CROWD
from netboard.nodes.ports.peer import Link, Probes, Rate, link_of
from netboard.nodes.ports.refusals import CROWDED, Refusals

BEAT_TICKS = 4
"""Ticks between two heartbeats while no forces are sent, so that nothing becomes stale [1]."""

PROBE_TICKS = 4
"""Ticks between two clock probes, which samples carry [1]."""

GONE_NS = 2_000_000_000
"""Silence after which an agent has left [ns]."""

MAY_SAY: frozenset[type[Message]] = frozenset((Hello, Stylus, Goodbye, Backfill))
"""Messages that an agent may send; others are refused without decoding."""

MOST_ODD = 4
"""Frames of registered agents, other than fixed-form samples, taken at once [1]."""

ODD_NS, ODD_AT_ONCE = 500_000, 64
"""Shortest mean interval [ns] and burst [1] of those frames from each agent; a burst follows a gap in its link."""

MOST_STRANGERS = 3
"""Frames of unregistered peers handled after a tick [1]."""

_VALUES = attrgetter(*(name for name, _ in fixed.fields_of(Stylus)))
_PACK = fixed.packer_of(Stylus)


class Seat:
    """The server's state of one side's agent."""

    def __init__(self, side: Side, words: Any) -> None:
        self.side = side
        self.hello: Hello | None = None
        self.agent = b""
        self.connection = ""
        self.clock = ClockEstimator()
        self.probe: tuple[int, int, int, int] | None = None
        self._words = words
        self._sample = np.zeros(samples.SAMPLE_WORDS, np.int64)
        self._probed_tick = -PROBE_TICKS
        self._rate = Rate()
        samples.empty(words)

    def sit(self, agent: bytes, hello: Hello, now_ns: int) -> None:
        """Register an agent, and forget the one before."""
        self.leave()
        self.hello, self.agent = hello, agent
        self._words[samples.ARRIVED] = now_ns

    def leave(self) -> None:
        """Remove the agent."""
        self.hello, self.agent, self.connection, self.probe = None, b"", "", None
        self.clock, self._probed_tick = ClockEstimator(), -PROBE_TICKS
        self._rate = Rate()
        samples.empty(self._words)

    def take(self, stylus: Stylus, now_ns: int, due_ns: int) -> None:
        """Take a sample that did not come in its fixed form."""
        _PACK.pack_into(self._sample.data, 0, *_VALUES(stylus))
        if samples.take(self._words, self._sample, now_ns, due_ns):
            self.look_at_clock()

    def look_at_clock(self) -> None:
        """Use the newest sample as a clock probe if it answers a new tick, at most every `PROBE_TICKS`."""
        tick = int(self._words[samples.FORCE_TICK])
        if tick - self._probed_tick >= PROBE_TICKS or tick < self._probed_tick:
            self._probe(tick, int(self._words[samples.ARRIVED]))

    def _probe(self, tick: int, now_ns: int) -> None:
        """Use the newest sample as a clock probe."""
        words, clock = self._words, self.clock
        sent, received, answered = (int(words[at]) for at in (samples.FORCE_SENT, samples.FORCE_RECEIVED, samples.SENT))
        probe = (sent, received, answered, now_ns)
        self._probed_tick = tick
        if clock.add(*probe):
            self.probe = probe
            words[samples.OFFSET], words[samples.CLOCK_KNOWN] = clock.offset_ns, True
            words[samples.STAMP] = words[samples.STAMPED] - clock.offset_ns
            words[samples.TRANSIT] = clock.round_trip_ns // 2

    def silent_ns(self, now_ns: int) -> int:
        """Time since the last sample [ns]."""
        return now_ns - int(self._words[samples.ARRIVED])

    def link(self, now_ns: int) -> Link | None:
        """Return the state of the link, or None without an agent."""
        if self.hello is None:
            return None
        rate = self._rate.of(int(self._words[samples.TAKEN]), now_ns)
        return link_of(self.hello, self.clock, self.silent_ns(now_ns), rate, int(self._words[samples.MISSING]))


class MotionPort:
    """Both seats and the socket.

    Parameters
    ----------
    timeout_ns : int
        Age from which a sample no longer counts [ns].
    bound_ns : int
        Largest error bound of an agent's clock with which its device may be armed [ns].
    ends : ndarray of float64, shape (2, 3), or None
        For agents that compute their own forces (`netboard.nodes.ports.samples.ends_of`); else None.
    """

    def __init__(
        self, router: endpoints.Router, welcome: Welcome, timeout_ns: int, bound_ns: int, ends: Any = None
    ) -> None:
        self._words = np.zeros((len(SIDES), samples.WORDS), np.int64)
        self.seats: dict[Side, Seat] = {side: Seat(side, self._words[place]) for place, side in enumerate(SIDES)}
        self.news: News = []
        self.backfills: list[tuple[Side, Backfill]] = []
        self.may_arm = True
        self.fast = fastpath.FastPath(router.socket, router.keyed)
        self._router = router
        self._frame = np.zeros(sockets.LARGEST_SAMPLE, np.uint8)
        self._sample = np.zeros(samples.SAMPLE_WORDS, np.int64)
        self._welcome = encode(welcome)
        self._timeout_ns = timeout_ns
        self._bound_ns = bound_ns
        self._by_agent: dict[bytes, Seat] = {}
        self.refusals = Refusals(router, self.news)
        self._comings = Comings(self.news)
        self._crowd = np.zeros(1, CROWD)
        self._looked_at = 0
        self._odd_ns = dict.fromkeys(SIDES, 0)
        self._probes = Probes()
        self._force = np.zeros(fixed.FORCE.size, np.uint8)
        self._force_words = np.zeros(len(fixed.FORCE.markers), np.int64)
        self._ends = ends
        self.gains = np.ones(len(SIDES))
        self._point = np.zeros(fixed.POINT.size, np.uint8)
        self._point_words = np.zeros(len(fixed.POINT.markers), np.int64)

    @property
    def empty(self) -> bool:
        """Whether no agent is registered."""
        return not self._by_agent

    @property
    def unheard(self) -> bool:
        """Whether frames of unregistered peers wait to be handled."""
        return bool(self._crowd[0]["kept"])

    @property
    def complete(self) -> bool:
        """Whether each side that was punctual at the last tick has sent a new sample, so that waiting gains nothing."""
        return not samples.awaited(self._words)

    def drain(self, clock: Callable[[], int], due_ns: int, signalled: bool = False) -> None:
        """Take what has arrived.

        Parameters
        ----------
        signalled : bool
            The socket has signalled: take frames only until the tick is complete.
        """
        left, odd = samples.MOST_FRAMES, MOST_ODD
        while left > 0 and odd > 0:
            form = fixed.STYLUS[:2]
            found = samples.drain(
                *(self._words, self.fast.record, self._frame, *form, self._sample, due_ns, signalled, left, self._crowd)
            )
            for place, seat in enumerate(self.seats.values()):
                if found & (1 << place):
                    seat.look_at_clock()
            if found & samples.FAILED:
                self.fast.fail("motion")
            if not found & samples.OTHER:
                return
            self._read_odd(clock(), due_ns)
            left -= found // samples.FRAMES
            odd -= 1

    def attend(self, now_ns: int, due_ns: int) -> None:
        """Handle a few frames of unregistered peers, and count those that were dropped."""
        crowd = self._crowd[0]
        last = min(int(crowd["kept"]), self._looked_at + MOST_STRANGERS)
        for row in range(self._looked_at, last):
            stranger = crowd["strangers"][row]
            frame = stranger["frame"][: stranger["size"]].tobytes()
            self._hear(*self._router.checked(*fastpath.sender_of(stranger), frame), now_ns, due_ns)
        self._looked_at = last
        if last == crowd["kept"]:
            crowd["kept"] = self._looked_at = 0
        if crowd["dropped"]:
            self.refusals.note("strangers", CROWDED, now_ns, int(crowd["dropped"]))
            crowd["dropped"] = 0

    def fill(self, row: Any, number: int, due_ns: int, late_ns: int) -> int:
        """Begin the row of a tick with both sides' samples; see `netboard.nodes.ports.samples.fill`."""
        return samples.fill(row, self._words, number, due_ns, late_ns, self._timeout_ns)

    def force(self, row: Any, told: Any) -> None:
        """Send each agent its commanded force of a tick, or the board's state from which it computes the force.

        Parameters
        ----------
        told : ndarray of int64
            Words of the row with the commanded force (`netboard.stage.stage.Stage.commanded_row`).
        """
        fast, seated, gains = self.fast.record, self._words, self.gains
        if self._ends is None:
            form, words = fixed.FORCE[:2], self._force_words
            sent = samples.send_forces(fast, self._force, row, told, seated, gains, *form, words)
        else:
            form, words = fixed.POINT[:2], self._point_words
            sent = samples.send_points(fast, self._point, row, seated, gains, self._ends, *form, words)
        if sent == fastpath.FAILED:
            self.fast.fail("motion")

    @property
    def loops_ns(self) -> list[int]:
        """Newest sample-to-force latency of each hand, 0 if not yet known [ns]."""
        return [int(words[samples.LOOP]) for words in self._words]

    def beat(self, tick: int, now_ns: int, at_once: bool = False) -> None:
        """Send each agent a heartbeat, which commands no force: every `BEAT_TICKS` or at once."""
        if tick % BEAT_TICKS and not at_once:
            return
        for place, seat in enumerate(self.seats.values()):
            if seat.hello is not None:
                seq, lead_ns = int(self._words[place, samples.SEQ]), int(self._words[place, samples.LEAD])
                arm = self.may_arm and seat.clock.bound_ns <= self._bound_ns
                self._router.send(seat.agent, encode(Beat(tick, now_ns, seq, lead_ns, arm)))

    def lacks(self, now_ns: int, needed: Collection[Side]) -> list[str]:
        """Return what is missing of the agents of these sides."""
        lacking = []
        for place, (side, seat) in enumerate(self.seats.items()):
            if side not in needed:
                continue
            if not self._words[place, samples.TAKEN] or seat.silent_ns(now_ns) >= self._timeout_ns:
                lacking.append(f"the {side} agent")
            elif seat.clock.bound_ns > self._bound_ns:
                known = f"{seat.clock.bound_ns * 1e-6:.2f} ms" if seat.clock.known else "nothing yet"
                lacking.append(f"the {side} agent's clock to {self._bound_ns * 1e-6:g} ms (known to {known})")
            elif not self._words[place, samples.SAFEGUARDS] & samples.ARMED_BIT:
                lacking.append(f"the {side} device to be armed")
        return lacking

    def ask(self, side: Side, request: BackfillRequest) -> None:
        """Ask a side's agent, if there is one, what it rendered while its samples did not arrive."""
        agent = self.seats[side].agent
        if agent:
            self._router.send(agent, encode(request))

    def knows_clock(self, side: Side) -> bool:
        """Return whether a side has an agent whose clock is known well enough."""
        seat = self.seats[side]
        return seat.hello is not None and seat.clock.bound_ns <= self._bound_ns

    def expire(self, now_ns: int) -> None:
        """Remove agents that have been silent too long; they say hello when they are back.

        Messages that an agent could not be sent before are sent now.
        """
        self._router.pay()
        self.refusals.look(now_ns)
        for seat in self.seats.values():
            if seat.hello is not None and seat.silent_ns(now_ns) > GONE_NS:
                self._leave(seat, "fell silent", now_ns)

    def clock_records(self, seq: int) -> list[ClockRecord]:
        """Return the newest raw probe of each agent with the current estimate, numbered from `seq`."""
        return self._probes.records(self.seats.values(), seq)

    def links(self, now_ns: int) -> list[Link]:
        """Return the connections of the agents."""
        return [link for seat in self.seats.values() if (link := seat.link(now_ns)) is not None]

    def renew(self, welcome: Welcome, ends: Any) -> None:
        """Send the welcome of a new block to both agents."""
        self._welcome, self._ends = encode(welcome), ends
        for seat in self.seats.values():
            if seat.hello is not None:
                self._router.owe(seat.agent, self._welcome)

    def goodbye(self, reason: str) -> None:
        """Tell both agents that the session is over, and close."""
        for seat in self.seats.values():
            if seat.hello is not None:
                self._router.send(seat.agent, encode(Goodbye(reason)))
        self.fast.close()
        self._router.close_after_goodbye()

    def _read_odd(self, now_ns: int, due_ns: int) -> None:
        """Handle a registered agent's frame that is not a fixed-form sample, unless it sends too many."""
        agent, frame = self._router.checked(*self.fast.sender, self._frame[: self.fast.size].tobytes())
        seat = self._by_agent.get(agent)
        if seat is not None:
            spent_ns = max(self._odd_ns[seat.side], now_ns) + ODD_NS
            if spent_ns - now_ns > ODD_AT_ONCE * ODD_NS:
                self.refusals.refuse(agent, CROWDED, now_ns)
                return
            self._odd_ns[seat.side] = spent_ns
        self._hear(agent, frame, now_ns, due_ns)

    def _hear(self, agent: bytes, frame: bytes, now_ns: int, due_ns: int) -> None:
        """Handle a frame of any peer."""
        if (agent, frame) == endpoints.NOBODY:
            return
        seat = self._by_agent.get(agent)
        try:
            kind = kind_of(frame)
            if kind not in MAY_SAY:
                raise WireError(f"an agent does not send {kind.__name__}" if seat else HELLO_FIRST)
            if seat is None and kind is not Hello:
                raise WireError(HELLO_FIRST)
            match decode(frame):
                case Hello() as hello:
                    self._greet(agent, hello, now_ns)
                case Stylus() as stylus if seat is not None:
                    seat.take(stylus, now_ns, due_ns)
                case Goodbye(reason=reason) if seat is not None:
                    self._leave(seat, reason, now_ns)
                case Backfill() as backfill if seat is not None:
                    # At most two are kept, so that an agent that repeats its answer cannot fill the memory.
                    self.backfills = [*self.backfills[-1:], (seat.side, backfill)]
        except WireError as error:
            self.refusals.refuse(agent, str(error), now_ns)

    def _leave(self, seat: Seat, reason: str, now_ns: int) -> None:
        self._comings.tell("agent_left", {"side": seat.side, "reason": reason}, now_ns)
        del self._by_agent[seat.agent]
        self.fast.forget(SIDES.index(seat.side))
        seat.leave()

    def _greet(self, agent: bytes, hello: Hello, now_ns: int) -> None:
        admit(hello)
        if hello.role != "agent":
            raise WireError(f"this is the motion channel, not one for a {hello.role}")
        if reason := self._router.forbids(hello.role, hello.side):
            raise WireError(reason)
        seat = next(seat for seat in self.seats.values() if seat.side == hello.side)
        before = self._by_agent.get(agent, seat)
        if before is not seat:
            raise WireError(f"it is the {before.side} side's agent already")
        taken = seat.hello is not None and seat.silent_ns(now_ns) < self._timeout_ns
        if taken and seat.hello is not None and seat.hello != hello:
            raise WireError(f"the {seat.side} side already has an agent: {seat.hello.name}")
        if not self._router.send(agent, self._welcome):
            return
        if not taken:
            self._comings.tell("agent_joined", {"side": seat.side, "name": hello.name, **hello.details}, now_ns)
        self._by_agent.pop(seat.agent, None)
        seat.sit(agent, hello, now_ns)
        self._by_agent[agent] = seat
        self.fast.know(SIDES.index(seat.side), agent, self._router.key)
