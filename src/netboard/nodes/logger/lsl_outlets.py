"""A running session as streams of the Lab Streaming Layer (LSL), for LabRecorder and other LSL clients.

The streams exist as long as the process, so that they can be selected before a session begins, and a recorder stays
connected when the next one does. A sample has the time of its tick, not of its sending: server time, converted to the
LSL clock by means of the server's clock probes of this machine. Samples wait until that offset is known. If both clocks
are the same, stamps are exact. Lost records and the clock offset are reported in the event stream.
"""

import logging
import platform
from collections.abc import Callable
from dataclasses import replace
from importlib import import_module
from typing import Any
from xml.etree.ElementTree import Element

import numpy as np
from numpy.typing import NDArray

from netboard.base.clock import now_ns
from netboard.base.errors import ConfigError
from netboard.base.tables.questionnaires import public_details
from netboard.network.protocol.joining import Welcome
from netboard.network.protocol.records import EventRecord
from netboard.recording.export.lsl_streams import (
    EVENTS,
    MARKERS,
    STREAMS,
    TICKS,
    Stream,
    description,
    event_text,
    remark_text,
    samples,
    seconds,
)
from netboard.recording.export.trigger_pulses import onset_ns

log = logging.getLogger(__name__)

COMPARISONS = 100
"""Comparisons of the LSL clock with the machine's at the start; the closest one counts [1]."""

MAX_WAITING = 10_000
"""Largest number of ticks that wait for the clock offset [1]."""


def library() -> Any:
    """Import pylsl, or raise an error that says how to install it."""
    try:
        return import_module("pylsl")
    except (ImportError, RuntimeError) as error:
        raise ConfigError(
            f'this needs pylsl and the library liblsl: pip install "netboard[lsl]" ({str(error).strip()})'
        ) from None


def compare(layer_clock: Callable[[], float], clock: Callable[[], int] = now_ns) -> tuple[int, int]:
    """Return by how much the LSL clock is ahead of this machine's monotonic clock, and a bound of the error [ns].

    The offset is 0 if both may be the same clock.
    """
    best = None
    for _ in range(COMPARISONS):
        before, there, after = clock(), layer_clock(), clock()
        if best is None or after - before < best[1] - best[0]:
            best = before, after, round(there * 1e9)
    assert best is not None
    before, after, there_ns = best
    bound_ns = (after - before + 1) // 2 + 1
    offset_ns = there_ns - (before + after) // 2
    return (0 if abs(offset_ns) <= bound_ns else offset_ns), bound_ns


class Outlets:
    """The LSL outlets of one server."""

    def __init__(self, name: str, port: int) -> None:
        self.ticks = self.events = 0
        self._lsl = library()
        self._layer_ns, self._layer_bound_ns = compare(self._lsl.local_clock)
        clock = {
            "source": "the server's monotonic clock, by way of this machine's",
            "layer_minus_machine_ns": str(self._layer_ns),
            "layer_bound_ns": str(self._layer_bound_ns),
            "machine_minus_server": f"in {name}.events as lsl_clock: offset_ns and bound_ns",
        }
        self._outlets = {
            stream.name: self._open(stream, name, f"{platform.node()}:{port}", {"clock": clock}) for stream in STREAMS
        }
        self._shift_ns: int | None = None
        self._exact = False
        self._waiting: list[tuple[NDArray[Any], list[EventRecord]]] = []
        log.info(
            "streams %s; LSL's clock is this machine's %s",
            ", ".join(f"{name}.{stream.name}" for stream in STREAMS),
            f"plus {self._layer_ns} ns, to {self._layer_bound_ns} ns" if self._layer_ns else "",
        )

    def begin(self, welcome: Welcome) -> None:
        """Begin a session, with a server whose clock is not known yet."""
        self._shift_ns, self._exact = None, False
        self._discard()
        log.info("session %s", welcome.session)
        self._remark("lsl_session", {"session": welcome.session, "config": welcome.config})

    def set_clock(self, offset_ns: int, bound_ns: int) -> None:
        """Set the clock offset [ns]; within its bound of zero both machines are taken to share one clock."""
        known = self._shift_ns is not None
        if known and self._exact and abs(offset_ns) <= bound_ns:
            return
        self._exact = abs(offset_ns) <= bound_ns
        used_ns = 0 if self._exact else offset_ns
        self._shift_ns = used_ns + self._layer_ns
        details = {"offset_ns": str(used_ns), "bound_ns": str(bound_ns), "one_clock": str(self._exact).lower()}
        self._remark("lsl_clock", details)
        if known:
            return
        found = "is this machine's" if self._exact else f"is {-offset_ns * 1e-9:+.6f} s from this machine's"
        log.info("the server's clock %s (within %.3f ms)", found, bound_ns * 1e-6)
        held, self._waiting = self._waiting, []
        for ticks, events in held:
            self._send(self._shift_ns, ticks, events)

    def report_lost(self, first: int, count: int) -> None:
        """Report records that did not arrive."""
        log.warning("%d records from number %d on were not received: the streams have a gap", count, first)
        self._remark("lsl_lost", {"first": str(first), "count": str(count)})

    def take(self, ticks: NDArray[Any], events: list[EventRecord]) -> None:
        """Send ticks and events, or hold them until the clock offset is known."""
        if self._shift_ns is not None:
            self._send(self._shift_ns, ticks, events)
            return
        self._waiting.append((ticks, events))
        if sum(len(held) for held, _ in self._waiting) > MAX_WAITING:
            self._discard()

    def _discard(self) -> None:
        """Discard what waits for the clock offset, and report it."""
        ticks, events = (sum(len(waiting[which]) for waiting in self._waiting) for which in (0, 1))
        self._waiting.clear()
        if ticks or events:
            log.warning("%d ticks and %d events were not sent: the server's clock is unknown", ticks, events)
            self._remark("lsl_unsent", {"ticks": str(ticks), "events": str(events)})

    def _send(self, shift_ns: int, ticks: NDArray[Any], events: list[EventRecord]) -> None:
        if len(ticks):
            stamps = seconds(ticks["time_ns"] + shift_ns).tolist()
            self._outlets[TICKS.name].push_chunk(samples(ticks), stamps)
            self.ticks += len(ticks)
        for event in events:
            (stamp,) = seconds(np.array([onset_ns(event) + shift_ns])).tolist()
            self._outlets[MARKERS.name].push_sample([event.name], stamp)
            public = replace(event, details=public_details(event.name, event.details))
            self._outlets[EVENTS.name].push_sample([event_text(public)], stamp)
            self.events += 1

    def _remark(self, name: str, details: dict[str, str]) -> None:
        """Report something about the streams in the event stream."""
        self._outlets[EVENTS.name].push_sample([remark_text(name, details)])

    def _open(self, stream: Stream, name: str, source: str, notes: dict[str, dict[str, str]]) -> Any:
        lsl = self._lsl
        form = {"double64": lsl.cf_double64, "string": lsl.cf_string}[stream.format]
        full = f"{name}.{stream.name}"
        info = lsl.StreamInfo(
            full, stream.type, len(stream.channels), stream.rate_hz, form, f"netboard.{stream.name}@{source}"
        )
        _describe(info.desc(), description(stream, notes))
        return lsl.StreamOutlet(info)


def _describe(to: Any, element: Element) -> None:
    """Copy the children of an element to an LSL description."""
    for child in element:
        if len(child):
            _describe(to.append_child(child.tag), child)
        else:
            to.append_child_value(child.tag, child.text or "")
