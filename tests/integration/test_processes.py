"""Real processes on real sockets: a session from start to verified recording, and faults in it."""

import json
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from pathlib import Path

import numpy as np
import pytest

from netboard.base.config import parse
from netboard.base.safeguards import Safeguard
from netboard.benchmarks.harness.rig import Rig
from netboard.network.transport import channels, sockets
from netboard.recording.files.reader import Recording
from netboard.recording.integrity.verification import verify_recording
from netboard.recording.recovery.recover import recover
from netboard.task.trials.state_machine import Cause, Phase

pytestmark = [pytest.mark.integration, pytest.mark.quiet, pytest.mark.slow, pytest.mark.timeout(240)]

QUICK_TRIALS = (
    "task.level_time=0.05",
    "task.level_angle_deg=5.0",
    "task.level_rate_deg_s=30.0",
    "network.sample_timeout_ms=1000",
)
"""The ball is released almost at once, and a slow machine does not pause the trial."""


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    return tmp_path


@pytest.fixture
def rig(folder: Path) -> Iterator[Rig]:
    with Rig(folder, (*QUICK_TRIALS, "block.trials=50")) as rig:
        yield rig


def verified(path: Path) -> np.ndarray:
    """Ticks of a recording that a replay reproduces bit by bit."""
    with Recording(path) as recording:
        ticks = recording.ticks()
        verdict = verify_recording(recording)
    assert verdict.identical, verdict
    return ticks


def test_session_is_recorded_completely_and_verifies(rig: Rig) -> None:
    rig.start_all(displays=True)
    rig.until(lambda s: s.phase == "running")
    status = rig.until(lambda s: {"display.left", "display.right", "logger"} <= set(s.peers) and s.tick > 4000)
    (path,) = rig.finish()
    ticks = verified(path)
    assert ticks["tick"].tolist() == list(range(len(ticks)))
    assert len(ticks) >= status.tick
    with Recording(path) as recording:
        names = [event.name for event in recording.events()]
        assert [event.seq for event in recording.events()] == list(range(len(names)))
        assert names[:2] == ["block_began", "session_started"]
        assert names[-1] == "session_ended"
        assert {"agent_joined", "display_joined", "start", "level"} <= set(names)
        assert {frame.station for frame in recording.frames()} == {"left", "right"}
        peers = {clock.peer for clock in recording.clocks()}
        assert peers >= {"agent.left", "agent.right", "display.left", "display.right", "logger", "console"}
        assert parse(recording.config_text) == rig.config
        assert recording.metadata["session"] == status.session
    live = ticks[(ticks["left_live"] == 1) & (ticks["phase"] == Phase.RUNNING)]
    assert np.nan_to_num(live["left_rendered"]).any()
    assert np.any(live["left_loop_ns"] > 0)
    for side in ("left", "right"):
        assert rig.stop(f"{side} agent") == 0
        assert rig.stop(f"{side} display") == 0


@pytest.mark.sampled(2, of="processes")
def test_clocks_of_processes_on_one_machine_agree_within_their_bounds(rig: Rig) -> None:
    rig.start_all()
    rig.until(lambda s: s.tick > 5000 and s.phase != "idle")
    (path,) = rig.finish()
    with Recording(path) as recording:
        clocks = [clock for clock in recording.clocks() if clock.seq >= 2]
    assert clocks
    assert [clock for clock in clocks if abs(clock.offset_ns) > clock.bound_ns] == []


@pytest.mark.sampled(2, of="processes")
def test_services_start_in_any_order_and_report_what_they_wait_for(rig: Rig) -> None:
    rig.start("right agent", "agent", "--side", "right")
    rig.start("server", "server")
    status = rig.until(lambda s: "the left agent" in s.waiting_for and "agent.right" in s.peers)
    assert "the logger" in status.waiting_for
    assert status.phase == "idle"
    assert "waiting for" in status.notice
    rig.start("left agent", "agent", "--side", "left")
    rig.until(lambda s: s.waiting_for == ("the logger",))
    rig.start("logger", "logger", "--once")
    rig.until(lambda s: s.phase == "running")
    (path,) = rig.finish()
    assert verified(path)["tick"][0] == 0


@pytest.mark.sampled(2, of="processes")
def test_killed_agent_pauses_the_trial_and_a_new_agent_resumes_it(rig: Rig) -> None:
    rig.start_all()
    before = rig.until(lambda s: s.phase == "running")
    rig.kill("left agent")
    paused = rig.until(lambda s: s.phase == "paused")
    assert "left agent" in paused.notice
    rig.start("left agent", "agent", "--side", "left")
    rig.until(lambda s: s.phase == "running")
    (path,) = rig.finish()
    ticks = verified(path)
    fault = ticks[ticks["event"] == Cause.FAULT][0]
    again = ticks[(ticks["tick"] > fault["tick"]) & (ticks["phase"] == Phase.RUNNING)][0]
    assert (again["trial"], again["attempt"]) == (fault["trial"], fault["attempt"] + 1)
    assert again["trial"] >= before.trial
    after = ticks[(ticks["tick"] > fault["tick"]) & (ticks["phase"] == Phase.PAUSED)]
    assert not after["right_force"].any()


