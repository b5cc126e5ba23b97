"""Forces rendered while a link was cut: the agent stores them, the server requests them, and the ticks contain them."""

from collections.abc import Iterator
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
import pytest
from fake_router import hello
from motion_rig import MotionRig

from netboard.base.safeguards import Safeguard
from netboard.base.tick import KNOWN_NS, RENDERED, TICK
from netboard.network.protocol.motion import BACKFILL_ROWS, Backfill, BackfillRequest, Stylus
from netboard.network.protocol.records import BackfillRecord
from netboard.network.transport import sockets
from netboard.nodes.agent.rendered_buffer import RenderedRing
from netboard.nodes.ports.backfill import MAX_GAPS, REPEAT_INTERVAL_NS, Backfiller
from netboard.nodes.ports.motion_port import SILENCE_TIMEOUT_NS
from netboard.recording.format.backfill import Backfilled

MS = 1_000_000
AGENT = b"agent.left@1"
CLOCK_NS = 10**15
"""The agent's clock minus the server's [ns]."""
HOUSEKEEPING_TICKS = 10


def rendered(seq: int) -> float:
    return 0.43 - 1e-5 * seq


def guards(seq: int) -> int:
    return int(Safeguard.ARMED | (Safeguard.STALE if seq % 3 == 0 else Safeguard.CLAMPED))


@dataclass
class Link:
    """A server's motion port and an agent, connected by a link that can be cut; each tick takes 1 ms."""

    rig: MotionRig
    rows: Any = field(default_factory=lambda: np.zeros(1024, TICK))
    ring: RenderedRing = field(default_factory=RenderedRing)
    filler: Backfiller = field(default_factory=Backfiller)
    records: list[BackfillRecord] = field(default_factory=list)
    ticks: list[Any] = field(default_factory=list)
    requests: list[BackfillRequest] = field(default_factory=list)
    answers_lost: int = 0
    number: int = 0
    seq: int = -1

    @property
    def now_ns(self) -> int:
        return (1000 + self.number) * MS

    def connect(self) -> None:
        self.rig.router.send_from(AGENT, hello("agent", "left"))
        self.rig.drain(lambda: self.now_ns)
        self.rig.router.received_by(AGENT)

    def run(self, ticks: int, *, cut: bool = False) -> None:
        for _ in range(ticks):
            self._tick(cut=cut)

    def _tick(self, *, cut: bool) -> None:
        now = self.now_ns
        stamp, self.seq = now + CLOCK_NS - 300_000, self.seq + 1
        sample = Stylus(
            self.seq, stamp, *[0.0] * 6, 0, guards(self.seq), rendered(self.seq), self.number,
            now - 400_000, now + CLOCK_NS - 350_000, now + CLOCK_NS - 250_000, 0,
        )  # fmt: skip
        self.ring.add(self.seq, stamp, sample.rendered, sample.safeguards)
        if not cut:
            self.rig.router.send_from(AGENT, sample)
            self._answer()
        self.rig.drain(lambda: now - 200_000, now)
        row = self.rows[self.number % 1024 : self.number % 1024 + 1]
        self.rig.port.fill(row.view(np.int64), self.number, now, 0)
        self.ticks.append(row.copy())
        self.number += 1
        if self.number % HOUSEKEEPING_TICKS == 0:
            self.rig.port.expire(now)
            self.records += self.filler.attend(self.rig.port, self.rows, self.number, now)

    def _answer(self) -> None:
        for message in self.rig.router.received_by(AGENT):
            if isinstance(message, BackfillRequest):
                self.requests.append(message)
                if self.answers_lost:
                    self.answers_lost -= 1
                else:
                    self.rig.router.send_from(AGENT, self.ring.answer(message))

    def recorded(self) -> Any:
        return np.concatenate(self.ticks)

    def filled(self) -> Any:
        rows = self.recorded()
        Backfilled(self.records).fill(rows)
        return rows


@pytest.fixture
def link() -> Iterator[Link]:
    with sockets.open_context() as context:
        created = Link(MotionRig(context))
        created.connect()
        yield created


def assert_rows_match_rendered_forces(rows: Any, first: int) -> None:
    """Check that each tick has the force rendered at the newest sample before it."""
    np.testing.assert_array_equal(rows["left_rendered"], [rendered(tick + first) for tick in range(len(rows))])
    np.testing.assert_array_equal(rows["left_safeguards"], [guards(tick + first) for tick in range(len(rows))])


