"""The server's state of one side's agent: who it is, its clock, and the state of its link.

The newest sample is in the row of words that `netboard.nodes.ports.samples` reads and writes.
"""

from operator import attrgetter

import numpy as np
from numpy.typing import NDArray

from netboard.base.compiled import machine_code
from netboard.base.config import Side
from netboard.network.protocol import fixed
from netboard.network.protocol.clock_estimator import ClockEstimator
from netboard.network.protocol.control import LinkStatus
from netboard.network.protocol.joining import Hello
from netboard.network.protocol.motion import Stylus
from netboard.nodes.ports import samples
from netboard.nodes.ports.peer import CountRate, link_status

PROBE_TICKS = 4
"""Ticks between two clock probes, which samples carry [1]."""

_VALUES = attrgetter(*(name for name, _ in fixed.fields_of(Stylus)))
_PACK = fixed.packer_of(Stylus)


class AgentState:
    """The server's state of one side's agent."""

    def __init__(self, side: Side, words: NDArray[np.int64]) -> None:
        self.side = side
        self.hello: Hello | None = None
        self.peer = b""
        self.connection = ""
        self.clock = ClockEstimator()
        self.probe: tuple[int, int, int, int] | None = None
        self._words = words
        self._sample = np.zeros(samples.SAMPLE_WORDS, np.int64)
        self._take = machine_code(samples.take, words, self._sample, 0, 0)
        self._probed_tick = -PROBE_TICKS
        self._rate = CountRate()

    def register(self, peer: bytes, hello: Hello, now_ns: int) -> None:
        """Register an agent, and forget the one before."""
        self.leave()
        self.hello, self.peer = hello, peer
        self._words[samples.ARRIVED] = now_ns

    def leave(self) -> None:
        """Remove the agent."""
        self.hello, self.peer, self.connection, self.probe = None, b"", "", None
        self.clock, self._probed_tick = ClockEstimator(), -PROBE_TICKS
        self._rate = CountRate()
        samples.empty(self._words)

    def take(self, stylus: Stylus, now_ns: int, due_ns: int) -> None:
        """Take a sample that did not come in its fixed form."""
        _PACK.pack_into(self._sample.data, 0, *_VALUES(stylus))
        if self._take(self._words, self._sample, now_ns, due_ns):
            self.probe_clock()

    def probe_clock(self) -> None:
        """Use the newest sample, if there is one, as a clock probe if it answers a new tick; one in `PROBE_TICKS`."""
        tick = int(self._words[samples.FORCE_TICK])
        if not self._words[samples.TAKEN]:
            return
        if tick - self._probed_tick >= PROBE_TICKS or tick < self._probed_tick:
            self._probe(tick, int(self._words[samples.ARRIVED]))

    def _probe(self, tick: int, now_ns: int) -> None:
        words, clock = self._words, self.clock
        sent, received, answered = (int(words[at]) for at in (samples.FORCE_SENT, samples.FORCE_RECEIVED, samples.SENT))
        probe = (sent, received, answered, now_ns)
        self._probed_tick = tick
        if clock.add(*probe):
            self.probe = probe
            words[samples.OFFSET], words[samples.CLOCK_KNOWN] = clock.offset_ns, True
            # Of the sample that brought the probe, too, because the next tick uses it.
            words[samples.SERVER_STAMP] = words[samples.AGENT_STAMP] - clock.offset_ns
            words[samples.TRANSIT] = clock.round_trip_ns // 2

    def silent_ns(self, now_ns: int) -> int:
        """Time since the last sample [ns]."""
        return now_ns - int(self._words[samples.ARRIVED])

    def link(self, now_ns: int) -> LinkStatus | None:
        """Return the state of the link, or None without an agent."""
        if self.hello is None:
            return None
        rate = self._rate.of(int(self._words[samples.TAKEN]), now_ns)
        return link_status(self.hello, self.clock, self.silent_ns(now_ns), rate, int(self._words[samples.MISSING]))