@pytest.mark.sampled(2, of="processes")
def test_killed_logger_loses_no_ticks_buffered_by_the_server(rig: Rig) -> None:
    rig.start_all()
    rig.until(lambda s: s.phase == "running")
    rig.kill("logger")
    (part,) = (rig.folder / "recordings").glob("*.part")
    before = part.read_bytes()
    rig.until(lambda s: "logger" not in s.peers)
    rig.start("logger", "logger", "--once")
    back = rig.until(lambda s: "logger" in s.peers)
    rig.until(lambda s: s.tick > back.tick + 500)
    (second,) = rig.finish()
    assert part.read_bytes() == before
    report = recover(part)
    first_ticks, second_ticks = verified(report.output), verified(second)
    assert second_ticks["tick"][0] <= first_ticks["tick"][-1] + 1
    assert second_ticks["tick"].tolist() == list(range(second_ticks["tick"][0], second_ticks["tick"][-1] + 1))
    assert first_ticks["tick"].tolist() == list(range(len(first_ticks)))


@pytest.mark.sampled(2, of="processes")
def test_block_without_haptics_renders_no_force(folder: Path) -> None:
    with Rig(folder, (*QUICK_TRIALS, "block.trials=50", "block.force=none")) as rig:
        rig.start_all()
        running = rig.until(lambda s: s.phase == "running")
        rig.until(lambda s: s.tick > running.tick + 500)
        (path,) = rig.finish()
    ticks = verified(path)
    assert not ticks["left_force"].any()
    assert np.isfinite(ticks["left_rendered"]).any()
    assert not np.nan_to_num(ticks["left_rendered"]).any()
    assert np.any(ticks["left_coupling"] != 0)


def ignores(rig: Rig, name: str, number: signal.Signals) -> bool:
    """Return whether a process ignores a signal."""
    status = Path(f"/proc/{rig.running[name].pid}/status").read_text(encoding="utf-8")
    ignored = next(line for line in status.splitlines() if line.startswith("SigIgn:"))
    return bool(int(ignored.split()[1], 16) >> (number - 1) & 1)


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
@pytest.mark.sampled(1)
def test_services_stop_cleanly_while_waiting_for_peers(rig: Rig, number: signal.Signals) -> None:
    rig.start("logger", "logger")
    rig.start("left agent", "agent", "--side", "left")
    rig.start("left display", "display", "--station", "left")
    rig.start("server", "server")
    rig.until(lambda s: {"agent.left", "display.left", "logger"} <= set(s.peers))
    assert [name for name in rig.running if ignores(rig, name, signal.SIGTSTP)] == ["left agent", "server"]
    assert rig.stop("server", number) == 0, rig.output_of("server")
    for name in ("left display", "left agent", "logger"):
        assert rig.stop(name, number) == 0, rig.output_of(name)
    (path,) = rig.recordings()
    verified(path)


@pytest.mark.sampled(2, of="processes")
def test_watched_status_outlasts_a_restart_of_the_server(rig: Rig) -> None:
    rig.start("server", "server")
    rig.until(lambda s: True)
    rig.start("status", "status", "--watch", "--json")
    assert wait_for(lambda: '{"' in rig.output_of("status"))
    rig.kill("server")
    assert wait_for(lambda: "no server answers" in rig.output_of("status"))
    before = rig.output_of("status").count('{"')
    rig.start("server", "server")
    assert wait_for(lambda: rig.output_of("status").count('{"') > before)
    assert rig.stop("status", signal.SIGINT) == 0


def wait_for(condition: Callable[[], bool], seconds: float = 60.0) -> bool:
    """Wait until a condition holds; return False after the timeout [s]."""
    until = time.monotonic() + seconds
    while not condition() and time.monotonic() < until:
        time.sleep(0.1)
    return condition()


@pytest.mark.sampled(2, of="processes")
def test_second_server_on_the_same_ports_exits_with_an_error(rig: Rig) -> None:
    rig.start("server", "server")
    rig.until(lambda s: True)
    second = rig.start("second server", "server")
    assert second.wait(60) == 1
    assert "is another server running?" in rig.output_of("second server")


