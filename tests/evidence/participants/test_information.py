"""The worth of information: statistics of given blocks, and a small run of all tables."""

from functools import partial
from pathlib import Path

import numpy as np
import pytest

from evidence.participants import information
from evidence.participants.information import MODELS, Case, Result, more_falls, perform, ratio, study, with_skill
from netboard.base.tables.simulated import Participant
from netboard.benchmarks.harness.running import Options, run
from netboard.participants.people.partner_models import INFORMED


def test_ratio_is_the_geometric_mean_over_dyads_with_the_interval_of_a_t_test() -> None:
    one = [Result(time, 0, 1) for time in (2.0, 4.0, 9.0)]
    other = [Result(time, 0, 1) for time in (4.0, 4.0, 6.0)]
    middle, low, high = ratio(one, other)
    logs = np.log([0.5, 1.0, 1.5])
    half_width = 4.302652729911275 * logs.std(ddof=1) / np.sqrt(3)
    assert (middle, low, high) == pytest.approx(np.exp(logs.mean() + half_width * np.array([0.0, -1.0, 1.0])))


def test_falls_are_more_only_beyond_their_chance() -> None:
    assert not more_falls(12, 4)
    assert more_falls(13, 4)
    assert not more_falls(0, 9)


def test_skill_multiplies_all_noises() -> None:
    person = with_skill(Participant(), 2.0)
    changed = {name for name in person.__slots__ if getattr(person, name) != getattr(Participant(), name)}
    assert changed == set(information._NOISY)
    assert person.tilt_noise_deg == 2.0 * Participant().tilt_noise_deg


@pytest.mark.slow
def test_models_of_the_partner_differ_in_dyads_that_feel_a_force_and_what_it_tells_only_there() -> None:
    dyadic = {model: perform(Case(model, 1, 1)) for model in MODELS}
    assert len(set(dyadic.values())) == len(MODELS)
    for case in ({"configuration": "bimanual"}, {"force": "none"}):
        assert len({perform(Case(model, 1, 1, **case)) for model in ("mechanics", *INFORMED)}) == 1


@pytest.mark.slow
def test_study_tabulates_scenes_hands_and_skills(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(information, "QUICK_TRIALS", 1)
    verdicts = run(
        "information", partial(study, 2, 1), Options(tmp_path / "found", tmp_path / "found.json", quick=True)
    )
    assert len(verdicts) == 6
    assert verdicts[2].holds, "one person with both hands has no partner"
