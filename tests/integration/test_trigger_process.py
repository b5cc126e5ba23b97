"""`netboard trigger` as a process of a real session: a pulse for each event with a code, also around lost boxes."""

import time
from collections.abc import Sequence
from pathlib import Path

import pytest

from netboard.base.tables.triggers import Triggers, code_of, codes_of
from netboard.benchmarks.harness.rig import ACTIVE, Rig
from netboard.benchmarks.loop.trigger_box import PtyBox
from netboard.network.protocol.control import Status
from netboard.network.protocol.records import EventRecord
from netboard.network.protocol.triggers import TRIGGER, TRIGGER_BOX, TRIGGER_LOST
from netboard.recording.files.reader import Recording
from netboard.recording.integrity.verification import verify_recording

pytestmark = [pytest.mark.integration, pytest.mark.quiet, pytest.mark.slow, pytest.mark.timeout(240)]

TRIALS = (
    "task.level_time=0.05",
    "task.level_angle_deg=5.0",
    "task.level_rate_deg_s=30.0",
    "network.sample_timeout_ms=1000",
    "block.trials=50",
)
"""Short trials that a slow machine does not pause."""


def start(rig: Rig) -> None:
    """Start a session with its trigger box, and wait for a trial."""
    rig.start_all()
    waiting = rig.until(lambda s: "logger" in s.peers and len(s.stations) == 2)
    assert waiting.phase == "idle", "a block waits for its trigger box"
    rig.start("trigger", "trigger")
    rig.until(lambda s: s.phase in ACTIVE)


def abort(rig: Rig, times: int = 1) -> Status:
    """Abort attempts, whose events have codes; return a status of the next attempt."""
    for _ in range(times):
        rig.until(lambda s: s.phase == "running")  # the release of the ball has a code
        rig.operator.do("abort")  # refused if the ball has just fallen, which has one, too
    return rig.until(lambda s: s.phase in ACTIVE)


def events_of(recordings: Sequence[Path]) -> list[EventRecord]:
    """Return the events of the only recording, which verifies."""
    (path,) = recordings
    with Recording(path) as recording:
        assert verify_recording(recording).identical
        return list(recording.events())


def coded(events: Sequence[EventRecord]) -> list[tuple[str, str, str]]:
    """Return event, tick and code of each event that has a code, in order."""
    codes = codes_of(Triggers())
    found = ((event, code_of(codes, event.name, event.details)) for event in events)
    return [(event.name, str(event.tick), str(code)) for event, code in found if code]


def pulses(events: Sequence[EventRecord], *kinds: str) -> list[tuple[str, str, str]]:
    """Return event, tick and code of each pulse that was made or lost, in the order of their events."""
    made = [event.details for event in events if event.name in kinds]
    found = [(one["event"], one["event_tick"], one["code"]) for one in made]
    return sorted(found, key=lambda one: int(one[1]))


def test_every_event_with_a_code_has_its_pulse(tmp_path: Path) -> None:
    with Rig(tmp_path, (*TRIALS, "triggers.kind=simulated", "triggers.loopback=true")) as rig:
        start(rig)
        abort(rig, 3)
        events = events_of(rig.finish())
        assert rig.stop("trigger") == 0
        said = rig.output_of("trigger")
    assert pulses(events, TRIGGER_LOST) == []
    assert {name for name, *_ in coded(events)} >= {"start", "level", "stop"}
    assert pulses(events, TRIGGER) == coded(events)
    made = [event.details for event in events if event.name == TRIGGER]
    assert all(float(one["latency_us"]) > 0 and float(one["loopback_us"]) >= 0 for one in made)
    assert f"{len(made)} pulses made, 0 failed" in said


def test_session_goes_on_while_the_box_is_unplugged_and_its_process_killed(tmp_path: Path) -> None:
    with PtyBox(tmp_path) as box, Rig(tmp_path, (*TRIALS, "triggers.kind=serial", *at(box))) as rig:
        start(rig)
        box.unplug()
        gone = rig.until(lambda s: "the trigger box is not ready" in s.notice)
        assert "was unplugged" in gone.notice
        assert gone.phase != "paused"
        abort(rig)
        box.plug_in()
        rig.until(lambda s: "is not ready" not in s.notice)
        abort(rig)
        rig.kill("trigger")
        rig.until(lambda s: "netboard trigger is not connected" in s.notice)
        abort(rig)
        rig.start("trigger", "trigger")
        rig.until(lambda s: "is not ready" not in s.notice)
        abort(rig)
        events = events_of(rig.finish())
        assert rig.stop("trigger") == 0
        until = time.monotonic() + 5
        while box.received[-1] != 0 and time.monotonic() < until:
            time.sleep(0.01)
    assert box.received[-1] == 0, "its lines are low"
    assert pulses(events, TRIGGER, TRIGGER_LOST) == coded(events), "each event has a pulse, or the reason why not"
    reasons = {event.details["reason"] for event in events if event.name == TRIGGER_LOST}
    assert any("unplugged" in reason or "no such port" in reason for reason in reasons)
    assert any("not connected" in reason for reason in reasons)
    states = [event.details["ready"] for event in events if event.name == TRIGGER_BOX]
    assert states.count("true") >= 3
    assert "false" in states


def at(box: PtyBox) -> tuple[str, ...]:
    """Return the settings of a serial box."""
    return (f"triggers.address={box.address}", "triggers.loopback=true")