@pytest.mark.sampled(2, of="processes")
def test_suspended_agent_pauses_the_trial_and_continues_by_itself(rig: Rig) -> None:
    rig.start_all()
    rig.until(lambda s: s.phase == "running")
    rig.suspend("left agent")
    rig.until(lambda s: s.phase == "paused")
    time.sleep(6)  # long enough for ZeroMQ's heartbeats to drop the connection, if they were enabled
    rig.resume("left agent")
    rig.until(lambda s: s.phase == "running")
    (path,) = rig.finish()
    ticks = verified(path)
    assert ticks["tick"].tolist() == list(range(len(ticks)))
    assert rig.stop("left agent") == 0


@pytest.mark.sampled(2, of="processes")
def test_suspended_server_records_the_stall_and_aborts_the_attempt(rig: Rig) -> None:
    rig.start_all()
    before = rig.until(lambda s: s.phase == "running")
    rig.suspend("server")
    time.sleep(0.3)
    rig.resume("server")
    rig.until(lambda s: s.phase == "running" and s.tick > before.tick + 1000)
    (path,) = rig.finish()
    ticks = verified(path)
    with Recording(path) as recording:
        stood_still = [event for event in recording.events() if event.name == "stood_still"]
    assert any(int(event.details["milliseconds"]) >= 250 for event in stood_still)
    assert np.any(ticks["event"] == Cause.FAULT)


@pytest.mark.sampled(2, of="processes")
def test_server_waits_at_the_end_for_a_suspended_logger(rig: Rig) -> None:
    rig.start_all()
    status = rig.until(lambda s: s.phase == "running")
    rig.suspend("logger")
    rig.until(lambda s: s.tick > status.tick + 500)
    rig.operator.command("end")
    time.sleep(3)
    rig.resume("logger")
    assert rig.running.pop("server").wait(60) == 0, rig.output_of("server")
    assert rig.running.pop("logger").wait(60) == 0, rig.output_of("logger")
    ticks = np.concatenate([verified(path) for path in rig.recordings()])
    assert np.array_equal(np.unique(ticks["tick"]), np.arange(ticks["tick"].max() + 1))
    assert ticks["tick"].max() > status.tick + 500


@pytest.mark.sampled(2, of="processes")
def test_server_without_its_logger_reports_unsaved_records_and_fails(rig: Rig) -> None:
    rig.start_all()
    rig.until(lambda s: s.phase == "running")
    rig.kill("logger")
    assert rig.stop("server") == 1
    assert "records may not be on disk" in rig.output_of("server")


@pytest.mark.sampled(2, of="processes")
def test_flood_of_invalid_messages_does_not_delay_the_ticks(rig: Rig) -> None:
    rig.start_all()
    before = rig.until(lambda s: s.phase == "running")
    where = channels.addresses(rig.config.network)
    flood = sockets.motion_agent(rig.context, where.reach(channels.MOTION), "flood")
    began = time.monotonic()
    while rig.until(lambda s: True).tick <= before.tick + 1000:
        burst_end = time.monotonic() + 0.1
        while time.monotonic() < burst_end:
            sockets.send(flood, b"nonsense")
    flood.close()
    rig.until(lambda s: s.phase == "running")
    (path,) = rig.finish()
    seconds = time.monotonic() - began  # the server may still read invalid messages after the flood
    verified(path)
    with Recording(path) as recording:
        refused = [event for event in recording.events() if event.name == "refused"]
    kinds = {(event.details["peer"], event.details["reason"]) for event in refused}
    assert 1 <= len(refused) <= len(kinds) * (seconds + 2), (
        "each kind is recorded at most once a second, and at the end"
    )
    assert all(event.details["channel"] == "motion" for event in refused)


@pytest.mark.sampled(2, of="processes")
def test_fault_of_one_dyad_does_not_affect_another_on_the_same_server(folder: Path) -> None:
    (folder / "a").mkdir()
    (folder / "b").mkdir()
    settings = (*QUICK_TRIALS, "block.trials=50", "realtime.scheduling=false")
    with Rig(folder / "a", settings) as one, Rig(folder / "b", settings) as other:
        one.start("server", "server", "-c", str(other.file))
        for rig in (one, other):
            rig.start("logger", "logger", "--once")
            rig.start_stations()
        for rig in (one, other):
            rig.until(lambda s: s.phase == "running")
        one.kill("left agent")
        # Just before, the machine may have stalled the server, whose notice is then another: see what the pause awaits.
        one.until(lambda s: s.phase == "paused" and "left agent" in " ".join((s.notice, *s.waiting_for)))
        status = other.until(lambda s: s.phase in ("running", "levelling"))
        one.start_agent("left")
        one.until(lambda s: s.phase == "running")
        other.until(lambda s: s.tick > status.tick + 500)
        one.operator.command("end")
        assert one.wait("logger") == 0, one.output_of("logger")
        after = other.until(lambda s: True)
        other.until(lambda s: s.tick > after.tick + 200)
        other.operator.command("end")
        assert other.wait("logger") == 0, other.output_of("logger")
        assert one.wait("server") == 0, one.output_of("server")
        first, second = (verified(path) for rig in (one, other) for path in rig.recordings())
    assert np.any(first["event"] == Cause.FAULT)
    for ticks in (first, second):
        assert ticks["tick"].tolist() == list(range(len(ticks)))
    with Recording(next((folder / "b" / "recordings").glob("*.mcap"))) as recording:
        assert not [e for e in recording.events() if "agent" in e.details.get("notice", "")]


