"""The rules of a session without its sockets: who is admitted, what is missing, who is silent, what time it is there.

Each class follows one peer or one stream, is told what happened and when, and answers questions. Nothing here reads a
clock, so the same rules run live, in a simulation and in a test. What a peer does wrong on the way (a lost sample, a
late answer, an impossible stamp) is counted; only a `Hello` that cannot be accepted is a `WireError`.
"""

from collections import deque
from typing import NamedTuple

from netboard.errors import WireError
from netboard.wire.messages import PROTOCOL_VERSION, Hello

NEVER_NS = 2**63 - 1
"""Age of what was never heard, and error bound of a clock that was never probed [ns]."""

_MILLION = 1_000_000

_SEATED = ("agent", "display")


def admit(hello: Hello) -> str:
    """Check a `Hello` and name its sender.

    Parameters
    ----------
    hello : Hello
        What the peer said.

    Returns
    -------
    str
        What the peer is: ``agent.left``, ``display.right``, ``logger``, ``console``.

    Raises
    ------
    WireError
        If it speaks another version of the protocol, or its side does not go with its role; the text says which, and
        is fit for a `Refusal`.
    """
    if hello.protocol != PROTOCOL_VERSION:
        raise WireError(f"the server speaks protocol {PROTOCOL_VERSION}, the {hello.role} {hello.protocol}")
    if (hello.role in _SEATED) != bool(hello.side):
        wanted = "left or right" if hello.role in _SEATED else "no side"
        raise WireError(f"{hello.role} with side {hello.side!r}: expected {wanted}")
    return f"{hello.role}.{hello.side}" if hello.side else hello.role


class SequenceGuard:
    """Follows the numbers of one stream whose source counts from 0 without gaps.

    Attributes
    ----------
    newest : int
        Highest number taken; -1 before the first [1].
    taken : int
        Numbers taken: each was newer than all before it [1].
    stale : int
        Numbers not taken: repeated or overtaken [1].
    missing : int
        Numbers skipped between two that were taken. One that comes after all is stale and stays missing: it was of no
        use [1].
    """

    def __init__(self) -> None:
        self.newest = -1
        self.taken = self.stale = self.missing = 0

    def fresh(self, seq: int) -> bool:
        """Take the number of what has just arrived; False if it is not newer than what came before.

        Parameters
        ----------
        seq : int
            Its number [1].
        """
        if seq <= self.newest:
            self.stale += 1
            return False
        if self.taken:  # what was sent before the first one heard was sent to nobody
            self.missing += seq - self.newest - 1
        self.newest = seq
        self.taken += 1
        return True


class Liveness:
    """Tells whether a peer has been heard of late.

    Parameters
    ----------
    timeout_ns : int
        Silence after which a peer counts as gone [ns].
    """

    def __init__(self, timeout_ns: int) -> None:
        self.timeout_ns = timeout_ns
        self.heard_ns: int | None = None

    def hear(self, now_ns: int) -> None:
        """Note that the peer said something.

        Parameters
        ----------
        now_ns : int
            Present time [ns].
        """
        self.heard_ns = now_ns

    def age_ns(self, now_ns: int) -> int:
        """Time since the peer was last heard; `NEVER_NS` if it never was [ns].

        Parameters
        ----------
        now_ns : int
            Present time [ns].
        """
        return NEVER_NS if self.heard_ns is None else now_ns - self.heard_ns

    def gone(self, now_ns: int) -> bool:
        """Whether the peer has been silent for longer than the timeout, or was never heard.

        Parameters
        ----------
        now_ns : int
            Present time [ns].
        """
        return self.age_ns(now_ns) > self.timeout_ns


class _Probe(NamedTuple):
    """An exchange that is, or may yet become, the best one."""

    rank: int  # twice the bound it would have at time 0, in 1e-6 ns: a whole number, and the same at all times
    t0_ns: int
    offset_ns: int


