"""The study of partners: its kinds, its plan, its statistics, and what it says of a block that was given up."""

from pathlib import Path

import numpy as np
import pytest

from evidence.participants import partner_pairs
from evidence.participants.decisions import times_of
from evidence.participants.partner_pairs import jobs_of_robots
from evidence.participants.partners import jobs_beside, kinds, ratio, study_text
from netboard.base.config import Config
from netboard.benchmarks.harness.results import ResultPart
from netboard.participants.seat.partners import POLICIES, make_partner
from netboard.task.studies.study import parse_study


def test_kinds_are_those_of_the_registry() -> None:
    assert set(kinds()) == {"person", "still", *POLICIES} - {"robot"}


def test_participant_sits_at_the_left_beside_each_kind_with_haptic_feedback_on_and_off() -> None:
    names = ("person", "still", "playback", "leader")
    study = parse_study(study_text(names, 3, Path("hand.mcap")))
    one, other = (jobs_beside(study, number) for number in (1, 2))
    found = sorted((job.config.block.left, job.config.block.right, job.config.block.force) for job in one)
    assert found == sorted(("person", name, force) for name in names for force in ("full", "none"))
    assert all(
        job.config.partners.right == {"file": "hand.mcap"} for job in one if job.config.block.right == "playback"
    )
    assert len({job.people["A"] for job in one}) == 1, "no block depends on practice"
    assert one[0].people["A"] != other[0].people["A"]
    assert one[0].config.participant != other[0].config.participant, "each is another draw of the posterior"


def test_two_robots_meet_once_unless_neither_acts() -> None:
    jobs = jobs_of_robots(("still", "playback", "leader"), Path("hand.mcap"))
    assert [job.config.session.dyad for job in jobs] == [
        "still-leader",
        "playback-playback",
        "playback-leader",
        "leader-leader",
    ]
    assert jobs[1].config.partners.left == jobs[1].config.partners.right == {"file": "hand.mcap"}


def test_ratio_is_that_of_paired_participants() -> None:
    found = ratio(np.array([1.0, 4.0, 9.0]), np.array([2.0, 4.0, 6.0]))
    logs = np.log([0.5, 1.0, 1.5])
    half = 4.302652729911275 * logs.std(ddof=1) / np.sqrt(3)
    assert (found.value, found.low, found.high) == pytest.approx(np.exp(logs.mean() + half * np.array([0, -1, 1])))


def test_block_that_was_given_up_has_no_completion_time() -> None:
    pairs = ResultPart("robots on", "", "left | right | given up | completion time [s]")
    pairs.add("leader", "leader", False, 1.654)
    pairs.add("playback", "playback", True, 40.0)
    assert partner_pairs.times_of(pairs) == {frozenset(("leader",)): "1.65", frozenset(("playback",)): "given up"}


@pytest.mark.slow
def test_decisions_are_timed_one_by_one() -> None:
    times = times_of(make_partner("leader", Config(), "right"), 0.1)
    assert times.shape == (100,)
    assert (times > 0.0).all()
