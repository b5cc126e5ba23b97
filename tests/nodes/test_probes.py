"""Recorded clock probes: `netboard check` finds no damage, whichever peers connect, leave and return."""

from collections.abc import Callable
from dataclasses import replace
from itertools import count

import numpy as np
import pytest
from fake_router import WELCOME, FakeRouter, hello

from fakes import FakeClock
from netboard.network.protocol.joining import Goodbye, Ping, Pong
from netboard.network.protocol.records import ClockRecord, kind_of_peer
from netboard.nodes.ports.control_port import ControlPort
from netboard.recording.integrity.clock_check import check_clocks, connections_of
from netboard.recording.integrity.severity import Finding, Severity, worst

MS = 1_000_000
HOUSE_MS = 10


class Station:
    """A server's control channel in memory, and the peers that answer its pings, each by a clock of its own."""

    def __init__(self) -> None:
        self.router = FakeRouter()
        self.port = ControlPort(self.router, WELCOME)  # type: ignore[arg-type]
        self.records: list[ClockRecord] = []
        self.clocks: dict[bytes, int] = {}
        self.held: list[tuple[int, bytes, Pong]] = []
        self.chance = np.random.default_rng(5)
        self.now_ms = 0

    def join(self, name: bytes, role: str, side: str = "", ahead_s: float = 0.0) -> None:
        self.clocks[name] = round(ahead_s * 1e9)
        self.router.say(name, hello(role, side, name.decode()))

    def leave(self, name: bytes) -> None:
        self.router.say(name, Goodbye("restarted"))
        del self.clocks[name]

    def vanish(self, name: bytes) -> None:
        """Say nothing any more."""
        del self.clocks[name]

    def run_once(self, seconds: float) -> None:
        for _ in range(round(seconds * 1000 / HOUSE_MS)):
            self.now_ms += HOUSE_MS
            now_ns = self.now_ms * MS
            self.port.pump(now_ns)
            for name in list(self.router.sent):
                for message in self.router.heard(name):
                    if isinstance(message, Ping) and name in self.clocks:
                        there, way = self.clocks[name], self.chance.integers(50_000, 60 * MS, 2).tolist()
                        received = message.sent_ns + way[0] + there
                        pong = Pong(message.sent_ns, received, received + 1000)
                        self.held.append((message.sent_ns + sum(way) + 1000, name, pong))
            for item in sorted((item for item in self.held if item[0] <= now_ns), key=lambda item: item[0]):
                self.held.remove(item)
                self.router.say(item[1], item[2])
            self.port.drain(lambda: self.now_ms * MS)
            if self.now_ms % 1000 == 0:
                self.records += self.port.clock_records(len(self.records))

    def findings(self, records: list[ClockRecord]) -> list[Finding]:
        return [*check_clocks(records, 0.5, None)]


def two_displays(at: Station) -> None:
    at.join(b"one", "display", "left")
    at.join(b"two", "display", "left", ahead_s=-7.0)
    at.run_once(12)


def several_consoles(at: Station) -> None:
    for number in range(4):
        at.join(b"console %d" % number, "console", ahead_s=number * 100.0)
    at.run_once(12)


def restarted_display(at: Station) -> None:
    at.join(b"other", "display", "right")
    for number in range(3):
        at.join(b"run %d" % number, "display", "left", ahead_s=number * 1e6)
        at.run_once(6)
        at.leave(b"run %d" % number)


def replaced_display(at: Station) -> None:
    at.join(b"one", "display", "left")
    at.run_once(6)
    at.vanish(b"one")
    at.join(b"two", "display", "left")
    at.run_once(12)


def display_with_repeated_hello(at: Station) -> None:
    at.join(b"one", "display", "left")
    at.run_once(6)
    at.join(b"one", "display", "left")
    at.run_once(6)


TOPOLOGIES = (
    two_displays,
    several_consoles,
    restarted_display,
    replaced_display,
    display_with_repeated_hello,
)


