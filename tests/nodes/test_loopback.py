"""The doctor's loop-back test of a trigger box: times, losses, a histogram, and words for a box that is not there."""

from pathlib import Path

import pytest

from netboard.base.tables.triggers import Triggers
from netboard.benchmarks.loop.trigger_box import PtyBox
from netboard.nodes.doctor.loopback import LoopbackTimes, examine, histogram, verdict


def ignore(done: float) -> None:
    """Discard the progress."""


def test_every_pulse_of_a_serial_box_comes_back(tmp_path: Path) -> None:
    with PtyBox(tmp_path) as box:
        triggers = Triggers(kind="serial", address=str(box.address), loopback=True, width=0.0005, gap=0.0)
        (found,) = examine(triggers, 20, "red", ignore)
    assert found.figures["lost"] == 0
    assert "20 pulses" in found.found
    assert box.received == [0] + 20 * [255, 0] + [0]  # low again before it is closed
    counts = [line.split("ms")[-1].split() for line in histogram(found)[1:-1]]
    assert sum(int(count[0]) for count in counts) == 20


def test_interrupted_test_leaves_the_lines_low(tmp_path: Path) -> None:
    def interrupt(done: float) -> None:
        raise KeyboardInterrupt

    with PtyBox(tmp_path) as box:
        triggers = Triggers(kind="serial", address=str(box.address), reset=False, width=0.0005, gap=0.0)
        with pytest.raises(KeyboardInterrupt):
            [*examine(triggers, 4, "red", interrupt)]
    assert box.received == [0, 255, 0]


def test_lost_pulses_are_counted_and_red(tmp_path: Path) -> None:
    with PtyBox(tmp_path, drops=2) as box:
        triggers = Triggers(kind="serial", address=str(box.address), loopback=True, width=0.0005, gap=0.0)
        (found,) = examine(triggers, 4, "red", ignore)
    assert (found.colour, found.figures["lost"]) == ("red", 2)
    assert "check the wire" in found.advice
    assert histogram(found)[-1].split()[:2] == ["lost", "2"]


def test_box_without_loopback_is_yellow_and_has_no_histogram() -> None:
    (found,) = examine(Triggers(kind="simulated", width=0.0005, gap=0.0), 2, "red", ignore)
    assert found.colour == "yellow"
    assert "loopback = true" in found.advice
    assert histogram(found) == []


def test_stand_in_is_never_green() -> None:
    (found,) = examine(Triggers(kind="simulated", loopback=True, width=0.0005, gap=0.0), 2, "red", ignore)
    assert (found.colour, found.advice) == ("yellow", "no pulse reaches an amplifier")


def test_slow_box_is_yellow() -> None:
    found = verdict("box", LoopbackTimes([0.1] * 10, [9.0] * 10), loopback=True, simulated=False)
    assert found.colour == "yellow"
    assert verdict("box", LoopbackTimes([0.1], [0.9]), loopback=True, simulated=False).colour == "green"


def test_absent_box_has_the_colour_of_the_machine_and_a_rig_without_one_no_line() -> None:
    (found,) = examine(Triggers(kind="serial", address="/dev/ttyNONE"), 2, "yellow", ignore)
    assert found.colour == "yellow"
    assert "no such port" in found.found
    assert [*examine(Triggers(), 2, "red", ignore)] == []
