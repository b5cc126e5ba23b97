"""Counts of painted and dropped frames."""

from hypothesis import given
from hypothesis import strategies as st

from netboard.network.protocol.codec import decode, encode
from netboard.windows.participant.frames import MAX_KEPT, FrameTally

MS = 1_000_000
PERIOD = 16 * MS


def test_views_painted_in_time_are_no_drops():
    tally = FrameTally("left", PERIOD)
    for seq in range(63):
        at = 16 * seq * MS
        tally.receive(seq, at)
        tally.expect(16 * seq, at, at)
        assert tally.paint(at + 2 * MS)
    assert (tally.painted, tally.dropped) == (63, 0)


def test_views_faster_than_the_screen_are_no_drops():
    tally = FrameTally("left", PERIOD)
    for seq in range(125):
        tally.receive(seq, 8 * seq * MS)
    for seq in range(125, 250, 2):  # every other one was replaced before it arrived
        tally.receive(seq, 8 * seq * MS)
    assert tally.dropped == 0


def test_views_slower_than_the_screen_are_no_drops():
    tally = FrameTally("left", PERIOD)
    for seq in range(20):
        tally.receive(seq, 50 * seq * MS)
    assert tally.dropped == 0


def test_gap_of_three_frames_is_three_drops_and_a_restarted_count_is_none():
    tally = FrameTally("left", PERIOD)
    tally.receive(1000, 0)
    tally.receive(1004, 4 * PERIOD)
    assert tally.dropped == 3
    tally.receive(1006, 14 * PERIOD)  # one view was sent in ten periods, and was lost
    assert tally.dropped == 4
    tally.receive(5, 15 * PERIOD)
    assert tally.dropped == 4


def test_replaced_and_late_frames_are_drops():
    tally = FrameTally("right", PERIOD)
    tally.expect(1, 0, 0)
    tally.expect(2, 20 * MS, 20 * MS)
    assert tally.dropped == 1
    assert tally.paint(20 * MS + PERIOD + 1)
    assert tally.dropped == 2
    tally.expect(3, 0, 100 * MS)
    tally.paint(100 * MS + 3 * PERIOD)
    assert tally.dropped == 5


def test_paint_without_a_waiting_view_is_not_a_frame():
    tally = FrameTally("left", PERIOD)
    assert not tally.paint(5)
    assert tally.painted == 0
    assert tally.report() is None


@given(st.lists(st.sampled_from("wpc"), max_size=60))
def test_every_painted_frame_is_reported_once(steps):
    tally = FrameTally("left", PERIOD)
    waited, reported = 0, []
    for i, step in enumerate(steps):
        if step == "w":
            tally.expect(i, i, i)
            waited += 1
        elif step == "p":
            tally.paint(i)
        elif (frames := tally.report()) is not None:
            assert tally.report() == frames
            reported += frames.shown
            tally.clear()
    last = tally.report()
    reported += last.shown if last else ()
    assert len(reported) == tally.painted
    assert [tick for tick, _, _ in reported] == sorted({tick for tick, _, _ in reported})
    assert waited - tally.painted - tally.dropped in (0, 1)


def test_unreported_frames_stay_within_the_size_of_a_report():
    tally = FrameTally("left", PERIOD)
    for number in range(2 * MAX_KEPT):
        tally.receive(number, number)
        tally.expect(number, -(2**62), 2**62)
        tally.paint(2**62)
    for far in (2**63 - 1, -(2**63)) * 100:
        tally.receive(far, far)
    reported_ticks: list[int] = []
    while (report := tally.report()) is not None:
        assert decode(encode(report)) == report
        assert tally.report() == report
        reported_ticks += [tick for tick, _, _ in report.shown]
        tally.clear()
    assert reported_ticks == list(range(MAX_KEPT, 2 * MAX_KEPT))
