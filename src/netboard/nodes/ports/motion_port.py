"""The server's endpoint of the motion channel, to which one agent connects for each side.

An agent registers for a side with `Hello`. A restarted agent replaces itself; a second agent is refused while the first
is alive. Nothing here waits.

At a side without a person the device gets no force and is not armed: the forces of the stage are those of another hand
than the one that may hold it.

No peer can hold up a tick. Compiled code keeps frames of unregistered peers, a few a second for each, and they are
handled after the tick, a few at a time. Of a registered agent, frames other than fixed-form samples are rate-limited.
"""

from collections.abc import Callable, Collection
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

from netboard.base.compiled import machine_code
from netboard.base.config import SIDES, Side
from netboard.base.errors import WireError
from netboard.base.tick import HEARTBEAT_TICKS, TICK_WORDS
from netboard.network.protocol.codec import decode, encode, kind_of
from netboard.network.protocol.control import LinkStatus
from netboard.network.protocol.joining import HELLO_FIRST, Goodbye, Hello, Welcome
from netboard.network.protocol.messages import sent_by
from netboard.network.protocol.motion import Backfill, BackfillRequest, Stylus
from netboard.network.protocol.records import ClockRecord
from netboard.network.transport import endpoints, fastpath
from netboard.nodes.ports import samples
from netboard.nodes.ports.agent_state import AgentState
from netboard.nodes.ports.emergency import AWAITING_ARMING
from netboard.nodes.ports.peer import Probes, admit
from netboard.nodes.ports.peer_events import News, PeerEvents
from netboard.nodes.ports.refusals import TOO_MANY_MESSAGES, Refusals

SILENCE_TIMEOUT_NS = 2_000_000_000
"""Silence after which an agent has left [ns]."""

ALLOWED_MESSAGES = sent_by("agent")
"""Messages that an agent may send; others are refused without decoding."""

MAX_OTHER_FRAMES = 4
"""Frames of registered agents, other than fixed-form samples, taken at once [1]."""

OTHER_FRAME_INTERVAL_NS, OTHER_FRAME_BURST = 500_000, 64
"""Shortest mean interval [ns] and burst [1] of those frames from each agent; a burst follows a gap in its link."""

MAX_UNREGISTERED_AT_ONCE = 3
"""Frames of unregistered peers handled after a tick [1]."""


