"""Blocks are rehearsed by one function: participants follow from the dyad, and results do not depend on the workers."""

from dataclasses import replace
from pathlib import Path

import pytest

from netboard.base.config import Config, parse
from netboard.nodes.rehearsal.jobs import jobs_of, rehearse, rehearse_all
from netboard.recording.export.runs import unnumbered_run
from netboard.recording.files.reader import Recording
from netboard.recording.integrity.verification import verify_recording


def blocks() -> list[Config]:
    default = Config()
    dyadic = replace(default.block, trials=1, number=1, blocks=2)
    bimanual = replace(dyadic, number=2, configuration="bimanual", force="none")
    return [replace(default, block=block) for block in (dyadic, bimanual)]


@pytest.mark.slow
def test_simulated_participants_depend_on_the_dyad() -> None:
    one, two = (jobs_of(blocks(), 1, dyad, None) for dyad in (1, 2))
    assert [one[1].people[letter] for letter in "AB"] == [
        replace(one[0].people[letter], practice=1.0, acquaintance=1.0, felt_trials=1.0) for letter in "AB"
    ]
    assert one[0].people != two[0].people
    assert rehearse(one[0]).ticks != rehearse(two[0]).ticks


def test_rehearsal_is_marked_as_a_pilot_session() -> None:
    jobs = jobs_of(blocks(), 1, 1, None)
    assert all(job.config.session.pilot for job in jobs)
    assert len({job.session for job in jobs}) == 1
    other = jobs_of(blocks(), 2, 1, None)
    assert other[0].session != jobs[0].session


@pytest.mark.slow
@pytest.mark.parametrize("workers", [1, 2])
def test_results_are_in_block_order_and_each_is_reported(tmp_path: Path, workers: int) -> None:
    reported: list[int] = []
    results = rehearse_all(jobs_of(blocks(), 1, 1, tmp_path), workers, lambda result: reported.append(result.block))
    assert [result.block for result in results] == [1, 2]
    assert sorted(reported) == [1, 2]
    assert all(Path(result.recording).is_file() and result.factor > 0 for result in results)


@pytest.mark.slow
def test_recording_contains_its_start_time(tmp_path: Path) -> None:
    begun_ns = 1_790_000_000_000_000_000
    names = ("one", "other")
    for name in names:
        (tmp_path / name).mkdir()
        rehearse(replace(jobs_of(blocks(), 1, 1, tmp_path / name)[0], begun_ns=begun_ns))
    files = [next((tmp_path / name).iterdir()) for name in names]
    assert files[0].read_bytes() == files[1].read_bytes()
    with Recording(files[0]) as recording:
        assert int(recording.metadata["opened_log_ns"]) == begun_ns


def test_recording_of_two_robot_partners_verifies_and_names_both(tmp_path: Path) -> None:
    config = parse("", overrides=["block.left=robot", "block.right=robot", "block.trials=1"])
    result = rehearse(jobs_of([config], 1, 1, tmp_path)[0])
    with Recording(Path(result.recording)) as recording:
        assert verify_recording(recording).identical
        assert recording.metadata["left_policy"] == recording.metadata["right_policy"] == "simulated participant"
    assert unnumbered_run(Path(result.recording)).people == ()
