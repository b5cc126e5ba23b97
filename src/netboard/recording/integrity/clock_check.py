"""Checks the clocks of a recording's peers, from the raw probes and the recorded offset estimates.

Probes belong to one connection each, and each connection is checked separately. Older servers gave all connections of
one kind of peer (two displays at a station, several consoles) the same name; their probes are separated first.

A server probes more often than it records, so an estimate cannot be reproduced from the file, but it can be refuted.
Each probe limits the clock offset, because no message has a negative delay, and has an error bound that the estimate
made with it may not exceed. The limits of all probes of a peer must be consistent with a plausible drift between two
clocks. The estimates of each minute must lie near a straight line, fitted to the probes by Theil-Sen regression, which
does not use the limits. Over longer times clocks do not drift linearly.
"""

from collections.abc import Iterator, Sequence
from itertools import pairwise
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.stats import theilslopes

from netboard.network.protocol.clock_estimator import ClockEstimator
from netboard.network.protocol.records import ClockRecord, kind_of_peer
from netboard.recording.integrity.severity import CheckFinding, Severity

MAX_DRIFT_PPM = 100.0
"""Largest plausible drift between two crystals; the bounds of the estimates allow for it [1e-6]."""

_INTERLEAVED_NS = 1_000_000_000
"""Largest time between probes of several connections that were recorded together, once a second [ns]."""

_SINGLE = "agent."
"""Name prefix of peers with a single connection: an agent occupies its side."""

_PROBES_PER_FIT = 60  # of a minute: one a second is recorded
_MIN_PROBES = 6


class ClockFit(NamedTuple):
    """A straight line through probes of a peer."""

    drift_ppm: float  # slope; NaN if the delays of the probes leave it undetermined [1e-6]
    beyond: int  # number of estimates further from the line than their bound and the delays of its probes allow


def check_clocks(
    probes: Sequence[ClockRecord], bound_ms: float, active_ns: tuple[int, int] | None
) -> Iterator[CheckFinding]:
    """Check the clocks of all peers. ``bound_ms``: largest bound of an agent's clock offset during trials [ms]."""
    if not probes:
        yield CheckFinding(Severity.SOUND, "no clock probes were recorded")
    for peer in sorted({probe.peer for probe in probes}):
        connections = connections_of([probe for probe in probes if probe.peer == peer])
        for number, connection in enumerate(connections, start=1):
            name = peer if len(connections) == 1 else f"{peer} (connection {number} of {len(connections)})"
            yield from check_connection(name, connection, bound_ms, active_ns)


def connections_of(probes: Sequence[ClockRecord]) -> list[list[ClockRecord]]:
    """Separate the connections whose probes an older server recorded under one name.

    All are one connection if they can be, or if no interleaving explains their order.
    """
    peer = probes[0].peer
    in_order = all(before.t3_ns <= later.t3_ns for before, later in pairwise(probes))
    if in_order or peer != kind_of_peer(peer) or peer.startswith(_SINGLE):
        return [list(probes)]
    connections: list[list[ClockRecord]] = []
    newest_ns = probes[0].t3_ns
    for probe in {(p.t0_ns, p.t1_ns, p.t2_ns, p.t3_ns): p for p in probes}.values():
        # The last probe of a silent connection was recorded repeatedly; keep only its first occurrence.
        if probe.t3_ns < newest_ns - _INTERLEAVED_NS:
            return [list(probes)]
        newest_ns = max(newest_ns, probe.t3_ns)
        for connection in connections:
            if connection[-1].t3_ns < probe.t3_ns and not stepped([connection[-1], probe]):
                connection.append(probe)
                break
        else:
            connections.append([probe])
    return connections


def check_connection(
    peer: str, probes: Sequence[ClockRecord], bound_ms: float, active_ns: tuple[int, int] | None
) -> Iterator[CheckFinding]:
    """Check the clock of a peer by the probes of one connection."""
    impossible = sum(not is_possible(probe) for probe in probes)
    if impossible:
        yield CheckFinding(Severity.DAMAGE, f"{peer}: {impossible} probes have impossible time stamps")
        return
    refuted = sum(contradicts(probe) for probe in probes)
    if refuted:
        yield CheckFinding(Severity.DAMAGE, f"{peer}: {refuted} of {len(probes)} estimates contradict their own probe")
    back = sum(later.t3_ns < before.t3_ns for before, later in pairwise(probes))
    if back:
        yield CheckFinding(Severity.DAMAGE, f"{peer}: {back} probes are earlier than the one before")
    wide = [probe.bound_ns * 1e-6 for probe in probes if _is_too_wide(probe, bound_ms, active_ns)]
    if wide:
        text = f"{peer}: during trials {len(wide)} estimates have a bound of up to {max(wide):.2f} ms, expected at most"
        yield CheckFinding(Severity.LOSS, f"{text} {bound_ms:g} ms")
    if not (refuted or back):
        yield _fitted(peer, probes)


