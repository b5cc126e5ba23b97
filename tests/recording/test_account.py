"""The account of a session: present ticks, lost ticks with their causes, and unexplained losses."""

from collections.abc import Iterable, Sequence
from contextlib import closing
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from netboard.base.errors import RecordingError
from netboard.base.tables.rig import RecordingSettings as Settings
from netboard.base.tick import TICK
from netboard.network.protocol.codec import encode
from netboard.network.protocol.joining import Welcome
from netboard.network.protocol.records import BLOCK_BEGAN, EventRecord, LogBatch, TickRecord
from netboard.recording.files.container import Container
from netboard.recording.files.writer import RecordingWriter
from netboard.recording.integrity.account import Account, NumberRange, PauseRecord, account_of, parts_of
from netboard.recording.recovery.recover import recover
from netboard.recording.recovery.spill import Spill
from netboard.recording.recovery.spilled import recover_any
from netboard.task.trials.state_machine import Cause
from samples import CONFIG_TEXT, MS, OPENED_NS, metadata

Log = list[TickRecord | EventRecord]


def session(ticks: int, events: dict[int, EventRecord] | None = None, rows: dict[int, Cause] | None = None) -> Log:
    """The log of a session: an event before every tenth tick, and some more."""
    log: Log = []
    table = np.zeros(ticks, TICK)
    table["tick"] = np.arange(ticks)
    for tick, cause in (rows or {}).items():
        table["event"][tick] = cause
        if cause >= Cause.START:
            table["command"][tick] = cause
    for k, row in enumerate(table):
        if k % 10 == 0:
            log.append(EventRecord(k, k, k * MS, "tenth", {}))
        log.append(TickRecord(row.tobytes()))
        if events and k in events:
            log.append(events[k])
    return log


def write_part(path: Path, log: Sequence[Any], held: Iterable[int], ended: str = "complete") -> Path:
    """Record some numbers of a log; the missing numbers between them are noted as lost."""
    writer = RecordingWriter(path, metadata(), CONFIG_TEXT, Settings(chunk_bytes=2048), OPENED_NS)
    expected: int | None = None
    for number in held:
        if expected is not None and number > expected:
            writer.note_lost(expected, number - expected, OPENED_NS)
        writer.write(log[number], number, OPENED_NS + number * MS)
        expected = number + 1
    if ended:
        writer.finish(OPENED_NS, ended)
        return path
    writer.flush(OPENED_NS)
    writer.abandon()
    return recover(writer.part).output


def ticks_in(log: Sequence[Any], numbers: Iterable[int]) -> list[int]:
    return [int(np.frombuffer(log[k].row, TICK)["tick"][0]) for k in numbers if isinstance(log[k], TickRecord)]


def spread(ranges: Iterable[NumberRange]) -> list[int]:
    return [number for one in ranges for number in range(one.first, one.last + 1)]


def test_complete_session_has_all_ticks_and_no_losses(tmp_path: Path) -> None:
    log = session(500)
    account = account_of([write_part(tmp_path / "a.mcap", log, range(len(log)))])
    assert account.present == (NumberRange(0, 499),)
    assert (account.lost, account.unexplained, account.lost_records, account.unexplained_records) == ((), (), (), ())
    assert account.sound
    assert account.complete
    assert len(account.events) == 50
    assert account.parts[0][1:] == (0, 550, "complete", "")


def test_ticks_before_the_session_was_opened_are_not_missing(tmp_path: Path) -> None:
    log = session(500)
    later = [EventRecord(0, 123, 0, BLOCK_BEGAN, {"config": CONFIG_TEXT}), *log[ticks_before(log, 123) :]]
    account = account_of([write_part(tmp_path / "a.mcap", later, range(len(later)))])
    assert account.present == (NumberRange(123, 499),)
    assert account.sound


def ticks_before(log: Sequence[Any], tick: int) -> int:
    """Number of the record of a tick."""
    return next(k for k in range(len(log)) if ticks_in(log, [k]) == [tick])


