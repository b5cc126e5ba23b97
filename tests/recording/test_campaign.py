"""Some cases of the recovery benchmark: cuts, changed bytes, zeros, and killed loggers over real sockets."""

import os
from itertools import islice
from pathlib import Path

import numpy as np
import pytest

from netboard.benchmarks.recording.feeding import live_log
from netboard.benchmarks.recording.recovery_bench import (
    Harm,
    cuts,
    cuts_of_last_chunk,
    flips,
    kill_one,
    try_one,
    zeroed,
)
from netboard.benchmarks.recording.specimen import Specimen, make_specimen

SEED = 11


@pytest.fixture(scope="module")
def whole(tmp_path_factory: pytest.TempPathFactory) -> Specimen:
    return make_specimen(tmp_path_factory.mktemp("whole") / "whole.mcap", 650)


@pytest.fixture
def _without_fsync(monkeypatch: pytest.MonkeyPatch) -> None:
    """Skip fsync: these tests inspect the content of the file only."""
    monkeypatch.setattr(os, "fsync", lambda handle: None)


@pytest.mark.usefixtures("_without_fsync")
@pytest.mark.slow
@pytest.mark.parametrize("way", ["last chunk", "cuts", "flips", "zeroed"])
def test_damage_costs_only_the_chunks_it_touches(tmp_path: Path, whole: Specimen, way: str) -> None:
    chance = np.random.default_rng(SEED)
    harms = {
        "last chunk": lambda: islice(cuts_of_last_chunk(whole, 97), 60),
        "cuts": lambda: cuts(whole, 40, chance),
        "flips": lambda: flips(whole, 40, chance),
        "zeroed": lambda: zeroed(whole, 40, chance),
    }[way]()
    found = [try_one(whole, harm, tmp_path) for harm in harms]
    assert [fault for one in found for fault in one.faults] == []
    assert any(one.lost for one in found)
    if way in ("cuts", "flips"):
        longest = max(stop - first for first, stop in (piece.ticks for piece in whole.pieces))
        assert max(one.lost for one in found if not one.refused) <= longest


def test_file_without_the_mcap_magic_gives_every_chunk(tmp_path: Path, whole: Specimen) -> None:
    found = try_one(whole, Harm(b"\0" * 8 + whole.data[8:], 0, 8), tmp_path)
    assert (found.refused, found.lost, found.faults) == (False, 0, ())


def test_recovered_rows_that_differ_are_reported_as_a_fault(tmp_path: Path, whole: Specimen) -> None:
    """The judge is not blind: rows other than those that were written are a fault."""
    other = whole.rows.copy()
    other["z"][100] += 1e-9
    found = try_one(Specimen(whole.data, other, whole.pieces), Harm(whole.data, len(whole.data), 0), tmp_path)
    assert found.faults == ("a tick that is not what it was",)


@pytest.mark.slow
@pytest.mark.integration
@pytest.mark.skipif(os.name == "nt", reason="needs SIGKILL")
def test_killed_logger_has_acknowledged_records_on_disk(tmp_path: Path) -> None:
    log, chance = live_log(1600), np.random.default_rng(SEED)
    for _ in range(3):
        assert kill_one(tmp_path / "killed", log, chance).faults == ()