def _fitted(peer: str, probes: Sequence[ClockRecord]) -> CheckFinding:
    """Check that the probes are consistent and the estimates lie near straight lines."""
    widest = max(probe.bound_ns for probe in probes) * 1e-6
    words = f"{peer}: {len(probes)} probes, bound at most {widest:.2f} ms"
    if steps := stepped(probes):
        text = f"{words}; {steps} of them contradict every plausible drift: the clock was stepped or set"
        return CheckFinding(Severity.LOSS, text)
    fits = [
        fit
        for at in range(0, len(probes), _PROBES_PER_FIT)
        if (fit := line_through(probes[at : at + _PROBES_PER_FIT])) is not None
    ]
    if not fits:
        return CheckFinding(Severity.SOUND, f"{words}; too few for a line")
    known = [fit.drift_ppm for fit in fits if not np.isnan(fit.drift_ppm)]
    drift = f"drift {np.median(known):+.1f} ppm" if known else "drift unknown"
    beyond = sum(fit.beyond for fit in fits)
    about = f"{words}, {drift}"
    if beyond:
        return CheckFinding(Severity.LOSS, f"{about}; {beyond} estimates are off the line through the probes")
    return CheckFinding(Severity.SOUND, f"{about}; every estimate agrees with its probe and with a line through all")


def is_possible(probe: ClockRecord) -> bool:
    """Return True if the time stamps are possible: no reply before its request, no negative delay."""
    return ClockEstimator().add(probe.t0_ns, probe.t1_ns, probe.t2_ns, probe.t3_ns)


def contradicts(probe: ClockRecord) -> bool:
    """Return True if an estimate contradicts its own probe: outside its limits, or with a wider bound."""
    single = ClockEstimator()
    single.add(probe.t0_ns, probe.t1_ns, probe.t2_ns, probe.t3_ns)
    difference = abs(probe.offset_ns - single.offset_ns)
    return probe.bound_ns > single.bound_ns or difference > probe.bound_ns + single.bound_ns


def _is_too_wide(probe: ClockRecord, bound_ms: float, active_ns: tuple[int, int] | None) -> bool:
    """Return True if an agent's bound is too wide during trials."""
    if active_ns is None or not probe.peer.startswith(_SINGLE):
        return False
    return active_ns[0] <= probe.t3_ns <= active_ns[1] and probe.bound_ns > bound_ms * 1e6


def stepped(probes: Sequence[ClockRecord]) -> int:
    """Count the probes that no drift up to `MAX_DRIFT_PPM` reconciles with the previous ones."""
    sent, received, answered, back = _stamps(probes)[:4]
    upper, lower = received - sent, answered - back
    rate = MAX_DRIFT_PPM * 1e-6
    highest = np.minimum.accumulate(upper - rate * sent)[:-1] + rate * back[1:]
    lowest = np.maximum.accumulate(lower + rate * back)[:-1] - rate * sent[1:]
    return int(np.count_nonzero((lower[1:] > highest + 1.0) | (upper[1:] < lowest - 1.0)))


def line_through(probes: Sequence[ClockRecord]) -> ClockFit | None:
    """Fit a line through the midpoints of the faster half of the probes; None for too few of them."""
    if len(probes) < _MIN_PROBES:
        return None
    sent, received, answered, back, offsets, bounds = _stamps(probes)
    delays = (back - sent) - (answered - received)
    t, middles = (sent + back) / 2, ((received - sent) + (answered - back)) / 2
    fastest = np.argsort(delays, kind="stable")[: (len(delays) + 1) // 2]
    if np.ptp(t[fastest]) == 0.0:
        return None
    slope, offset, *_ = theilslopes(middles[fastest], t[fastest])
    # The line is no more accurate than the delays of its probes, which may all lie on one side of it; its uncertainty
    # grows with the distance from them.
    longest, span = np.max(delays[fastest]), np.ptp(t[fastest])
    known = longest < MAX_DRIFT_PPM * 1e-6 * span
    beyond = np.abs(offset + slope * t - offsets) > bounds + longest * (1.0 + np.ptp(t) / span)
    return ClockFit(float(slope) * 1e6 if known else float("nan"), int(np.count_nonzero(beyond)))


def _stamps(probes: Sequence[ClockRecord]) -> NDArray[np.float64]:
    """Return t0 to t3, the estimate and its bound as rows, relative to the first probe [ns]."""
    stamps = np.array([(p.t0_ns, p.t1_ns, p.t2_ns, p.t3_ns, p.offset_ns, p.bound_ns) for p in probes], np.int64)
    server, peer = stamps[0, 0], stamps[0, 1]
    zeros = np.array([server, peer, peer, server, peer - server, 0])
    # Relative to the first probe the values are small enough for float64 to resolve every nanosecond.
    return np.asarray((stamps - zeros).T, np.float64)
