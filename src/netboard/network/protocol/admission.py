"""The rules of a session without its sockets: who is admitted, what is missing, who is silent, what time it is there.

Each class follows one peer or one stream, is told what happened and when, and answers questions. Nothing here reads a
clock, so the same rules run live, in a simulation and in a test. What a peer does wrong on the way (a lost sample, a
late answer, an impossible stamp) is counted; only a `Hello` that cannot be accepted is a `WireError`.
"""

import math
from collections import deque
from typing import NamedTuple

from netboard.base.errors import WireError
from netboard.network.protocol.joining import Hello
from netboard.network.protocol.messages import PROTOCOL_VERSION

NEVER_NS = 2**63 - 1
"""Age of what was never heard, and error bound of a clock that was never probed [ns]."""

FAR_NS = 2**61
"""Clocks further apart than this, 73 years, are nonsense; nearer, every figure of an estimate fits 64 bits [ns]."""

_MILLION = 1_000_000

_SPANS = 8
_POINT_NS = 4_000_000_000
_POINTS = 64
_DRIFT_KNOWN_PPM = 10.0

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
        What the peer is: ``agent.left``, ``display.right``, ``logger``, ``console``, ``listener``.

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


class _Span(NamedTuple):
    """The best that the probes of an eighth of the window say: the limits of the offset as they would be at time 0."""

    until_ns: int
    upper: int
    lower: int
    round_trip_ns: int


class _Point(NamedTuple):
    """What the estimate was at a time."""

    at_ns: int
    offset_ns: int
    bound_ns: int


_NOTHING = _Span(NEVER_NS, NEVER_NS, -NEVER_NS, NEVER_NS)