@pytest.mark.sampled(2, of="processes")
def test_idle_server_keeps_every_tick_of_one_millisecond(folder: Path) -> None:
    with Rig(folder, ("network.require_logger=false",)) as rig:
        rig.start("server", "server")
        first = rig.until(lambda s: s.tick > 500)
        rig.start("logger", "logger", "--once")
        rig.until(lambda s: "logger" in s.peers and s.tick > first.tick + 1000)
        (path,) = rig.finish()
    ticks = verified(path)
    assert ticks["tick"].tolist() == list(range(len(ticks)))
    steps = np.diff(ticks["time_ns"])
    assert np.all(steps % 1_000_000 == 0)
    assert np.median(steps) == 1_000_000


@pytest.mark.sampled(2, of="processes")
def test_coupling_computed_at_both_ends_is_rendered_and_verifies(folder: Path) -> None:
    settings = ("block.trials=50", "physics.coupling_at=both", "safety.passivity=true")
    with Rig(folder, (*QUICK_TRIALS, *settings)) as rig:
        rig.start_all()
        status = rig.until(lambda s: s.phase == "running")
        rig.until(lambda s: s.tick > status.tick + 1500)
        (path,) = rig.finish()
    ticks = verified(path)
    with Recording(path) as recording:
        (limit,) = {event.details["limit"] for event in recording.events() if event.name == "delay_limit"}
    assert limit.endswith(" ms")
    armed = ticks[(ticks["phase"] == Phase.RUNNING) & ((ticks["left_safeguards"] & Safeguard.ARMED.value) != 0)]
    for side in ("left", "right"):
        late = armed[f"{side}_rendered"][20:] - armed[f"{side}_force"][:-20]
        assert np.nan_to_num(armed[f"{side}_rendered"]).any()
        assert np.nanmedian(np.abs(late)) < 0.1  # both ends compute the same spring from their own data


def shell(rig: Rig, *words: str) -> str:
    """Run an operator's command, and return its output, or an error text if it fails."""
    command = [sys.executable, "-m", "netboard.services.cli", *words, "-c", str(rig.folder / "rig.toml")]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    return done.stdout if done.returncode == 0 else f"error {done.returncode}: {done.stderr}"


@pytest.mark.sampled(2, of="processes")
def test_operator_pauses_and_emergency_stops_a_session_from_a_shell(rig: Rig) -> None:
    rig.start_all()
    rig.until(lambda s: s.phase in ("levelling", "running"))
    assert json.loads(shell(rig, "control", "pause", "--json"))["status"]["phase"] == "paused"
    assert shell(rig, "control", "resume").startswith("resume: the trial is ")
    assert "EMERGENCY STOP" in shell(rig, "stop")
    stopped = rig.until(lambda s: s.phase == "paused" and "the left device to be armed" in s.waiting_for)
    assert stopped.notice.startswith("paused: emergency stop by an operator")
    assert "error 1: netboard: cannot resume: waiting for" in shell(rig, "control", "resume")
    assert "is released" in shell(rig, "stop", "--release")
    rig.until(lambda s: s.phase == "paused" and not s.waiting_for)
    assert shell(rig, "control", "resume").startswith("resume: the trial is ")
    (path,) = rig.finish()
    ticks = verified(path)
    with Recording(path) as recording:
        ticks_of = {event.name: event.tick for event in recording.events()}
    stopped = ticks[(ticks["tick"] > ticks_of["emergency_stop"]) & (ticks["tick"] < ticks_of["emergency_release"])]
    for side in ("left", "right"):
        armed = (stopped[f"{side}_safeguards"] & Safeguard.ARMED.value) != 0
        seqs = stopped[f"{side}_seq"]
        disarmed = seqs[np.argmin(armed)]
        assert disarmed <= seqs[0] + 250, "the agent disarms within 250 of its own samples"
        faded = stopped[seqs > disarmed + 30]  # the force has faded
        assert len(faded) > 100
        assert not np.nan_to_num(faded[f"{side}_rendered"]).any()
        assert not (faded[f"{side}_safeguards"] & Safeguard.ARMED.value).any()
