"""Tables of other systems become recordings with the same content, and exports become their recordings again."""

import csv
import hashlib
import json
import math
import re
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from typer.testing import CliRunner

from netboard.base.config import Config, resolve
from netboard.base.errors import ConfigError, RecordingError
from netboard.base.tables.simulated import Participant
from netboard.base.tick import TICK
from netboard.participants.seat.block import Rehearsal
from netboard.recording.export.formats import export
from netboard.recording.export.runs import people_in
from netboard.recording.files.offline_writer import BlockWriter
from netboard.recording.files.reader import Recording
from netboard.recording.importing import tables
from netboard.recording.importing.table_import import Imported, ImportOptions, import_table, in_words
from netboard.recording.integrity.account import account_of, parts_of
from netboard.recording.integrity.checking import check
from netboard.recording.integrity.severity import Severity
from netboard.recording.integrity.verification import verify_recording
from netboard.services.cli import app

UTC_NS = 1_790_000_000_000_000_000
CONFIG = replace(Config(), block=replace(Config().block, trials=2))


def quiet(what: str, done: int, total: int) -> None:
    assert 0 < done <= total


def write_csv(path: Path, columns: dict[str, Any], separator: str = ",") -> Path:
    with path.open("x", encoding="utf-8", newline="") as file:
        writer = csv.writer(file, delimiter=separator)
        writer.writerow(columns)
        writer.writerows(zip(*columns.values(), strict=True))
    return path


def imported(path: Path, folder: Path, config: Config = CONFIG, **wishes: Any) -> Recording:
    return Recording(import_table(path, folder, config, ImportOptions(**wishes), UTC_NS, quiet).path)