class ClockEstimator:
    """Offset of a peer's clock, from the four stamps of an exchange, with a bound on its error.

    The server sends at t0, the peer receives at t1 and sends at t2, the server receives at t3; t0 and t3 on the
    server's clock, t1 and t2 on the peer's. A message takes no negative time: t1 - t0 is an upper limit of the offset
    (peer minus server), t2 - t3 a lower one. Both loosen with age, by the largest skew assumed between two clocks: the
    upper one from t0 on, the lower one from t3 on, however late the answer. The estimate is the middle between the
    tightest limits of the window, which need not be of one probe, and the bound is half their distance: with a single
    probe delay/2 and dispersion of NTP (RFC 5905). All limits loosen alike, so the tightest stays the tightest.

    A probe whose limits contradict those before proves that a clock was stepped, suspended or ran away: the estimate
    starts anew. A step that is smaller than the delay can hide in it. Until the window has passed, the error may then
    exceed the bound, by the shortest delay one way since the step at most.

    The drift is the slope between two estimates of the last minutes. Its bound, the sum of theirs over the time between
    them, is that of the mean rate. It never tightens the bound of the offset, for a rate may change.

    Parameters
    ----------
    window_ns : int
        Probes older than this are forgotten, at times a quarter sooner [ns].
    skew_ppm : int
        Largest skew between two clocks: 100 allows 50 parts per million to each [1e-6].

    Attributes
    ----------
    offset_ns : int
        Estimated peer clock minus server clock; 0 before the first probe [ns].
    bound_ns : int
        Largest possible error of the offset when the newest probe came in; `NEVER_NS` before the first [ns].
    round_trip_ns : int
        Shortest time on the way, there and back, of the probes in the window; `NEVER_NS` before the first [ns].
    drift_ppm : float
        Rate of the peer's clock minus that of the server's; NaN until it is known to 10e-6 [1e-6].
    drift_bound_ppm : float
        Largest possible error of the drift; infinite before it can be told [1e-6].
    accepted, rejected : int
        Probes used, and impossible ones: a negative round trip, or an answer before its question [1].
    restarts : int
        Times the estimate started anew [1].
    """

    def __init__(self, window_ns: int = 2_000_000_000, skew_ppm: int = 100) -> None:
        self.offset_ns = 0
        self.bound_ns = self.round_trip_ns = NEVER_NS
        self.accepted = self.rejected = self.restarts = 0
        self._window_ns = window_ns
        self._skew_ppm = skew_ppm
        self._spans: deque[_Span] = deque()
        self._points: deque[_Point] = deque(maxlen=_POINTS)
        self._upper: int
        self._lower: int
        self._span_upper: int
        self._span_lower: int
        self._span_round_trip_ns: int
        self._forget()

    @property
    def known(self) -> bool:
        """Whether there has been a probe."""
        return self.accepted > 0

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
        if t2_ns < t1_ns or not -FAR_NS < lowest <= highest < FAR_NS:  # which also rules out t3 before t0
            self.rejected += 1
            return False
        self.accepted += 1
        age = t3_ns * self._skew_ppm // _MILLION + 1  # at t3 an upper limit is its value at time 0 and this, rounded up
        upper = highest - t0_ns * self._skew_ppm // _MILLION
        lower = lowest + age - 1
        if upper + 2 * age < self._lower or lower - 2 * age > self._upper:
            self._forget()
            self.restarts += 1
        if t3_ns >= self._turn_ns:
            self._turn(t3_ns)
        if upper < self._span_upper:
            self._span_upper = upper
            self._upper = min(self._upper, upper)
        if lower > self._span_lower:
            self._span_lower = lower
            self._lower = max(self._lower, lower)
        if highest - lowest < self._span_round_trip_ns:
            self._span_round_trip_ns = highest - lowest
            self.round_trip_ns = min(self.round_trip_ns, highest - lowest)
        self.offset_ns = (self._upper + self._lower) // 2
        self.bound_ns = (self._upper - self._lower) // 2 + age + 1  # 1 for the rounding of both halves
        if t3_ns >= self._point_ns:
            self._measure_drift(t3_ns)
        return True

    def to_server(self, peer_ns: int) -> int:
        """Turn a stamp of the peer's clock into server time [ns].

        Parameters
        ----------
        peer_ns : int
            The stamp [ns].
        """
        return peer_ns - self.offset_ns

    def _forget(self) -> None:
        """Begin without a past."""
        self._spans.clear()
        self._points.clear()
        self._turn_ns = self._point_ns = -NEVER_NS
        self._begin(_NOTHING)
        self.drift_ppm, self.drift_bound_ppm = math.nan, math.inf

    def _begin(self, best: _Span) -> None:
        """Begin an empty span, after others of which this is the best."""
        self._upper, self._lower, self.round_trip_ns = best.upper, best.lower, best.round_trip_ns
        self._span_upper, self._span_lower = _NOTHING.upper, _NOTHING.lower
        self._span_round_trip_ns = _NOTHING.round_trip_ns

    def _turn(self, now_ns: int) -> None:
        """Put the present span to the others, drop the old ones, and begin a new one."""
        length = self._window_ns // _SPANS
        self._spans.append(_Span(self._turn_ns, self._span_upper, self._span_lower, self._span_round_trip_ns))
        while self._spans and self._spans[0].until_ns < now_ns - (_SPANS - 2) * length:
            self._spans.popleft()
        _, uppers, lowers, round_trips = zip(_NOTHING, *self._spans, strict=True)
        self._begin(_Span(0, min(uppers), max(lowers), min(round_trips)))
        self._turn_ns = now_ns + length

    def _measure_drift(self, now_ns: int) -> None:
        """Take the slope from the one of the earlier estimates that leaves the least doubt."""
        self._point_ns = now_ns + _POINT_NS
        new = _Point(now_ns, self.offset_ns, self.bound_ns)
        if self._points:
            doubt, slope = min(_slope(old, new) for old in self._points)
            self.drift_bound_ppm = doubt
            self.drift_ppm = slope if doubt <= _DRIFT_KNOWN_PPM else math.nan
        self._points.append(new)


def _slope(old: _Point, new: _Point) -> tuple[float, float]:
    """Bound of the mean rate between two estimates, and the rate itself [1e-6]."""
    per_million = _MILLION / (new.at_ns - old.at_ns)
    return (new.bound_ns + old.bound_ns) * per_million, (new.offset_ns - old.offset_ns) * per_million
