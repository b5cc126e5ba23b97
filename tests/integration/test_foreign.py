"""Clients in another language: an agent and a display in JavaScript, implemented from PROTOCOL.md alone.

The tests need Node.js and npm; the two packages of the clients are installed once, into build/foreign.
"""

import json
import subprocess
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from foreign_clients import ROOT, run

from netboard.benchmarks.harness.rig import Rig
from netboard.network.protocol.codec import decode
from netboard.network.protocol.control import Status
from netboard.recording.files.reader import Recording
from netboard.recording.integrity.verification import verify_recording
from netboard.task.trials.state_machine import Phase

pytestmark = [pytest.mark.integration, pytest.mark.quiet, pytest.mark.slow, pytest.mark.timeout(240)]

FRAMES = ROOT / "tests" / "data" / "frames"
QUICK_TRIALS = (
    "task.level_time=0.05",
    "task.level_angle_deg=5.0",
    "task.level_rate_deg_s=30.0",
    "task.time_limit=10.0",
)
"""A ball that is released almost at once, and a short time limit for the trial."""
TWO_BLOCKS = 'orders.main = "2 duo"\n[kinds.duo]\n'
"""A study of two blocks."""

Line = dict[str, Any]


@dataclass(frozen=True)
class ForeignSession:
    """A session of a foreign agent and display at the left and one of our agents at the right.

    Attributes
    ----------
    status : Status
        The status shortly before the end.
    path : Path
        The recording.
    agent, display : list of dict
        The output of the two clients.
    """

    status: Status
    path: Path
    agent: list[Line]
    display: list[Line]


def start_client(rig: Rig, javascript_clients: Path, what: str) -> None:
    """Start the left agent or display."""
    command = ["node", f"{what}.mjs", "left", rig.config.network.host, str(rig.config.network.port)]
    with (rig.folder / f"left {what}.log").open("wb") as log:
        rig.running[f"left {what}"] = subprocess.Popen(command, cwd=javascript_clients, stdout=log, stderr=log)


def client_output(rig: Rig, what: str) -> list[Line]:
    return [json.loads(line) for line in rig.output_of(f"left {what}").splitlines()]


@pytest.fixture(scope="module")
def foreign_session(javascript_clients: Path, tmp_path_factory: pytest.TempPathFactory) -> ForeignSession:
    with Rig(tmp_path_factory.mktemp("foreign"), QUICK_TRIALS) as rig:
        rig.start("logger", "logger", "--once")
        rig.start("server", "server")
        rig.start_agent("right")
        for what in ("agent", "display"):
            start_client(rig, javascript_clients, what)
        rig.until(lambda status: status.phase == "running" and "display.left" in status.peers)
        status = rig.until(lambda status: status.successes + status.failures > 0)
        (path,) = rig.finish()
        for what in ("agent", "display"):
            assert rig.stop(f"left {what}") == 0, rig.output_of(f"left {what}")
        return ForeignSession(status, path, client_output(rig, "agent"), client_output(rig, "display"))


def golden_lines(javascript_clients: Path) -> list[Line]:
    return [json.loads(line) for line in run(["node", "golden.mjs", str(FRAMES)], javascript_clients).splitlines()]


def test_golden_frames_are_decoded_and_reencoded_identically(javascript_clients: Path) -> None:
    checked = golden_lines(javascript_clients)
    assert {line["frame"] for line in checked} == {path.stem for path in FRAMES.glob("*.bin")}
    assert [line for line in checked if not (line["equal"] and line["identical"])] == []


def test_fixed_width_frames_of_a_foreign_client_decode_to_the_same_message(javascript_clients: Path) -> None:
    fixed = {line["frame"]: bytes.fromhex(line["fixed"]) for line in golden_lines(javascript_clients) if line["fixed"]}
    assert {"stylus", "stylus-extremes", "force"} <= set(fixed)
    for name, frame in fixed.items():
        assert repr(decode(frame)) == repr(decode((FRAMES / f"{name}.bin").read_bytes()))
    assert (len(fixed["stylus"]), len(fixed["force"])) == (148, 47)


