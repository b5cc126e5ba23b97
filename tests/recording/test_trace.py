"""Causes of stutter: sessions with known causes, and the causes found by the trace."""

import errno
import json
import os
from pathlib import Path

import numpy as np
import pytest
from staged_timing import MS, START, Staged
from typer.testing import CliRunner

import rehearsed
from netboard.base.config import SIDES
from netboard.base.errors import RecordingError
from netboard.base.tick import TICK
from netboard.network.protocol.records import EventRecord
from netboard.recording.files.reader import Recording
from netboard.recording.timing.causes import CAUSES
from netboard.recording.timing.evidence import runs
from netboard.recording.timing.stamps import COLUMNS, UNKNOWN, stamps_from
from netboard.recording.timing.trace import TimingTrace, trace
from netboard.services.cli import app

LIMIT = 500_000
AT = 400 * MS
runner = CliRunner()


def traced(staged: Staged, *events: EventRecord) -> TimingTrace:
    rows = staged.rows()
    return trace(stamps_from({name: rows[name] for name in COLUMNS}, events, staged.backfill(rows, 7)), LIMIT)


def span(milliseconds: float, start: int = AT - 400_000) -> tuple[int, int]:
    """A stall from just before a deadline to some time after it."""
    return start, AT + round(milliseconds * MS)


def event(name: str, tick: int, time_ns: int) -> EventRecord:
    return EventRecord(0, tick, time_ns, name, {})


def test_session_without_stalls_has_no_episodes() -> None:
    found = traced(Staged())
    assert found.episodes == ()
    assert found.missed == found.unrecorded == 0
    spreads = found.spreads
    assert spreads["left: read to arrival"].p50 == pytest.approx(150e-6)
    assert spreads["right: sample to force"].p50 == pytest.approx(300e-6, abs=1e-7)
    assert spreads["tick begins after its deadline"].p50 == pytest.approx(-300e-6, abs=2e-9)


BOTH = {side: [span(5)] for side in SIDES}
CASES = {
    "server": (Staged(server=[span(5)]), "", 5.0),
    "machine": (Staged(server=[span(5)], agents=BOTH), "", 5.0),
    "shared": (Staged(server=[span(5)], agents={"left": [span(5)]}), "", 5.0),
    "short": (Staged(server=[span(0.53)]), "", 0.53),
    "agent": (Staged(agents={"left": [(AT - 600_000, AT + 4 * MS)]}), "left", 5.0),
    "agents": (Staged(agents={side: [(AT - 600_000, AT + 9 * MS)] for side in SIDES}), "", 9.75),
    "network": (Staged(up={"right": [(AT - 400_000, AT + 4 * MS)]}), "right", 4.3),
    "away": (Staged(agents={"right": [(AT, AT + 200 * MS)]}), "right", 199.0),
    "throttle": (Staged(2000, server=[span(50), (AT + 999_600_000, AT + 1050 * MS)]), "", 50.0),
}


@pytest.mark.parametrize("name", CASES)
def test_known_cause_is_identified(name: str) -> None:
    staged, side, size = CASES[name]
    found = traced(staged)
    assert {one.cause.name for one in found.episodes} == {name}
    assert {one.evidence.side for one in found.episodes} == {side}
    worst = found.worst[0]
    assert worst.evidence.size_ns / MS == pytest.approx(size, abs=1.0 if name == "away" else 0.1)
    assert worst.tick - 70 in range(399, 403)
    assert worst.trial == 3


def test_skipped_ticks_count_as_missed() -> None:
    found = traced(CASES["throttle"][0])
    assert found.missed >= 100
    assert found.stamps.moved_ns.sum() == 2 * 50 * MS


def test_event_that_delays_a_tick_is_named() -> None:
    staged = Staged(server=[span(3)])
    found = traced(staged, event("logger_joined", 469, START + AT - 100_000))
    (one,) = found.episodes
    assert (one.cause.name, one.evidence.events) == ("event", ("logger_joined",))
    (other,) = traced(staged, event("logger_joined", 460, START + AT - 9 * MS)).episodes
    assert other.cause.name == "server"


def test_start_of_a_block_explains_the_stalls_after_it() -> None:
    stalls = Staged(agents={side: [(AT - 600_000, AT + 5 * MS)] for side in SIDES})
    (one,) = traced(stalls, event("block_began", 460, START + AT - 10 * MS)).episodes
    assert one.cause.name == "block"
    (joined,) = traced(stalls, event("agent_joined", 480, START + AT + 10 * MS)).episodes
    assert joined.cause.name == "block"
    (late,) = traced(stalls, event("block_began", 300, START + 230 * MS)).episodes
    assert late.cause.name == "agents"


