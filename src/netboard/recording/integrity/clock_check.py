"""Checks the clocks of a recording's peers by what was recorded of them: raw probes, and the estimates made with these.

Probes belong to one connection each, and are checked connection by connection. Older servers gave all connections of a
kind of peer (two displays at a station, several consoles) the same name; their probes are told apart first.

A server probes more often than it records, so an estimate cannot be made again from the file; it can be refuted. Each
probe limits the offset (a message takes no negative time) and has a bound of its own, which the estimate that was made
with it, and with others, may not exceed. The limits of all probes of a peer must go together with some drift that two
clocks can have. And the estimates of a minute must lie about a straight line, fitted through the probes by a method
that knows nothing of limits (Theil and Sen's); over more than minutes clocks do not go straight.
"""

from collections.abc import Iterator, Sequence
from itertools import pairwise
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.stats import theilslopes

from netboard.network.protocol.admission import ClockEstimator
from netboard.network.protocol.records import ClockRecord, kind_of_peer
from netboard.recording.integrity.severity import Finding, Grade

LARGEST_DRIFT_PPM = 100.0
"""Two crystals do not differ by more: what the bounds of the estimates allow for [1e-6]."""

_INTERLEAVED_NS = 1_000_000_000
"""The newest probes of several connections are recorded together, once a second: they are not further apart [ns]."""

_SINGLE = "agent."
"""Only of these there is one at a time: an agent takes the seat of its side."""

_STRETCH = 60
_AT_LEAST = 6


class Fit(NamedTuple):
    """A straight line through some probes of a peer.

    Attributes
    ----------
    drift_ppm : float
        Its slope; NaN if the ways of the probes leave it open [1e-6].
    beyond : int
        Estimates that are further from it than their bound and the ways of its probes allow [1].
    """

    drift_ppm: float
    beyond: int


def check_clocks(
    probes: Sequence[ClockRecord], bound_ms: float, active_ns: tuple[int, int] | None
) -> Iterator[Finding]:
    """Check the clocks of all peers.

    Parameters
    ----------
    bound_ms : float
        An agent's clock must be known so well while trials go on [ms].
    """
    if not probes:
        yield Finding("clocks", Grade.SOUND, "no clock probe was recorded")
    for peer in sorted({probe.peer for probe in probes}):
        connections = connections_of([probe for probe in probes if probe.peer == peer])
        for number, mine in enumerate(connections, start=1):
            name = peer if len(connections) == 1 else f"{peer} (connection {number} of {len(connections)})"
            yield from check_connection(name, mine, bound_ms, active_ns)


def connections_of(probes: Sequence[ClockRecord]) -> list[list[ClockRecord]]:
    """Tell the connections apart of which an older server recorded the probes under one name.

    Returns
    -------
    list of list of ClockRecord
        Of each connection. If the probes can be those of one connection, or no interleaving explains their order, it is
        one.
    """
    peer = probes[0].peer
    in_order = all(before.t3_ns <= later.t3_ns for before, later in pairwise(probes))
    if in_order or peer != kind_of_peer(peer) or peer.startswith(_SINGLE):
        return [list(probes)]
    connections: list[list[ClockRecord]] = []
    newest_ns = probes[0].t3_ns
    for probe in {(p.t0_ns, p.t1_ns, p.t2_ns, p.t3_ns): p for p in probes}.values():
        # The last probe of a silent connection was recorded again and again; here each is in its first place, once.
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
) -> Iterator[Finding]:
    """Check the clock of a peer by the probes of one of its connections."""
    impossible = sum(not is_possible(probe) for probe in probes)
    if impossible:
        yield Finding("clocks", Grade.DAMAGE, f"{peer}: {impossible} probes have stamps that are not possible")
        return
    refuted = sum(contradicts(probe) for probe in probes)
    if refuted:
        yield Finding(
            "clocks", Grade.DAMAGE, f"{peer}: {refuted} of {len(probes)} estimates are refuted by their own probe"
        )
    back = sum(later.t3_ns < before.t3_ns for before, later in pairwise(probes))
    if back:
        yield Finding("clocks", Grade.DAMAGE, f"{peer}: {back} probes are earlier than the one before")
    wide = [probe.bound_ns * 1e-6 for probe in probes if _counts(probe, bound_ms, active_ns)]
    if wide:
        text = f"{peer}: during trials {len(wide)} estimates have a bound of up to {max(wide):.2f} ms, expected at most"
        yield Finding("clocks", Grade.LOSS, f"{text} {bound_ms:g} ms")
    if not (refuted or back):
        yield _fitted(peer, probes)