def test_block_recordings_add_up_to_one_session(tmp_path: Path) -> None:
    log = session(500)
    stem = "S01_D01_20260921T14{}_3f2a9c1e_block0{}"
    files = [
        (stem.format("1320Z", "1"), range(200), "complete"),
        (stem.format("1420Z", "2"), range(200, 300), "the logger was stopped"),
        (stem.format("1430Z", "2_part2"), range(295, 400), "complete"),
        (stem.format("1520Z", "3"), range(400, 550), "the server left"),
    ]
    paths = [write_part(tmp_path / f"{name}.mcap", log, held, ended) for name, held, ended in files]
    assert all(parts_of(path) == paths for path in paths)
    account = account_of(paths)
    assert account.present == (NumberRange(0, 499),)
    assert account.sound
    assert not account.complete
    assert account_of(paths[:3]).complete


def test_overlapping_parts_add_up_to_one_session(tmp_path: Path) -> None:
    log = session(500)
    parts = [
        write_part(tmp_path / "b.mcap", log, range(180, 400), "the logger was stopped"),
        write_part(tmp_path / "c.mcap", log, range(390, 550)),
        write_part(tmp_path / "a.mcap", log, range(200), ""),
    ]
    account = account_of(parts)
    assert account.present == (NumberRange(0, 499),)
    assert account.sound
    assert account.complete
    assert [part.path.name for part in account.parts] == ["a.recovered.mcap", "b.mcap", "c.mcap"]
    assert len(account.events) == 50
    assert not account_of([parts[0], parts[2]]).complete


def test_lost_records_have_the_cause_reported_by_the_server(tmp_path: Path) -> None:
    report = EventRecord(401, 400, 0, "log_lost", {"first": "100", "count": "50", "cause": "the spill is full"})
    log = session(500, {400: report})
    held = [*range(100), *range(150, 200), *range(210, len(log))]
    account = account_of([write_part(tmp_path / "a.mcap", log, held)])
    assert spread(account.lost) == ticks_in(log, [*range(100, 150), *range(200, 210)])
    assert [one.cause for one in account.lost] == ["the spill is full", "the server no longer had them"]
    assert [one[:2] for one in account.lost_records] == [(100, 149), (200, 209)]
    assert account.sound


def test_losses_before_the_first_record_are_listed(tmp_path: Path) -> None:
    log = session(300)
    writer = RecordingWriter(tmp_path / "a.mcap", metadata(), CONFIG_TEXT, Settings(), OPENED_NS)
    writer.note_lost(0, 110, OPENED_NS)
    for number in range(110, len(log)):
        writer.write(log[number], number, OPENED_NS)
    writer.finish(OPENED_NS)
    account = account_of([tmp_path / "a.mcap"])
    assert spread(account.lost) == list(range(100))
    assert account.sound


def test_missing_part_is_an_unexplained_loss(tmp_path: Path) -> None:
    log = session(500)
    parts = [
        write_part(tmp_path / "a.mcap", log, range(100), "the logger was stopped"),
        write_part(tmp_path / "c.mcap", log, range(200, 550)),
    ]
    account = account_of(parts)
    assert not account.sound
    assert spread(account.unexplained) == ticks_in(log, range(100, 200))
    assert account.unexplained_records == (NumberRange(100, 199),)
    missing_first = account_of(parts[1:])
    assert spread(missing_first.unexplained) == ticks_in(log, range(200))
    assert missing_first.unexplained_records == (NumberRange(0, 199),)


def test_lost_event_is_unexplained_even_if_no_tick_is_missing(tmp_path: Path) -> None:
    log = session(100)
    assert isinstance(log[55], EventRecord)
    account = account_of(
        [
            write_part(tmp_path / "a.mcap", log, range(55), "the logger was stopped"),
            write_part(tmp_path / "b.mcap", log, range(56, 110)),
        ]
    )
    assert account.unexplained == ()
    assert account.unexplained_records == (NumberRange(55, 55),)
    assert not account.sound


