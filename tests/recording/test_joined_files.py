"""Files that hold a recording twice, in parts, or with others: nothing is lost, and nothing is mixed."""

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from typer.testing import CliRunner

from netboard.base.errors import RecordingError
from netboard.base.tables.rig import RecordingSettings as Settings
from netboard.recording.files.provenance import SEQUENCE, MetadataName
from netboard.recording.files.reader import Recording
from netboard.recording.files.writer import RecordingWriter
from netboard.recording.integrity.checking import check
from netboard.recording.integrity.severity import Severity
from netboard.recording.recovery.recover import is_whole, recover, recover_all
from netboard.services.cli import app
from samples import CONFIG_TEXT, OPENED_NS, fill, metadata, random_rows

A_ROWS, B_ROWS = random_rows(240, seed=11), random_rows(200, seed=12)
B_ROWS["time_ns"] += 123_456  # another run of a server has its ticks at other parts of a millisecond

OTHER = {"session": "77aa000000000000", "dyad": "D02", "name": "S02"}


def write(
    path: Path, rows: NDArray[Any], about: dict[str, str] | None = None, recovery: dict[str, str] | None = None
) -> Path:
    """Write a finished recording in chunks of a few ticks."""
    settings = Settings(chunk_bytes=8192)
    writer = RecordingWriter(path, metadata() | (about or {}), CONFIG_TEXT, settings, OPENED_NS, recovery)
    writer.finish(fill(writer, rows))
    return path


@pytest.fixture(scope="module")
def files(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, Path]:
    folder = tmp_path_factory.mktemp("recordings")
    return write(folder / "a.mcap", A_ROWS), write(folder / "b.mcap", B_ROWS, OTHER)


def part(data: bytes, first: float, stop: float) -> bytes:
    return data[round(len(data) * first) : round(len(data) * stop)]


def same_as(path: Path, rows: NDArray[Any], original: Path) -> bool:
    """Whether a recovered file has exactly these ticks, and the events, probes and end of the original."""
    with Recording(path) as found, Recording(original) as whole:
        found.check()
        assert found.ticks().tobytes() == rows.tobytes()
        return (found.events(), found.clocks(), found.frames(), found.end) == (
            *(whole.events(), whole.clocks(), whole.frames()),
            whole.end,
        )


REPEATS: dict[str, Callable[[bytes], bytes]] = {
    "half of it, then all": lambda a: part(a, 0, 0.5) + a,
    "twice": lambda a: a + a,
    "three times": lambda a: a + a + a,
    "overlapping halves": lambda a: part(a, 0, 0.6) + part(a, 0.4, 1),
    "its unfinished beginning behind it": lambda a: a + part(a, 0, 0.7),
    "its end before it": lambda a: part(a, 0.6, 1) + a,
    "a piece of it behind it": lambda a: a + part(a, 0.3, 0.8),
    "other bytes behind it": lambda a: a + bytes(range(256)) * 4,
    "other bytes before it": lambda a: bytes(range(256)) * 4 + a,
    "its first kilobyte before it": lambda a: a[:1000] + a,
}


@pytest.mark.parametrize("how", REPEATS)
def test_recording_that_a_file_contains_whole_is_recovered_to_the_bit(
    tmp_path: Path, files: tuple[Path, Path], how: str
) -> None:
    source = tmp_path / "wrong.mcap"
    source.write_bytes(REPEATS[how](files[0].read_bytes()))
    assert check(source).severity == Severity.DAMAGE
    (report,) = recover_all(source)
    assert (report.missing, report.damage) == ((), ())
    assert report.left_out
    assert same_as(report.output, A_ROWS, files[0])
    assert [file.name for file in sorted(tmp_path.iterdir())] == ["wrong.mcap", "wrong.recovered.mcap"]
    if "bytes" in how:
        assert any("1024 bytes at" in what for what in report.left_out)


def test_repeated_ticks_are_named(tmp_path: Path, files: tuple[Path, Path]) -> None:
    (tmp_path / "wrong.mcap").write_bytes(files[0].read_bytes() * 2)
    answer = CliRunner().invoke(app, ["recover", str(tmp_path / "wrong.mcap")])
    assert "left out: 240 ticks that the file has twice (0 to 239), all identical" in answer.stdout
    assert answer.exit_code == 0


