"""The two seats: who may sit, which sample counts, what is answered."""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from fake_router import WELCOME, FakeRouter, hello

from netboard.nodes.motion_port import BEAT_TICKS, MOST_FRAMES, SANE_NS, MotionPort
from netboard.nodes.refusals import AGAIN_NS, REMEMBERED
from netboard.tick import TICK
from netboard.wire.messages import Beat, Force, Goodbye, Refusal, Safeguard, StatusRequest, Stylus, Welcome

TIMEOUT_NS = 50_000_000
MS = 1_000_000
A, B = b"agent.left@1", b"agent.right@2"
STYLUS = Stylus(0, 0, 0.0, 0.0, 0.01, 0.0, 0.0, 0.1, 0, 0, 0.0, -1, 0, 0, 0, 0)


class Rig:
    """A port with its fake socket."""

    def __init__(self) -> None:
        self.router = FakeRouter()
        self.port = MotionPort(self.router, WELCOME, TIMEOUT_NS)  # type: ignore[arg-type]

    def seated(self) -> "Rig":
        self.router.say(A, hello("agent", "left"))
        self.router.say(B, hello("agent", "right"))
        self.port.drain(lambda: 0)
        assert [type(m) for m in self.router.heard(A) + self.router.heard(B)] == [Welcome, Welcome]
        self.port.news.clear()
        return self

    def row(self, now_ns: int) -> Any:
        row = np.zeros(1, TICK)[0]
        self.port.fill(row, now_ns)
        return row


def test_a_stranger_is_told_to_say_hello_and_a_sitter_is_not() -> None:
    rig = Rig()
    rig.router.say(A, STYLUS)
    rig.port.drain(lambda: 0)
    assert rig.router.heard(A) == [Refusal("say hello first")]
    rig.seated().router.say(A, STYLUS)
    rig.port.drain(lambda: MS)
    assert rig.router.heard(A) == []
    assert rig.row(MS)["left_live"] == 1


@pytest.mark.parametrize(
    "message",
    [hello("display", "left"), hello("agent", ""), replace(hello("agent", "left"), protocol=99), b"\x00nonsense"],
)
def test_who_does_not_belong_is_refused_in_words_and_noted(message: Any) -> None:
    rig = Rig()
    rig.router.say(A, message)
    rig.port.drain(lambda: 0)
    (answer,) = rig.router.heard(A)
    assert isinstance(answer, Refusal)
    assert answer.reason
    assert [name for name, _ in rig.port.news] == ["refused"]


def test_a_second_agent_for_a_side_waits_until_the_first_is_gone() -> None:
    rig = Rig().seated()
    rig.router.say(b"other", hello("agent", "left", "host:9"))
    rig.port.drain(lambda: MS)
    (answer,) = rig.router.heard(b"other")
    assert isinstance(answer, Refusal)
    assert "already has an agent: host:1" in answer.reason
    rig.router.say(b"other", hello("agent", "left", "host:9"))
    rig.port.drain(lambda: MS + TIMEOUT_NS)
    assert isinstance(rig.router.heard(b"other")[0], Welcome)
    rig.router.say(A, STYLUS)
    rig.port.drain(lambda: MS + TIMEOUT_NS)
    assert rig.router.heard(A) == [Refusal("say hello first")]


def test_the_newest_sample_wins_whatever_the_order() -> None:
    rig = Rig().seated()
    for seq in (3, 5, 4, 5, 1):
        rig.router.say(A, replace(STYLUS, seq=seq, z=seq * 1e-3))
    rig.port.drain(lambda: MS)
    row = rig.row(MS)
    assert (row["left_seq"], row["left_sent_z"]) == (5, 5e-3)
    assert (row["right_seq"], row["right_live"]) == (-1, 0)


def test_a_sample_grows_old_and_one_that_is_no_number_never_counts() -> None:
    rig = Rig().seated()
    rig.router.say(A, STYLUS)
    rig.port.drain(lambda: 0)
    assert rig.row(TIMEOUT_NS - 1)["left_live"] == 1
    assert rig.row(TIMEOUT_NS)["left_live"] == 0
    rig.router.say(A, replace(STYLUS, seq=1, vz=float("nan")))
    rig.port.drain(lambda: TIMEOUT_NS)
    assert rig.row(TIMEOUT_NS)["left_live"] == 0


def test_stamps_are_turned_into_server_time_by_the_probes_in_the_samples() -> None:
    rig = Rig().seated()
    ahead = 7_000_000_000
    sent, received, answered = 10 * MS, 10 * MS + 100_000 + ahead, 10 * MS + 300_000 + ahead
    probe = replace(
        STYLUS, stamp_ns=answered, force_tick=1, force_sent_ns=sent, force_received_ns=received, sent_ns=answered
    )
    rig.router.say(A, probe)
    rig.port.drain(lambda: 10 * MS + 400_000)
    assert rig.row(11 * MS)["left_stamp_ns"] == answered - ahead
    (record,) = rig.port.clock_records(0)
    assert (record.peer, record.offset_ns) == ("agent.left", ahead)
    assert record.bound_ns >= 100_000