def test_records_lost_in_one_part_may_be_present_in_another(tmp_path: Path) -> None:
    log = session(300)
    account = account_of(
        [
            write_part(tmp_path / "a.mcap", log, [*range(50), *range(150, 330)]),
            write_part(tmp_path / "b.mcap", log, range(40, 160), ""),
        ]
    )
    assert account.present == (NumberRange(0, 299),)
    assert account.lost_records == ()


def test_ticks_of_a_damaged_chunk_are_lost_to_damage(tmp_path: Path) -> None:
    log = session(500)
    whole = write_part(tmp_path / "a.mcap", log, range(len(log)))
    data = bytearray(whole.read_bytes())
    with closing(Container(whole)) as container:
        chunks = container.chunks_with("/ticks")
    data[chunks[len(chunks) // 2] + 80] ^= 1
    (tmp_path / "b.mcap").write_bytes(data)
    account = account_of([recover(tmp_path / "b.mcap").output])
    assert account.unexplained == ()
    assert account.lost
    assert all("a damaged chunk" in one.cause for one in account.lost)


def test_unreadable_record_is_lost_with_its_reason(tmp_path: Path) -> None:
    log = session(30)
    writer = RecordingWriter(tmp_path / "a.mcap", metadata(), CONFIG_TEXT, Settings(), OPENED_NS)
    for number, record in enumerate(log):
        if number == 20:
            writer.note_unreadable(b"junk", number, "no message", OPENED_NS)
        else:
            writer.write(record, number, OPENED_NS)
    writer.finish(OPENED_NS)
    account = account_of([tmp_path / "a.mcap"])
    assert [one.cause for one in account.lost] == ["could not be read: no message"]
    assert account.sound


def test_pauses_are_listed_with_their_causes(tmp_path: Path) -> None:
    events = {
        50: EventRecord(51, 51, 0, "fault", {"notice": "paused: no sample from the left agent"}),
        80: EventRecord(81, 80, 0, "pause", {}),
        120: EventRecord(121, 121, 0, "fault", {}),
    }
    rows = {50: Cause.FAULT, 80: Cause.PAUSE, 120: Cause.FAULT, 150: Cause.FAULT}
    log = session(200, events, rows)
    row = np.frombuffer(bytearray(log[log.index(events[120]) - 1].row), TICK)  # type: ignore[union-attr]
    row["command"] = Cause.NONE
    log[log.index(events[120]) - 1] = TickRecord(row.tobytes())
    account = account_of([write_part(tmp_path / "a.mcap", log, range(len(log)))])
    assert account.pauses == (
        PauseRecord(50, "no sample from the left agent"),
        PauseRecord(80, "the operator"),
        PauseRecord(120, "the stage: a value was not finite, or the board stood upright"),
        PauseRecord(150, ""),
    )
    assert not account.sound


def test_parts_of_different_sessions_are_refused(tmp_path: Path) -> None:
    one = write_part(tmp_path / "a.mcap", session(10), range(11))
    writer = RecordingWriter(
        tmp_path / "b.mcap", metadata() | {"session": "another"}, CONFIG_TEXT, Settings(), OPENED_NS
    )
    writer.finish(OPENED_NS)
    with pytest.raises(RecordingError, match="parts of one session, found 3f2a9c1e00000000 and another"):
        account_of([one, tmp_path / "b.mcap"])
    with pytest.raises(RecordingError, match="found none"):
        account_of([])


def test_parts_of_a_session_are_found_by_file_name(tmp_path: Path) -> None:
    names = [
        "S01_D01_20260921T141320Z_3f2a9c1e.recovered.mcap",
        "S01_D01_20260921T141500Z_3f2a9c1e_part2.mcap",
        "S01_D01_3f2a9c1e.recovered.mcap",
        "S01_D01_20260921T141320Z_beef0000.mcap",
        "S02_D01_20260921T141320Z_3f2a9c1e.mcap",
        "S01_D01_20260921T141320Z_3f2a9c1e.mcap.part",
        "whatever you like.mcap",
    ]
    for name in names:
        (tmp_path / name).touch()
    for name in names[:3]:
        assert [path.name for path in parts_of(tmp_path / name)] == sorted(names[:3])
    assert parts_of(tmp_path / names[6]) == [tmp_path / names[6]]


def test_recovered_spill_is_a_part_of_the_session(tmp_path: Path) -> None:
    log = session(400)
    frames = [encode(record) for record in log]
    spill = Spill(tmp_path / "S01_D01_3f2a9c1e.spill", Welcome("3f2a9c1e00000000", 1, 0, CONFIG_TEXT), 10**7)
    for first in range(200, 300, 20):
        spill.put(LogBatch(first, 0, tuple(frames[first : first + 20])))
    spill.close(iter([LogBatch(320, 0, (*frames[320:439], b"junk"))]))
    assert spill._thread is not None
    spill._thread.join(30)
    (report,) = recover_any(spill.path)
    assert report.output.name == "S01_D01_3f2a9c1e.recovered.mcap"
    assert (report.chunks, report.damage, report.has_config) == (6, (), True)
    assert sum(report.messages[topic] for topic in ("/ticks", "/event")) == 219
    first_part = write_part(tmp_path / "S01_D01_20260921T141320Z_3f2a9c1e.mcap", log, range(210), "killed")
    account = account_of(parts_of(first_part))
    assert len(account.parts) == 2
    assert account.parts[1].ended == "no logger took it from the server"
    assert spread(account.lost) == ticks_in(log, range(300, 320))
    assert [one[:2] for one in account.lost_records] == [(300, 319), (439, 439)]
    assert account.sound


def test_intact_blocks_of_a_damaged_spill_are_recovered(tmp_path: Path) -> None:
    log = session(400)
    frames = [encode(record) for record in log]
    spill = Spill(tmp_path / "a.spill", Welcome("3f2a9c1e00000000", 1, 0, CONFIG_TEXT), 10**7)
    spill.close(iter([LogBatch(first, 0, tuple(frames[first : first + 20])) for first in range(0, 440, 20)]))
    assert spill._thread is not None
    spill._thread.join(30)
    data = bytearray(spill.path.read_bytes())
    data[len(data) // 2] ^= 1
    (tmp_path / "b.spill").write_bytes(data[:-100])
    (report,) = recover_any(tmp_path / "b.spill")
    assert [damage.reason for damage in report.damage] == ["a damaged block"] * 2
    assert report.messages["/ticks"] + report.messages["/event"] == 400
    account = account_of([report.output])
    assert len(spread(account.lost_records)) == 20
    assert spread(account.lost) == ticks_in(log, spread(account.lost_records))
    assert "a damaged block" in account.lost[0].cause
    assert account.unexplained == ()
    (tmp_path / "c.spill").write_bytes(data[:30])
    with pytest.raises(RecordingError, match="the beginning of this spill is damaged"):
        recover_any(tmp_path / "c.spill")


@settings(max_examples=20, deadline=None)
@given(st.data())
def test_every_tick_is_present_lost_or_unexplained(
    tmp_path_factory: pytest.TempPathFactory, data: st.DataObject
) -> None:
    log = session(120)
    folder = tmp_path_factory.mktemp("account")
    parts, everything = [], set()
    for number in range(data.draw(st.integers(1, 3))):
        held = sorted(data.draw(st.sets(st.integers(0, len(log) - 1), min_size=1)))
        everything |= set(held)
        parts.append(write_part(folder / f"{number}.mcap", log, held))
    account: Account = account_of(parts)
    there = ticks_in(log, sorted(everything))
    assert spread(account.present) == there
    missing = [*spread(account.lost), *spread(account.unexplained)]
    assert sorted([*there, *missing]) == list(range(there[-1] + 1 if there else 0))
    records = [*spread(account.lost_records), *spread(account.unexplained_records)]
    assert sorted([*everything, *records]) == list(range(max(everything) + 1))