JOINED: dict[str, Callable[[bytes, bytes], tuple[bytes, float, float]]] = {
    "both": lambda a, b: (a + b, 1.0, 1.0),
    "an unfinished one behind a finished one": lambda a, b: (a + part(b, 0, 0.7), 1.0, 0.7),
    "a finished one behind an unfinished one": lambda a, b: (part(a, 0, 0.5) + b, 0.5, 1.0),
}


@pytest.mark.parametrize("how", JOINED)
def test_two_recordings_in_a_file_become_two_files(tmp_path: Path, files: tuple[Path, Path], how: str) -> None:
    source = tmp_path / "wrong.mcap"
    content, *_ = JOINED[how](*(file.read_bytes() for file in files))
    source.write_bytes(content)
    reports = recover_all(source)
    assert [one.output.name for one in reports] == [
        "wrong.recovered.mcap",
        "S02_D02_20260921T141320Z_77aa0000.recovered.mcap",
    ]
    assert [one.whose for one in reports] == ["dyad D01, session S01, block 1", "dyad D02, session S02, block 1"]
    for report, rows, original in zip(reports, (A_ROWS, B_ROWS), files, strict=True):
        with Recording(report.output) as found, Recording(original) as whole:
            ticks = found.ticks()
            assert ticks.tobytes() == rows[: len(ticks)].tobytes()
            assert found.events() == whole.events()[: len(found.events())]
            assert found.metadata["session"] == whole.metadata["session"]
        assert (len(ticks) < len(rows)) == bool(report.damage)


def test_end_of_another_recording_is_not_taken_for_the_rest(tmp_path: Path, files: tuple[Path, Path]) -> None:
    late = B_ROWS.copy()
    late["tick"] += 1000
    late["time_ns"] += 1000 * 1_000_000
    other = write(tmp_path / "b.mcap", late, OTHER)
    source = tmp_path / "wrong.mcap"
    source.write_bytes(part(files[0].read_bytes(), 0, 0.5) + part(other.read_bytes(), 0.5, 1))
    own, others = recover_all(source)
    assert own.whose == "dyad D01, session S01, block 1"
    assert others.output.name == "wrong_other.recovered.mcap"
    with Recording(own.output) as first, Recording(others.output) as second:
        assert first.ticks().tobytes() == A_ROWS[: len(first.ticks())].tobytes()
        assert second.ticks().tobytes() == late[-len(second.ticks()) :].tobytes()
        assert not second.gaps()


def test_hole_in_the_middle_is_still_one_recording(tmp_path: Path, files: tuple[Path, Path]) -> None:
    data = files[0].read_bytes()
    (tmp_path / "a.mcap").write_bytes(part(data, 0, 0.4) + part(data, 0.6, 1))
    (report,) = recover_all(tmp_path / "a.mcap")
    assert len(report.missing) == 1
    assert report.damage


def test_different_ticks_with_the_same_metadata_are_kept_apart_and_said(
    tmp_path: Path, files: tuple[Path, Path]
) -> None:
    changed = A_ROWS.copy()
    changed["theta"][100] = 0.25
    other = write(tmp_path / "b.mcap", changed)
    (tmp_path / "wrong.mcap").write_bytes(files[0].read_bytes() + other.read_bytes())
    reports = recover_all(tmp_path / "wrong.mcap")
    assert "differs from another one in the file that has the same metadata" in reports[1].whose
    for report, rows in zip(reports, (A_ROWS, changed), strict=True):
        with Recording(report.output) as recording:
            assert recording.ticks().tobytes() == rows.tobytes()


def test_no_file_is_left_if_one_of_them_cannot_be_written(tmp_path: Path, files: tuple[Path, Path]) -> None:
    (tmp_path / "wrong.mcap").write_bytes(b"".join(file.read_bytes() for file in files))
    (tmp_path / "wrong.recovered.mcap").touch()
    assert CliRunner().invoke(app, ["recover", str(tmp_path / "wrong.mcap")]).exit_code == 2
    assert len(list(tmp_path.iterdir())) == 2


