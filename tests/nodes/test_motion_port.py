"""The motion channel: registration for a side, which samples count, and answers."""

import math
import struct
from collections.abc import Callable, Iterator
from dataclasses import astuple, replace
from typing import Any

import numpy as np
import pytest
from fake_router import WELCOME, hello
from motion_rig import TIMEOUT_NS, MotionRig

from netboard.base.config import SIDES
from netboard.base.safeguards import Safeguard
from netboard.base.tables.scene import Physics
from netboard.base.tick import HEARTBEAT_TICKS, TICK, TICK_NS
from netboard.network.protocol import fixed
from netboard.network.protocol.codec import encode
from netboard.network.protocol.control import StatusRequest
from netboard.network.protocol.joining import Goodbye, Refusal, Welcome
from netboard.network.protocol.motion import Force, Heartbeat, Point, Stylus
from netboard.network.transport import sockets
from netboard.network.transport.sockets import MAX_SAMPLE
from netboard.nodes.ports import samples
from netboard.nodes.ports.motion_port import SILENCE_TIMEOUT_NS
from netboard.nodes.ports.samples import ARMED, LIVE, MAX_STAMP_NS
from netboard.nodes.ports.unregistered import UNREGISTERED_INTERVAL_NS

MS = 1_000_000
A, B = b"agent.left@1", b"agent.right@2"
STYLUS = Stylus(0, 0, 0.0, 0.0, 0.01, 0.0, 0.0, 0.1, 0, 0, 0.0, -1, 0, 0, 0, 0)


class Rig(MotionRig):
    """A port with its router, driven as the session does."""

    def registered(self) -> "Rig":
        self.router.send_from(A, hello("agent", "left"))
        self.router.send_from(B, hello("agent", "right"))
        self.drain(lambda: 0)
        assert [type(m) for m in self.router.received_by(A) + self.router.received_by(B)] == [Welcome, Welcome]
        self.port.news.clear()
        return self

    def row(self, now_ns: int) -> Any:
        row = np.zeros(1, TICK)
        self.found = self.port.fill(row.view(np.int64), 0, now_ns, 0)
        return row[0]

    def force(self, tick: int, left: float = 0.0, right: float = 0.0) -> None:
        row = np.zeros(1, TICK)
        row["tick"], row["left_force"], row["right_force"] = tick, left, right
        self.port.fast.record["simulated_ns"] = tick
        self.port.force(row.view(np.int64), row.view(np.int64))


@pytest.fixture
def new_rig() -> Iterator[Callable[..., Rig]]:
    with sockets.open_context() as context:
        rigs: list[Rig] = []

        def make(ends: Any = None) -> Rig:
            rigs.append(Rig(context, ends))
            return rigs[-1]

        yield make


@pytest.fixture
def rig(new_rig: Callable[[], Rig]) -> Rig:
    return new_rig()


def test_unregistered_agent_is_refused_and_registered_agent_is_not(rig: Rig) -> None:
    rig.router.send_from(A, STYLUS)
    rig.drain(lambda: 0)
    assert rig.router.received_by(A) == [Refusal("it has not joined yet")]
    rig.registered().router.send_from(A, STYLUS)
    rig.drain(lambda: MS)
    assert rig.router.received_by(A) == []
    assert rig.row(MS)["left_live"] == 1


@pytest.mark.parametrize(
    "message",
    [hello("display", "left"), hello("agent", ""), replace(hello("agent", "left"), protocol=99), b"\x00nonsense"],
)
def test_invalid_registration_is_refused_with_a_reason_and_recorded(rig: Rig, message: Any) -> None:
    rig.router.send_from(A, message)
    rig.drain(lambda: 0)
    (answer,) = rig.router.received_by(A)
    assert isinstance(answer, Refusal)
    assert answer.reason
    assert [name for name, _ in rig.port.news] == ["refused"]