def _fitted(peer: str, probes: Sequence[ClockRecord]) -> Finding:
    """Say how well the probes go together, and lie about lines."""
    widest = max(probe.bound_ns for probe in probes) * 1e-6
    words = f"{peer}: {len(probes)} probes, bound at most {widest:.2f} ms"
    if steps := stepped(probes):
        text = f"{words}; {steps} of them go with no drift that two clocks can have: its clock was stepped or set anew"
        return Finding("clocks", Grade.LOSS, text)
    fits = [
        fit for at in range(0, len(probes), _STRETCH) if (fit := line_through(probes[at : at + _STRETCH])) is not None
    ]
    if not fits:
        return Finding("clocks", Grade.SOUND, f"{words}; too few for a line")
    known = [fit.drift_ppm for fit in fits if not np.isnan(fit.drift_ppm)]
    drift = f"drift {np.median(known):+.1f} ppm" if known else "drift not known"
    beyond = sum(fit.beyond for fit in fits)
    about = f"{words}, {drift}"
    if beyond:
        return Finding("clocks", Grade.LOSS, f"{about}; {beyond} estimates are off the line through the probes")
    return Finding("clocks", Grade.SOUND, f"{about}; every estimate agrees with its probe and with a line through all")


def is_possible(probe: ClockRecord) -> bool:
    """Tell whether a probe's stamps are possible: no answer before its question, no negative time on the way."""
    return ClockEstimator().add(probe.t0_ns, probe.t1_ns, probe.t2_ns, probe.t3_ns)


def contradicts(probe: ClockRecord) -> bool:
    """Tell whether an estimate cannot be that of its probe: outside its limits, or worse than the probe by itself."""
    alone = ClockEstimator()
    alone.add(probe.t0_ns, probe.t1_ns, probe.t2_ns, probe.t3_ns)
    apart = abs(probe.offset_ns - alone.offset_ns)
    return probe.bound_ns > alone.bound_ns or apart > probe.bound_ns + alone.bound_ns


def _counts(probe: ClockRecord, bound_ms: float, active_ns: tuple[int, int] | None) -> bool:
    """Tell whether a bound is too wide where it matters."""
    if active_ns is None or not probe.peer.startswith("agent."):
        return False
    return active_ns[0] <= probe.t3_ns <= active_ns[1] and probe.bound_ns > bound_ms * 1e6


def stepped(probes: Sequence[ClockRecord]) -> int:
    """Count the probes of which the limits go with those before for no drift up to `LARGEST_DRIFT_PPM`."""
    sent, received, answered, back = _stamps(probes)[:4]
    upper, lower = received - sent, answered - back
    rate = LARGEST_DRIFT_PPM * 1e-6
    highest = np.minimum.accumulate(upper - rate * sent)[:-1] + rate * back[1:]
    lowest = np.maximum.accumulate(lower + rate * back)[:-1] - rate * sent[1:]
    return int(np.count_nonzero((lower[1:] > highest + 1.0) | (upper[1:] < lowest - 1.0)))


def line_through(probes: Sequence[ClockRecord]) -> Fit | None:
    """Fit a straight line through the middles of the quicker half of some probes; None for too few of them."""
    if len(probes) < _AT_LEAST:
        return None
    sent, received, answered, back, offsets, bounds = _stamps(probes)
    ways = (back - sent) - (answered - received)
    t, middles = (sent + back) / 2, ((received - sent) + (answered - back)) / 2
    quick = np.argsort(ways, kind="stable")[: (len(ways) + 1) // 2]
    if np.ptp(t[quick]) == 0.0:
        return None
    slope, offset, *_ = theilslopes(middles[quick], t[quick])
    # A line is no better than the ways of the probes that it goes through, all of which may be on one side of it; and
    # beyond those it is worse the further it is drawn.
    longest, span = np.max(ways[quick]), np.ptp(t[quick])
    known = longest < LARGEST_DRIFT_PPM * 1e-6 * span
    beyond = np.abs(offset + slope * t - offsets) > bounds + longest * (1.0 + np.ptp(t) / span)
    return Fit(float(slope) * 1e6 if known else float("nan"), int(np.count_nonzero(beyond)))


def _stamps(probes: Sequence[ClockRecord]) -> NDArray[np.float64]:
    """Return t0 to t3, the estimate and its bound, a row each, from the first probe on [ns]."""
    stamps = np.array([(p.t0_ns, p.t1_ns, p.t2_ns, p.t3_ns, p.offset_ns, p.bound_ns) for p in probes], np.int64)
    server, peer = stamps[0, 0], stamps[0, 1]
    zeros = np.array([server, peer, peer, server, peer - server, 0])
    # From there on they are small enough for every nanosecond.
    return np.asarray((stamps - zeros).T, np.float64)
