"""Offset of a peer's clock from clock probes, with a bound on its error.

Nothing here reads a clock, so the same estimate is made live, in an integrity check and in a test. An impossible stamp
is counted and is no error.
"""

import math
from collections import deque
from typing import NamedTuple

UNKNOWN_NS = 2**63 - 1
"""Age of a peer that never sent a frame, and error bound of a clock that was never probed [ns]."""

MAX_OFFSET_NS = 2**61
"""Clock offsets beyond this (73 years) are invalid; below it, every number of an estimate fits 64 bits [ns]."""

SKEW_PPM = 100
"""Largest skew between two clocks: 50 parts per million for each [1e-6]."""

_MILLION = 1_000_000

_SPANS = 8
_ESTIMATE_INTERVAL_NS = 4_000_000_000
_ESTIMATES = 64  # of the last four minutes
_DRIFT_KNOWN_PPM = 10.0


class _Span(NamedTuple):
    """Tightest limits of the offset from the probes of an eighth of the window, extrapolated back to time 0."""

    until_ns: int
    upper: int
    lower: int
    round_trip_ns: int


class _Estimate(NamedTuple):
    """The offset and its bound at a time."""

    at_ns: int
    offset_ns: int
    bound_ns: int


_NO_SPAN = _Span(UNKNOWN_NS, UNKNOWN_NS, -UNKNOWN_NS, UNKNOWN_NS)


class ClockEstimator:
    """Offset of a peer's clock with a bound on its error, from the four stamps of an exchange.

    The server sends at t0, the peer receives at t1 and sends at t2, the server receives at t3; t0 and t3 are on the
    server's clock, t1 and t2 on the peer's. No message takes a negative time, so t1 - t0 is an upper limit of the
    offset (peer minus server) and t2 - t3 a lower one. Both loosen with age, by the largest assumed skew between two
    clocks: the upper limit from t0 on, the lower one from t3 on, however late the answer. The estimate is the middle
    between the tightest limits in the window, which may be of two probes, and the bound is half their distance. With a
    single probe this is NTP's delay/2 plus dispersion (RFC 5905). All limits loosen alike, so the tightest stays the
    tightest.

    A probe whose limits contradict the earlier ones proves that a clock was stepped, suspended or ran away: the
    estimate restarts. A step smaller than the delay can go undetected. Until the window has passed, the error may
    then exceed the bound, at most by the shortest one-way delay since the step.

    The drift is the slope between two estimates of the last minutes. Its bound is the sum of their bounds over the time
    between them, and holds for the mean rate. It never tightens the bound of the offset, because a rate may change.

    Parameters
    ----------
    window_ns : int
        Window of the probes in use; some are dropped up to a quarter of it sooner [ns].

    Attributes
    ----------
    offset_ns : int
        Estimated peer clock minus server clock; 0 before the first probe [ns].
    bound_ns : int
        Largest possible error of the offset at the newest probe; `UNKNOWN_NS` before the first [ns].
    round_trip_ns : int
        Shortest round trip of the probes in the window; `UNKNOWN_NS` before the first [ns].
    drift_ppm : float
        Rate of the peer's clock minus that of the server's; NaN until it is known to 10e-6 [1e-6].
    drift_bound_ppm : float
        Largest possible error of the drift; infinite before the first estimate [1e-6].
    accepted, rejected : int
        Probes used, and impossible ones: a negative round trip, or an answer before its question [1].
    restarts : int
        Number of restarts of the estimate [1].
    """

    def __init__(self, window_ns: int = 2_000_000_000) -> None:
        self.offset_ns = 0
        self.bound_ns = self.round_trip_ns = UNKNOWN_NS
        self.accepted = self.rejected = self.restarts = 0
        self._window_ns = window_ns
        self._spans: deque[_Span] = deque()
        self._estimates: deque[_Estimate] = deque(maxlen=_ESTIMATES)
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
        """Take one exchange; return False if it is impossible.

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
        if t2_ns < t1_ns or not -MAX_OFFSET_NS < lowest <= highest < MAX_OFFSET_NS:  # which also rules out t3 before t0
            self.rejected += 1
            return False
        self.accepted += 1
        age = t3_ns * SKEW_PPM // _MILLION + 1  # rounded up: how much an upper limit has loosened since time 0
        upper = highest - t0_ns * SKEW_PPM // _MILLION
        lower = lowest + age - 1
        if upper + 2 * age < self._lower or lower - 2 * age > self._upper:
            self._forget()
            self.restarts += 1
        if t3_ns >= self._span_end_ns:
            self._close_span(t3_ns)
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
        if t3_ns >= self._next_estimate_ns:
            self._measure_drift(t3_ns)
        return True

    def _forget(self) -> None:
        """Forget all probes."""
        self._spans.clear()
        self._estimates.clear()
        self._span_end_ns = self._next_estimate_ns = -UNKNOWN_NS
        self._begin_span(_NO_SPAN)
        self.drift_ppm, self.drift_bound_ppm = math.nan, math.inf

    def _begin_span(self, best: _Span) -> None:
        """Begin an empty span; `best` is the best of the earlier ones."""
        self._upper, self._lower, self.round_trip_ns = best.upper, best.lower, best.round_trip_ns
        self._span_upper, self._span_lower = _NO_SPAN.upper, _NO_SPAN.lower
        self._span_round_trip_ns = _NO_SPAN.round_trip_ns

    def _close_span(self, now_ns: int) -> None:
        """Close the current span, drop the spans that have left the window, and begin a new one."""
        length = self._window_ns // _SPANS
        self._spans.append(_Span(self._span_end_ns, self._span_upper, self._span_lower, self._span_round_trip_ns))
        while self._spans and self._spans[0].until_ns < now_ns - (_SPANS - 2) * length:
            self._spans.popleft()
        # `_NO_SPAN` is there even if all spans have left the window.
        _, uppers, lowers, round_trips = zip(_NO_SPAN, *self._spans, strict=True)
        self._begin_span(_Span(0, min(uppers), max(lowers), min(round_trips)))
        self._span_end_ns = now_ns + length

    def _measure_drift(self, now_ns: int) -> None:
        """Take the slope from the earlier estimate that gives the smallest bound."""
        self._next_estimate_ns = now_ns + _ESTIMATE_INTERVAL_NS
        new = _Estimate(now_ns, self.offset_ns, self.bound_ns)
        if self._estimates:
            self.drift_bound_ppm, slope = min(_slope(old, new) for old in self._estimates)
            self.drift_ppm = slope if self.drift_bound_ppm <= _DRIFT_KNOWN_PPM else math.nan
        self._estimates.append(new)


def _slope(old: _Estimate, new: _Estimate) -> tuple[float, float]:
    """Return the bound of the mean rate between two estimates, and the rate itself [1e-6]."""
    per_million = _MILLION / (new.at_ns - old.at_ns)
    return (new.bound_ns + old.bound_ns) * per_million, (new.offset_ns - old.offset_ns) * per_million
