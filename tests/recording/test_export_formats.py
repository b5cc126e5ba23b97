"""Exported files are read by other libraries, to the bit, and are complete or absent."""

import csv
import errno
import json
import os
import shutil
import subprocess
import sys
from dataclasses import replace
from importlib.metadata import metadata
from pathlib import Path

import numpy as np
import pytest
from scipy.io import loadmat
from typer.testing import CliRunner

from netboard.base.config import Config
from netboard.base.errors import ConfigError, NetboardError, RecordingError
from netboard.base.files.cells import RUNS, text_of_cell
from netboard.base.files.new import new_file, refuse_existing
from netboard.base.system.locks import lock
from netboard.base.tables.experiment import Design
from netboard.base.tick import TICK
from netboard.recording.export import matlab
from netboard.recording.export.formats import FORMATS, export, library, new_folder, writer_of
from netboard.recording.export.tables import TABLES, TICKS
from netboard.recording.files.reader import Recording
from netboard.recording.importing.table_import import ImportOptions, import_table
from netboard.services.cli import app
from netboard.testing.difficult_recording import ODD, START_NS, UTC_NS, make_rows, without_payloads, write
from netboard.testing.export_format import Columns, ExportFormatContract


def quiet(what: str, done: int, total: int) -> None:
    assert 0 <= done <= total


@pytest.fixture(scope="module")
def two(tmp_path_factory: pytest.TempPathFactory) -> list[Path]:
    folder = tmp_path_factory.mktemp("made")
    return [write(folder / "S01.mcap", make_rows(1)), write(folder / "S02.mcap", make_rows(2), part=2)]


class TestParquet(ExportFormatContract):
    name = "parquet"

    def read(self, folder: Path, recording: str) -> Columns:
        table = pytest.importorskip("pyarrow.parquet").read_table(folder / "ticks" / f"{recording}.parquet")
        return {name: table[name].to_numpy() for name in TICK.names or ()}


class TestCsv(ExportFormatContract):
    name, keeps_payloads = "csv", False

    def read(self, folder: Path, recording: str) -> Columns:
        with (folder / "ticks" / f"{recording}.csv").open(encoding="utf-8", newline="") as file:
            rows = list(csv.DictReader(file))
        number = {"i": int, "f": float}
        return {
            name: np.array([number[TICK[name].kind](row[name]) for row in rows], TICK[name])
            for name in TICK.names or ()
        }


class TestMat(ExportFormatContract):
    name = "mat"

    def read(self, folder: Path, recording: str) -> Columns:
        ticks = loadmat(folder / f"{recording}.mat", struct_as_record=False, squeeze_me=True)["ticks"]
        return {name: getattr(ticks, name) for name in TICK.names or ()}


def test_parquet_keeps_types_and_units(two: list[Path], tmp_path: Path) -> None:
    parquet, dataset = pytest.importorskip("pyarrow.parquet"), pytest.importorskip("pyarrow.dataset")
    export(two, "parquet", tmp_path / "out", quiet)
    table = parquet.read_table(tmp_path / "out" / "ticks" / "S02.parquet")
    assert table.schema.field("theta").metadata == {b"unit": b"rad", b"about": b"tilt of the board, + = right end up"}
    both = dataset.dataset(tmp_path / "out" / "ticks").to_table(columns=["recording", "tick"])
    assert set(both["recording"].to_pylist()) == {"S01", "S02"}
    events = parquet.read_table(tmp_path / "out" / "events.parquet").to_pylist()
    assert [event["recording"] for event in events] == ["S01", "S01", "S02", "S02"]
    assert json.loads(events[0]["details"]) == {"text": ODD}
    assert parquet.read_table(tmp_path / "out" / "remarks.parquet").num_rows == 0