def test_tick_without_a_sample_has_no_rendered_force(link: Link) -> None:
    link.run(20)
    link.run(1000, cut=True)
    rows = link.recorded()[20:]
    known_ticks = KNOWN_NS // MS
    np.testing.assert_array_equal(rows["left_rendered"][: known_ticks - 1], rendered(19))
    assert np.isnan(rows["left_rendered"][known_ticks:]).all()
    assert np.isnan(rows["right_rendered"]).all(), "no right agent is connected"


@pytest.mark.slow
@pytest.mark.parametrize("away", [30, 700, SILENCE_TIMEOUT_NS // MS + 500])
def test_ticks_of_a_cut_are_backfilled_from_the_agent(link: Link, away: int) -> None:
    link.run(50)
    link.run(away, cut=True)
    if away * MS > SILENCE_TIMEOUT_NS:
        link.connect()
    link.answers_lost = 2
    link.run(50 + away // 2 + 3 * REPEAT_INTERVAL_NS // MS)
    known = link.filled()
    unknown = np.isnan(link.recorded()["left_rendered"])
    assert away - 5 < np.count_nonzero(unknown) <= away + 5
    filled = np.flatnonzero(unknown)
    assert_rows_match_rendered_forces(known[filled[0] : filled[-1] + 1], int(filled[0]))
    assert not np.isnan(known["left_rendered"]).any()
    assert [record.seq for record in link.records] == list(range(len(link.records)))
    assert max(len(record.rows) for record in link.records) <= BACKFILL_ROWS * RENDERED.itemsize
    assert len(link.requests) <= len(link.records) + 2 + 1


def test_agent_that_numbers_its_samples_absurdly_does_no_harm(link: Link) -> None:
    link.run(20)
    link.seq = 2**63 - 2
    link.run(1)
    link.seq = 20
    link.run(20)
    assert not link.requests
    assert link.recorded()["left_seq"].max() == 40


def test_cut_during_backfill_loses_nothing(link: Link) -> None:
    link.run(20)
    link.run(400, cut=True)
    link.run(80)
    assert 0 < len(link.records) < 400 // BACKFILL_ROWS
    link.run(300, cut=True)
    link.run(800)
    assert not np.isnan(link.filled()["left_rendered"]).any()


def test_restarted_agent_cannot_backfill(link: Link) -> None:
    link.run(100)
    link.run(500, cut=True)
    link.ring, link.seq = RenderedRing(), -1
    link.run(100, cut=True)
    link.rig.port.agents["left"].leave()
    link.connect()
    link.run(400)
    rows = link.filled()
    assert np.isnan(rows["left_rendered"][110:600]).all()
    np.testing.assert_array_equal(rows["left_rendered"][600:], [rendered(k) for k in range(500)])


def test_restarted_agent_is_not_asked_what_the_last_one_rendered(link: Link) -> None:
    link.run(20)
    link.run(200, cut=True)
    link.answers_lost = 10**6
    link.run(80)
    assert link.requests
    link.ring, link.seq = RenderedRing(), -1
    link.rig.port.agents["left"].leave()
    link.connect()
    link.run(100)
    link.requests.clear()
    link.run(3 * REPEAT_INTERVAL_NS // MS)  # the new agent has samples with the numbers of the first interruption
    assert link.requests == []


def test_nothing_is_requested_before_the_agent_connects(link: Link) -> None:
    link.run(500, cut=True)
    link.run(100)
    assert (link.requests, link.records) == ([], [])


def test_unrequested_or_invalid_backfills_are_ignored(link: Link) -> None:
    link.run(20)
    link.run(300, cut=True)
    link.answers_lost = 10**6
    link.run(100)
    (request, *_) = link.requests
    row = np.zeros(1, RENDERED).tobytes()
    for wrong in (
        Backfill(request.first + 1, request.stop, row),
        Backfill(request.first, request.first, row),
        Backfill(request.first, request.stop + 1, row),
        Backfill(request.first, request.stop, row[:-1]),
        Backfill(request.first, request.stop, row * (BACKFILL_ROWS + 1)),
    ):
        assert link.filler.take("left", wrong, 0) is None
    assert link.filler.take("right", Backfill(request.first, request.stop, row), 0) is None
    assert link.filler.take("left", Backfill(request.first, request.stop, row), 5) == BackfillRecord(0, "left", 5, row)
    assert link.filler.take("left", Backfill(request.first, request.stop, row), 5) is None


def test_ring_buffer_answers_only_for_what_it_still_holds() -> None:
    ring = RenderedRing(capacity=100)
    assert ring.answer(BackfillRequest(3, 9)) == Backfill(3, 9, b"")
    for seq in range(250):
        ring.add(seq, 10 * seq, rendered(seq), seq)
    answer = ring.answer(BackfillRequest(120, 240))
    rows = np.frombuffer(answer.rows, RENDERED)
    assert (answer.first, answer.next) == (120, 150 + BACKFILL_ROWS)
    np.testing.assert_array_equal(rows["seq"], np.arange(150, 150 + BACKFILL_ROWS))
    np.testing.assert_array_equal(rows["stamp_ns"], 10 * rows["seq"])
    np.testing.assert_array_equal(rows["rendered"], [rendered(seq) for seq in rows["seq"]])
    last = ring.answer(replace(BackfillRequest(answer.next, 240)))
    assert (last.next, len(last.rows)) == (240, (240 - answer.next) * RENDERED.itemsize)
    assert ring.answer(BackfillRequest(0, 150)) == Backfill(0, 150, b"")
    assert ring.answer(BackfillRequest(240, 400)).next == 400


def test_more_gaps_than_are_remembered_one_by_one_lose_nothing() -> None:
    filler, rows = Backfiller(), np.zeros(1024, TICK)
    number, missing = 0, set()
    for _ in range(MAX_GAPS + 7):
        for part in range(20):
            row, unknown = rows[number % 1024], part < 5 and number >= 20
            row["left_seq"], row["left_rendered"] = number, np.nan if unknown else 0.0
            missing |= {number} if unknown else set()
            number += 1
        filler.poll(rows, number)
    first = filler.due("left", 0)
    assert first is not None
    assert filler.due("left", REPEAT_INTERVAL_NS - 1) is None
    assert filler.due("left", REPEAT_INTERVAL_NS) == first
    assert filler.due("right", 0) is None
    requests = requested_in(filler)
    assert len(requests) == MAX_GAPS
    assert {seq for request in requests for seq in range(request.first, request.stop)} >= missing


def test_restarted_agent_is_asked_although_many_gaps_are_open() -> None:
    filler, rows = Backfiller(), np.zeros(1024, TICK)
    for number in range(1000):
        restarted = number >= 980
        row, unknown = rows[number], number % 10 < 5 and number >= 20
        row["left_seq"] = number - 980 if restarted else number
        row["left_rendered"] = np.nan if unknown else 0.0
    filler.poll(rows, 1000)
    assert requested_in(filler)[-1] == BackfillRequest(0, 16)


def requested_in(filler: Backfiller) -> list[BackfillRequest]:
    """Answer all requests to the left agent, and return them."""
    requests: list[BackfillRequest] = []
    while request := filler.due("left", 10 * REPEAT_INTERVAL_NS):
        requests.append(request)
        filler.take("left", Backfill(request.first, request.stop, np.zeros(1, RENDERED).tobytes()), 0)
    return requests


def test_answer_counts_only_while_the_clock_is_known(link: Link) -> None:
    link.run(20)
    link.run(600, cut=True)
    link.run(80)
    assert link.records
    clock = link.rig.port.agents["left"].clock
    before, link.records = len(link.records), []
    known = clock.offset_ns, clock.bound_ns
    attend = link.filler.attend

    def with_unknown_clock(*arguments: Any) -> list[BackfillRecord]:
        clock.offset_ns, clock.bound_ns = known[0] + 285 * MS, 300 * MS  # as after a first probe that took 0.6 s
        records = attend(*arguments)
        clock.offset_ns, clock.bound_ns = known
        return records

    link.filler.attend = with_unknown_clock  # type: ignore[method-assign]
    link.run(50)
    assert link.records == []
    assert link.filler.pending(link.rig.port, link.rows, link.number)
    link.filler.attend = attend  # type: ignore[method-assign]
    link.run(700)
    assert before + len(link.records) > 600 // BACKFILL_ROWS
    assert {record.offset_ns for record in link.records} == {known[0]}


def test_delayed_samples_do_not_hide_part_of_a_gap() -> None:
    filler, rows = Backfiller(), np.zeros(8192, TICK)
    rows["left_rendered"], rows["left_seq"] = np.nan, -1
    rows["left_rendered"][:1000], rows["left_seq"][:1000] = 0.0, np.arange(1000)
    for tick, seq in ((6000, 5700), (6001, 5800), (6003, 6002), (6004, 6003)):  # the first two were delayed by 0.3 s
        rows["left_rendered"][tick], rows["left_seq"][tick] = 0.0, seq
    filler.poll(rows, 6005)
    requested = {seq for request in requested_in(filler) for seq in range(request.first, request.stop)}
    assert requested >= set(range(999, 6003))