def test_what_the_safety_chain_did_between_two_ticks_is_not_lost_nor_told_twice() -> None:
    rig = Rig().seated()
    for seq, bits in enumerate((Safeguard.ARMED | Safeguard.CLAMPED, Safeguard.ARMED)):
        rig.router.say(A, replace(STYLUS, seq=seq, safeguards=int(bits)))
    rig.port.drain(lambda: MS)
    assert rig.row(MS)["left_safeguards"] == Safeguard.ARMED | Safeguard.CLAMPED
    assert rig.row(MS)["left_safeguards"] == 0


def test_forces_go_every_tick_and_beats_now_and_then_without_a_force() -> None:
    rig = Rig().seated()
    row = np.zeros(1, TICK)[0]
    row["left_force"], row["right_force"] = -0.5, 0.25
    for tick in range(2 * BEAT_TICKS):
        row["tick"] = tick
        rig.port.answer(row, True, tick)
    assert [(m.tick, m.force) for m in rig.router.heard(A)] == [(t, -0.5) for t in range(2 * BEAT_TICKS)]  # type: ignore[union-attr]
    assert isinstance(rig.router.heard(B)[0], Force)
    for tick in range(2 * BEAT_TICKS):
        row["tick"] = tick
        rig.port.answer(row, False, tick)
    beats = rig.router.heard(A)
    assert [type(m) for m in beats] == [Beat, Beat]


def test_an_agent_that_leaves_frees_its_seat_and_is_sent_nothing_more() -> None:
    rig = Rig().seated()
    rig.router.say(A, Goodbye("done"))
    rig.port.drain(lambda: MS)
    assert rig.port.news == [("agent_left", {"side": "left", "reason": "done"})]
    rig.port.answer(np.zeros(1, TICK)[0], True, MS)
    assert rig.router.heard(A) == []
    assert len(rig.router.heard(B)) == 1


def test_an_agent_cannot_ask_what_only_an_operator_may() -> None:
    rig = Rig().seated()
    rig.router.say(A, StatusRequest())
    rig.port.drain(lambda: MS)
    assert rig.router.heard(A) == [Refusal("an agent does not send StatusRequest")]


@pytest.mark.parametrize("field", ["stamp_ns", "force_sent_ns", "force_received_ns", "sent_ns"])
@pytest.mark.parametrize("value", [2**63 - 1, -(2**63), SANE_NS + 1])
def test_nonsense_stamps_are_no_sample_and_do_no_harm(field: str, value: int) -> None:
    rig = Rig().seated()
    rig.router.say(A, replace(STYLUS, force_tick=0, **{field: value}))  # type: ignore[arg-type]
    rig.port.drain(lambda: MS)
    assert rig.row(MS)["left_live"] == 0
    assert rig.port.clock_records(0) == []


def test_a_sample_from_the_future_does_not_stay_live_when_its_agent_falls_silent() -> None:
    rig = Rig().seated()
    probe = {"force_tick": 1, "force_sent_ns": 0, "force_received_ns": MS, "sent_ns": MS}
    rig.router.say(A, replace(STYLUS, stamp_ns=MS, **probe))  # type: ignore[arg-type]
    rig.port.drain(lambda: 2 * MS)
    assert rig.row(2 * MS)["left_live"] == 1
    rig.router.say(A, replace(STYLUS, seq=1, stamp_ns=10_000 * 10**9, **probe))  # type: ignore[arg-type]
    rig.port.drain(lambda: 3 * MS)
    assert rig.row(3 * MS)["left_live"] == 0


def test_a_flood_is_taken_bit_by_bit_answered_once_a_second_and_noted_with_its_number() -> None:
    rig = Rig().seated()
    for _ in range(10 * MOST_FRAMES):
        rig.router.say(b"flood", b"\x00")
    rig.router.say(A, STYLUS)
    for tick in range(11):
        rig.port.drain(lambda now=tick * MS: now)
    assert rig.row(11 * MS)["left_live"] == 1
    assert len(rig.router.heard(b"flood")) == 1
    assert [name for name, _ in rig.port.news] == ["refused"]
    rig.router.say(b"flood", b"\x00")
    rig.port.drain(lambda: AGAIN_NS)
    assert rig.port.news[-1][1]["times"] == str(10 * MOST_FRAMES + 1)


def test_however_many_strangers_there_are_only_so_many_are_told_apart() -> None:
    rig = Rig()
    for number in range(2000):
        rig.router.say(b"stranger %d" % number, b"\x00")
    for tick in range(40):
        rig.port.drain(lambda now=tick: now)
    assert len(rig.port.news) == REMEMBERED + 1
