"""Influence in synthetic dyads with known leaders and delays."""

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pandas as pd
import pytest

from made_modern import Path, modern_blocks, modern_study, with_paths, without_paths
from netboard.analysis.extraction.study import StudyData
from netboard.analysis.topics import influence
from netboard.analysis.topics.influence import Influence, influences

SAMPLES = 120


def study_with_a_leader(weight: float, seed: int = 1) -> StudyData:
    """Dyads whose right hand repeats the left hand's movement 40 ms later, plus noise of its own."""
    chance = np.random.default_rng(seed)

    def draw(trial: pd.Series) -> Path:
        left, own = chance.normal(size=(2, SAMPLES))
        right = own + weight * np.concatenate([[0.0, 0.0], left[:-2]])
        return {"left_vz": 0.01 * left, "right_vz": 0.01 * right, "p": chance.normal(size=SAMPLES)}

    def last(row: dict[str, float], configuration: str, force: str, dyad: int) -> None:
        row["completion"] = 0.02 * (SAMPLES - 1) + 0.001

    blocks = [one for one in modern_blocks(trials=12, forces=("full",), change=last) if one.configuration == "dyadic"]
    return with_paths(modern_study(blocks), draw)


def changed_paths(study: StudyData, change: Callable[[pd.DataFrame], pd.DataFrame]) -> dict[str, pd.DataFrame]:
    """Change the paths of every recording."""
    return {name: change(paths) for name, paths in study.paths.items()}


def influence_of(study: StudyData, direction: str) -> Influence:
    (only,) = [one for one in influences(study).parts if one.direction == direction]
    return only


@pytest.mark.slow
def test_influence_of_the_leader_exceeds_chance() -> None:
    study = study_with_a_leader(1.0)
    to_right, to_left = influence_of(study, "left to right"), influence_of(study, "right to left")
    assert to_right.condition.name == "dyadic, haptics on"
    assert to_right.dyads == ("D01", "D02", "D03", "D04")
    assert to_right.values == pytest.approx(np.full(4, np.log(2.0)), abs=0.1)
    assert to_right.chance is not None
    assert to_left.chance is not None
    assert to_right.chance.excess == pytest.approx(np.log(2.0), abs=0.05)
    assert to_right.chance.p == pytest.approx(1 / 24)
    assert abs(to_left.chance.excess) < 0.01
    assert (to_right.trials, to_right.available) == (12, 12)


@pytest.mark.slow
def test_dyads_without_influence_show_no_excess() -> None:
    found = [influence_of(study_with_a_leader(0.0, seed), "left to right").chance for seed in range(4)]
    excess = [one.excess for one in found if one is not None]
    assert len(excess) == 4
    assert max(map(abs, excess)) < 0.005
    assert np.mean([one.p for one in found if one is not None]) > 0.2


@pytest.mark.slow
def test_influence_is_invariant_to_mirrored_trials() -> None:
    study = study_with_a_leader(0.7)
    left = study.trials["trial"] % 2 == 0
    trials = study.trials.assign(target=np.where(left, -1, 1))
    targets = trials[["recording", "trial", "attempt", "target"]]

    def turn(paths: pd.DataFrame) -> pd.DataFrame:
        signs = pd.merge(paths, targets)["target"].to_numpy()
        return paths.assign(**{name: paths[name] * signs for name in ("left_vz", "right_vz", "p")})

    turned = replace(study, trials=trials, paths=changed_paths(study, turn))
    for one, other in zip(influences(study).parts, influences(turned).parts, strict=True):
        np.testing.assert_allclose(one.values, other.values, rtol=1e-9)
        assert one.chance is not None
        assert other.chance is not None
        np.testing.assert_allclose(one.chance.surrogates, other.chance.surrogates, rtol=1e-9)


@pytest.mark.slow
def test_swapping_sides_swaps_the_directions() -> None:
    study = study_with_a_leader(0.7)
    names = {"left_vz": "right_vz", "right_vz": "left_vz"}
    exchanged = replace(study, paths=changed_paths(study, lambda paths: paths.rename(columns=names)))
    one, other = influence_of(study, "left to right"), influence_of(exchanged, "right to left")
    np.testing.assert_allclose(one.values, other.values)


@pytest.mark.slow
def test_samples_after_completion_and_trials_with_gaps_are_left_out() -> None:
    study = study_with_a_leader(1.0)
    end = 0.02 * (SAMPLES - 1) - 0.3
    late = changed_paths(
        study, lambda paths: paths.assign(right_vz=paths["right_vz"].where(paths["time"] <= end, 99.0))
    )
    cut = replace(study, trials=study.trials.assign(completion=end), paths=late)
    assert influence_of(cut, "left to right").values == pytest.approx(np.full(4, np.log(2.0)), abs=0.12)
    gappy = replace(
        study, paths=changed_paths(study, lambda paths: paths.assign(p=paths["p"].where(paths["trial"] != 3, np.nan)))
    )
    assert influence_of(gappy, "left to right").available == 11


def test_many_trials_are_subsampled_with_a_fixed_seed(monkeypatch: pytest.MonkeyPatch) -> None:
    study = study_with_a_leader(1.0)
    monkeypatch.setattr(influence, "MOST", 5 * 4**2)
    monkeypatch.setattr(influence, "LEAST", 2)
    one, again = influence_of(study, "left to right"), influence_of(replace(study), "left to right")
    assert (one.trials, one.available) == (5, 12)
    np.testing.assert_array_equal(one.values, again.values)
    monkeypatch.setattr(influence, "MOST", 0)
    assert influence_of(replace(study), "left to right").trials == 2


@pytest.mark.slow
def test_single_dyad_has_influence_and_no_surrogates() -> None:
    study = study_with_a_leader(1.0)
    own = study.trials["dyad"] == "D01"
    found = influences(replace(study, trials=study.trials[own]))
    assert [one.chance for one in found.parts] == [None, None]
    assert ["no surrogates" in row.note for row in found.results] == [True, True]


def test_no_influence_without_two_people_or_without_paths() -> None:
    study = study_with_a_leader(1.0)
    alone = study.blocks.assign(left_by="D01A", right_by="D01A")
    for blocks in (alone, study.blocks.assign(right_by="robot"), study.blocks.assign(left_by="still")):
        assert influences(replace(study, blocks=blocks)).parts == ()
    assert influences(without_paths(study)).parts == ()