def test_sound_file_is_not_copied(tmp_path: Path, files: tuple[Path, Path]) -> None:
    assert is_whole(files[0])
    (tmp_path / "a.mcap").write_bytes(files[0].read_bytes())
    answer = CliRunner().invoke(app, ["recover", str(tmp_path / "a.mcap")])
    assert (answer.exit_code, [file.name for file in tmp_path.iterdir()]) == (0, ["a.mcap"])
    assert "a.mcap: is complete and undamaged" in answer.stdout


# --- files that older versions made, and readers -----------------------------------------------------------------


def old(path: Path, rows: NDArray[Any]) -> Path:
    """Write a file as an older recovery did: all chunks in file order, as one recording."""
    return write(path, rows, recovery={"source": "wrong.mcap", "damage": ""})


@pytest.mark.parametrize("second", [A_ROWS, B_ROWS], ids=["twice", "another dyad's"])
@pytest.mark.parametrize(
    "command",
    [
        ["info"],
        ["export", "--to", "csv"],
        ["analyse", "--no-cache"],
        ["replay", "--verify"],
        ["check"],
        ["whatif", "--set", "physics.gravity=9"],
    ],
)
def test_every_command_refuses_ticks_that_are_not_one_sequence(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, second: NDArray[Any], command: list[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    old(Path("a.mcap"), np.concatenate([A_ROWS, second]))
    answer = CliRunner().invoke(app, [command[0], "a.mcap", *command[1:]])
    assert answer.exit_code == 1, answer.output
    words = "a.mcap: is not one recording: tick"
    assert words in " ".join(answer.output.split())
    assert "Traceback" not in answer.output
    assert command[0] == "check" or len(answer.output.splitlines()) == 1


def test_repeat_that_an_older_version_wrote_is_recovered(tmp_path: Path) -> None:
    report = recover(old(tmp_path / "a.mcap", np.concatenate([A_ROWS[:100], A_ROWS])))
    with Recording(report.output) as recording:
        assert recording.ticks().tobytes() == A_ROWS.tobytes()
        assert recording.recovery[SEQUENCE]


def test_ticks_of_two_recordings_in_a_chunk_are_not_guessed_apart(tmp_path: Path) -> None:
    source = old(tmp_path / "a.mcap", np.concatenate([A_ROWS[:100], B_ROWS]))
    with pytest.raises(RecordingError, match=r"a\.mcap: has ticks of several recordings in one chunk"):
        recover(source)
    assert list(tmp_path.iterdir()) == [source]


def test_recovered_file_with_two_clocks_is_refused(tmp_path: Path) -> None:
    late = B_ROWS[:50].copy()
    late["tick"] += 500
    source = old(tmp_path / "a.mcap", np.concatenate([A_ROWS, late]))
    with pytest.raises(RecordingError, match="not one recording: tick 500 follows another clock than tick 239"):
        Recording(source)
    (tmp_path / "wrong.mcap").touch()
    with pytest.raises(RecordingError, match=r"recover its source again: netboard recover .*wrong\.mcap -o "):
        Recording(source)


def test_second_opening_record_in_a_file_is_refused(tmp_path: Path) -> None:
    writer = RecordingWriter(tmp_path / "a.mcap", metadata(), CONFIG_TEXT, Settings(), OPENED_NS)
    last = fill(writer, A_ROWS)
    writer._file.add_metadata(MetadataName.OPENED, metadata() | OTHER)
    writer.finish(last)
    with pytest.raises(RecordingError, match="2 records of metadata netboard"):
        Recording(tmp_path / "a.mcap")


def test_events_that_repeat_are_refused(tmp_path: Path, files: tuple[Path, Path]) -> None:
    writer = RecordingWriter(tmp_path / "a.mcap", metadata(), CONFIG_TEXT, Settings(), OPENED_NS)
    with Recording(files[0]) as recording:
        events = recording.events()[:3]
    for number, event in enumerate((*events, *events)):
        writer.write(event, number, OPENED_NS + number)
    writer.finish(OPENED_NS + 10)
    with (
        Recording(tmp_path / "a.mcap") as recording,
        pytest.raises(RecordingError, match="event 0 comes after event 2"),
    ):
        recording.events()