class MotionPort:
    """The state of both agents, and the socket.

    ``timeout_ns``: age from which a sample no longer counts [ns]. ``bound_ns``: largest error bound of an agent's clock
    with which its device may be armed [ns]. ``ends``: `netboard.nodes.ports.samples.ends_of` if agents compute their
    own forces, else None.
    """

    def __init__(
        self,
        router: endpoints.Router,
        welcome: Welcome,
        timeout_ns: int,
        bound_ns: int,
        ends: NDArray[np.float64] | None = None,
    ) -> None:
        self.fast = fastpath.FastPath(router.socket, router.keyed)
        self._motion = samples.motion_of(self.fast.record)
        pairs = zip(SIDES, self._motion.agents, strict=True)
        self.agents: dict[Side, AgentState] = {side: AgentState(side, words) for side, words in pairs}
        self.news: News = []
        self.backfills: list[tuple[Side, Backfill]] = []
        self.may_arm = True
        self._people: tuple[Side, ...] = SIDES
        self._router = router
        self._welcome = encode(welcome)
        self._timeout_ns = timeout_ns
        self._bound_ns = bound_ns
        self._by_peer: dict[bytes, AgentState] = {}
        self.refusals = Refusals(router, self.news)
        self._peer_events = PeerEvents(self.news)
        self._handled = 0  # of the kept frames of unregistered peers
        self._other_frames_ns = dict.fromkeys(SIDES, 0)
        self._probes = Probes()
        self._ends = ends
        self.gains = np.ones(len(SIDES))
        # Compiled now, so that no sample is delayed.
        row, no_ends = np.zeros(len(TICK_WORDS), np.int64), np.zeros((len(SIDES), 3))
        self._drain = machine_code(samples.drain, self._motion, 0, False, 0)
        self._awaited = machine_code(samples.awaited, self._motion.agents)
        self._fill = machine_code(samples.fill, row, self._motion.agents, 0, 0, 0, 0)
        self._send_forces = machine_code(samples.send_forces, self._motion, row, row, self.gains)
        self._send_points = machine_code(samples.send_points, self._motion, row, self.gains, no_ends)
        self._send_heartbeats = machine_code(samples.send_heartbeats, self._motion, 0, 0)

    @property
    def empty(self) -> bool:
        """Whether no agent is registered."""
        return not self._by_peer

    @property
    def unhandled(self) -> bool:
        """Whether frames of unregistered peers wait to be handled."""
        return bool(self._motion.unregistered[0]["kept"])

    def drain(self, clock: Callable[[], int], due_ns: int, *, signalled: bool = False) -> bool:
        """Take what has arrived; return whether each side that was punctual at the last tick has sent a new sample.

        ``signalled``: take frames only until then, because a tick can begin, and leave all else for the next call.
        """
        most, most_others = samples.MAX_FRAMES, MAX_OTHER_FRAMES
        while most > 0 and most_others > 0:
            found = self._drain(self._motion, due_ns, signalled, most)
            if not found & (samples.OTHER | samples.FAILED):
                break
            if found & samples.FAILED:
                self.fast.raise_failure("motion")
            self.read_other_frame(clock(), due_ns)
            most -= found // samples.FRAMES
            most_others -= 1
        if not signalled:
            self.probe_clocks()
        return not self._awaited(self._motion.agents)

    def probe_clocks(self) -> None:
        """Use the newest samples as clock probes."""
        for agent in self.agents.values():
            agent.probe_clock()

    def attend(self, now_ns: int, due_ns: int) -> None:
        """Handle a few frames of unregistered peers, and count those that were dropped."""
        unregistered = self._motion.unregistered[0]
        stop = min(int(unregistered["kept"]), self._handled + MAX_UNREGISTERED_AT_ONCE)
        for row in range(self._handled, stop):
            kept = unregistered["frames"][row]
            frame = kept["frame"][: kept["size"]].tobytes()
            self._handle(*self._router.checked(*fastpath.sender_of(kept), frame), now_ns, due_ns)
        self._handled = stop
        if stop == unregistered["kept"]:
            unregistered["kept"] = self._handled = 0
        if unregistered["dropped"]:
            self.refusals.note("strangers", TOO_MANY_MESSAGES, now_ns, int(unregistered["dropped"]))
            unregistered["dropped"] = 0

    def fill(self, row: NDArray[np.int64], number: int, due_ns: int, late_ns: int) -> int:
        """Begin the row of a tick with both sides' samples; see `netboard.nodes.ports.samples.fill`."""
        return self._fill(row, self._motion.agents, number, due_ns, late_ns, self._timeout_ns)

    def undisturbed_ticks(
        self, ticks: Callable[..., int], stage: tuple[Any, ...], run: Any, delay: int
    ) -> Callable[[], int]:
        """Return a call that runs undisturbed ticks; see `netboard.nodes.server.server_runs`, also for its result."""
        self._permit()
        return partial(ticks, self._motion, self.gains, stage, run, delay, self._timeout_ns)

    def force(self, row: NDArray[np.int64], commanded: NDArray[np.int64]) -> None:
        """Send each agent its commanded force of a tick, or the board's state from which it computes the force.

        An agent at a side without a person gets nothing; it needs heartbeats.

        ``commanded``: words of the row with the commanded force (`netboard.stage.stage.Stage.commanded_row`).
        """
        self._permit()
        if self._ends is None:
            sent = self._send_forces(self._motion, row, commanded, self.gains)
        else:
            sent = self._send_points(self._motion, row, self.gains, self._ends)
        if sent == fastpath.FAILED:
            self.fast.raise_failure("motion")

    def _permit(self) -> None:
        """Note for compiled code whose hand is a person's, and whose device may be armed."""
        for words, agent in zip(self._motion.agents, self.agents.values(), strict=True):
            words[samples.PERSON] = agent.side in self._people
            words[samples.ARM] = self.may_arm and words[samples.PERSON] and agent.clock.bound_ns <= self._bound_ns

    @property
    def loops_ns(self) -> list[int]:
        """Newest sample-to-force latency of each hand, 0 if not yet known [ns]."""
        return [int(words[samples.LOOP]) for words in self._motion.agents]

    def send_heartbeat(self, tick: int, at_once: bool = False, sides: Collection[Side] = SIDES) -> None:
        """Send each agent of these sides a heartbeat, which commands no force: every `HEARTBEAT_TICKS` or at once."""
        if tick % HEARTBEAT_TICKS and not at_once:
            return
        self._permit()
        places = sum(1 << SIDES.index(side) for side in sides)
        if self._send_heartbeats(self._motion, tick, places) == fastpath.FAILED:
            self.fast.raise_failure("motion")

    def find_missing(self, now_ns: int, needed: Collection[Side]) -> list[str]:
        """Return what a block waits for at the agents of these sides."""
        missing = []
        for place, (side, agent) in enumerate(self.agents.items()):
            if side not in needed:
                continue
            if not self._motion.agents[place, samples.TAKEN] or agent.silent_ns(now_ns) >= self._timeout_ns:
                missing.append(f"the {side} agent")
            elif agent.clock.bound_ns > self._bound_ns:
                known = f"{agent.clock.bound_ns * 1e-6:.2f} ms" if agent.clock.known else "unknown"
                limit = f"{self._bound_ns * 1e-6:g} ms"
                missing.append(f"the {side} agent's clock offset to be known within {limit} (now {known})")
            elif not self._motion.agents[place, samples.SAFEGUARDS] & samples.ARMED_BIT:
                missing.append(f"the {side} {AWAITING_ARMING}")
        return missing

    def ask(self, side: Side, request: BackfillRequest) -> None:
        """Ask a side's agent, if there is one, what it rendered while its samples did not arrive."""
        peer = self.agents[side].peer
        if peer:
            self._router.send(peer, encode(request))

    def knows_clock(self, side: Side) -> bool:
        """Return whether a side has an agent whose clock is known well enough."""
        agent = self.agents[side]
        return agent.hello is not None and agent.clock.bound_ns <= self._bound_ns

    def expire(self, now_ns: int) -> None:
        """Remove agents that have been silent too long, and send messages that could not be sent before."""
        self._router.send_queued()
        self.refusals.poll(now_ns)
        for agent in self.agents.values():
            if agent.hello is not None and agent.silent_ns(now_ns) > SILENCE_TIMEOUT_NS:
                self._leave(agent, "fell silent", now_ns)

    def clock_records(self, seq: int) -> list[ClockRecord]:
        """Return the newest raw probe of each agent with the current estimate, numbered from `seq`."""
        return self._probes.records(self.agents.values(), seq)

    def links(self, now_ns: int) -> list[LinkStatus]:
        """Return the connections of the agents."""
        return [link for agent in self.agents.values() if (link := agent.link(now_ns)) is not None]

    def renew(self, welcome: Welcome, ends: NDArray[np.float64], people: tuple[Side, ...] = SIDES) -> None:
        """Send the welcome of a new block to both agents. ``people``: the sides whose hand is a person's."""
        self._welcome, self._ends, self._people = encode(welcome), ends, people
        for agent in self.agents.values():
            if agent.hello is not None:
                self._router.send_or_queue(agent.peer, self._welcome)

    def goodbye(self, reason: str) -> None:
        """Tell both agents that the session is over, and close."""
        for agent in self.agents.values():
            if agent.hello is not None:
                self._router.send(agent.peer, encode(Goodbye(reason)))
        self.fast.close()
        self._router.close_after_goodbye()

    def read_other_frame(self, now_ns: int, due_ns: int) -> None:
        """Handle a registered agent's frame that is not a fixed-form sample, unless it sends too many."""
        peer, frame = self._router.checked(*self.fast.sender, self._motion.frame[: self.fast.size].tobytes())
        agent = self._by_peer.get(peer)
        if agent is not None:
            next_ns = max(self._other_frames_ns[agent.side], now_ns) + OTHER_FRAME_INTERVAL_NS
            if next_ns - now_ns > OTHER_FRAME_BURST * OTHER_FRAME_INTERVAL_NS:
                self.refusals.refuse(peer, TOO_MANY_MESSAGES, now_ns)
                return
            self._other_frames_ns[agent.side] = next_ns
        self._handle(peer, frame, now_ns, due_ns)

    def _handle(self, peer: bytes, frame: bytes, now_ns: int, due_ns: int) -> None:
        if (peer, frame) == endpoints.REFUSED:
            return
        agent = self._by_peer.get(peer)
        try:
            kind = kind_of(frame)
            if kind not in ALLOWED_MESSAGES:
                raise WireError(f"an agent does not send {kind.__name__}" if agent else HELLO_FIRST)
            if agent is None and kind is not Hello:
                raise WireError(HELLO_FIRST)
            match decode(frame):
                case Hello() as hello:
                    self._greet(peer, hello, now_ns)
                case Stylus() as stylus if agent is not None:
                    agent.take(stylus, now_ns, due_ns)
                case Goodbye(reason=reason) if agent is not None:
                    self._leave(agent, reason, now_ns)
                case Backfill() as backfill if agent is not None:
                    # At most two are kept, so that an agent that repeats its answer cannot fill the memory.
                    self.backfills = [*self.backfills[-1:], (agent.side, backfill)]
        except WireError as error:
            self.refusals.refuse(peer, str(error), now_ns)

    def _leave(self, agent: AgentState, reason: str, now_ns: int) -> None:
        self._peer_events.add("agent_left", {"side": agent.side, "reason": reason}, now_ns)
        del self._by_peer[agent.peer]
        self._router.drop_queued(agent.peer)
        self.fast.unregister(SIDES.index(agent.side))
        agent.leave()

    def _greet(self, peer: bytes, hello: Hello, now_ns: int) -> None:
        admit(hello, self._router, ("agent",))
        agent = next(agent for agent in self.agents.values() if agent.side == hello.side)
        registered = self._by_peer.get(peer, agent)
        if registered is not agent:
            raise WireError(f"it is the {registered.side} side's agent already")
        present = agent.hello if agent.silent_ns(now_ns) < self._timeout_ns else None
        if present is not None and present != hello:
            raise WireError(f"the {agent.side} side already has an agent: {present.name}")
        # Not registered: an agent that was not welcomed sends no samples, and says hello again.
        if not self._router.send(peer, self._welcome):
            return
        if present is None:
            self._peer_events.add_with_details(hello, "agent_joined", {"side": agent.side, "name": hello.name}, now_ns)
        self._by_peer.pop(agent.peer, None)
        agent.register(peer, hello, now_ns)
        self._by_peer[peer] = agent
        self.fast.register(SIDES.index(agent.side), peer, self._router.key)
