"""The sensitivity benchmark, on a rehearsed dyad with two trials in each block."""

import json
from collections import Counter
from pathlib import Path

import numpy as np
import pytest
from typer.testing import CliRunner

from evidence.__main__ import app
from evidence.analysis.disturbance_tables import MEASURES
from evidence.analysis.disturbances import DISTURBANCES
from evidence.analysis.multiverse import HEADLINES, count_holding
from evidence.analysis.open_questions import QUESTIONS
from evidence.analysis.question_tables import change, signed
from evidence.analysis.reported_numbers import STATEMENTS
from evidence.analysis.sensitivity_bench import (
    QUICK,
    recordings_to_disturb,
    study,
    variants_of,
    window_settings,
)
from netboard.base.config import Config
from netboard.base.errors import RecordingError
from netboard.benchmarks.harness.results import Folder, ResultPart
from netboard.task.plans.plan import blocks_of, shortened
from netboard.task.studies.study import paper_study
from rehearsed_study import rehearse

whole = pytest.mark.sampled(0, of="longest", part="sensitivity")


def test_short_study_has_each_condition_twice() -> None:
    dyads, most, trials = QUICK
    for dyad in range(1, dyads + 1):
        blocks = [config.block for config in shortened(blocks_of(Config(), paper_study(), 1, dyad), most, trials)]
        times = Counter((block.configuration, block.force, block.performer) for block in blocks)
        assert len(times) == 6
        assert set(times.values()) == {2}


@pytest.fixture(scope="module")
def recordings(tmp_path_factory: pytest.TempPathFactory) -> list[Path]:
    return rehearse(tmp_path_factory.mktemp("plan"), 1, tuple(range(1, 19)), 2)


@pytest.fixture(scope="module")
def parts(recordings: list[Path], tmp_path_factory: pytest.TempPathFactory) -> dict[str, ResultPart]:
    folder = Folder(tmp_path_factory.mktemp("results") / "new")
    shares: list[float] = []
    found = {
        part.name: part for part in study(recordings, folder, lambda text, share: shares.append(share), quick=True)
    }
    assert shares == sorted(shares)
    assert 0 < shares[0] <= shares[-1] <= 1
    for kind in ("png", "svg"):
        assert (folder.path / f"analysis-paths.{kind}").stat().st_size > 1000
    folder.write(list(found.values()), {"study": "sensitivity"})
    assert len(json.loads((folder.path / "results.json").read_text(encoding="utf-8"))["parts"]) == len(found)
    return found


@pytest.mark.slow
@whole
def test_every_alternative_has_a_row(parts: dict[str, ResultPart]) -> None:
    rows = [(row[0], row[3]) for row in parts["readings"].rows]
    expected = [(one.name, other.name) for one in QUESTIONS for other in one.alternatives]
    assert [row for row in rows if row[1] != "none"] == expected
    assert {name for name, _ in rows} == {one.name for one in QUESTIONS}


@pytest.mark.slow
@whole
def test_alternatives_change_the_expected_numbers(parts: dict[str, ResultPart]) -> None:
    assert parts["readings"].holds
    moved = {(row[0], row[2]): (row[4], row[5]) for row in parts["moved"].rows}
    before, after = moved["A7", "peaks, dyadic, last"]
    assert after > before
    before, after = moved["E4", "peaks, bimanual, last"]
    assert after > 1.5 * before
    before, after = moved["A19", "delay at 10 %, dyadic, haptics off"]
    assert after < before
    assert not [name for (question, name) in moved if question in ("A10", "E5")]
    most = {(row[0], row[3]): row[4] for row in parts["readings"].rows}
    assert most["B5", "the whole ball"] == "no value"
    assert {row[4] for row in parts["concerned"].rows} == {"100.0 %"}  # whole balls never stay in the target


