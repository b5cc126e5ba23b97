"""Recorded clock probes: `netboard check` finds no damage, whichever peers connect, leave and return."""

from collections.abc import Callable
from dataclasses import replace
from itertools import count

import numpy as np
import pytest
from fake_router import WELCOME, WELCOMES, FakeRouter, hello

from fakes import FakeClock
from netboard.network.protocol.joining import Goodbye, Ping, Pong
from netboard.network.protocol.records import ClockRecord, kind_of_peer
from netboard.nodes.ports.control_port import ControlPort
from netboard.recording.integrity.clock_check import check_clocks, connections_of
from netboard.recording.integrity.severity import CheckFinding, Severity, worst

MS = 1_000_000
HOUSEKEEPING_MS = 10


class ControlRig:
    """A server's control channel in memory, with peers that answer its pings by clocks of their own."""

    def __init__(self) -> None:
        self.router = FakeRouter()
        self.port = ControlPort(self.router, WELCOMES)  # type: ignore[arg-type]
        self.records: list[ClockRecord] = []
        self.clocks: dict[bytes, int] = {}
        self.pending: list[tuple[int, bytes, Pong]] = []
        self.rng = np.random.default_rng(5)
        self.now_ms = 0

    def join(self, name: bytes, role: str, side: str = "", ahead_s: float = 0.0) -> None:
        self.clocks[name] = round(ahead_s * 1e9)
        self.router.send_from(name, hello(role, side, name.decode()))

    def leave(self, name: bytes) -> None:
        self.router.send_from(name, Goodbye("restarted"))
        del self.clocks[name]

    def vanish(self, name: bytes) -> None:
        """Stop answering without a goodbye."""
        del self.clocks[name]

    def run_once(self, seconds: float) -> None:
        for _ in range(round(seconds * 1000 / HOUSEKEEPING_MS)):
            self.now_ms += HOUSEKEEPING_MS
            now_ns = self.now_ms * MS
            self.port.pump(now_ns)
            for name in list(self.router.sent):
                for message in self.router.received_by(name):
                    if isinstance(message, Ping) and name in self.clocks:
                        clock_offset, delays = self.clocks[name], self.rng.integers(50_000, 60 * MS, 2).tolist()
                        received = message.sent_ns + delays[0] + clock_offset
                        pong = Pong(message.sent_ns, received, received + 1000)
                        self.pending.append((message.sent_ns + sum(delays) + 1000, name, pong))
            for item in sorted((item for item in self.pending if item[0] <= now_ns), key=lambda item: item[0]):
                self.pending.remove(item)
                self.router.send_from(item[1], item[2])
            self.port.drain(lambda: self.now_ms * MS)
            if self.now_ms % 1000 == 0:
                self.records += self.port.clock_records(len(self.records))

    def findings(self, records: list[ClockRecord]) -> list[CheckFinding]:
        return [*check_clocks(records, 0.5, None)]


def two_displays(rig: ControlRig) -> None:
    rig.join(b"one", "display", "left")
    rig.join(b"two", "display", "left", ahead_s=-7.0)
    rig.run_once(12)


def several_consoles(rig: ControlRig) -> None:
    for number in range(4):
        rig.join(b"console %d" % number, "console", ahead_s=number * 100.0)
    rig.run_once(12)


def restarted_display(rig: ControlRig) -> None:
    rig.join(b"other", "display", "right")
    for number in range(3):
        rig.join(b"run %d" % number, "display", "left", ahead_s=number * 1e6)
        rig.run_once(6)
        rig.leave(b"run %d" % number)


def replaced_display(rig: ControlRig) -> None:
    rig.join(b"one", "display", "left")
    rig.run_once(6)
    rig.vanish(b"one")
    rig.join(b"two", "display", "left")
    rig.run_once(12)


def display_with_repeated_hello(rig: ControlRig) -> None:
    rig.join(b"one", "display", "left")
    rig.run_once(6)
    rig.join(b"one", "display", "left")
    rig.run_once(6)


TOPOLOGIES = (
    two_displays,
    several_consoles,
    restarted_display,
    replaced_display,
    display_with_repeated_hello,
)