def test_trial_with_a_foreign_agent_is_recorded_and_verifies(foreign_session: ForeignSession) -> None:
    with Recording(foreign_session.path) as recording:
        ticks, verdict = recording.ticks(), verify_recording(recording)
        events = [event.name for event in recording.events()]
    assert verdict.identical, verdict
    assert ticks["tick"].tolist() == list(range(len(ticks)))
    assert "refused" not in events
    assert {"held", "fell", "timed_out"} & set(events), events
    rendered = ticks[(ticks["phase"] == Phase.RUNNING) & (ticks["left_live"] == 1)]
    assert np.nan_to_num(rendered["left_rendered"]).any()
    assert np.any(rendered["left_loop_ns"] > 0)
    assert np.any(rendered["left_z"] != 0)


def test_foreign_agent_clock_is_estimated_and_its_phase_is_locked(foreign_session: ForeignSession) -> None:
    with Recording(foreign_session.path) as recording:
        ticks = recording.ticks()
        clocks = {peer: [c for c in recording.clocks() if c.peer == peer] for peer in ("agent.left", "display.left")}
    for probes in clocks.values():
        assert probes
        assert [probe for probe in probes if abs(probe.offset_ns) > probe.bound_ns] == []
    leads = ticks["left_lead_ns"][ticks["left_live"] == 1]
    windows = np.array_split(leads, len(leads) // 250)
    assert any(0.15e6 < np.median(window) < 0.45e6 for window in windows), [np.median(window) for window in windows]


def test_foreign_display_frames_are_recorded_and_hide_the_partner(foreign_session: ForeignSession) -> None:
    with Recording(foreign_session.path) as recording:
        frames = recording.frames()
    shown = [line for line in foreign_session.display if "picture" in line]
    assert {frame.station for frame in frames} == {"left"}
    assert 0 < len(frames) <= shown[-1]["frames"]
    assert all(frame.painted_ns >= frame.received_ns for frame in frames)
    assert any(" running " in line["picture"] for line in shown)
    assert shown[-1]["pings"] > 0
    assert {line["partner_seen"] for line in shown} == {0}


def require_one_session(output: list[Line], session: str) -> None:
    """Check that a client was welcomed in one session and that nothing was refused."""
    replies = [line for line in output if "armed" not in line and "picture" not in line]
    assert [list(line) for line in replies] in ([["Welcome"]], [["Welcome"], ["Goodbye"]]), replies
    assert replies[0]["Welcome"] == session


def test_foreign_clients_are_welcomed_and_never_refused(foreign_session: ForeignSession) -> None:
    for output in (foreign_session.agent, foreign_session.display):
        require_one_session(output, foreign_session.status.session)
    assert any(line["armed"] for line in foreign_session.agent if "armed" in line)


@pytest.mark.sampled(2, of="sessions in real time")
def test_foreign_clients_continue_with_the_next_block(javascript_clients: Path, tmp_path: Path) -> None:
    with Rig(tmp_path, (*QUICK_TRIALS, "session.pilot=true")) as rig:
        study = rig.folder / "two.toml"
        study.write_text(TWO_BLOCKS, encoding="utf-8")
        rig.start("logger", "logger", "--once")
        rig.start("server", "server", "--study", str(study), "--autostart")
        rig.start_agent("right")
        for what in ("agent", "display"):
            start_client(rig, javascript_clients, what)
        rig.until(lambda status: status.phase == "running" and "display.left" in status.peers)
        rig.until(lambda status: rig.operator.do("pause").accepted or status.phase == "paused")
        rig.until(lambda status: status.phase == "paused")
        assert rig.operator.do("next").accepted
        status = rig.until(lambda status: status.block == 2 and status.successes + status.failures > 0)
        paths = rig.finish()
        for what in ("agent", "display"):
            assert rig.stop(f"left {what}") == 0, rig.output_of(f"left {what}")
        agent, display = client_output(rig, "agent"), client_output(rig, "display")
    for output in (agent, display):
        require_one_session(output, status.session)
        assert max(line.get("welcomes", 0) for line in output) >= 2
    shown = [line["picture"] for line in display if "picture" in line]
    assert any("running 1/" in picture and "of block 2/2" in picture for picture in shown), shown
    seqs = []
    for number, path in enumerate(paths, start=1):
        with Recording(path) as recording:
            ticks = recording.ticks()
            assert recording.metadata["block"] == str(number)
            assert verify_recording(recording).identical
        rendered = ticks[(ticks["phase"] == Phase.RUNNING) & (ticks["left_live"] == 1)]
        assert np.nan_to_num(rendered["left_rendered"]).any()
        seqs += ticks["left_seq"][ticks["left_live"] == 1].tolist()
    assert len(paths) == 2
    assert seqs == sorted(seqs), "sample numbers continue across blocks"
