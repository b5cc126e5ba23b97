"""A file that lies about itself is refused in words by whatever reads it, and never reads as something else."""

import struct
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import lz4.frame
import pytest
import zstandard
from mcap.records import Chunk

from evidence.fuzz.container import Container
from evidence.fuzz.hostile_files import COMMANDS, EACH, commands_for, turns
from evidence.fuzz.lies import KINDS, SOURCE, cases, nested, ticks_schema, unchanged, written
from netboard.base.errors import NetboardError
from netboard.recording.files.provenance import MetadataName
from netboard.recording.files.reader import Recording
from netboard.recording.format.batches import ATTEMPTS_NAME
from netboard.recording.format.claims import MAX_CHUNK_BYTES, MAX_JOINED
from netboard.recording.integrity.catalogue import entry_of, with_trials
from netboard.recording.integrity.checking import check
from netboard.recording.integrity.severity import RESULTS, Severity
from netboard.recording.recovery.recover import is_whole
from netboard.recording.recovery.spilled import recover_any

FILES = 8
"""Files of each kind [1]."""

BESIDE = ("spill", "journal", "unfinished file", "folder", "table of ticks", "table of hands", "keys")
"""Kinds that are no finished recording, or beside a sound one."""


def _schema_with_differences(container: Container) -> None:
    schema = ticks_schema(container)
    schema.data = schema.data.replace(b'"differences": ', b'"differences": 1000000000', 1)


def _stored(*chunk: object) -> Callable[[Container], object]:
    word, data, size = chunk
    return lambda container: setattr(container.chunks[0], "stored", Chunk(word, data, 10**18, 0, 0, size))


NAMED: dict[str, tuple[Callable[[Container], object], str]] = {
    "differences": (_schema_with_differences, "differences: input should be less than or equal to 8, found 1000000000"),
    "nested schema": (
        lambda c: setattr(ticks_schema(c), "data", b'{"columns": ' + nested(100_000).encode() + b"}"),
        "the schema of its ticks: not valid JSON: lists or objects are nested too deeply",
    ),
    "nested list of attempts": (
        lambda c: setattr(c.attachment(ATTEMPTS_NAME), "data", nested(100_000).encode()),
        "its list of attempts: not valid JSON: lists or objects are nested too deeply",
    ),
    "number of 6000 digits": (
        lambda c: c.metadata(MetadataName.OPENED).update(opened_log_ns="1" * 6000),
        "metadata netboard, opened_log_ns: found '1111",
    ),
    "count of 2**62 ticks": (
        lambda c: c.places[0].__setitem__(3, 2**62),
        "its list of places contradicts its index",
    ),
    "negative count of ticks": (
        lambda c: c.places[0].__setitem__(3, -5),
        "its list of places contradicts its index",
    ),
    "lz4 that does not unpack": (_stored("lz4", b"this is not lz4 at all" * 100, 300_000), "a damaged chunk: LZ4F_"),
}
"""Files that have made commands hang or end in a traceback, and the reasons for which they are refused."""


def read_all(path: Path) -> None:
    """Read everything of a recording."""
    with Recording(path) as recording:
        assert recording.ticks().size == recording.counts["/ticks"]
        for records in (recording.events, recording.clocks, recording.frames, recording.backfills, recording.remarks):
            records()
        recording.attempts()
        recording.gaps()
        recording.chunk_times()
        assert recording.config


def refusal(read: Callable[[], object]) -> str:
    """Return why a file was refused; empty if it was not."""
    try:
        read()
    except NetboardError as error:
        return str(error)
    return ""


def test_assembled_recording_is_the_same_as_before(tmp_path: Path) -> None:
    path = written(unchanged)(tmp_path)
    with Recording(path) as again, Recording(SOURCE) as before:
        again.check()
        assert again.ticks().tobytes() == before.ticks().tobytes()
        assert again.events() == before.events()
        assert again.metadata == before.metadata
        assert repr(again.attempts()) == repr(before.attempts())
    assert check(path).severity is check(SOURCE).severity is Severity.SOUND


