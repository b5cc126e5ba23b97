"""Studies with missing parts: tables, figures and report exist, and every attempt is accounted for."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from matplotlib.figure import Figure

from made_study import SMALL, made_study, random_blocks
from netboard.analysis.extraction.study import StudyData
from netboard.analysis.report.html import write_report
from netboard.analysis.report.tables import write_tables
from netboard.analysis.topics.everything import NOT_COMPUTED, PICTURES, drawn, results_in, results_of
from netboard.analysis.topics.figure import TopicFigure, as_bytes
from netboard.analysis.topics.groups import windows_of
from report_studies import provenance_of
from thinned_study import LACKS, lacking


def check_attempts(study: StudyData) -> None:
    """Check that every attempt counts, failed, or is excluded for a reason, and that counted trials have a time."""
    keys = ["recording", "trial", "attempt"]
    out = set(study.exclusions[keys].itertuples(index=False, name=None))
    for row in study.trials.to_dict("records"):
        excluded = tuple(row[key] for key in keys) in out
        assert row["counts"] == (row["outcome"] == "success" and not excluded)
    assert np.isfinite(study.counted["completion"]).all()
    assert (study.exclusions["why"] != "").all()


def check_analysis(study: StudyData, folder: Path) -> None:
    """Make all tables, figures and the report of a study, and check that no error left any out."""
    check_attempts(study)
    results = results_of(study)
    assert results.loc[results["quantity"] == NOT_COMPUTED, "note"].tolist() == []
    write_tables(folder / "tables", study, results, ())
    pictures = [drawn(study, draw) for draw in PICTURES]
    assert [picture.caption for picture in pictures if picture.failed] == []
    assert all(picture.caption for picture in pictures)
    report = write_report(folder, study, results, pictures, provenance_of(study))
    assert "nan" not in {word.strip("[]().,;") for word in report.read_text(encoding="utf-8").split()}


@pytest.mark.slow
@pytest.mark.parametrize(
    "lacks",
    [
        ("no_success",),
        ("no_completion", "no_falls"),
        ("all_flagged", "only_dyadic"),
        ("one_condition", "one_trial"),
        ("one_participant", "empty_block"),
        ("no_measures", "no_movements"),
        ("constant", "no_forces"),
        ("holes", "many_falls", "unequal"),
    ],
)
@pytest.mark.sampled(1)
def test_incomplete_study_is_analysed(tmp_path: Path, lacks: tuple[str, ...]) -> None:
    check_analysis(lacking(lacks, seed=1, dyads=1, trials=2), tmp_path)


@pytest.mark.slow
@given(st.sets(st.sampled_from(LACKS), max_size=5), st.integers(0, 99), st.integers(1, 3), st.integers(1, 4))
def test_incomplete_study_accounts_for_every_attempt(lacks: set[str], seed: int, dyads: int, trials: int) -> None:
    check_attempts(lacking(sorted(lacks), seed, dyads, trials))


@pytest.mark.slow
@settings(max_examples=4)
@given(lacks=st.sets(st.sampled_from(LACKS), min_size=1, max_size=4), seed=st.integers(0, 99), dyads=st.integers(1, 2))
def test_randomly_incomplete_study_has_all_results(lacks: set[str], seed: int, dyads: int) -> None:
    results = results_of(lacking(sorted(lacks), seed, dyads, trials=2))
    assert results.loc[results["quantity"] == NOT_COMPUTED, "note"].tolist() == []


def test_failed_results_and_figures_are_replaced_by_the_reason() -> None:
    study = made_study(random_blocks(dyads=1, trials=3), *SMALL)

    def breaks(study: StudyData) -> TopicFigure:
        raise ValueError("Axis limits cannot be NaN or Inf")

    picture = drawn(study, breaks)
    assert picture.failed
    assert "Axis limits cannot be NaN or Inf" in picture.caption
    assert isinstance(picture.shown, Figure)
    assert b"could not be drawn" in as_bytes(picture.shown, "svg")
    (only,) = results_in(study, breaks)  # type: ignore[arg-type]
    assert (only.quantity, np.isnan(only.value)) == (NOT_COMPUTED, True)
    assert only.topic == picture.name == __name__.rpartition(".")[2]
    assert replace(picture, figure=None).shown is not None


@pytest.mark.parametrize(("trials", "ends", "group"), [(180, 30, 30), (60, 30, 30), (12, 6, 6), (5, 2, 3), (1, 1, 3)])
def test_windows_are_those_of_the_paper_or_fit_the_trials(trials: int, ends: int, group: int) -> None:
    study = made_study(random_blocks(dyads=1, trials=trials, forces=("full",)))
    found = windows_of(study)
    assert (found.ends, found.group) == (ends, group)
    assert bool(found.note) == (trials < 60)
    assert 2 * found.ends <= max(trials, 2)
    asked = windows_of(made_study(random_blocks(dyads=1, trials=trials, forces=("full",)), *SMALL))
    assert (asked.ends, asked.group, asked.note) == (3, 3, "")
