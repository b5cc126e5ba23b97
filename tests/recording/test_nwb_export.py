"""An NWB export satisfies the NWB inspector and the schema, has two people on one clock, and keeps every bit."""

import gc
import sys
from pathlib import Path

import h5py
import numpy as np
import pytest
from dyads import dyad, make_session

from made_recordings import recorded, two_trials
from netboard.base.config import Config
from netboard.base.errors import RecordingError
from netboard.testing.difficult_recording import make_rows, same_bits, write

pynwb = pytest.importorskip("pynwb")

from netboard.recording.export import nwb  # noqa: E402
from netboard.recording.export.formats import export  # noqa: E402
from netboard.recording.export.runs import devices_of  # noqa: E402
from netboard.recording.files.reader import Recording  # noqa: E402
from netboard.recording.importing.table_import import ImportOptions, import_table  # noqa: E402
from netboard.task.trials.state_machine import Phase  # noqa: E402
from netboard.testing.export_format import Columns, ExportFormatContract  # noqa: E402

LEFT_TO_THE_LAB = {"check_experimenter_exists", "check_institution"}


def quiet(what: str, done: int, total: int) -> None:
    assert 0 <= done <= total


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    place = tmp_path_factory.mktemp("nwb")
    (place / "out").mkdir()
    nwb.write(make_session(place), place / "out", quiet)
    return place / "out"


def path_of(folder: Path, subject: str, run: int) -> Path:
    return folder / f"sub-{subject}" / f"sub-{subject}_ses-D07S2_run-{run:02d}_behavior.nwb"


class TestNwb(ExportFormatContract):
    name = "nwb"

    def read(self, folder: Path, recording: str) -> Columns:
        (path,) = folder.glob(f"sub-D01A/*run-{int(recording[-1]):02d}*.nwb")
        with h5py.File(path) as file:
            behavior = file["processing/behavior"]
            z = behavior["Position/left_stylus/data"][:, 2]
            return {"left_sent_z": z, "theta": behavior["board/board_tilt/data"][:]}


@pytest.mark.slow
def test_each_participant_and_run_has_a_file(folder: Path) -> None:
    expected = {path_of(folder, "D07A", 1), path_of(folder, "P22", 1), path_of(folder, "P22", 2)}
    assert set(folder.rglob("*.nwb")) == expected


@pytest.mark.slow
def test_nwb_inspector_asks_only_for_metadata_of_the_lab(folder: Path) -> None:
    nwbinspector = pytest.importorskip("nwbinspector")
    for path in folder.rglob("*.nwb"):
        found = list(nwbinspector.inspect_nwbfile(nwbfile_path=path))
        assert {message.check_function_name for message in found} == LEFT_TO_THE_LAB
        assert all(message.importance.name == "BEST_PRACTICE_SUGGESTION" for message in found)


@pytest.mark.slow
def test_every_file_satisfies_the_schema(folder: Path) -> None:
    for path in folder.rglob("*.nwb"):
        assert pynwb.validate(path=str(path)) == []


def test_participants_have_their_own_stylus_and_the_same_board_bit_for_bit(folder: Path) -> None:
    rows = make_rows(1)
    for subject, side, other in (("D07A", "right", "left"), ("P22", "left", "right")):
        with h5py.File(path_of(folder, subject, 1)) as file:
            behavior = file["processing/behavior"]
            place = behavior[f"Position/{side}_stylus/data"][:]
            for k, field in enumerate(("x", "y", "sent_z")):
                assert same_bits(place[:, k], rows[f"{side}_{field}"])
            for name, field in (("vz", "sent_vz"), ("force_on_hand", "force"), ("sample", "seq")):
                assert same_bits(behavior[f"{side}_stylus/{side}_stylus_{name}/data"][:], rows[f"{side}_{field}"])
            for name, field in (("board/board_tilt", "theta"), ("ball/ball_position", "p"), ("trial/phase", "phase")):
                assert same_bits(behavior[f"{name}/data"][:], rows[field])
            assert f"{other}_stylus" not in behavior
            assert behavior["board/board_tilt/data"].attrs["unit"] == "radians"


def test_all_devices_of_a_side_that_moved_in_the_run_are_listed(tmp_path: Path) -> None:
    """The first one was replaced before the first attempt, and the last agent has the same device again."""
    serials = [(0, "1"), (5, "2"), (155, "3"), (220, "3")]
    joined = [(tick, {"side": "left", "device": "falcon", "model": "Falcon", "serial": said}) for tick, said in serials]
    (tmp_path / "out").mkdir()
    path = write(tmp_path / "replaced.mcap", make_rows(1), joined=joined)
    with Recording(path) as recording:
        assert [(one.side, one.serial) for one in devices_of(recording.config, recording)] == [
            ("left", "2"),
            ("left", "3"),
            ("right", ""),
        ]
    nwb.write([path], tmp_path / "out", quiet)
    first, *_ = sorted((tmp_path / "out").rglob("*.nwb"))
    with pynwb.NWBHDF5IO(first, "r") as io:
        found = {name: (one.serial_number, one.model.name) for name, one in io.read().devices.items()}
    assert found == {"left stylus 1": ("2", "left Falcon 1"), "left stylus 2": ("3", "left Falcon 2")}