def test_csv_has_every_field_and_the_events(two: list[Path], tmp_path: Path) -> None:
    export(two, "csv", tmp_path / "out", quiet)
    with (tmp_path / "out" / "ticks" / "S01.csv").open(encoding="utf-8", newline="") as file:
        assert next(csv.reader(file)) == [field.name for field in TICKS.fields]
    with (tmp_path / "out" / "events.csv").open(encoding="utf-8", newline="") as file:
        events = list(csv.DictReader(file))
    assert json.loads(events[2]["details"]) == {"text": ODD}
    assert int(events[2]["time_ns"]) == START_NS - 1_000_000


def test_csv_has_no_formula_and_gives_its_texts_back(tmp_path: Path) -> None:
    label = '=HYPERLINK("http://example.org", "open")'
    config = replace(Config(), block=replace(Config().block, label=label))
    recording = write(tmp_path / "=1+1.mcap", make_rows(1), config)
    export([recording], "csv", tmp_path / "out", quiet)
    for table in (table for table in TABLES if table is not TICKS):
        with (tmp_path / "out" / f"{table.name}.csv").open(encoding="utf-8", newline="") as file:
            read = list(csv.DictReader(file))
        texts = [field.name for field in table.fields if field.kind == "string"]
        assert not [row for row in read if any(row[name].startswith(RUNS) for name in texts)], table.name
        assert {text_of_cell(row["recording"]) for row in read} <= {"=1+1"}
    with (tmp_path / "out" / "trials.csv").open(encoding="utf-8", newline="") as file:
        trials = list(csv.DictReader(file))
    assert {text_of_cell(row["block_label"]) for row in trials} == {label}
    assert {row["target"] for row in trials} <= {"-1", "0", "1"}
    found = import_table(
        tmp_path / "out" / "ticks" / "=1+1.csv", tmp_path / "again", Config(), ImportOptions(), UTC_NS, quiet
    )
    with Recording(found.path) as back:
        assert back.config.block.label == label


def test_mat_has_a_struct_for_each_table(two: list[Path], tmp_path: Path) -> None:
    export(two, "mat", tmp_path / "out", quiet)
    read = loadmat(tmp_path / "out" / "S02.mat", struct_as_record=False, squeeze_me=True)
    assert read["trials"].outcome.tolist() == ["fell", "success", "timed_out", "abort", "unfinished"]
    assert json.loads(read["events"].details[0]) == {"text": ODD}
    assert {path.name for path in (tmp_path / "out").iterdir()} == {
        *("S01.mat", "S02.mat", "dictionary.json", "dictionary.csv", "configurations")
    }


@pytest.mark.parametrize(("name", "seed"), [("csv", 3), ("csv", 4), ("parquet", 3), ("parquet", 4)])
def test_exported_ticks_import_bit_exactly(tmp_path: Path, name: str, seed: int) -> None:
    if name == "parquet":
        pytest.importorskip("pyarrow")
    rows = make_rows(seed)
    export([write(tmp_path / "S01.mcap", rows)], name, tmp_path / "out", quiet)
    table = tmp_path / "out" / "ticks" / f"S01.{name}"
    made = import_table(table, tmp_path, Config(), ImportOptions(), UTC_NS, lambda *progress: None)
    with Recording(made.path) as recording:
        expected = without_payloads(rows) if name == "csv" else rows
        assert recording.ticks().tobytes() == expected.tobytes()


OCTAVE = """
s = load("S01.mat");
printf("%s %s %s\\n", class(s.ticks.time_ns), class(s.ticks.theta), class(s.trials.outcome));
printf("%d %d\\n", s.ticks.time_ns(1), s.ticks.time_ns(end) - s.ticks.time_ns(1));
printf("%s\\n", num2hex(s.ticks.left_z)');
printf("%s\\n", s.trials.outcome{:});
printf("%d %d\\n", numel(s.remarks.seq), numel(s.events.details));
"""