@pytest.mark.parametrize("scenario", TOPOLOGIES)
def test_probes_of_any_topology_are_valid_per_connection(scenario: Callable[[ControlRig], None]) -> None:
    rig = ControlRig()
    scenario(rig)
    findings = rig.findings(rig.records)
    assert worst(findings) == Severity.SOUND, findings
    assert len(findings) == len({record.peer for record in rig.records}) >= 1
    assert len({(record.peer, record.t0_ns) for record in rig.records}) == len(rig.records)


@pytest.mark.parametrize("scenario", TOPOLOGIES)
def test_probes_sharing_a_name_from_older_servers_are_no_damage(scenario: Callable[[ControlRig], None]) -> None:
    rig = ControlRig()
    scenario(rig)
    findings = rig.findings([replace(record, peer=kind_of_peer(record.peer)) for record in rig.records])
    assert worst(findings) < Severity.DAMAGE, findings


def test_interleaved_probes_under_one_name_are_separated() -> None:
    rig = ControlRig()
    two_displays(rig)
    old = [replace(record, peer="display.left") for record in rig.records]
    repeated = [replace(old[-1], seq=len(old) + k) for k in range(3)]  # the last record, repeated
    separated = connections_of([*old, *repeated, *(replace(p, t3_ns=p.t3_ns) for p in repeated)])
    assert sorted(map(len, separated)) == [len(old) // 2, len(old) // 2]
    assert all(len({record.offset_ns // 10**9 for record in connection}) == 1 for connection in separated)
    assert worst(rig.findings([*old, *repeated])) == Severity.SOUND


def test_out_of_order_probes_of_one_connection_are_damage() -> None:
    rig = ControlRig()
    restarted_display(rig)
    for peer in {record.peer for record in rig.records}:
        indices = [k for k, record in enumerate(rig.records) if record.peer == peer]
        swapped = list(rig.records)
        swapped[indices[1]], swapped[indices[3]] = swapped[indices[3]], swapped[indices[1]]
        findings = rig.findings(swapped)
        assert [f.severity for f in findings if "earlier than the one before" in f.text] == [Severity.DAMAGE], peer


def test_pong_with_impossible_stamps_is_not_recorded() -> None:
    rig = ControlRig()
    rig.join(b"one", "display", "left")
    rig.run_once(1.5)
    (known,) = rig.port.clock_records(0) or rig.records[-1:]
    now_ns = rig.now_ms * MS
    for number, pong in zip(
        count(1), (Pong(now_ns, 20, 10), Pong(now_ns + 10**9, 1, 2), Pong(-(2**62), 0, 0)), strict=False
    ):
        rig.router.send_from(b"one", pong)
        rig.port.drain(lambda number=number: now_ns + number)
        assert rig.port.clock_records(9) == []
    assert known.peer == "display.left"


def test_pong_arriving_during_a_drain_is_stamped_after_it_was_sent() -> None:
    router, clock = FakeRouter(), FakeClock()
    port = ControlPort(router, WELCOMES)  # type: ignore[arg-type]
    router.send_from(b"one", hello("display", "left"))
    port.drain(clock)
    assert router.received_by(b"one") == [WELCOME, Ping(clock())]
    clock.advance(1.0)
    port.pump(clock())
    (ping,) = (message for message in router.received_by(b"one") if isinstance(message, Ping))
    clock.advance(0.001)
    port.drain(clock_while_frames_arrive(router, clock, ping))
    (record,) = port.clock_records(0)
    assert record.t3_ns == clock()
    assert abs(record.offset_ns) <= record.bound_ns  # both read the same clock, so the true offset is 0


def clock_while_frames_arrive(router: FakeRouter, clock: FakeClock, ping: Ping) -> Callable[[], int]:
    """Return a clock; while the port handles a frame of another peer, the answer to the ping arrives."""
    router.send_from(b"other", hello("console"))

    def read() -> int:
        if not router.incoming and clock() < ping.sent_ns + 3 * MS:
            clock.advance(0.002)
            router.send_from(b"one", Pong(ping.sent_ns, clock(), clock()))
        return clock()

    return read
