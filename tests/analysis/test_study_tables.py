"""The tables of a study: recordings in the order of the plan, trials counted or excluded, exclusions listed."""

from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from made_study import Block, made_study, times
from made_study import measured as made_block
from netboard.analysis.extraction.exclusions import NO_COMPLETION, excluded
from netboard.analysis.extraction.recordings import Measured
from netboard.analysis.extraction.settings import Exclusions, Readings, parse
from netboard.analysis.extraction.study import FIELDS_IN_STUDY, StudyData, notes, study_of
from netboard.base.errors import ConfigError
from netboard.base.tables.experiment import TECHNICAL
from rehearsed_study import measured, rehearse


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    where = tmp_path_factory.mktemp("study")
    rehearse(where)
    return where


def study(folder: Path, *words: str) -> StudyData:
    readings = parse("", overrides=words)
    return study_of(measured(folder, Readings()), readings)


def blocks(**columns: object) -> pd.DataFrame:
    base = {"recording": ["r"], "pilot": 0, "simulated": 0, "stand_ins": "", "not_measured": "", "run": "r", "block": 1}
    return pd.DataFrame(base | {"config_sha256": "", "exclude": " ".join(TECHNICAL)} | columns)


def trials(**columns: object) -> pd.DataFrame:
    base = {"recording": "r", "trial": [1, 2, 3], "attempt": 1, "catch": 0, "perturbation": 0.0, "flags": ""}
    base |= {"outcome": "success", "completion": 1.0, "target": 1, "duration": 3.0, "recorded_completion": 1.0}
    return pd.DataFrame(base | columns)


@pytest.mark.slow
def test_trials_are_numbered_within_each_performer_and_condition(folder: Path) -> None:
    found = study(folder)
    assert found.dyads == ["D01", "D02"]
    for _, own in found.counted.groupby(["performer", "condition"]):
        assert list(own["order"]) == list(range(1, len(own) + 1))
    assert set(found.counted["condition"]) == {
        f"{who}, {force}" for who in ("bimanual", "dyadic") for force in ("haptics off", "haptics on")
    }
    assert (found.trials.loc[found.trials["outcome"] != "success", "counts"] == 0).all()
    for name in ("blocks", "trials", "movements"):
        assert list(getattr(found, name)) == list(dict.fromkeys(getattr(found, name)))
        assert set(getattr(found, name)) == {field.name for field in found.with_factor_fields(FIELDS_IN_STUDY[name])}


@pytest.mark.slow
def test_study_does_not_depend_on_the_order_of_recordings(folder: Path) -> None:
    one, other = (study_of(m, Readings()) for m in (measured(folder, Readings()), measured(folder, Readings())[::-1]))
    for name in ("blocks", "trials", "movements"):
        pd.testing.assert_frame_equal(getattr(one, name), getattr(other, name))
    assert list(one.paths) == list(other.paths) == list(one.blocks["recording"])
    for name, paths in one.paths.items():
        pd.testing.assert_frame_equal(paths, other.paths[name])


@pytest.mark.slow
def test_numbering_by_configuration_continues_across_conditions(folder: Path) -> None:
    found = study(folder, "summaries.numbering=configuration")
    dyads = found.counted[found.counted["configuration"] == "dyadic"]
    assert dyads["order"].max() == 2 * study(folder).counted["order"].max()


@pytest.mark.slow
def test_excluded_trials_do_not_count_and_are_listed(folder: Path) -> None:
    first = study(folder).blocks["recording"][0]
    found = study(folder, "exclusions.warm_up=1", f'exclusions.trials=["{first}/3: the phone rang"]')
    assert (found.counted["trial"] > 1).all()
    assert found.exclusions["why"].value_counts()["excluded by the experimenter: the phone rang"] == 1
    assert len(found.counted) == 8 * 2 - 1


@pytest.mark.parametrize(
    ("change", "rules", "why"),
    [
        (
            {"flags": ["", "clipped too_long", ""]},
            Exclusions(),
            ["a force was at its limit for too large a share of the time"],
        ),
        ({"flags": ["too_long", "", ""]}, Exclusions(), []),
        (
            {"flags": ["stuck_left", "", ""]},
            Exclusions(),
            ["the height of the left stylus did not change for too long"],
        ),
        ({"catch": [0, 1, 0]}, Exclusions(), ["a catch trial"]),
        ({"catch": [0, 1, 0]}, Exclusions(catch=False), []),
        ({"perturbation": [0.0, -0.5, np.nan]}, Exclusions(), ["a perturbation trial"]),
        ({"perturbation": [0.0, -0.5, np.nan]}, Exclusions(perturbed=False), []),
        ({}, Exclusions(warm_up=2), ["one of the first 2 trials of the block"] * 2),
        ({"completion": [1.0, np.nan, 2.0]}, Exclusions(), [NO_COMPLETION]),
        ({"completion": np.nan, "outcome": "fell"}, Exclusions(), []),
    ],
)
def test_each_rule_excludes_its_trials_with_a_reason(
    change: dict[str, object], rules: Exclusions, why: list[str]
) -> None:
    assert list(excluded(blocks(), trials(**change), rules)["why"]) == why


