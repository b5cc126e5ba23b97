"""Clients in another language: an agent and a display in JavaScript, written from PROTOCOL.md alone.

Node.js and npm must be there; the two packages that the clients need are fetched once, into build/foreign.
"""

import json
import subprocess
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from foreign_clients import ROOT, run

from netboard.benchmarks.faults.rigs import Rig
from netboard.network.protocol.codec import decode
from netboard.network.protocol.control import Status
from netboard.recording.files.reader import Recording
from netboard.recording.integrity.verification import verify_recording
from netboard.task.trials.state_machine import Phase

pytestmark = [pytest.mark.integration, pytest.mark.quiet, pytest.mark.slow, pytest.mark.timeout(240)]

FRAMES = ROOT / "tests" / "data" / "frames"
EASY = ("task.level_time=0.05", "task.level_angle_deg=5.0", "task.level_rate_deg_s=30.0", "task.time_limit=10.0")
"""A ball that is released almost at once, and a trial that ends in any case."""
TWO_BLOCKS = 'orders.main = "2 duo"\n[kinds.duo]\n'
"""A study."""

Line = dict[str, Any]


@dataclass(frozen=True)
class Played:
    """A session of a foreign agent and display at the left and one of our agents at the right.

    Attributes
    ----------
    status : Status
        How it stood shortly before the end.
    path : Path
        The recording.
    agent, display : list of dict
        What the two clients said.
    """

    status: Status
    path: Path
    agent: list[Line]
    display: list[Line]


def start_client(rig: Rig, clients: Path, what: str) -> None:
    """Start the left agent or display."""
    command = ["node", f"{what}.mjs", "left", rig.config.network.host, str(rig.config.network.port)]
    with (rig.folder / f"left {what}.log").open("wb") as said:
        rig.running[f"left {what}"] = subprocess.Popen(command, cwd=clients, stdout=said, stderr=said)


def lines(rig: Rig, what: str) -> list[Line]:
    return [json.loads(line) for line in rig.said(f"left {what}").splitlines()]


@pytest.fixture(scope="module")
def played(clients: Path, tmp_path_factory: pytest.TempPathFactory) -> Played:
    with Rig(tmp_path_factory.mktemp("foreign"), EASY) as rig:
        rig.start("logger", "logger", "--once")
        rig.start("server", "server")
        rig.start_agent("right")
        for what in ("agent", "display"):
            start_client(rig, clients, what)
        rig.until(lambda status: status.phase == "running" and "display.left" in status.peers)
        status = rig.until(lambda status: status.successes + status.failures > 0)
        (path,) = rig.finish()
        for what in ("agent", "display"):
            assert rig.stop(f"left {what}") == 0, rig.said(f"left {what}")
        return Played(status, path, lines(rig, "agent"), lines(rig, "display"))


def golden_lines(clients: Path) -> list[Line]:
    return [json.loads(line) for line in run(["node", "golden.mjs", str(FRAMES)], clients).splitlines()]


def test_every_golden_frame_is_understood_and_written_byte_by_byte(clients: Path) -> None:
    checked = golden_lines(clients)
    assert {line["frame"] for line in checked} == {path.stem for path in FRAMES.glob("*.bin")}
    assert [line for line in checked if not (line["equal"] and line["identical"])] == []


def test_the_fixed_form_of_a_foreign_client_is_the_same_message(clients: Path) -> None:
    fixed = {line["frame"]: bytes.fromhex(line["fixed"]) for line in golden_lines(clients) if line["fixed"]}
    assert {"stylus", "stylus-extremes", "force"} <= set(fixed)
    for name, frame in fixed.items():
        assert repr(decode(frame)) == repr(decode((FRAMES / f"{name}.bin").read_bytes()))
    assert (len(fixed["stylus"]), len(fixed["force"])) == (148, 47)


def test_a_trial_is_played_with_a_foreign_agent_and_verifies(played: Played) -> None:
    with Recording(played.path) as recording:
        ticks, verdict = recording.ticks(), verify_recording(recording)
        events = [event.name for event in recording.events()]
    assert verdict.identical, verdict
    assert ticks["tick"].tolist() == list(range(len(ticks)))
    assert "refused" not in events
    assert {"held", "fell", "timed_out"} & set(events), events
    felt = ticks[(ticks["phase"] == Phase.RUNNING) & (ticks["left_live"] == 1)]
    assert np.nan_to_num(felt["left_rendered"]).any()
    assert np.any(felt["left_loop_ns"] > 0)
    assert np.any(felt["left_z"] != 0)