def with_factor(name: str) -> Config:
    """The configuration of a block with a numeric factor of this name."""
    design = Design(
        factors={name: "low"}, levels={name: ("low",)}, types={name: "numeric"}, values={name: (0.5,)}, units={name: ""}
    )
    return replace(Config(), design=design)


def test_mat_file_has_the_columns_of_factors_with_long_names(tmp_path: Path) -> None:
    recording = write(tmp_path / "S01.mcap", make_rows(1), with_factor("strength_of_the_partners_feedback"))
    export([recording], "mat", tmp_path / "out", quiet)
    trials = loadmat(tmp_path / "out" / "S01.mat")["trials"][0, 0]
    assert set(trials["factor_strength_of_the_partners_feedback_value"][:, 0]) == {0.5}


def test_factor_with_a_name_too_long_for_matlab_is_refused(tmp_path: Path) -> None:
    recording = write(tmp_path / "S01.mcap", make_rows(1), with_factor("x" * 60))
    with pytest.raises(RecordingError, match=r"column factor_x+: found 67 characters, expected at most 63"):
        export([recording], "mat", tmp_path / "out", quiet)
    assert [path.name for path in tmp_path.iterdir()] == ["S01.mcap"]


@pytest.mark.slow
def test_octave_reads_mat_files(two: list[Path], tmp_path: Path) -> None:
    octave = shutil.which("octave-cli")
    if octave is None:
        pytest.skip("GNU Octave is not installed")
    export(two[:1], "mat", tmp_path / "out", quiet)
    script = tmp_path / "read.m"
    script.write_text(OCTAVE, encoding="utf-8")
    command = [octave, "--quiet", "--no-init-file", str(script)]
    printed = subprocess.run(command, cwd=tmp_path / "out", capture_output=True, text=True, check=True).stdout.split()
    rows = make_rows(1)
    assert printed[:5] == ["int64", "double", "cell", str(START_NS), "299000000"]
    assert printed[5] == "".join(f"{bits:016x}" for bits in rows["left_z"].view(np.uint64).tolist())
    assert printed[6:] == ["fell", "success", "timed_out", "abort", "unfinished", "0", "2"]


def test_recording_too_large_for_matlab_is_refused(
    two: list[Path], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(matlab, "MAX_BYTES", 1000)
    with pytest.raises(RecordingError, match=r"S01\.mcap: its ticks are .* use --to parquet"):
        export(two, "mat", tmp_path / "out", quiet)
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize("name", FORMATS)
def test_every_format_has_a_writer_and_a_known_extra(name: str) -> None:
    """A new format is one entry: the command's choices and the table in the docs follow."""
    entry = FORMATS[name]
    assert callable(writer_of(name))
    extras = metadata("netboard").get_all("Provides-Extra") or []
    assert entry.extra in ("", *extras)


def test_link_to_nowhere_is_not_replaced(tmp_path: Path) -> None:
    link = tmp_path / "d.mcap"
    link.symlink_to(tmp_path / "not fetched")
    with pytest.raises(ConfigError, match="already exists"):
        refuse_existing(link)


def test_full_disk_names_the_folder_that_was_asked_for(tmp_path: Path) -> None:
    with (
        pytest.raises(NetboardError, match=r"^\S+/out: cannot be written: No space left on device$"),
        new_folder(tmp_path / "out") as part,
        new_file(part / "report.html"),
    ):
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))


def test_output_folder_created_during_the_export_is_left_alone(two: list[Path], tmp_path: Path) -> None:
    def appear(what: str, done: int, total: int) -> None:
        (tmp_path / "out").mkdir(exist_ok=True)

    with pytest.raises(ConfigError, match="out: already exists"):
        export(two, "csv", tmp_path / "out", appear)
    assert [path.name for path in tmp_path.rglob("*")] == ["out"]