@pytest.mark.slow
@whole
def test_numbers_lie_within_their_ranges(parts: dict[str, ResultPart]) -> None:
    names = [row[0] for row in parts["numbers"].rows]
    assert {name for name, _, _ in HEADLINES} <= set(names)
    assert len(set(names)) == len(names)
    for name, _, value, low, high in parts["numbers"].rows:
        assert low <= high or np.isnan(low), name
        assert np.isnan(value) or low <= value <= high, name


@pytest.mark.slow
@whole
def test_joint_effect_is_the_sum_of_single_effects_and_interaction(parts: dict[str, ResultPart]) -> None:
    assert parts["pairs"].rows
    for _, _, base, one, other, both, joint in parts["pairs"].rows:
        assert both == pytest.approx(one + other - base + joint)


@pytest.mark.slow
@whole
def test_paths_and_statements_cover_all_paths(parts: dict[str, ResultPart]) -> None:
    assert [row[-1] for row in parts["paths"].rows[:2]] == [16, 16]
    for _, _, least, low, middle, high, most, _, _ in parts["paths"].rows:
        assert np.isnan(least) or least <= low <= middle <= high <= most
    assert [row[0] for row in parts["statements"].rows] == [one.text for one in STATEMENTS]


@pytest.mark.slow
@whole
def test_every_disturbance_has_a_row_and_every_measure_a_column(parts: dict[str, ResultPart]) -> None:
    rows = {(row[0], row[1]): row[2:] for row in parts["disturbances"].rows}
    assert len(rows) == len(DISTURBANCES) + 1
    assert all(len(row) == len(MEASURES) for row in rows.values())
    assert set(rows["offset of the left stylus", "5 mm"]) == {"0"}
    assert parts["disturbances"].holds
    assert parts["forms"].holds


def test_windows_are_those_of_the_paper_or_fit_the_trials() -> None:
    assert window_settings(180) == ("summaries.ends=30", "summaries.group=30")
    assert window_settings(60) == ("summaries.ends=30", "summaries.group=30")
    assert window_settings(9) == ("summaries.ends=4", "summaries.group=3")
    assert window_settings(1) == ("summaries.ends=1", "summaries.group=3")


def test_missing_condition_is_refused(recordings: list[Path]) -> None:
    with pytest.raises(RecordingError, match="found none of dyadic with force full, dyadic with force none"):
        variants_of(recordings[:2], quick=True)


def test_one_recording_of_each_condition_is_disturbed(recordings: list[Path]) -> None:
    runs = variants_of(recordings, quick=True).runs
    disturbed = [run.config.block for run in runs if run.path in recordings_to_disturb(runs)]
    assert sorted((block.configuration, block.force) for block in disturbed) == [
        ("bimanual", "full"),
        ("bimanual", "none"),
        ("dyadic", "full"),
        ("dyadic", "none"),
    ]


def test_changes_are_relative() -> None:
    assert change(2.0, 3.0) == 0.5
    assert change(-2.0, -3.0) == -0.5
    assert change(float("nan"), float("nan")) == 0.0
    assert change(0.0, 0.0) == 0.0
    assert [signed(share) for share in (0.5, 0.012, 0.0, float("nan"), change(0.0, 1.0))] == [
        "+50 %",
        "+1.2 %",
        "0",
        "no value",
        "from 0",
    ]


def test_statements_are_counted_where_they_are_defined() -> None:
    names = "completion time, bimanual, first", "completion time, bimanual, last"

    class Found(dict[str, float]):
        def __missing__(self, name: str) -> float:
            return float("nan")

    paths = [Found(zip(names, pair, strict=True)) for pair in ((5.0, 4.0), (5.0, 6.0), (5.0, float("nan")))]
    assert count_holding(paths)[0] == (1, 2)
    assert count_holding(paths)[1] == (0, 0)


def test_folder_without_recordings_is_refused(tmp_path: Path) -> None:
    found = CliRunner().invoke(app, ["sensitivity", str(tmp_path)])
    assert found.exit_code == 2
    assert "folder with recordings" in found.output
    assert not list(tmp_path.iterdir())