def test_paused_and_aborted_attempts_are_listed() -> None:
    interrupted = blocks(not_measured=["2.1 pause; 4.3 abort"])
    found = excluded(interrupted, trials(), Exclusions())
    assert list(found[["trial", "attempt"]].itertuples(index=False, name=None)) == [(2, 1), (4, 3)]
    assert [why.rpartition(": ")[2] for why in found["why"]] == ["pause", "abort"]


def test_simulated_still_hand_is_not_excluded() -> None:
    assert excluded(blocks(simulated=[1]), trials(flags="stuck_left"), Exclusions()).empty


def test_attempt_is_listed_with_all_its_reasons() -> None:
    found = excluded(blocks(), trials(flags=["clipped lost_samples", "", ""]), Exclusions(warm_up=1))
    assert len(found) == 3
    assert set(found["trial"]) == {1}


@pytest.mark.parametrize(("pilots", "count"), [("unless_all", 1), ("always", 1), ("never", 0)])
def test_pilots_are_excluded_as_configured(pilots: str, count: int) -> None:
    both = blocks(recording=["r", "s"], pilot=[0, 1], run=["r", "s"])
    rows = trials(recording=["r", "r", "s"])
    assert len(excluded(both, rows, Exclusions(pilots=pilots))) == count  # type: ignore[arg-type]
    alone = excluded(blocks(pilot=[1]), trials(), Exclusions(pilots=pilots))  # type: ignore[arg-type]
    assert len(alone) == (3 if pilots == "always" else 0)


def test_an_attempt_that_two_loggers_recorded_counts_once() -> None:
    """The second logger joined in trial 2, and the first one failed in trial 4, which neither has completely."""
    both = blocks(recording=["a", "b"], not_measured=["4.1 unknown", "2.1 unreleased"])
    rows = trials(recording=["a", "a", "a", "b", "b"], trial=[1, 2, 3, 3, 5], duration=[3.0, 2.0, 4.0, 4.0, 3.0])
    found = excluded(both, rows, Exclusions())
    again = found[~found["why"].str.contains("ended|release")]
    assert list(again.itertuples(index=False, name=None)) == [
        ("b", 3, 1, "recorded by another logger, too: counts in a")
    ]
    flagged = excluded(both, rows.assign(flags=["", "", "lost_samples", "", ""]), Exclusions())
    again = flagged[flagged["why"].str.contains("another logger")]
    assert list(again[["recording", "trial"]].itertuples(index=False, name=None)) == [("a", 3)]
    other_runs = both.assign(run=["one", "two"])
    assert not excluded(other_runs, rows, Exclusions())["why"].str.contains("another logger").any()


@pytest.mark.parametrize("word", ["r/9: late", "q/1: late", "r/1", "r/one: late", "r/1:"])
def test_excluding_a_missing_trial_is_an_error(word: str) -> None:
    with pytest.raises(ConfigError, match=r"exclusions\] trials"):
        excluded(blocks(), trials(), Exclusions(trials=(word,)))


def test_nan_is_not_a_quality_flag() -> None:
    assert excluded(blocks(), trials(flags=np.nan), Exclusions()).empty


def one_trial_recording(
    name: str,
    block: int,
    opened: str,
    *,
    part: int = 1,
    run: str = "",
    force: str = "full",
    study: str = "",
    session: str = "S01",
) -> Measured:
    """Tables of a recording of one trial."""
    one = made_block(Block("D01", "D01", "dyadic", force, [{"trial": part}]), block)
    run = run or name.partition("_part")[0]
    columns = {"recording": name, "opened_utc": opened, "part": part, "run": run, "study": study, "session": session}
    for column, value in columns.items():
        one.blocks[column][:] = value
    for table in (one.trials, one.movements, one.paths):
        table["recording"][:] = name
    return one


def test_resumed_block_continues_its_trial_numbers() -> None:
    """The parts of a block are ordered by when they were opened, and their trials are numbered through."""
    parts = [
        one_trial_recording("x_ff", 1, "10:00"),
        one_trial_recording("x_ff_part2", 1, "10:05", part=2),
        one_trial_recording("x_00", 1, "10:10"),
    ]
    found = study_of(parts, Readings())
    assert list(found.blocks["recording"]) == ["x_ff", "x_ff_part2", "x_00"]
    assert list(found.trials["recording"]) == ["x_ff", "x_ff_part2", "x_00"]
    assert list(found.trials["order"]) == [1, 2, 3]
    assert set(found.blocks["block"]) == {1}