@pytest.mark.skipif(sys.platform == "win32", reason="locks folders")
def test_rest_of_a_killed_export_is_removed_but_not_that_of_a_running_one(tmp_path: Path) -> None:
    killed, running = (tmp_path / f".out.{number}.part" for number in (1, 2))
    for folder in (killed, running):
        folder.mkdir()
        (folder / "ticks.csv").touch()
    handle = os.open(running, os.O_RDONLY)
    lock(handle)
    with new_folder(tmp_path / "out"):
        assert not killed.exists()
    os.close(handle)
    assert sorted(tmp_path.iterdir()) == [running, tmp_path / "out"]


def test_unknown_format_and_missing_library_are_refused(tmp_path: Path) -> None:
    with pytest.raises(ConfigError, match="no export format 'xls'; it has: bids, csv, mat"):
        export([], "xls", tmp_path / "out", quiet)
    with pytest.raises(ConfigError, match=r"this needs nosuch, .* pip install 'netboard\[some\]'"):
        library("nosuch.module", "some")


def test_export_command_accepts_folders(two: list[Path], tmp_path: Path) -> None:
    result = CliRunner().invoke(app, ["export", str(two[0].parent), "--to", "csv", "-o", str(tmp_path / "out")])
    assert result.exit_code == 0, result.exception
    assert "2 recordings" in result.output
    with Recording(two[0]) as recording:
        kept = (tmp_path / "out" / "configurations" / "S01.toml").read_text(encoding="utf-8")
        assert kept == recording.config_text
    for table in TABLES[1:]:
        assert (tmp_path / "out" / f"{table.name}.csv").is_file()


def test_export_command_lists_unfinished_recordings(two: list[Path], tmp_path: Path) -> None:
    shutil.copy(two[0], tmp_path)
    (tmp_path / "S03.mcap.part").touch()
    result = CliRunner().invoke(app, ["export", str(tmp_path), "--to", "xdf", "-o", str(tmp_path / "out")])
    assert result.exit_code == 0
    assert "S03.mcap.part is unfinished; netboard recover makes a recording of it" in result.stderr


@pytest.mark.parametrize("name", ["csv", "mat", "bids"])
def test_copies_of_a_recording_are_refused(two: list[Path], tmp_path: Path, name: str) -> None:
    copy = tmp_path / "copy.mcap"
    shutil.copy(two[0], copy)
    with pytest.raises(RecordingError, match=r"copy\.mcap: is a copy of .*S01\.mcap"):
        export([two[0], copy], name, tmp_path / "out", quiet)
    assert list(tmp_path.iterdir()) == [copy]


def test_simulations_of_the_same_hands_with_two_configurations_are_no_copies(tmp_path: Path) -> None:
    table = tmp_path / "hands.csv"
    table.write_text("time,left_z,right_z\n" + "".join(f"{k / 100},0.01,{k * 1e-5}\n" for k in range(30)))
    rig = Config()
    made = [
        import_table(
            table,
            tmp_path / "made",
            replace(rig, session=replace(rig.session, name=name), physics=replace(rig.physics, k_h=k_h)),
            ImportOptions(simulate=True),
            UTC_NS,
            lambda *progress: None,
        ).path
        for name, k_h in (("S01", 200.0), ("S02", 150.0))
    ]
    export(made, "csv", tmp_path / "out", quiet)
    assert {path.stem for path in (tmp_path / "out" / "ticks").iterdir()} == {path.stem for path in made}


def test_export_command_refuses_equal_names_and_missing_files(two: list[Path], tmp_path: Path) -> None:
    other = tmp_path / "S01.mcap"
    other.write_bytes(two[1].read_bytes())
    result = CliRunner().invoke(app, ["export", str(two[0]), str(other), "--to", "csv", "-o", str(tmp_path / "out")])
    assert result.exit_code == 1
    assert "have the same name" in result.output
    result = CliRunner().invoke(app, ["export", str(tmp_path / "none"), "--to", "csv", "-o", str(tmp_path / "out")])
    assert "none: cannot be read" in result.output