def test_details_of_an_agent_do_not_replace_its_side_and_name(rig: Rig) -> None:
    details = {"side": "right", "name": "Falcon", "serial": "7"}
    rig.router.send_from(A, replace(hello("agent", "left"), details=details))
    rig.drain(lambda: 0)
    assert rig.port.news == [("agent_joined", {"side": "left", "name": "host:1", "serial": "7"})]


def test_second_agent_of_a_side_is_refused_until_the_first_times_out(rig: Rig) -> None:
    rig.registered()
    rig.router.send_from(b"other", hello("agent", "left", "host:9"))
    rig.drain(lambda: MS)
    (answer,) = rig.router.received_by(b"other")
    assert isinstance(answer, Refusal)
    assert "already has an agent: host:1" in answer.reason
    rig.router.send_from(b"other", hello("agent", "left", "host:9"))
    rig.drain(lambda: MS + TIMEOUT_NS + UNREGISTERED_INTERVAL_NS)
    assert isinstance(rig.router.received_by(b"other")[0], Welcome)
    rig.router.send_from(A, STYLUS)
    rig.drain(lambda: MS + TIMEOUT_NS + UNREGISTERED_INTERVAL_NS)
    assert rig.router.received_by(A) == [Refusal("it has not joined yet")]


def test_newest_sample_is_used_in_any_order_of_arrival(rig: Rig) -> None:
    rig.registered()
    for seq in (3, 5, 4, 5, 1):
        rig.router.send_from(A, replace(STYLUS, seq=seq, z=seq * 1e-3))
    rig.drain(lambda: MS)
    row = rig.row(MS)
    assert (row["left_seq"], row["left_sent_z"]) == (5, 5e-3)
    assert (row["right_seq"], row["right_live"]) == (-1, 0)


@pytest.mark.parametrize("z", [1e300, -75.0, 1.001, float("inf")])
def test_samples_from_impossible_heights_are_not_live(rig: Rig, z: float) -> None:
    """A trial must pause for them: as a device in millimetres, they would hold the end of the board at its limit."""
    rig.registered()
    for seq, (height, live) in enumerate([(1.0, 1), (z, 0), (-1.0, 1)]):
        rig.router.send_from(A, replace(STYLUS, seq=seq, z=height))
        rig.drain(lambda: 0)
        assert rig.row(MS)["left_live"] == live


def test_expired_and_non_finite_samples_are_not_live(rig: Rig) -> None:
    rig.registered()
    rig.router.send_from(A, STYLUS)
    rig.drain(lambda: 0)
    assert rig.row(TIMEOUT_NS - 1)["left_live"] == 1
    assert rig.row(TIMEOUT_NS)["left_live"] == 0
    rig.router.send_from(A, replace(STYLUS, seq=1, vz=float("nan")))
    rig.drain(lambda: TIMEOUT_NS)
    assert rig.row(TIMEOUT_NS)["left_live"] == 0


def test_multipart_and_oversized_messages_are_refused_without_delay(rig: Rig) -> None:
    rig.registered()
    rig.router.send_from(A, STYLUS, STYLUS)
    rig.router.send_from(A, b"", STYLUS, b"")
    rig.router.send_from(A, bytes(MAX_SAMPLE + 1))
    rig.router.send_from(A, replace(STYLUS, seq=7))
    rig.drain(lambda: MS)
    assert rig.row(MS)["left_seq"] == 7
    assert [details["reason"] for _, details in rig.port.news] == ["0 bytes are no message"]


def test_sample_stamps_are_converted_to_server_time(rig: Rig) -> None:
    rig.registered()
    ahead = 7_000_000_000
    sent, received, answered = 10 * MS, 10 * MS + 100_000 + ahead, 10 * MS + 300_000 + ahead
    probe = replace(
        STYLUS, stamp_ns=answered, force_tick=1, force_sent_ns=sent, force_received_ns=received, sent_ns=answered
    )
    rig.router.send_from(A, probe)
    rig.drain(lambda: 10 * MS + 400_000)
    (record,) = rig.port.clock_records(0)
    assert record.peer == "agent.left"
    assert abs(record.offset_ns - ahead) <= 100
    assert 100_000 <= record.bound_ns <= 101_000
    assert rig.row(11 * MS)["left_stamp_ns"] == answered - record.offset_ns


