"""The catalogue of a folder describes each file, damaged ones too."""

from dataclasses import replace
from datetime import date
from io import StringIO
from pathlib import Path

import pytest
from rich.console import Console

import rehearsed
from netboard.recording.integrity.catalogue import (
    CatalogueEntry,
    Filter,
    entry_of,
    files_in,
    in_order,
    with_check,
    with_trials,
)
from netboard.recording.integrity.report_text import sessions_table
from netboard.task.trials.state_machine import Cause, Phase

pytestmark = pytest.mark.slow


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Two dyads: a whole block; and one without its end, one unfinished, one cut."""
    made = tmp_path_factory.mktemp("catalogue")
    config, rows = rehearsed.config(), rehearsed.rows()
    other = replace(config, session=replace(config.session, dyad="D02", study="own", pilot=True))
    whole = rehearsed.write(made / "whole.mcap", rows)
    (made / "deep").mkdir()
    rehearsed.write(made / "deep" / "early.mcap", rows[:-2000], other, ended="the server began another session")
    writer = rehearsed.writer_of(made / "deep" / "left.mcap", other, {})
    writer.flush(rehearsed.fill(writer, rows[:500]))
    writer.abandon()
    (made / "cut.mcap").write_bytes(whole.read_bytes()[:-100])
    (made / "junk.mcap").write_bytes(b"junk")
    (made / "notes.txt").write_text("not of the catalogue")
    return made


def test_every_recording_file_has_a_catalogue_entry(folder: Path) -> None:
    entries = {path.name: with_trials(entry_of(path)) for path in files_in(folder)}
    assert sorted(entries) == ["cut.mcap", "early.mcap", "junk.mcap", "left.mcap.part", "whole.mcap"]
    whole, early, left = entries["whole.mcap"], entries["early.mcap"], entries["left.mcap.part"]
    assert (whole.verdict, whole.done, whole.trials, whole.dyad) == ("complete", 2, 2, "D01")
    assert whole.duration == pytest.approx(len(rehearsed.rows()) * 1e-3)  # however fast the logger received them
    assert (early.verdict, early.done, early.study) == ("complete with listed losses", 1, "own")
    assert "the server began another session" in early.why
    assert (left.kind, left.verdict, left.dyad, left.pilot) == ("unfinished", "damaged", "D02", True)
    assert (entries["cut.mcap"].verdict, entries["cut.mcap"].dyad) == ("damaged", "D01")
    assert "not an MCAP file" in entries["junk.mcap"].why


@pytest.mark.parametrize("name", ["a.mcap", "a.mcap.part", "a.spill"])
def test_empty_file_is_listed_as_empty(tmp_path: Path, name: str) -> None:
    (tmp_path / name).touch()
    entry = with_trials(entry_of(tmp_path / name))
    assert entry.verdict == with_check(entry).verdict == "damaged"
    assert entry.why.startswith("is empty")
    assert "is empty" in with_check(entry).why


def test_quick_verdict_equals_that_of_the_full_check(folder: Path) -> None:
    for path in files_in(folder):
        quick = with_trials(entry_of(path))
        assert with_check(quick).verdict == quick.verdict


def test_filters_select_entries_by_dyad_study_verdict_pilot_and_date(folder: Path) -> None:
    entries = [with_trials(entry_of(path)) for path in files_in(folder)]

    def names(wanted: Filter) -> set[str]:
        return {one.path.name for one in entries if wanted.matches(one) and wanted.matches_result(one)}

    assert names(Filter(dyad="D02")) == {"early.mcap", "left.mcap.part"}
    assert names(Filter(study="own", verdict="damaged")) == {"left.mcap.part"}
    assert names(Filter(verdict="complete")) == {"whole.mcap"}
    assert names(Filter(pilot=True)) == {"early.mcap", "left.mcap.part"}
    assert "whole.mcap" in names(Filter(since=date(2026, 9, 1)))
    assert names(Filter(since=date(2027, 1, 1))) == set()


def test_files_are_grouped_by_session(folder: Path) -> None:
    groups = dict(in_order(entry_of(path) for path in files_in(folder)))
    assert set(groups) == {("D01", "S01"), ("D02", "S01"), ("", "")}


def test_blocks_are_listed_by_number_and_their_parts_by_time(folder: Path) -> None:
    whole = entry_of(folder / "whole.mcap")
    places = [(1, "2026-09-01T10:00"), (2, "2026-09-01T09:00"), (2, "2026-09-01T11:00")]
    entries = [replace(whole, block=block, opened=opened) for block, opened in places]
    (listed,) = dict(in_order(reversed(entries))).values()
    assert [(one.block, one.opened) for one in listed] == places


def printed(entry: CatalogueEntry, folder: Path, width: int = 200) -> str:
    console = Console(file=StringIO(), width=width)
    console.print(sessions_table([entry], folder))
    assert isinstance(console.file, StringIO)
    return console.file.getvalue()


def test_file_name_stays_whole_on_a_narrow_terminal(folder: Path) -> None:
    """Someone copies it for the next command."""
    long = replace(entry_of(folder / "whole.mcap"), path=folder / "S01_D01_block01_52dec06c_part2.mcap")
    assert long.path.name in printed(long, folder, 80)
    lossy = replace(long, verdict="complete with listed losses", why="4 of the block's 5 trials done, 1 failed attempt")
    assert long.path.name in printed(lossy, folder, 80)


def test_repeated_trial_counts_as_wanted_and_done(tmp_path: Path) -> None:
    config, rows = rehearsed.config(), rehearsed.rows()
    rows["extra"] = 1
    file = rehearsed.write(tmp_path / "a.mcap", rows, replace(config, block=replace(config.block, trials=1)))
    entry = with_trials(entry_of(file))
    assert (entry.done, entry.trials, entry.verdict) == (2, 2, "complete")
    assert "2 of 2" in printed(entry, tmp_path)


def test_stopped_block_with_a_repeat_not_done_is_a_loss_in_both_results(tmp_path: Path) -> None:
    rows = rehearsed.rows()
    last = rows[-1:]
    last["trial"], last["extra"], last["event"], last["command"] = 3, 1, Cause.STOP, Cause.STOP
    last["phase"] = Phase.LEVELLING
    entry = with_trials(entry_of(rehearsed.write(tmp_path / "a.mcap", rows)))
    assert (entry.done, entry.trials, entry.verdict) == (2, 3, "complete with listed losses")
    assert entry.why.startswith("2 of the block's 3 trials done")
    assert entry.why.endswith("an operator stopped the block")
    assert "2 of 3" in printed(entry, tmp_path)
    assert with_check(entry).verdict == entry.verdict
    assert entry.why in with_check(entry).why


def test_quick_result_gives_the_losses_in_the_words_of_the_full_check(folder: Path) -> None:
    entry = with_trials(entry_of(folder / "deep" / "early.mcap"))
    assert entry.why
    assert set(entry.why.split("; ")) <= set(with_check(entry).why.split("; "))