def test_sample_out_of_phase_waits_for_the_next_tick() -> None:
    rows = Staged().rows()
    rows["left_lead_ns"][500:520] += 1_100_000  # it arrived just after the tick before
    rows["left_stamp_ns"][500:520] -= 1_100_000
    rows["left_loop_ns"][501:521] += 1_100_000
    (one,) = trace(stamps_from({name: rows[name] for name in COLUMNS}), LIMIT).episodes
    assert (one.cause.name, one.evidence.side, one.tick) == ("phase", "left", 571)


def test_drifting_agent_misses_a_tick_without_being_late() -> None:
    (one,) = traced(Staged(drift={"right": 5_000})).episodes
    assert (one.cause.name, one.evidence.side) == ("phase", "right")
    assert 0 <= one.evidence.missing_ns < 10_000


def test_force_late_at_its_agent_is_a_return_delay() -> None:
    rows = Staged().rows()
    rows["right_loop_ns"][500] += 2 * MS
    (one,) = trace(stamps_from({name: rows[name] for name in COLUMNS}), LIMIT).episodes
    assert (one.cause.name, one.evidence.side, one.tick) == ("return", "right", 570)
    assert one.evidence.size_ns == pytest.approx(2.3 * MS, rel=1e-3)


def test_stall_of_an_agent_is_known_only_from_its_backfill() -> None:
    staged = CASES["agent"][0]
    rows = staged.rows()
    columns = {name: rows[name] for name in COLUMNS}
    (one,) = trace(stamps_from(columns), LIMIT).episodes
    assert (one.cause.name, one.evidence.read_late_ns) == ("network", 0)
    (known,) = trace(stamps_from(columns, (), staged.backfill(rows)), LIMIT).episodes
    assert known.cause.name == "agent"
    assert known.evidence.read_late_ns == pytest.approx(4_450_000, abs=2)


def test_every_cause_is_tested_and_has_a_unique_title() -> None:
    assert {*CASES, "event", "block", "phase", "return"} == {cause.name for cause in CAUSES}
    assert len({cause.title for cause in CAUSES}) == len(CAUSES)


def test_runs_join_across_short_gaps() -> None:
    mask = np.array([1, 0, 0, 1, 0, 0, 0, 1, 1], bool)
    assert list(runs(mask, 2)) == [(0, 3), (7, 8)]
    assert list(runs(mask, 0)) == [(0, 0), (3, 3), (7, 8)]
    assert list(runs(np.zeros(3, bool), 2)) == []


def test_arrival_after_a_stall_uses_the_old_deadline() -> None:
    stamps = traced(Staged(server=[span(50)])).stamps
    (stalled,) = np.flatnonzero(stamps.moved_ns)
    assert stamps.began_ns[stalled] == START + AT + 50 * MS
    for side in stamps.sides.values():
        assert side.arrived_ns[stalled] == START + AT + 50 * MS
        assert np.all(side.rendered_ns[side.rendered_ns != UNKNOWN] > 0)


def test_robot_in_the_server_is_not_an_agent() -> None:
    rows = CASES["machine"][0].rows()
    rows["left_stamp_ns"] = rows["time_ns"] - 310_000
    rows["left_seq"], rows["left_lead_ns"] = rows["tick"], 310_000
    (one,) = trace(stamps_from({name: rows[name] for name in COLUMNS}), LIMIT).episodes
    assert one.cause.name == "machine"
    assert one.evidence.agents == {"left": "unknown", "right": "late"}


def test_unrecorded_ticks_are_not_an_episode() -> None:
    rows = np.delete(Staged().rows(), slice(300, 340))
    found = trace(stamps_from({name: rows[name] for name in COLUMNS}), LIMIT)
    assert (found.unrecorded, found.episodes) == (40, ())


@pytest.mark.parametrize(("rows", "what"), [(0, "contains no ticks"), (5, "contains no sample of an agent")])
def test_recording_without_ticks_or_samples_is_refused(rows: int, what: str) -> None:
    table = np.zeros(rows, TICK)
    table["left_seq"] = table["right_seq"] = -1
    with pytest.raises(RecordingError, match=what):
        stamps_from({name: table[name] for name in COLUMNS})


# --- the command -------------------------------------------------------------------------------------------------


