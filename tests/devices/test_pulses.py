"""Pulses of a trigger box: one at a time, none merged, none dropped."""

from itertools import pairwise

from hypothesis import given
from hypothesis import strategies as st

from netboard.base.tables.triggers import Triggers
from netboard.devices.triggers.pulses import EDGE_NS, MAX_WAITING, TOO_MANY, Pulse, Pulses

MS = 1_000_000
WRITE_NS = 10_000


class Bench:
    """Runs pulses by a clock of its own; ``wrote``: the codes and when each was written [ns]."""

    def __init__(self, **settings: object) -> None:
        self.pulses = Pulses(Triggers(**settings))  # type: ignore[arg-type]
        self.now_ns = 0
        self.wrote: list[tuple[int, int]] = []

    def run(self, until_ns: int) -> list[Pulse]:
        """Write what is due until a time; return the pulses that are done by then."""
        while True:
            while (code := self.pulses.due(self.now_ns)) is not None:
                self.wrote.append((self.now_ns, code))
                self.pulses.wrote(self.now_ns, self.now_ns + WRITE_NS)
                self.now_ns += WRITE_NS
            self.pulses.expire(self.now_ns)
            wake_ns = self.pulses.wake_ns()
            if wake_ns is None or wake_ns > until_ns:
                self.now_ns = max(self.now_ns, until_ns)
                return self.pulses.done
            self.now_ns = max(self.now_ns, wake_ns)


def test_pulse_begins_at_once_and_ends_after_its_width() -> None:
    bench = Bench()
    bench.pulses.want(0, 9, 0)
    (pulse,) = bench.run(10 * MS)
    assert bench.wrote == [(0, 9), (5 * MS + WRITE_NS, 0)]
    assert (pulse.began_ns, pulse.ended_ns, pulse.waited_ns, pulse.fault) == (WRITE_NS, 5 * MS + 2 * WRITE_NS, 0, "")


def test_two_events_in_one_tick_give_two_pulses_the_second_after_the_gap() -> None:
    bench = Bench()
    bench.pulses.want(0, 4, 0)
    bench.pulses.want(1, 7, 0)
    first, second = bench.run(30 * MS)
    assert [code for _, code in bench.wrote] == [4, 0, 7, 0]
    assert first.waited_ns == 0
    assert second.waited_ns == first.ended_ns + 5 * MS


def test_box_that_ends_its_pulses_gets_no_code_0() -> None:
    bench = Bench(reset=False)
    bench.pulses.want(0, 4, 0)
    bench.pulses.want(1, 7, 0)
    assert len(bench.run(30 * MS)) == 2
    assert [code for _, code in bench.wrote] == [4, 7]
    assert bench.wrote[1][0] >= 10 * MS


def test_edge_belongs_to_the_oldest_pulse_without_one() -> None:
    bench = Bench(loopback=True)
    bench.pulses.want(0, 1, 0)
    bench.run(MS)
    assert bench.pulses.edge(bench.now_ns)
    assert not bench.pulses.edge(bench.now_ns)  # an input pulse of its own
    (pulse,) = bench.run(10 * MS)
    assert pulse.edge_ns == MS


def test_pulse_without_its_edge_is_done_after_the_timeout() -> None:
    bench = Bench(loopback=True)
    bench.pulses.want(0, 1, 0)
    assert bench.run(EDGE_NS) == []
    (pulse,) = bench.run(EDGE_NS + MS)
    assert (pulse.edge_ns, pulse.fault) == (0, "")


def test_lost_box_fails_every_pulse_once() -> None:
    bench = Bench(loopback=True)
    for number in range(3):
        bench.pulses.want(number, 1, 0)
    bench.run(MS)
    bench.pulses.fail("it was unplugged")
    assert sorted((pulse.number, pulse.fault) for pulse in bench.pulses.done) == [
        (number, "it was unplugged") for number in range(3)
    ]
    assert bench.pulses.wake_ns() is None


def test_newest_of_too_many_pulses_is_refused() -> None:
    bench = Bench()
    for number in range(MAX_WAITING + 1):
        bench.pulses.want(number, 1, 0)
    assert [(pulse.number, pulse.fault) for pulse in bench.pulses.done] == [(MAX_WAITING, TOO_MANY)]


@given(st.lists(st.integers(0, 40), max_size=MAX_WAITING), st.booleans())
def test_every_code_comes_once_in_order_with_the_gap_between(times_ms: list[int], reset: bool) -> None:
    bench = Bench(reset=reset, width=0.002, gap=0.003)
    for number, at_ms in enumerate(sorted(times_ms)):
        bench.run(at_ms * MS)
        bench.pulses.want(number, number + 1, bench.now_ns)
    done = bench.run(10**9)
    assert [pulse.number for pulse in done] == [*range(len(times_ms))]
    assert [code for _, code in bench.wrote if code] == [*range(1, len(times_ms) + 1)]
    for before, after in pairwise(done):
        assert after.begin_ns - before.ended_ns >= 3 * MS
        assert before.ended_ns - before.began_ns >= 2 * MS