class ClockEstimator:
    """Offset of a peer's clock, from the four stamps of an exchange, with a bound on its error.

    The server sends at t0, the peer receives at t1 and sends at t2, the server receives at t3; t0 and t3 on the
    server's clock, t1 and t2 on the peer's. A message that takes no negative time puts the offset (peer minus server)
    between t2 - t3 and t1 - t0; the estimate is the middle, the bound half the width, which is half the round trip:
    delay/2 of NTP (RFC 5905). From then on the bound grows with the age of t0 by the largest skew assumed between two
    clocks, NTP's dispersion. The probe with the least bound is used. All bounds grow alike, so which one that is does
    not change with time, and a queue of the probes that may still become the best holds the answer at its head.

    A peer may answer one server stamp several times, or late: the age counts from t0, so the bound stays true. A probe
    whose interval does not meet the present one proves that a clock was stepped or suspended: the estimate starts anew.

    Parameters
    ----------
    window_ns : int
        Probes older than this are forgotten as soon as there is a newer one [ns].
    skew_ppm : int
        Largest skew between two clocks: 100 allows 50 parts per million to each [1e-6].

    Attributes
    ----------
    offset_ns : int
        Estimated peer clock minus server clock; 0 before the first probe [ns].
    bound_ns : int
        Largest possible error of the offset when the newest probe came in; `NEVER_NS` before the first [ns].
    accepted, rejected : int
        Probes used, and impossible ones: a negative round trip, or an answer before its question [1].
    restarts : int
        Times the estimate started anew [1].
    """

    def __init__(self, window_ns: int = 2_000_000_000, skew_ppm: int = 100) -> None:
        self.offset_ns = 0
        self.bound_ns = NEVER_NS
        self.accepted = self.rejected = self.restarts = 0
        self._window_ns = window_ns
        self._skew_ppm = skew_ppm
        self._probes: deque[_Probe] = deque()

    @property
    def known(self) -> bool:
        """Whether there has been a probe."""
        return bool(self._probes)

    def add(self, t0_ns: int, t1_ns: int, t2_ns: int, t3_ns: int) -> bool:
        """Take one exchange; False if it is impossible.

        Parameters
        ----------
        t0_ns : int
            Sent by the server, on its clock [ns].
        t1_ns : int
            Received by the peer, on its clock [ns].
        t2_ns : int
            Sent by the peer, on its clock [ns].
        t3_ns : int
            Received by the server, on its clock [ns].
        """
        highest, lowest = t1_ns - t0_ns, t2_ns - t3_ns
        if highest < lowest or t2_ns < t1_ns:  # together they also rule out t3 before t0
            self.rejected += 1
            return False
        self.accepted += 1
        probes = self._probes
        if probes and not self._meets(lowest, highest, t3_ns):
            probes.clear()
            self.restarts += 1
        new = _Probe((highest - lowest) * _MILLION - 2 * self._skew_ppm * t0_ns, t0_ns, (highest + lowest) // 2)
        while probes and probes[-1].rank >= new.rank:
            probes.pop()
        probes.append(new)
        while probes[0].t0_ns < t3_ns - self._window_ns and len(probes) > 1:
            probes.popleft()
        self.offset_ns = probes[0].offset_ns
        self.bound_ns = self._bound_ns(t3_ns)
        return True

    def to_server(self, peer_ns: int) -> int:
        """Turn a stamp of the peer's clock into server time [ns].

        Parameters
        ----------
        peer_ns : int
            The stamp [ns].
        """
        return peer_ns - self.offset_ns

    def _bound_ns(self, now_ns: int) -> int:
        """Bound of the best probe, rounded up, with 1 ns for the offset's own rounding."""
        return -(-(self._probes[0].rank + 2 * self._skew_ppm * now_ns) // (2 * _MILLION)) + 1

    def _meets(self, lowest: int, highest: int, now_ns: int) -> bool:
        """Whether an offset in a new probe's interval is also within the present bound."""
        bound = self._bound_ns(now_ns)
        return highest >= self.offset_ns - bound and lowest <= self.offset_ns + bound