@pytest.mark.parametrize("name", NAMED)
def test_named_file_is_refused_with_its_reason(tmp_path: Path, name: str) -> None:
    change, reason = NAMED[name]
    path = written(change)(tmp_path)
    with pytest.raises(NetboardError) as refused:
        read_all(path)
    assert str(refused.value).startswith(f"{path}: ")
    assert reason in str(refused.value)
    assert len(str(refused.value).splitlines()) == 1
    assert check(path).severity is Severity.DAMAGE
    assert with_trials(entry_of(path)).verdict == RESULTS[Severity.DAMAGE] or "lz4" in name  # no chunk is read


@pytest.mark.parametrize("kind", [kind for kind in KINDS if kind not in BESIDE])
def test_hostile_recording_is_read_or_refused(tmp_path: Path, kind: str) -> None:
    for number, case in enumerate(cases(kind, FILES)):
        place = tmp_path / str(number)
        place.mkdir()
        path = case.make(place)
        reason = refusal(lambda path=path: read_all(path))
        assert len(reason) < 2000, case.name
        assert "run: netboard recover" not in reason or not is_whole(path), f"{case.name}: {reason}"
        assert check(path).findings
        with_trials(entry_of(path))
        assert refusal(lambda path=path: recover_any(path))[: len(str(place))] in ("", str(place))


def test_recording_with_a_damaged_list_of_attempts_is_recovered(tmp_path: Path) -> None:
    path = written(NAMED["nested list of attempts"][0])(tmp_path)
    (report,) = recover_any(path)
    with Recording(report.output) as recovered, Recording(SOURCE) as before:
        assert repr(recovered.attempts()) == repr(before.attempts())
        assert recovered.ticks().tobytes() == before.ticks().tobytes()


@pytest.mark.parametrize("kind", ["spill", "journal", "unfinished file"])
def test_other_hostile_files_are_read_or_refused(tmp_path: Path, kind: str) -> None:
    for number, case in enumerate(cases(kind, FILES)):
        place = tmp_path / str(number)
        place.mkdir()
        assert check(case.make(place)).findings
        for file in place.iterdir():
            with_trials(entry_of(file))


@pytest.mark.parametrize("kind", KINDS)
def test_every_command_gets_files_of_each_kind_and_every_file_goes_to_some(kind: str) -> None:
    files = cases(kind)
    planned = list(turns(kind, files, quick=False))
    assert {command for _, command in planned} == set(commands_for(kind))
    counts = [sum(one is case for one, _ in planned) for case in files]
    assert min(counts) >= min(EACH, len(commands_for(kind)))
    assert len({case.name for case in files}) == len(files)


@pytest.mark.parametrize("compression", ["zstd", "lz4"])
def test_chunk_that_expands_beyond_all_bounds_is_not_unpacked(tmp_path: Path, compression: str) -> None:
    zeros = bytes(2 * MAX_CHUNK_BYTES)
    packed = {"zstd": zstandard.compress, "lz4": lz4.frame.compress}[compression](zeros)
    path = written(_stored(compression, packed, len(zeros)))(tmp_path)
    with pytest.raises(NetboardError, match=f"a chunk of {2 * MAX_CHUNK_BYTES} bytes, expected at most"):
        read_all(path)


def test_file_that_claims_thousands_of_recordings_is_not_compared_with_itself(tmp_path: Path) -> None:
    name = struct.pack("<I", 8) + b"netboard"
    opened = b"\x0c" + struct.pack("<Q", len(name) + 4) + name + struct.pack("<I", 0)
    path = tmp_path / "a.mcap.part"
    path.write_bytes(SOURCE.read_bytes()[:50_000] + (opened + b"\xff") * (MAX_JOINED + 1))
    assert "claims to hold more than 200 recordings" in refusal(lambda: recover_any(path))
    assert check(path).severity is Severity.DAMAGE


@pytest.mark.slow
def test_commands_end_in_words_on_hostile_files(tmp_path: Path) -> None:
    run = [sys.executable, "-m", "evidence", "files", "--quick", "-o", str(tmp_path / "results")]
    ended = subprocess.run(run, cwd=Path(__file__).parents[2], capture_output=True, text=True, check=False)
    assert ended.returncode == 0, ended.stdout + ended.stderr
    assert "1 of 1 verdicts hold" in ended.stdout
    assert len(COMMANDS) == 16
