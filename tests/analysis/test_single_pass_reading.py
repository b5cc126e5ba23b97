"""A recording is read once for columns and checks, with the same results as when read twice."""

from pathlib import Path

import numpy as np
import pytest

from netboard.analysis.extraction.recordings import measure
from netboard.analysis.extraction.settings import Readings, parse
from netboard.analysis.extraction.trials import BlockData, columns_for
from netboard.base.safeguards import Safeguard
from netboard.base.tick import TICK
from netboard.recording.export.runs import runs_of
from netboard.recording.files.container import Container
from netboard.recording.files.reader import Recording
from netboard.recording.integrity.quality_check import judged
from netboard.task.trials.quality import FIELDS_NEEDED, Referee, empty_tally, tally, tally_columns

pytestmark = pytest.mark.slow


def test_partial_fields_give_the_same_quality_verdicts(recordings: tuple[Path, ...]) -> None:
    for run in runs_of(recordings):
        with Recording(run.path) as recording:
            rows = recording.ticks()
            found = judged(recording)
        referee = Referee(run.config, Safeguard.CLAMPED)
        assert list(found) == referee.watch(rows, 0, len(rows)) != []


def test_portions_of_columns_are_those_of_the_rows(recordings: tuple[Path, ...]) -> None:
    names = ("theta", "tick", "left_rendered", "late_ns")
    with Recording(recordings[0]) as recording:
        rows = recording.ticks(as_sent=True)
        portions = list(recording.portions(names))
        assert len(portions) > 1
        for name in names:
            assert np.concatenate([one[name] for one in portions]).tobytes() == rows[name].tobytes()
        with pytest.raises(ValueError, match="no field tilt"):
            next(recording.portions(("tilt",)))


@pytest.mark.parametrize("seed", [1, 2])
def test_tally_of_partial_fields_equals_that_of_whole_ticks(seed: int) -> None:
    generator = np.random.default_rng(seed)
    rows = np.frombuffer(bytearray(generator.bytes(400 * TICK.itemsize)), TICK)
    rows["phase"], rows["event"] = generator.integers(0, 7, 400), generator.integers(0, 12, 400)
    few = np.zeros(400, np.dtype([(name, TICK[name]) for name in FIELDS_NEEDED]))
    for name in FIELDS_NEEDED:
        few[name] = rows[name]
    columns = tuple(rows[name].copy() for name in FIELDS_NEEDED)
    whole, part, apart = empty_tally(), empty_tally(), empty_tally()
    first = 0
    while first < 400:
        taken = tally(whole, rows, first, 400 - first, 0.05, 4)
        assert tally(part, few, first, 400 - first, 0.05, 4) == taken
        assert tally_columns(apart, columns, first, 400 - first, 0.05, 4) == taken
        assert whole.tobytes() == part.tobytes() == apart.tobytes()
        first += taken


@pytest.mark.parametrize("velocity", ["derivative", "device"])
def test_streamed_columns_equal_those_of_the_recording(recordings: tuple[Path, ...], velocity: str) -> None:
    readings = parse(f'[filters]\nvelocity = "{velocity}"')
    (run,) = runs_of(recordings[:1])
    measured = measure(run, readings)
    with Recording(run.path) as recording:
        block = BlockData.of(recording, run.config, readings)
    assert measured.blocks["ticks"][0] == block.samples
    apart = [take.completion for take in block.takes()]
    assert measured.trials["completion"].tolist() == apart
    assert ("left_used_vz" in columns_for(run.config, readings)) == (velocity == "device")


def test_measuring_reads_each_chunk_once(recordings: tuple[Path, ...], monkeypatch: pytest.MonkeyPatch) -> None:
    (run,) = runs_of(recordings[:1])
    read, chunk = [], Container.chunk

    def counted(self: Container, offset: int) -> bytes:
        read.append(offset)
        return chunk(self, offset)

    monkeypatch.setattr(Container, "chunk", counted)
    measure(run, Readings())
    assert len(read) == len(set(read)) > 1


def test_events_read_along_with_ticks_equal_those_read_alone(recordings: tuple[Path, ...]) -> None:
    with Recording(recordings[0]) as recording:
        alone = recording.events()
    with Recording(recordings[0]) as recording:
        recording.ticks()
        assert recording.events() == alone != ()


def test_selected_fields_are_read_in_batches_to_the_bit(recordings: tuple[Path, ...]) -> None:
    with Recording(recordings[0]) as recording:
        rows = recording.ticks()
        portions = list(recording.batches(1000, ("theta", "tick")))
        with pytest.raises(ValueError, match="no field tilt"):
            next(recording.batches(names=("tilt",)))
    assert len(portions) > 1
    assert portions[0].dtype.names == ("theta", "tick")
    for name in ("theta", "tick"):
        assert np.concatenate([part[name] for part in portions]).tobytes() == rows[name].tobytes()


def test_empty_text_gives_the_default_settings() -> None:
    assert parse("") == Readings()