def test_each_probe_is_recorded_once_under_its_connection_name(rig: Rig) -> None:
    peers = []
    for start in (10 * MS, 20 * MS, 30 * MS):
        rig.registered()
        rig.registered()  # an agent repeats its hello until it is answered
        stamps = {"force_sent_ns": start, "force_received_ns": start + 10, "sent_ns": start + 20}
        rig.router.send_from(A, replace(STYLUS, stamp_ns=start, force_tick=1, **stamps))  # type: ignore[arg-type]
        rig.drain(lambda start=start: start + 30)  # type: ignore[misc]
        peers += [record.peer for record in rig.port.clock_records(0)]
        assert rig.port.clock_records(1) == []
    assert peers == ["agent.left", "agent.left#2", "agent.left#3"]


def test_probe_with_impossible_stamps_is_discarded(rig: Rig) -> None:
    rig.registered()
    stamps = {"force_sent_ns": 10 * MS, "force_received_ns": 30, "sent_ns": 20}
    rig.router.send_from(A, replace(STYLUS, stamp_ns=20, force_tick=1, **stamps))  # type: ignore[arg-type]
    rig.drain(lambda: 11 * MS)
    assert rig.port.clock_records(0) == []


def test_safeguards_between_two_ticks_are_reported_exactly_once(rig: Rig) -> None:
    rig.registered()
    for seq, bits in enumerate((Safeguard.ARMED | Safeguard.CLAMPED, Safeguard.ARMED)):
        rig.router.send_from(A, replace(STYLUS, seq=seq, safeguards=int(bits)))
    rig.drain(lambda: MS)
    assert rig.row(MS)["left_safeguards"] == Safeguard.ARMED | Safeguard.CLAMPED
    assert rig.row(MS)["left_safeguards"] == 0


def test_forces_are_sent_every_tick_and_heartbeats_at_intervals(rig: Rig) -> None:
    rig.registered()
    for tick in range(2 * HEARTBEAT_TICKS):
        rig.force(tick, -0.5, 0.25)
    assert [(m.tick, m.force) for m in rig.router.received_by(A)] == [(t, -0.5) for t in range(2 * HEARTBEAT_TICKS)]  # type: ignore[union-attr]
    assert [m.force for m in rig.router.received_by(B)] == [0.25] * 2 * HEARTBEAT_TICKS  # type: ignore[union-attr]
    for tick in range(2 * HEARTBEAT_TICKS):
        rig.port.send_heartbeat(tick)
    beats = rig.router.received_by(A)
    assert [type(m) for m in beats] == [Heartbeat, Heartbeat]