@pytest.mark.parametrize("scenario", TOPOLOGIES)
def test_probes_of_any_topology_are_valid_per_connection(scenario: Callable[[Station], None]) -> None:
    at = Station()
    scenario(at)
    findings = at.findings(at.records)
    assert worst(findings) == Severity.SOUND, findings
    assert len(findings) == len({record.peer for record in at.records}) >= 1
    assert len({(record.peer, record.t0_ns) for record in at.records}) == len(at.records)


@pytest.mark.parametrize("scenario", TOPOLOGIES)
def test_probes_sharing_a_name_from_older_servers_are_no_damage(scenario: Callable[[Station], None]) -> None:
    at = Station()
    scenario(at)
    findings = at.findings([replace(record, peer=kind_of_peer(record.peer)) for record in at.records])
    assert worst(findings) < Severity.DAMAGE, findings


def test_interleaved_probes_under_one_name_are_separated() -> None:
    at = Station()
    two_displays(at)
    old = [replace(record, peer="display.left") for record in at.records]
    silent = [replace(old[-1], seq=len(old) + k) for k in range(3)]  # recorded again and again
    apart = connections_of([*old, *silent, *(replace(p, t3_ns=p.t3_ns) for p in silent)])
    assert sorted(map(len, apart)) == [len(old) // 2, len(old) // 2]
    assert all(len({record.offset_ns // 10**9 for record in mine}) == 1 for mine in apart)
    assert worst(at.findings([*old, *silent])) == Severity.SOUND


def test_out_of_order_probes_of_one_connection_are_damage() -> None:
    at = Station()
    restarted_display(at)
    for peer in {record.peer for record in at.records}:
        places = [k for k, record in enumerate(at.records) if record.peer == peer]
        wrong = list(at.records)
        wrong[places[1]], wrong[places[3]] = wrong[places[3]], wrong[places[1]]
        findings = at.findings(wrong)
        assert [f.severity for f in findings if "earlier than the one before" in f.text] == [Severity.DAMAGE], peer


def test_pong_with_impossible_stamps_is_not_recorded() -> None:
    at = Station()
    at.join(b"one", "display", "left")
    at.run_once(1.5)
    (known,) = at.port.clock_records(0) or at.records[-1:]
    now_ns = at.now_ms * MS
    for number, pong in zip(
        count(1), (Pong(now_ns, 20, 10), Pong(now_ns + 10**9, 1, 2), Pong(-(2**62), 0, 0)), strict=False
    ):
        at.router.say(b"one", pong)
        at.port.drain(lambda number=number: now_ns + number)
        assert at.port.clock_records(9) == []
    assert known.peer == "display.left"


def test_pong_arriving_during_a_drain_is_stamped_after_it_was_sent() -> None:
    router, clock = FakeRouter(), FakeClock()
    port = ControlPort(router, WELCOME)  # type: ignore[arg-type]
    router.say(b"one", hello("display", "left"))
    port.drain(clock)
    clock.advance(1.0)
    port.pump(clock())
    (ping,) = (message for message in router.heard(b"one") if isinstance(message, Ping))
    clock.advance(0.001)
    port.drain(clock_while_frames_arrive(router, clock, ping))
    (record,) = port.clock_records(0)
    assert record.t3_ns == clock()
    assert abs(record.offset_ns) <= record.bound_ns  # both read the same clock, so the true offset is 0


def clock_while_frames_arrive(router: FakeRouter, clock: FakeClock, ping: Ping) -> Callable[[], int]:
    """Return a clock; while the port handles a frame of another peer, the answer to the ping arrives."""
    router.say(b"other", hello("console"))

    def read() -> int:
        if not router.arrived and clock() < ping.sent_ns + 3 * MS:
            clock.advance(0.002)
            router.say(b"one", Pong(ping.sent_ns, clock(), clock()))
        return clock()

    return read
