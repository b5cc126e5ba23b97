"""A recording that lies about itself is refused in words by whatever reads it, and never reads as something else."""

import random
import struct
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import hostile_files
import pytest
from hostile_files import COMMANDS, MUTATIONS, NAMED, OTHERS, SEED_FILE, Model, assemble, make_file

from netboard.base.errors import NetboardError
from netboard.recording.files.reader import Recording
from netboard.recording.format.claims import MAX_CHUNK_BYTES, MAX_JOINED
from netboard.recording.integrity.catalogue import entry_of, with_trials
from netboard.recording.integrity.checking import check
from netboard.recording.integrity.severity import RESULTS, Severity
from netboard.recording.recovery.spilled import recover_any

FILES = 8
"""Files of each kind [1]."""

REASONS = {
    "differences: 1000000000": "columns.3.differences: input should be less than or equal to 8, found 1000000000",
    "nested schema": "the schema of its ticks: not valid JSON: lists or objects are nested too deeply",
    "nested list of attempts": "its list of attempts: not valid JSON: lists or objects are nested too deeply",
    "number of 6000 digits": "metadata netboard, opened_log_ns: found '1111",
    "count of 2**62 ticks": "its list of places contradicts its index",
    "negative count of ticks": "its list of places contradicts its index",
    "lz4 that does not unpack": "a damaged chunk: LZ4F_",
}


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
    path = make_file(tmp_path, lambda model, rng: assemble(model), random.Random(0))
    with Recording(path) as again, Recording(SEED_FILE) as before:
        again.check()
        assert again.ticks().tobytes() == before.ticks().tobytes()
        assert again.events() == before.events()
        assert again.metadata == before.metadata
        assert repr(again.attempts()) == repr(before.attempts())


@pytest.mark.parametrize("name", NAMED)
def test_named_file_is_refused_with_its_reason(tmp_path: Path, name: str) -> None:
    path = make_file(tmp_path, NAMED[name], random.Random(0))
    with pytest.raises(NetboardError) as refused:
        read_all(path)
    assert str(refused.value).startswith(f"{path}: ")
    assert REASONS[name] in str(refused.value)
    assert len(str(refused.value).splitlines()) == 1
    assert check(path).severity is Severity.DAMAGE
    assert with_trials(entry_of(path)).verdict == RESULTS[Severity.DAMAGE] or "lz4" in name  # no chunk is read


@pytest.mark.parametrize("kind", MUTATIONS)
def test_hostile_recording_is_read_or_refused(tmp_path: Path, kind: str) -> None:
    refused = 0
    for number in range(FILES):
        place = tmp_path / str(number)
        place.mkdir()
        path = make_file(place, MUTATIONS[kind], random.Random(f"{kind} {number}"))
        reason = refusal(lambda path=path: read_all(path))
        refused += bool(reason)
        assert len(reason) < 2000
        assert check(path).findings
        with_trials(entry_of(path))
        assert refusal(lambda path=path: recover_any(path))[: len(str(place))] in ("", str(place))
    assert refused or kind in ("values of ticks", "details of events", "fields of the records")


@pytest.mark.parametrize("kind", OTHERS)
def test_other_hostile_files_are_read_or_refused(tmp_path: Path, kind: str) -> None:
    for number in range(FILES):
        place = tmp_path / str(number)
        place.mkdir()
        path = OTHERS[kind](place, random.Random(f"{kind} {number}"))
        assert check(path).findings
        for file in place.iterdir():
            with_trials(entry_of(file))


@pytest.mark.parametrize("compression", ["zstd", "lz4"])
def test_chunk_that_expands_beyond_all_bounds_is_not_unpacked(tmp_path: Path, compression: str) -> None:
    def mutate(model: Model, rng: random.Random) -> bytes:
        zeros = bytes(2 * MAX_CHUNK_BYTES)
        packed = {"zstd": hostile_files.zstandard.compress, "lz4": hostile_files.lz4.frame.compress}[compression](zeros)
        model.packed[0] = (compression, packed, len(zeros))
        return assemble(model)

    path = make_file(tmp_path, mutate, random.Random(0))
    with pytest.raises(NetboardError, match=f"a chunk of {2 * MAX_CHUNK_BYTES} bytes, expected at most"):
        read_all(path)


def test_file_that_claims_thousands_of_recordings_is_not_compared_with_itself(tmp_path: Path) -> None:
    name = struct.pack("<I", 8) + b"netboard"
    opened = b"\x0c" + struct.pack("<Q", len(name) + 4) + name + struct.pack("<I", 0)
    path = tmp_path / "a.mcap.part"
    path.write_bytes(SEED_FILE.read_bytes()[:50_000] + (opened + b"\xff") * (MAX_JOINED + 1))
    assert "claims to hold more than 200 recordings" in refusal(lambda: recover_any(path))
    assert check(path).severity is Severity.DAMAGE


@pytest.mark.slow
def test_commands_end_in_words_on_hostile_files(tmp_path: Path) -> None:
    run = [sys.executable, hostile_files.__file__, "--quick", "--count", "8", "-o", str(tmp_path / "results")]
    ended = subprocess.run(run, capture_output=True, text=True, check=False)
    assert ended.returncode == 0, ended.stdout + ended.stderr
    assert "1 of 1 verdicts hold" in ended.stdout
    assert len(COMMANDS) == 16
