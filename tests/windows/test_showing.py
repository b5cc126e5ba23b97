"""A running display: painting at refreshes, extrapolation between views, and markers sent with their frames."""

import os
import sys
from dataclasses import replace
from itertools import count

import pytest
from display_parts import VIEW, WORDS, bytes_from, until

from netboard.base.clock import now_ns
from netboard.base.config import Config
from netboard.base.errors import NetboardError
from netboard.base.tables.rig import Display
from netboard.windows.participant.markers import CODES, NoMarkers, open_markers
from netboard.windows.participant.screens import blank

MS = 1_000_000


class CollectingMarkers:
    """Markers that only collect their events."""

    def __init__(self):
        self.events = []

    def mark(self, event):
        self.events.append(event)

    def close(self):
        self.events.append("closed")


@pytest.fixture
def make(app, board):
    from netboard.windows.participant.showing import Showing

    view, paints = board

    def made(markers=None, **display):
        config = replace(Config(), display=Display(**display))
        return Showing("left", config, WORDS, markers or NoMarkers(), view.window())

    made.board, made.paints = view, paints
    return made


def take(showing, number, **changes):
    """Hand over a view that has just arrived, 8 ticks after the previous one."""
    now = now_ns()
    showing.take(replace(VIEW, **{"seq": number, "tick": 8 * number, "sent_ns": now - MS // 2, **changes}), now)


@pytest.mark.slow
def test_moving_board_is_extrapolated_and_then_settles_on_the_newest_view(app, make):
    showing = make()
    take(showing, 0, z=0.0)
    assert until(app, lambda: showing.tally.painted == 1)

    def height():
        return make.board.picture.handles[0][1]

    seqs = count(1)

    def drawn_beyond():
        """Return whether the board is drawn beyond its newest view within the 0.1 s after two moving views."""
        now = now_ns()
        for z, sent_ns in ((0.01, now - 40 * MS), (0.02, now)):
            seq = next(seqs)
            showing.take(replace(VIEW, seq=seq, tick=40 * seq, sent_ns=sent_ns, z=z), now)
        return until(app, lambda: height() > 0.0205, seconds=0.1)

    assert until(app, drawn_beyond)
    assert until(app, lambda: height() == pytest.approx(0.02, abs=1e-12))

    def still():
        """Return whether nothing is painted for 0.2 s, which is so once all pending views are painted."""
        painted = showing.tally.painted
        return not until(app, lambda: showing.tally.painted > painted, seconds=0.2)

    assert until(app, still)


def test_views_are_drawn_as_received_without_smoothing(app, make):
    showing = make(smooth=False)
    heights = set()
    make.board.painted.connect(lambda: heights.add(round(make.board.picture.handles[0][1], 4)))
    for number in range(3):
        take(showing, number, z=0.01 * number)
        assert until(app, lambda number=number: showing.tally.painted == number + 1)
    assert heights == {0.0, 0.01, 0.02}


def test_each_event_is_marked_once_when_painted(app, make):
    markers = CollectingMarkers()
    showing = make(markers)
    take(showing, 0, phase="holding", share=0.99, p=0.15)
    assert markers.events == []
    assert until(app, lambda: markers.events == ["holding"])
    take(showing, 1, phase="levelling", trial=5, target=-0.15, p=0.15, completion=2.0)
    take(showing, 2, phase="levelling", trial=5, target=-0.15, p=0.15, completion=2.0)
    assert until(app, lambda: markers.events == ["holding", "succeeded", "levelling"])
    assert make.board.picture.headline == "Well done"
    showing.blank(blank(Config(), WORDS, "Connection lost", lost=True))
    assert until(app, lambda: markers.events[3:] == ["blank"])
    showing.close()
    assert markers.events[4:] == ["closed"]


def test_invisible_change_is_marked_without_a_paint(app, make):
    markers = CollectingMarkers()
    showing = make(markers)
    take(showing, 0, phase="away", p=None, left=None)
    assert until(app, lambda: markers.events == ["away"])
    take(showing, 1, phase="away", p=None, left=None, block=2)
    assert until(app, lambda: markers.events == ["away", "away"])
    assert showing.tally.painted == 1


@pytest.mark.skipif(sys.platform == "win32", reason="serial ports are POSIX's here")
def test_serial_port_gets_the_phases_of_a_trial(app, make):
    ours, theirs = os.openpty()
    showing = make(open_markers(os.ttyname(theirs), "left", "127.0.0.1:5550"))
    for number, phase in enumerate(("levelling", "running", "holding")):
        take(showing, number, phase=phase, p=0.15)
        assert until(app, lambda: showing.tally.painted > number)  # noqa: B023  (called at once)
    assert bytes_from(ours, 3) == [CODES["levelling"], CODES["running"], CODES["holding"]]
    showing.close()
    os.close(theirs)
    os.close(ours)


def test_failing_marker_outlet_is_logged_and_the_board_is_still_shown(app, make, caplog):
    class Broken(NoMarkers):
        def mark(self, event):
            raise NetboardError(f"the marker {event!r} was not sent")

    showing = make(Broken())
    take(showing, 0)
    assert until(app, lambda: showing.tally.painted == 1)
    assert "'running' was not sent" in caplog.text


def test_photodiode_patch_and_pilot_band_are_drawn(app, make):
    showing = make(patch=True)
    showing.config = replace(showing.config, session=replace(showing.config.session, pilot=True))
    take(showing, 0, phase="levelling")
    assert until(app, lambda: showing.tally.painted == 1)

    def corner():
        return make.board.grab().toImage().pixelColor(make.board.width() - 3, make.board.height() - 3).name()

    assert corner() == "#000000"
    assert make.board.grab().toImage().pixelColor(5, 5).name() == "#f0e442"
    take(showing, 1, phase="running")
    assert until(app, lambda: showing.tally.painted == 2)
    assert corner() == "#ffffff"
