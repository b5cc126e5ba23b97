"""Some cases of the recovery benchmark: cuts, changed bytes, zeros, and killed loggers over real sockets."""

import os
from itertools import islice
from pathlib import Path

import numpy as np
import pytest

from evidence.recording.recovery_bench import (
    DamagedCopy,
    byte_changes,
    cuts,
    cuts_of_last_chunk,
    kill_one,
    recover_one,
    zero_stretches,
)
from netboard.benchmarks.recording.feeding import live_log
from netboard.benchmarks.recording.specimen import Specimen, make_specimen

SEED = 11


@pytest.fixture(scope="module")
def specimen(tmp_path_factory: pytest.TempPathFactory) -> Specimen:
    return make_specimen(tmp_path_factory.mktemp("whole") / "whole.mcap", 650)


@pytest.fixture
def _without_fsync(monkeypatch: pytest.MonkeyPatch) -> None:
    """Skip fsync: these tests inspect the content of the file only."""
    monkeypatch.setattr(os, "fsync", lambda handle: None)


@pytest.mark.usefixtures("_without_fsync")
@pytest.mark.slow
@pytest.mark.parametrize("way", ["last chunk", "cuts", "flips", "zeroed"])
def test_damage_costs_only_the_chunks_it_touches(tmp_path: Path, specimen: Specimen, way: str) -> None:
    chance = np.random.default_rng(SEED)
    copies = {
        "last chunk": lambda: islice(cuts_of_last_chunk(specimen, 97), 60),
        "cuts": lambda: cuts(specimen, 40, chance),
        "flips": lambda: byte_changes(specimen, 40, chance),
        "zeroed": lambda: zero_stretches(specimen, 40, chance),
    }[way]()
    found = [recover_one(specimen, damaged, tmp_path) for damaged in copies]
    assert [fault for one in found for fault in one.faults] == []
    assert any(one.lost for one in found)
    if way in ("cuts", "flips"):
        longest = max(stop - first for first, stop in (piece.ticks for piece in specimen.pieces))
        assert max(one.lost for one in found if not one.refused) <= longest


def test_file_without_the_mcap_magic_gives_every_chunk(tmp_path: Path, specimen: Specimen) -> None:
    found = recover_one(specimen, DamagedCopy(b"\0" * 8 + specimen.data[8:], 0, 8), tmp_path)
    assert (found.refused, found.lost, found.faults) == (False, 0, ())


def test_recovered_rows_that_differ_are_reported_as_a_fault(tmp_path: Path, specimen: Specimen) -> None:
    """The judge is not blind: rows other than those that were written are a fault."""
    other = specimen.rows.copy()
    other["z"][100] += 1e-9
    found = recover_one(
        Specimen(specimen.data, other, specimen.pieces), DamagedCopy(specimen.data, len(specimen.data), 0), tmp_path
    )
    assert found.faults == ("a tick that is not what it was",)


@pytest.mark.slow
@pytest.mark.integration
@pytest.mark.skipif(os.name == "nt", reason="needs SIGKILL")
def test_killed_logger_has_acknowledged_records_on_disk(tmp_path: Path) -> None:
    log, chance = live_log(1600), np.random.default_rng(SEED)
    for _ in range(3):
        assert kill_one(tmp_path / "killed", log, chance).faults == ()