def test_imported_measurements_do_not_claim_a_simulated_device(tmp_path: Path) -> None:
    table = tmp_path / "theirs.csv"
    table.write_text("time,left_z,right_z,p,trial\n" + "".join(f"{k / 100},0.01,0.02,0.1,1\n" for k in range(20)))
    made = import_table(table, tmp_path, Config(), ImportOptions(), 10**18, quiet).path
    for name in ("nwb", "bids"):
        export([made], name, tmp_path / name, quiet)
    first, *_ = sorted((tmp_path / "nwb").rglob("*.nwb"))
    with pynwb.NWBHDF5IO(first, "r") as io:
        device = io.read().devices["left stylus"]
        assert device.model.name == "left unknown"
        assert device.model.description == "device of undeclared kind; netboard's backend unknown"
    scans, *_ = sorted((tmp_path / "bids").rglob("*_scans.tsv"))
    names, values = (line.split("\t") for line in scans.read_text().splitlines())
    assert dict(zip(names, values, strict=True))["device"] == "n/a"


def test_recording_without_trials_and_events_has_no_tables_of_them(tmp_path: Path) -> None:
    idle = make_rows(1)[:50]
    idle["event"], idle["phase"] = 0, Phase.IDLE
    (tmp_path / "out").mkdir()
    nwb.write([write(tmp_path / "idle.mcap", idle)], tmp_path / "out", quiet)
    first, *_ = sorted((tmp_path / "out").rglob("*.nwb"))
    with pynwb.NWBHDF5IO(first, "r") as io:
        file = io.read()
        assert file.trials is None
        assert len(file.processing["behavior"]["board"].time_series["board_z"].data) == 50


def test_unknown_target_of_an_imported_table_has_no_side(tmp_path: Path) -> None:
    rows = two_trials()
    rows["target"] = 0
    (tmp_path / "out").mkdir()
    nwb.write([recorded(tmp_path, rows)], tmp_path / "out", quiet)
    first, *_ = sorted((tmp_path / "out").rglob("*.nwb"))
    with pynwb.NWBHDF5IO(first, "r") as io:
        assert list(io.read().trials["target"][:]) == ["n/a", "n/a"]


@pytest.mark.skipif(sys.platform == "win32", reason="POSIX limits")
def test_full_disk_is_named_and_leaves_nothing(tmp_path: Path) -> None:
    """HDF5 crashes when the objects of a file are discarded that it could not complete."""
    import resource

    recording = dyad(tmp_path / "a.mcap")
    limits = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (300_000, limits[1]))
    try:
        with pytest.raises(RecordingError, match=r"out: cannot be written: File too large$"):
            export([recording], "nwb", tmp_path / "out", quiet)
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, limits)
    gc.collect()
    assert [path.name for path in tmp_path.iterdir()] == ["a.mcap"]


def test_both_participants_share_one_time_axis_with_its_gap(folder: Path) -> None:
    starts, times = [], []
    for subject in ("D07A", "P22"):
        with pynwb.NWBHDF5IO(path_of(folder, subject, 1), "r") as io:
            file = io.read()
            assert file.session_id == "D07S2"
            assert file.subject.subject_id == subject
            starts.append(file.session_start_time)
            times.append(file.processing["behavior"]["board"]["board_z"].timestamps[:])
    assert starts[0] == starts[1]
    assert starts[0].utcoffset().total_seconds() == 0
    assert same_bits(times[0], times[1])
    assert times[0].tolist() == [k / 1000 for k in range(300) if k != 100]


@pytest.mark.slow
def test_evenly_spaced_rows_have_a_rate(tmp_path: Path) -> None:
    (tmp_path / "out").mkdir()
    rows = make_rows(1)[101:]
    nwb.write([dyad(tmp_path / "a.mcap", rows=rows)], tmp_path / "out", quiet)
    with pynwb.NWBHDF5IO(path_of(tmp_path / "out", "P22", 1), "r") as io:
        series = io.read().processing["behavior"]["Position"]["left_stylus"]
        assert (series.rate, series.starting_time, series.timestamps) == (1000.0, 0.0, None)
        assert same_bits(series.data[:, 1], rows["left_y"])


def test_trial_table_lists_the_attempts(folder: Path, tmp_path: Path) -> None:
    with Recording(dyad(tmp_path / "same.mcap")) as recording:
        attempts = recording.attempts()
    with pynwb.NWBHDF5IO(path_of(folder, "P22", 1), "r") as io:
        file = io.read()
        trials, events = file.trials[:], file.events["trial_events"][:]
        assert file.devices["left stylus"].model.manufacturer == "3D Systems"
    assert trials["start_time"].tolist() == [attempt.tick / 1000 for attempt in attempts]
    assert trials["stop_time"].tolist() == [attempt.stop / 1000 for attempt in attempts]
    assert trials["outcome"].tolist() == [attempt.outcome for attempt in attempts]
    assert np.array_equal(trials["completion_time"], [np.nan, 0.04, np.nan, np.nan, np.nan], equal_nan=True)
    assert trials["catch_trial"].tolist() == [False, False, True, True, True]
    assert set(trials["condition"]) == {"dyadic, force partner_only"}
    assert events["event"].tolist() == ["fell", "success", "timed_out", "abort"]
    assert events["timestamp"].tolist() == [0.059, 0.149, 0.199, 0.229]