def test_device_at_a_side_without_a_person_gets_no_force_and_is_not_armed(new_rig: Callable[..., Rig]) -> None:
    for ends in (None, samples.ends_of(Physics())):
        rig = new_rig().registered()
        for people in (("left",), SIDES):
            rig.port.renew(WELCOME, ends, people)
            assert [type(m) for m in rig.router.received_by(A) + rig.router.received_by(B)] == [Welcome, Welcome]
            row = np.zeros(1, TICK)
            row["left_live"], row["right_live"] = 1, 1
            rig.port.force(row.view(np.int64), row.view(np.int64))
            assert len(rig.router.received_by(A)) == 1
            assert len(rig.router.received_by(B)) == (people == SIDES)
        rig.port.renew(WELCOME, ends, ("left",))
        for peer in (A, B):
            rig.router.send_from(peer, replace(STYLUS, force_tick=4))
            rig.drain(lambda: MS // 10)
            rig.router.received_by(peer)
        rig.port.send_heartbeat(0, sides=("right",))
        assert rig.router.received_by(A) == []
        rig.port.send_heartbeat(0)
        (beat,), (first, second) = (rig.router.received_by(peer) for peer in (A, B))
        assert beat.arm
        assert (first.arm, second.arm) == (False, False)


def test_force_contains_its_sample_number_and_lead(rig: Rig) -> None:
    rig.registered()
    rig.router.send_from(A, replace(STYLUS, seq=9))
    rig.drain(lambda: 700_000, TICK_NS)
    rig.row(TICK_NS)
    rig.force(12, 0.5)
    assert rig.router.received_by(A) == [Force(12, 12, 9, 0.5, 300_000)]
    assert rig.router.received_by(B) == [Force(12, 12, -1, 0.0, 0)]


def test_encoding_of_a_force_is_stable_and_scaled_by_the_gain(rig: Rig) -> None:
    """A force computed by the server keeps its encoding, and the gain of the delay monitor scales it."""
    rig.registered()
    for force in (0.5, -0.0, 1e-310, float("inf")):
        row = np.zeros(1, TICK)
        row["tick"], row["left_force"] = 12, force
        words, frame = np.zeros(5, np.int64), np.zeros(fixed.FORCE.size, np.uint8)
        commanded = row.view(np.int64)
        samples.write_force(words, commanded, commanded, np.zeros((2, samples.WORDS), np.int64), np.ones(2), 0, 77)
        fixed.write(frame, fixed.FORCE, words)
        parts = (0x96, 11, 0xD3, 12, 0xD3, 77, 0xD3, 0, 0xCB, force, 0xD3, 0)
        assert frame.tobytes() == struct.pack(">BBBqBqBqBdBq", *parts)
    rig.port.gains[:] = 0.5, 1.0
    rig.force(13, 0.5, 0.5)
    assert [m.force for m in rig.router.received_by(A) + rig.router.received_by(B)] == [0.25, 0.5]  # type: ignore[union-attr]


def test_delayed_force_uses_an_earlier_row_and_the_current_tick(rig: Rig) -> None:
    rig.registered()
    row, earlier = np.zeros(1, TICK), np.zeros(1, TICK)
    row["tick"], row["left_force"], row["right_force"] = 12, 9.0, 9.0
    earlier["tick"], earlier["left_force"], earlier["right_force"] = 8, 0.5, -0.25
    rig.port.force(row.view(np.int64), earlier.view(np.int64))
    forces = rig.router.received_by(A) + rig.router.received_by(B)
    assert [(m.tick, m.force) for m in forces] == [(12, 0.5), (12, -0.25)]  # type: ignore[union-attr]


def test_agents_that_compute_their_own_force_receive_the_board_end(new_rig: Callable[..., Rig]) -> None:
    physics = Physics(coupling="right")
    rig = new_rig(samples.ends_of(physics)).registered()
    for peer, ahead in ((A, 5 * MS), (B, 0)):
        rig.router.send_from(peer, replace(STYLUS, seq=9, force_tick=1, force_received_ns=ahead, sent_ns=ahead))
    rig.drain(lambda: 700_000, TICK_NS)
    row = np.zeros(1, TICK)[0:1]
    words = row.view(np.int64).reshape(-1)
    rig.port.fill(words, 12, TICK_NS, 0)
    row["z"], row["vz"], row["theta"], row["omega"] = 0.01, 0.1, 0.1, 0.5
    row["left_live"], row["right_live"] = 1, 0
    rig.port.gains[:] = 0.5
    rig.port.force(words, words)
    (point,) = rig.router.received_by(A)
    assert isinstance(point, Point)
    assert (point.tick, point.stylus_seq, point.lead_ns) == (12, 9, 300_000)
    assert point.z == pytest.approx(0.01 - physics.l * math.sin(0.1))
    assert point.vz == pytest.approx(0.1 - physics.l * math.cos(0.1) * 0.5)
    assert abs(point.stamp_ns - (TICK_NS + 5 * MS)) <= 350_000
    assert (point.k, point.c) == (0.0, 0.0)
    assert rig.router.received_by(B) == []
    row["right_live"] = 1
    rig.port.force(words, words)
    (point,) = rig.router.received_by(B)
    assert isinstance(point, Point)
    assert (point.k, point.c) == (0.5 * physics.k_h, 0.5 * physics.c_h)
    assert point.z == pytest.approx(0.01 + physics.l * math.sin(0.1))


def test_sample_is_accepted_in_either_encoding(new_rig: Callable[[], Rig]) -> None:
    stylus = replace(STYLUS, seq=3, x=-0.25, z=0.5, safeguards=1, force_tick=7, sent_ns=2**40)
    words, frame = np.zeros(len(fixed.STYLUS.markers), np.int64), np.zeros(fixed.STYLUS.size, np.uint8)
    record = words.view(np.dtype(fixed.fields_of(Stylus)))
    record[0] = astuple(stylus)
    fixed.write(frame, fixed.STYLUS, words)
    rows = []
    for form in (frame.tobytes(), encode(stylus)):
        rig = new_rig().registered()
        rig.router.send_from(A, form)
        rig.drain(lambda: MS)
        rows.append(rig.row(MS))
    assert rows[0].tobytes() == rows[1].tobytes()  # the right hand is NaN
    assert (rows[0]["left_seq"], rows[0]["left_x"], rows[0]["left_sent_z"]) == (3, -0.25, 0.5)


def test_tick_waits_only_for_punctual_agents(rig: Rig) -> None:
    rig.registered()
    assert not rig.drain(lambda: 0)
    rig.router.send_from(A, STYLUS)
    assert rig.drain(lambda: 0)  # the right agent has never been in time
    rig.router.send_from(B, STYLUS)
    rig.drain(lambda: 0)
    rig.row(0)
    for agent, complete in ((B, False), (A, True)):
        rig.router.send_from(agent, replace(STYLUS, seq=1))
        assert rig.drain(lambda: MS) == complete
    rig.row(MS)
    rig.row(2 * MS)  # the left sample comes too late for this tick
    rig.router.send_from(B, replace(STYLUS, seq=2))
    assert rig.drain(lambda: 3 * MS)


def test_tick_waits_for_the_sample_after_one_that_just_missed_its_tick(rig: Rig) -> None:
    """Otherwise each sample of that side could miss its tick and be one millisecond late, for minutes."""
    early, late = 700_000, 710_000
    rig.registered()

    def completes_tick(peer: bytes, seq: int, at_ns: int, due_ns: int) -> bool:
        rig.router.send_from(peer, replace(STYLUS, seq=seq))
        return rig.drain(lambda: at_ns, due_ns)

    completes_tick(A, 0, early, MS)
    assert completes_tick(B, 0, late, MS)
    rig.row(MS)
    completes_tick(A, 1, MS + early, 2 * MS)
    rig.row(2 * MS)  # the right sample missed it
    completes_tick(B, 1, MS + late, 3 * MS)
    assert completes_tick(A, 2, 2 * MS + early, 3 * MS)  # no tick waits for a side that missed the last one
    rig.row(3 * MS)
    completes_tick(B, 2, 2 * MS + late, 4 * MS)
    assert not completes_tick(A, 3, 3 * MS + early, 4 * MS)
    assert completes_tick(B, 3, 3 * MS + late, 4 * MS)


def test_live_and_armed_agents_are_reported_every_tick(rig: Rig) -> None:
    rig.registered()
    rig.router.send_from(B, replace(STYLUS, safeguards=int(Safeguard.ARMED)))
    rig.drain(lambda: MS)
    rig.row(MS)
    assert rig.found == 2 * (LIVE | ARMED)
    rig.row(MS + TIMEOUT_NS)
    assert rig.found == 2 * ARMED


def test_device_is_armed_only_with_a_small_clock_bound(rig: Rig) -> None:
    rig.registered()
    for seq, delay_ns, may_arm in ((0, 600_000, False), (1, 400_000, True)):
        sent = seq * MS
        probe = replace(
            STYLUS, seq=seq, force_tick=4 * seq, force_sent_ns=sent, force_received_ns=sent, sent_ns=sent, stamp_ns=sent
        )
        rig.router.send_from(A, probe)
        rig.drain(lambda now=sent + 2 * delay_ns: now)
        rig.router.received_by(A)
        rig.port.send_heartbeat(0)
        (beat,) = rig.router.received_by(A)
        assert isinstance(beat, Heartbeat)
        assert beat.arm == may_arm
        missing = rig.port.find_missing(sent + 2 * delay_ns, SIDES)
        assert any("clock" in reason for reason in missing) != may_arm, missing
    assert rig.port.find_missing(MS, SIDES) == ["the left device to be armed", "the right agent"]
    assert rig.port.find_missing(MS, ("left",)) == ["the left device to be armed"]


def test_silent_agent_is_removed(rig: Rig) -> None:
    rig.registered()
    rig.port.expire(SILENCE_TIMEOUT_NS)
    assert not rig.port.empty
    rig.port.expire(SILENCE_TIMEOUT_NS + 1)
    assert rig.port.empty
    assert [details["reason"] for name, details in rig.port.news if name == "agent_left"] == ["fell silent"] * 2


def test_link_status_of_an_agent(rig: Rig) -> None:
    rig.registered()
    for seq in (0, 1, 4):
        rig.router.send_from(A, replace(STYLUS, seq=seq))
    rig.drain(lambda: MS)
    left, right = rig.port.links(3 * MS)
    assert left[:4] == ("agent.left", "host:1", "0", 0.002)
    assert left[8] == 2
    assert right[0] == "agent.right"


def test_departed_agent_frees_its_side_and_receives_nothing(rig: Rig) -> None:
    rig.registered()
    rig.router.send_from(A, Goodbye("done"))
    rig.drain(lambda: MS)
    assert rig.port.news == [("agent_left", {"side": "left", "reason": "done"})]
    rig.force(1)
    assert rig.router.received_by(A) == []
    assert len(rig.router.received_by(B)) == 1


def test_status_request_of_an_agent_is_refused(rig: Rig) -> None:
    rig.registered()
    rig.router.send_from(A, StatusRequest())
    rig.drain(lambda: MS)
    assert rig.router.received_by(A) == [Refusal("an agent does not send StatusRequest")]


@pytest.mark.parametrize("field", ["stamp_ns", "force_sent_ns", "force_received_ns", "sent_ns"])
@pytest.mark.parametrize("value", [2**63 - 1, -(2**63), MAX_STAMP_NS + 1])
def test_sample_with_out_of_range_stamps_is_ignored(rig: Rig, field: str, value: int) -> None:
    rig.registered()
    rig.router.send_from(A, replace(STYLUS, force_tick=0, **{field: value}))  # type: ignore[arg-type]
    rig.drain(lambda: MS)
    assert rig.row(MS)["left_live"] == 0
    assert rig.port.clock_records(0) == []


def test_sample_with_an_out_of_range_number_is_ignored(rig: Rig) -> None:
    """The server could not ask for the samples before it: the number after it does not fit a message."""
    rig.registered()
    rig.router.send_from(A, replace(STYLUS, seq=2**63 - 1))
    rig.drain(lambda: MS)
    assert rig.row(MS)["left_live"] == 0
    rig.router.send_from(A, STYLUS)
    rig.drain(lambda: MS)
    assert rig.row(MS)["left_live"] == 1


def test_sample_with_a_future_stamp_is_not_live(rig: Rig) -> None:
    rig.registered()
    probe = {"force_tick": 1, "force_sent_ns": 0, "force_received_ns": MS, "sent_ns": MS}
    rig.router.send_from(A, replace(STYLUS, stamp_ns=MS, **probe))  # type: ignore[arg-type]
    rig.drain(lambda: 2 * MS)
    assert rig.row(2 * MS)["left_live"] == 1
    rig.router.send_from(A, replace(STYLUS, seq=1, stamp_ns=10_000 * 10**9, **probe))  # type: ignore[arg-type]
    rig.drain(lambda: 3 * MS)
    assert rig.row(3 * MS)["left_live"] == 0