def test_the_clock_of_a_foreign_agent_is_known_and_its_phase_is_in_step(played: Played) -> None:
    with Recording(played.path) as recording:
        ticks = recording.ticks()
        clocks = {peer: [c for c in recording.clocks() if c.peer == peer] for peer in ("agent.left", "display.left")}
    for probes in clocks.values():
        assert probes
        assert [probe for probe in probes if abs(probe.offset_ns) > probe.bound_ns] == []
    leads = ticks["left_lead_ns"][ticks["left_live"] == 1]
    windows = np.array_split(leads, len(leads) // 250)
    assert any(0.15e6 < np.median(window) < 0.45e6 for window in windows), [np.median(window) for window in windows]


def test_what_a_foreign_display_shows_is_recorded_and_hides_the_partner(played: Played) -> None:
    with Recording(played.path) as recording:
        frames = recording.frames()
    shown = [line for line in played.display if "picture" in line]
    assert {frame.station for frame in frames} == {"left"}
    assert 0 < len(frames) <= shown[-1]["frames"]
    assert all(frame.painted_ns >= frame.received_ns for frame in frames)
    assert any(" running " in line["picture"] for line in shown)
    assert shown[-1]["pings"] > 0
    assert {line["partner_seen"] for line in shown} == {0}


def require_one_session(said: list[Line], session: str) -> None:
    """A client was welcome in one session, and nothing was refused."""
    words = [line for line in said if "armed" not in line and "picture" not in line]
    assert [list(line) for line in words] in ([["Welcome"]], [["Welcome"], ["Goodbye"]]), words
    assert words[0]["Welcome"] == session


def test_foreign_clients_are_welcomed_and_never_refused(played: Played) -> None:
    for said in (played.agent, played.display):
        require_one_session(said, played.status.session)
    assert any(line["armed"] for line in played.agent if "armed" in line)


@pytest.mark.daily(2, of="sessions in real time")
def test_foreign_clients_go_on_with_the_next_block(clients: Path, tmp_path: Path) -> None:
    with Rig(tmp_path, (*EASY, "session.pilot=true")) as rig:
        study = rig.folder / "two.toml"
        study.write_text(TWO_BLOCKS, encoding="utf-8")
        rig.start("logger", "logger", "--once")
        rig.start("server", "server", "--study", str(study), "--autostart")
        rig.start_agent("right")
        for what in ("agent", "display"):
            start_client(rig, clients, what)
        rig.until(lambda status: status.phase == "running" and "display.left" in status.peers)
        rig.until(lambda status: rig.operator.do("pause").accepted or status.phase == "paused")
        rig.until(lambda status: status.phase == "paused")
        assert rig.operator.do("next").accepted
        status = rig.until(lambda status: status.block == 2 and status.successes + status.failures > 0)
        paths = rig.finish()
        for what in ("agent", "display"):
            assert rig.stop(f"left {what}") == 0, rig.said(f"left {what}")
        agent, display = lines(rig, "agent"), lines(rig, "display")
    for said in (agent, display):
        require_one_session(said, status.session)
        assert max(line.get("welcomes", 0) for line in said) >= 2
    shown = [line["picture"] for line in display if "picture" in line]
    assert any("running 1/" in picture and "of block 2/2" in picture for picture in shown), shown
    seqs = []
    for number, path in enumerate(paths, start=1):
        with Recording(path) as recording:
            ticks = recording.ticks()
            assert recording.metadata["block"] == str(number)
            assert verify_recording(recording).identical
        felt = ticks[(ticks["phase"] == Phase.RUNNING) & (ticks["left_live"] == 1)]
        assert np.nan_to_num(felt["left_rendered"]).any()
        seqs += ticks["left_seq"][ticks["left_live"] == 1].tolist()
    assert len(paths) == 2
    assert seqs == sorted(seqs), "the numbers of its samples go on"