def test_an_attempt_in_two_recordings_counts_as_one_excluded_attempt() -> None:
    """A logger that failed in a trial recorded its beginning, and the next one its end."""
    parts = [one_trial_recording("x", 1, "10:00", run="x"), one_trial_recording("x_part2", 1, "10:05", part=2, run="x")]
    parts[0].blocks["not_measured"][:] = "2.1 abort"
    parts[1].blocks["not_measured"][:] = "2.1 unreleased; 3.1 pause"
    found = study_of(parts, Readings())
    assert len(found.exclusions) == 3
    assert found.excluded_attempts == 2


def test_parts_of_a_block_keep_their_order_if_the_wall_clock_is_set_back() -> None:
    """Each run of the server numbers the parts from 1; the runs are ordered by when they began."""
    parts = [
        one_trial_recording("again_part2", 1, "10:20", part=2, run="aa"),
        one_trial_recording("first_part2", 1, "09:05", part=2, run="bb"),
        one_trial_recording("first", 1, "10:00", run="bb"),
        one_trial_recording("again", 1, "10:15", run="aa"),
    ]
    found = study_of(parts, Readings())
    assert list(found.blocks["recording"]) == ["first", "first_part2", "again", "again_part2"]
    assert list(found.trials["order"]) == [1, 2, 3, 4]


def test_blocks_of_a_second_session_follow_those_of_the_first() -> None:
    """Every session of a plan numbers its blocks from 1."""
    visits = [
        one_trial_recording("a2", 2, "09:10", force="none"),
        one_trial_recording("b2", 2, "10:10", session="S02"),
        one_trial_recording("a1", 1, "09:00"),
        one_trial_recording("b1", 1, "10:00", session="S02", force="none"),
        one_trial_recording("c1", 1, "11:00", session="A", force="none"),
    ]
    found = study_of(visits, Readings())
    assert list(found.blocks["recording"]) == ["a1", "a2", "b1", "b2", "c1"]
    assert list(found.blocks["block"]) == [1, 2, 3, 4, 5]
    assert list(found.trials["order"]) == [1, 1, 2, 2, 3]


def test_blocks_of_several_plans_are_numbered_consecutively() -> None:
    one = [
        one_trial_recording("a1", 1, "09:00", study="a"),
        one_trial_recording("a2", 2, "09:10", study="a", force="none"),
    ]
    other = [
        one_trial_recording("b1", 1, "08:00", study="b", force="none"),
        one_trial_recording("b2", 2, "08:10", study="b"),
    ]
    found = study_of([*one, *other], Readings())
    assert list(found.blocks["recording"]) == ["b1", "b2", "a1", "a2"]
    assert list(found.blocks["block"]) == list(found.trials["block"]) == [1, 2, 3, 4]


def test_blocks_without_a_plan_are_numbered_consecutively() -> None:
    """Haptics on, off, on (in two parts), off: four blocks, though each recording says that it is the first."""
    recordings = [
        one_trial_recording("i1", 1, "09:00"),
        one_trial_recording("i2", 1, "09:10", force="none"),
        one_trial_recording("i3", 1, "09:20"),
        one_trial_recording("i3_part2", 1, "09:25", part=2),
        one_trial_recording("i4", 1, "09:30", force="none"),
    ]
    found = study_of(recordings, Readings())
    assert list(found.blocks["block"]) == list(found.trials["block"]) == [1, 2, 3, 3, 4]


def test_dyad_of_more_than_two_people_is_noted() -> None:
    blocks = [Block("D01", name, "bimanual", "full", times(1.0)) for name in ("P1", "P2")]
    together = Block("D01", "P1", "dyadic", "full", times(1.0), right_by="P2")
    assert notes(made_study([*blocks, together])) == ()
    (note,) = notes(made_study([*blocks, together, Block("D01", "P3", "bimanual", "full", times(1.0))]))
    assert note.startswith("dyad D01 has 3 participants (P1, P2, P3)")


def test_participant_of_two_dyads_is_noted() -> None:
    """Their dyads are not independent, and a robot partner is nobody."""
    pairs = [("D01", "P1", "P2"), ("D02", "P3", "P1"), ("D03", "P4", "robot"), ("D04", "P5", "robot")]
    blocks = [Block(dyad, left, "dyadic", "full", times(1.0), right_by=right) for dyad, left, right in pairs]
    (note,) = notes(made_study(blocks))
    assert note.startswith("participant P1 is in 2 dyads (D01, D02)")