@pytest.fixture(autouse=True)
def _wide_and_plain(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("COLUMNS", "200")
    monkeypatch.setenv("NO_COLOR", "1")


def recorded(path: Path, staged: Staged) -> Path:
    return rehearsed.write(path, staged.rows())


def test_trace_command_names_the_cause_and_the_remedy(tmp_path: Path) -> None:
    recorded(tmp_path / "S01.mcap", CASES["network"][0])
    result = runner.invoke(app, ["trace", "S01.mcap", "--figure", "a.png"])
    assert result.exit_code == 0, result.output
    for words in ("samples late on the way", "right", "read 0.000 ms late", "real-time.md", "of 1000 ticks"):
        assert words in result.output
    assert Path("a.png").read_bytes().startswith(b"\x89PNG")
    again = runner.invoke(app, ["trace", "S01.mcap", "--figure", "a.png"])
    assert (again.exit_code, "already exists" in again.stderr) == (2, True)


def test_figure_without_its_folder_is_refused_at_once(tmp_path: Path) -> None:
    recorded(tmp_path / "S01.mcap", CASES["network"][0])
    result = runner.invoke(app, ["trace", "S01.mcap", "--figure", "missing/a.png"])
    assert (result.exit_code, result.stdout) == (2, "")
    assert "there is no folder missing" in result.stderr


@pytest.mark.parametrize("kind", ["png", "svg", "pdf"])
def test_full_disk_leaves_no_half_figure(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, kind: str) -> None:
    def write_half(path: Path, data: bytes) -> None:
        with path.open("wb") as file:
            file.write(data[: len(data) // 2])
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    recorded(tmp_path / "S01.mcap", CASES["network"][0])
    monkeypatch.setattr(Path, "write_bytes", write_half)
    result = runner.invoke(app, ["trace", "S01.mcap", "--figure", f"a.{kind}"])
    assert (result.exit_code, f"a.{kind}: cannot be written: No space left" in result.stderr) == (1, True)
    assert [path.name for path in tmp_path.iterdir()] == ["S01.mcap"]


def test_json_lists_every_episode_in_seconds(tmp_path: Path) -> None:
    recorded(tmp_path / "S01.mcap", CASES["server"][0])
    printed = json.loads(runner.invoke(app, ["trace", "S01.mcap", "--json"]).output)
    (one,) = printed["episodes"]
    assert one["cause"] == "server"
    assert one["agents"] == {"left": "on time", "right": "on time"}
    assert one["size"] == pytest.approx(5e-3)
    assert one["time"] == pytest.approx(0.4)
    assert printed["missed_per_100000"] == printed["missed"] * 100
    assert "isolate" in printed["advice"]["server"]


def test_lower_limit_shows_more_episodes(tmp_path: Path) -> None:
    recorded(tmp_path / "S01.mcap", Staged(server=[span(0.3)]))
    assert "no episode" in runner.invoke(app, ["trace", "S01.mcap"]).output
    printed = json.loads(runner.invoke(app, ["trace", "S01.mcap", "--late", "0.2", "--json"]).output)
    assert [one["tick"] for one in printed["episodes"]] == [470]


@pytest.mark.parametrize("version", [1, 2, 3])
def test_older_formats_can_be_traced(version: int) -> None:
    path = Path(__file__).parent.parent / "data" / "recordings" / f"format-{version}.mcap"
    assert "no sample of an agent" in runner.invoke(app, ["trace", str(path)]).stderr  # its hands were simulated
    with Recording(path) as recording:
        columns = recording.columns(*COLUMNS)
    for side in SIDES:
        columns[f"{side}_stamp_ns"] = columns[f"{side}_stamp_ns"] + columns["tick"] % 3
    found = trace(stamps_from(columns), LIMIT)
    assert (found.stamps.tick.size, found.episodes) == (900, ())


@pytest.mark.parametrize(
    ("provenance", "what"),
    [
        ({"rehearsed": "true"}, "is a rehearsal: its stamps are simulated"),
        ({"what_if": "physics.g=0", "source": "S01.mcap"}, "is computed from S01.mcap"),
        ({"imported": "measured"}, "is imported from a table"),
    ],
)
def test_simulated_stamps_are_refused(tmp_path: Path, provenance: dict[str, str], what: str) -> None:
    rehearsed.write(tmp_path / "S01.mcap", Staged(50).rows(), metadata=provenance)
    result = runner.invoke(app, ["trace", "S01.mcap"])
    assert result.exit_code == 1
    assert what in result.stderr
    assert "live session" in result.stderr


def test_invalid_or_empty_recording_is_refused(tmp_path: Path) -> None:
    Path("text.mcap").write_text("never was one")
    assert "not an MCAP file" in runner.invoke(app, ["trace", "text.mcap"]).stderr
    assert "cannot be read" in runner.invoke(app, ["trace", "nowhere.mcap"]).stderr
    rehearsed.write(tmp_path / "empty.mcap", np.zeros(0, TICK))
    assert "contains no ticks" in runner.invoke(app, ["trace", "empty.mcap"]).stderr
    recorded(tmp_path / "S01.mcap", Staged(50))
    result = runner.invoke(app, ["trace", "S01.mcap", "--tick", "7000"])
    assert "has no tick 7000; found ticks 70 to 119" in result.stderr