@pytest.fixture(scope="module")
def rehearsed(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Two trials of simulated people."""
    keeper = BlockWriter(tmp_path_factory.mktemp("rehearsed"), CONFIG, "0123456789abcdef", UTC_NS)
    for rows in Rehearsal(CONFIG, {"A": Participant(), "B": Participant()}).pieces():
        keeper.take(rows)
    keeper.finish()
    return keeper.path


@pytest.mark.slow
@pytest.mark.parametrize("kind", ["csv", "parquet"])
def test_exported_ticks_import_bit_exactly(rehearsed: Path, tmp_path: Path, kind: str) -> None:
    if kind == "parquet":
        pytest.importorskip("pyarrow")
    export([rehearsed], kind, tmp_path / "out", lambda *progress: None)
    table = tmp_path / "out" / "ticks" / f"{rehearsed.stem}.{kind}"
    with imported(table, tmp_path, Config()) as back, Recording(rehearsed) as recording:
        assert back.ticks().tobytes() == recording.ticks().tobytes()
        assert back.config_text == recording.config_text
        assert repr(back.attempts()) == repr(recording.attempts())
        assert verify_recording(back).identical
        stage = [event for event in recording.events() if event.tick >= 0]
        assert [event for event in back.events() if event.tick >= 0][1:] == stage[1:]  # the first says what it is
        assert (back.metadata["imported"], back.metadata["imported_from"]) == ("ticks", table.name)
        assert back.metadata["rehearsed"] == "true"
        assert all(person.simulated for person in people_in(back.config, back.metadata))
        assert back.metadata["imported_sha256"] == hashlib.sha256(table.read_bytes()).hexdigest()
        account = account_of(parts_of(back.path))
    assert not account.unexplained
    assert not account.unexplained_records


@pytest.mark.slow
def test_trials_are_computed_from_hands_alone(rehearsed: Path, tmp_path: Path) -> None:
    with Recording(rehearsed) as recording:
        rows, before = recording.ticks(first=500), recording.attempts()
    hands = {"ms": range(len(rows)), "left": 1000 * rows["left_used_z"], "right": -100 * rows["right_used_z"]}
    rates = {"left_vz": rows["left_used_vz"], "right_vz": rows["right_used_vz"]}
    table = write_csv(tmp_path / "hands.csv", {**hands, **rates}, ";")
    names = ("time=ms", "left_z=left", "right_z=right")
    units = ("time=ms", "left_z=mm", "right_z=-cm")
    with imported(table, tmp_path, names=names, units=units, simulate=True) as found:
        assert verify_recording(found).identical
        after, ticks = found.attempts(), found.ticks()
        assert json.loads(found.metadata["imported_units"]) == list(units)
    assert ticks["right_sent_z"] == pytest.approx(rows["right_used_z"], rel=1e-15)
    # The same hands do the same, but for the block's first moments, before which there were others.
    assert [attempt.outcome for attempt in after] == [attempt.outcome for attempt in before]
    assert after[1].completion == pytest.approx(before[1].completion, abs=0.005)


def task_table(rate: int = 1000) -> dict[str, list[Any]]:
    """Two trials of a second with a second between them: the first a success, the second not."""
    time = [k / rate for k in range(4 * rate)]
    trial = [{1: 1, 3: 2}.get(math.floor(t), 0) for t in time]
    return {
        "time": time,
        "left_z": [0.01 * math.sin(3 * t) for t in time],
        "right_z": [0.01 * math.cos(3 * t) for t in time],
        "p": [0.1 * math.sin(t) for t in time],
        "theta": [0.05 * math.cos(2 * t) for t in time],
        "trial": ["" if number == 0 else number for number in trial],
        "outcome": [{1: "success", 2: "fell"}.get(number, "") for number in trial],
        "target": [-1 if number == 2 else 1 for number in trial],
    }


def test_measured_table_is_not_called_damaged_because_it_cannot_be_computed_again(tmp_path: Path) -> None:
    with imported(write_csv(tmp_path / "task.csv", task_table()), tmp_path) as found:
        with pytest.raises(RecordingError, match="measured by another program"):
            verify_recording(found)
        assert check(found.path, replay=True).result == "complete with listed losses"
        assert check(found.path).result == "complete"


def test_measured_columns_are_imported_unchanged(tmp_path: Path) -> None:
    columns = task_table()
    with imported(write_csv(tmp_path / "task.csv", columns), tmp_path) as found:
        rows, attempts = found.ticks(), found.attempts()
        assert found.metadata["imported"] == "measured"
    assert rows["tick"].tolist() == list(range(4000))
    for name, theirs in (("left_sent_z", "left_z"), ("right_used_z", "right_z"), ("p", "p"), ("theta", "theta")):
        assert rows[name].tolist() == columns[theirs], name
    t = np.array(columns["time"])
    assert rows["left_sent_vz"] == pytest.approx(0.03 * np.cos(3 * t), abs=1e-8)
    assert rows["vp"][1:-1] == pytest.approx(0.1 * np.cos(t)[1:-1], abs=5e-5)
    assert rows["omega"][1:-1] == pytest.approx(-0.1 * np.sin(2 * t)[1:-1], abs=5e-5)
    assert np.isnan(rows["left_force"]).all()
    assert [(a.trial, a.attempt, a.target, a.outcome, a.tick, a.stop) for a in attempts] == [
        (1, 1, 1, "success", 1000, 2000),
        (2, 1, -1, "fell", 3000, 4000),
    ]
    assert attempts[0].completion == 1.0
    assert rows["successes"][[0, 1999, 2000]].tolist() == [0, 0, 1]


def test_complete_import_passes_the_integrity_check(tmp_path: Path) -> None:
    columns = task_table()
    assert columns["target"][3500] == -1
    columns["target"] = [-target for target in columns["target"]]  # their targets followed no rule of ours
    with imported(write_csv(tmp_path / "task.csv", columns), tmp_path) as found:
        report = check(found.path)
    assert report.severity is Severity.SOUND, report
    assert any("2 attempts, 1 success, as imported" in finding.text for finding in report.findings)


def test_phase_and_completion_columns_define_the_attempts(tmp_path: Path) -> None:
    columns = task_table()
    del columns["trial"]
    phase = ["holding" if 1.6 <= t < 2 else "running" if 1 <= t < 2 else "" for t in columns["time"]]
    columns |= {"phase": phase, "outcome": ["success" if word else "" for word in phase]}
    with imported(write_csv(tmp_path / "phase.csv", columns), tmp_path) as found:
        (attempt,) = found.attempts()
    assert (attempt.trial, attempt.outcome, attempt.tick, attempt.stop) == (1, "success", 1000, 2000)
    assert attempt.completion == pytest.approx(0.6)
    columns["completion"] = [0.345 if word else "" for word in phase]
    with imported(write_csv(tmp_path / "completion.csv", columns), tmp_path) as found:
        assert found.attempts()[0].completion == pytest.approx(0.345)


@pytest.mark.parametrize("rate", [100, 240, 999.9, 1024, 2000])
@pytest.mark.parametrize("everywhere", [True, False], ids=["every-row", "last-row"])
def test_outcome_and_completion_belong_to_the_attempt_at_any_rate(
    tmp_path: Path, rate: float, *, everywhere: bool
) -> None:
    times = [k / rate for k in range(int(3.5 * rate))]
    trial = [1 + int(t) for t in times]
    shown = [everywhere or this != after for this, after in zip(trial, [*trial[1:], 0], strict=True)]
    given = {1: ("success", 0.75), 2: ("fell", ""), 3: ("success", 0.5), 4: ("success", 0.0)}
    columns: dict[str, Any] = {"time": times, "left_z": [0.01 * t for t in times], "right_z": [0.0] * len(times)}
    columns |= {"trial": trial, "outcome": [given[n][0] if seen else "" for n, seen in zip(trial, shown, strict=True)]}
    columns["completion"] = [given[n][1] if seen else "" for n, seen in zip(trial, shown, strict=True)]
    with imported(write_csv(tmp_path / "rate.csv", columns), tmp_path) as found:
        attempts = found.attempts()
    assert [one.outcome for one in attempts] == ["success", "fell", "success", "success"]
    assert [one.completion for one in attempts] == pytest.approx([0.75, np.nan, 0.5, 0.0], nan_ok=True)


def test_gaps_of_a_table_have_no_ticks(tmp_path: Path) -> None:
    columns = task_table()
    kept = [k for k in range(4000) if not 2000 <= k < 2500]
    table = write_csv(tmp_path / "gap.csv", {name: [values[k] for k in kept] for name, values in columns.items()})
    with imported(table, tmp_path) as found:
        assert found.ticks()["tick"].tolist() == kept
        assert len(found.attempts()) == 2


def test_simulation_continues_across_gaps_without_samples(tmp_path: Path) -> None:
    columns = task_table()
    kept = [k for k in range(4000) if not 2000 <= k < 2500]
    hands = {name: [columns[name][k] for k in kept] for name in ("time", "left_z", "right_z")}
    with imported(write_csv(tmp_path / "gap.csv", hands), tmp_path, simulate=True) as found:
        rows = found.ticks()
        assert verify_recording(found).identical
    assert rows["tick"].tolist() == list(range(4000))
    assert (np.flatnonzero(rows["left_live"] == 0) == np.arange(2000, 2500)).all()
    assert set(rows["left_used_z"][2000:2500]) == {rows["left_used_z"][1999]}


def test_parquet_from_other_software_is_imported(tmp_path: Path) -> None:
    arrow, parquet = pytest.importorskip("pyarrow"), pytest.importorskip("pyarrow.parquet")
    columns = task_table()
    columns["trial"] = [None if number == "" else number for number in columns["trial"]]
    columns["left_z"] = np.array(columns["left_z"], np.float32)
    parquet.write_table(arrow.table(columns), tmp_path / "task.parquet")
    with imported(tmp_path / "task.parquet", tmp_path) as found:
        rows = found.ticks()
        assert [attempt.outcome for attempt in found.attempts()] == ["success", "fell"]
    assert (rows["left_sent_z"] == columns["left_z"].astype(np.float64)).all()
    assert rows["right_sent_z"].tolist() == columns["right_z"]


HEAD = "time,left_z,right_z,p\n"


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("time,left_z,p\n0,0,0\n", r"missing: right_z \[m\]; it has time, left_z, p\. .*--map right_z=THEIRS"),
        (HEAD + "0,0,0,0\n0.1,x,0,0\n", 'line 3, column left_z: found "x", expected a number'),
        (HEAD + "0,0,0,0\n0.1,nan,0,0\n", "line 3, column left_z: found nan, expected a number"),
        (HEAD + "0,0,0,0\n\n0.1,,0,0\n", "line 4, column left_z: found nan"),
        (HEAD + "0,0,0,0\n0.1,0,0,0\n0.1,0,0,0\n", r"line 4, column time: found 0\.1 s after 0\.1 s"),
        (HEAD + "0,0,0,0\n0.1,12,0,0\n", r"line 3, column left_z: found 12 m, .*--unit left_z=mm"),
        (HEAD + "0,0,0,0\n0.1,0,0\n", "line 3: found 3 columns, expected 4"),
        (HEAD + "0,0,0,0\n", "rows: found 1, expected at least 2"),
        (HEAD + "0,0,0,0\n5,0,0,0\n", r"no two rows are within 0\.1 s .*--unit time=ms"),
        (HEAD[:-3] + "\n0,0,0\n0.1,0,0\n", "contains hands only, .*--simulate"),
        ("", "line 1: found nothing"),
        ("time,left_z,right_z,trial\n0,0,0,1.5\n", 'column trial: found "1.5", expected a whole number'),
        ("time,left_z,right_z,trial\n0,0,0,1_1\n", 'line 2, column trial: found "1_1", expected a whole number'),
        ("time,left_z,right_z,trial\n0,0,0,1e1\n", 'line 2, column trial: found "1e1", expected a whole number'),
        (HEAD + "0,0,0,0\n0.1,0,0.0_1,0\n", 'line 3, column right_z: found "0.0_1", expected a number'),
        (HEAD + "0,0,0,0\n0.1,0,0,٣\n", 'line 3, column p: found "٣", expected a number'),
        (HEAD + "0,0,0,0\n0.1,0,0,inf\n", 'line 3, column p: found "inf", expected a number'),
        (HEAD.replace(",", ";") + "0;0;0;0\n0,1;0;0;0\n", 'found "0,1", expected a number with a decimal point'),
        ("time,left_z,right_z,phase\n0,0,0,up\n0.1,0,0,up\n", 'column phase: found "up", expected one of idle, '),
        ("time,left_z,right_z,trial,outcome\n0,0,0,1,won\n0.1,0,0,1,won\n", 'column outcome: found "won", expected'),
        ("time,time,left_z,right_z,p\n0,0,0,0,0\n", "time is there twice"),
    ],
)
def test_invalid_table_is_refused_with_the_place(tmp_path: Path, text: str, message: str) -> None:
    table = tmp_path / "table.csv"
    table.write_text(text, encoding="utf-8")
    with pytest.raises(ConfigError, match=rf"table\.csv: {message}" if "missing" in message else message) as error:
        import_table(table, tmp_path / "made", CONFIG, ImportOptions(), UTC_NS, quiet)
    assert "table.csv" in str(error.value)
    assert not (tmp_path / "made").exists()


@pytest.mark.parametrize(
    ("wishes", "message"),
    [
        ({"names": ("lefty=z",)}, r"--map lefty=z: netboard has no column lefty; did you mean left_y\?"),
        ({"names": ("left_z",)}, r"--map left_z: expected COLUMN=\.\.\., as in --map left_z=Height1"),
        ({"names": ("z=height",)}, "--map z=height: .* has no column height; it has time, left_z"),
        ({"names": ("z=p", "z=p")}, "--map: z is given twice"),
        ({"units": ("left_z=inch",)}, "--unit left_z=inch: expected one of m, cm, mm, um, with -"),
        ({"units": ("phase=m",)}, "--unit phase=m: expected one of none"),
        ({"units": ("vp=m/s",)}, "--unit vp=m/s: .* has no such column"),
    ],
)
def test_invalid_import_option_is_refused(tmp_path: Path, wishes: dict[str, Any], message: str) -> None:
    table = write_csv(tmp_path / "task.csv", task_table())
    with pytest.raises(ConfigError, match=message):
        import_table(table, tmp_path, CONFIG, ImportOptions(**wishes), UTC_NS, quiet)


@pytest.mark.parametrize("kind", ["csv", "parquet"])
def test_imported_measurements_remain_measurements_when_exported_and_imported_again(tmp_path: Path, kind: str) -> None:
    if kind == "parquet":
        pytest.importorskip("pyarrow")
    with imported(write_csv(tmp_path / "task.csv", task_table()), tmp_path / "first") as first:
        export([first.path], kind, tmp_path / "out", lambda *progress: None)
    with imported(tmp_path / "out" / "ticks" / f"{first.path.stem}.{kind}", tmp_path / "again") as again:
        assert again.metadata["imported"] == "measured"
    assert check(again.path).severity is check(first.path).severity is not Severity.DAMAGE


def test_list_of_recordings_beside_a_table_of_ticks_need_not_be_of_an_export(rehearsed: Path, tmp_path: Path) -> None:
    export([rehearsed], "csv", tmp_path / "out", lambda *progress: None)
    table, listed = tmp_path / "out" / "ticks" / f"{rehearsed.stem}.csv", tmp_path / "out" / "recordings.csv"
    listed.write_text("file,notes\nS01,tired\n", encoding="utf-8")
    imported(table, tmp_path / "own").close()
    for metadata in ("hello", "", "[1]", '"{""what_if"":1}"'):
        listed.write_text(f"recording,metadata\n{rehearsed.stem},{metadata}\n", encoding="utf-8")
        with pytest.raises(ConfigError, match=rf"csv: column metadata of recording {rehearsed.stem}: expected"):
            imported(table, tmp_path / "damaged")


def resaved(table: Path, change: Callable[[str, str], str], *, first: int = 1) -> Path:
    """Save an exported table of ticks again, as another program does: each cell changed, from this row on."""
    with table.open(encoding="utf-8", newline="") as file:
        names, *rows = csv.reader(file)
    changed = [[change(*pair) for pair in zip(names, row, strict=True)] for row in rows[first - 1 :]]
    with table.open("w", encoding="utf-8", newline="") as file:
        csv.writer(file).writerows([names, *rows[: first - 1], *changed])
    return table


def rounded(name: str, cell: str) -> str:
    """Return a cell with ten digits, as a spreadsheet shows them."""
    return repr(float(f"{float(cell):.10g}")) if name in TICK.names and TICK[name].kind == "f" else cell


@pytest.fixture
def exported(rehearsed: Path, tmp_path: Path) -> Path:
    """The exported table of the two trials."""
    export([rehearsed], "csv", tmp_path / "out", lambda *progress: None)
    return tmp_path / "out" / "ticks" / f"{rehearsed.stem}.csv"


@pytest.mark.slow
def test_rounded_numbers_of_exported_ticks_are_said_at_the_import(exported: Path, tmp_path: Path) -> None:
    done = import_table(resaved(exported, rounded, first=3001), tmp_path, CONFIG, ImportOptions(), UTC_NS, quiet)
    first, note = in_words([done])
    assert first.endswith("a copy of an exported table, imported, not bit-exact")
    assert re.search(rf'not bit-exact: {re.escape(str(exported))}: line 3\d\d\d, column \w+: found "', note), note
    assert "without saving it in a spreadsheet" in note
    for replay in (False, True):
        report = check(done.path, replay=replay)
        assert report.severity is Severity.LOSS, report
        assert any("imported, not bit-exact: " in finding.text for finding in report.findings)
    printed = CliRunner().invoke(app, ["info", str(done.path)]).output
    assert "not bit-exact" in " ".join(printed.split())


@pytest.mark.slow
def test_changed_number_in_a_recording_is_damage_still(rehearsed: Path, tmp_path: Path) -> None:
    with Recording(rehearsed) as recording:
        rows = recording.ticks()
    rows["p"][5000] += 1e-9
    writer = BlockWriter(tmp_path, CONFIG, "changed", UTC_NS)
    writer.take(rows)
    writer.finish()
    assert check(writer.path, replay=True).severity is Severity.DAMAGE


@pytest.mark.slow
@pytest.mark.parametrize(
    ("change", "message"),
    [
        (
            lambda name, cell: f"{float(cell):.5E}" if name == "time_ns" else cell,
            r'line 2, column time_ns: found "1\.00000E\+09", expected a whole number in digits, all of them; import',
        ),
        (
            lambda name, cell: f"{round(int(cell), -7)}" if name == "time_ns" else cell,
            r'line 3, column time_ns: found "1000000000", expected 1001000000, as ticks are 1 ms apart',
        ),
        (lambda name, cell: "" if name == "left_seq" else cell, "line 2, column left_seq: found nothing, expected"),
        (lambda name, cell: "1_0" if name == "trial" else cell, 'column trial: found "1_0", expected a whole number'),
    ],
)
def test_time_stamps_that_lost_digits_are_refused(
    exported: Path, tmp_path: Path, change: Callable[[str, str], str], message: str
) -> None:
    with pytest.raises(ConfigError, match=message):
        import_table(resaved(exported, change), tmp_path / "made", CONFIG, ImportOptions(), UTC_NS, quiet)
    assert not list((tmp_path / "made").glob("*"))


@pytest.mark.slow
def test_rows_left_out_of_exported_ticks_are_said_at_the_import(exported: Path, tmp_path: Path) -> None:
    lines = exported.read_text(encoding="utf-8").splitlines(keepends=True)
    exported.write_text("".join([lines[0], *lines[1::10]]), encoding="utf-8")
    done = import_table(exported, tmp_path, CONFIG, ImportOptions(), UTC_NS, quiet)
    assert any("gaps between ticks, the first at" in note and "tick 10 follows 0" in note for note in done.notes)


@pytest.mark.slow
def test_error_at_the_end_of_a_table_leaves_no_recording(
    rehearsed: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(tables, "ROWS", 1000)
    export([rehearsed], "csv", tmp_path / "out", lambda *progress: None)
    table = tmp_path / "out" / "ticks" / f"{rehearsed.stem}.csv"
    lines = table.read_text(encoding="utf-8").splitlines(keepends=True)
    table.write_text("".join([*lines[:-1], lines[5]]), encoding="utf-8")
    with pytest.raises(ConfigError, match=f'line {len(lines)}, column tick: found "4", expected increasing numbers'):
        import_table(table, tmp_path / "made", CONFIG, ImportOptions(), UTC_NS, lambda *progress: None)
    assert list((tmp_path / "made").iterdir()) == []


def test_import_never_overwrites_a_recording(tmp_path: Path) -> None:
    table = write_csv(tmp_path / "task.csv", task_table())
    imported(table, tmp_path).close()
    with pytest.raises(ConfigError, match="already exists"):
        imported(table, tmp_path)


def test_import_command_summarises_the_import(tmp_path: Path) -> None:
    columns = task_table(200)
    del columns["target"]
    columns["mood"] = [1] * 800
    table = write_csv(tmp_path / "task.csv", columns)
    words = ["import", str(table), "-o", str(tmp_path / "made"), "--set", "session.dyad=D77"]
    result = CliRunner().invoke(app, words)
    assert result.exit_code == 0, result.output
    (path,) = (tmp_path / "made").iterdir()
    assert path.name.startswith("S01_D77_block01_")
    printed = " ".join(result.output.split())
    assert (
        "3996 ticks, derived from the measurements of another program 800 samples, 200 a second columns left out: "
        "mood missing columns, NaN" in printed
    )
    assert "left_force" in printed
    result = CliRunner().invoke(app, ["info", str(path)])
    assert result.exit_code == 0, result.output
    assert "unknown" in result.output  # the target
    assert "imported from task.csv, measured" in result.output
    with Recording(path) as found:
        assert found.config_text == resolve(replace(Config(), session=replace(Config().session, dyad="D77")))
        assert set(TICK.names) == set(found.ticks().dtype.names)


def test_exported_table_is_named_as_such() -> None:
    assert [*in_words([Imported(Path("S01.mcap"), "a copy", 3, ())])] == ["S01.mcap: 3 ticks, a copy"]
