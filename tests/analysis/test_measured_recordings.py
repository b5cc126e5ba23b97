"""Measures of a recording, compared with the server's values and with direct calls of the pure functions."""

from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray

from made_recordings import recorded, two_trials
from netboard.analysis.extraction.controls import CONTROLS, arms_of
from netboard.analysis.extraction.exclusions import NO_RELEASE
from netboard.analysis.extraction.recordings import FIELDS, Measured, measure
from netboard.analysis.extraction.settings import ControlSettings, Readings, parse
from netboard.analysis.extraction.study import study_of
from netboard.analysis.extraction.trials import RATE, BlockData
from netboard.analysis.measures.peaks import velocity_peaks
from netboard.base.errors import RecordingError
from netboard.recording.export.runs import runs_of
from netboard.recording.files.reader import Recording
from rehearsed_study import measured, rehearse

pytestmark = pytest.mark.slow


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    where = tmp_path_factory.mktemp("study")
    rehearse(where, dyads=1, blocks=(1, 9, 10))
    return where


def tables(folder: Path, *words: str) -> tuple[Measured, ...]:
    return measured(folder, parse("", overrides=words))


def column(folder: Path, name: str, *words: str) -> NDArray[np.float64]:
    return np.concatenate([one.trials[name] for one in tables(folder, *words)])


def test_tables_have_all_declared_columns_with_their_types(folder: Path) -> None:
    kinds = {"integer": "i", "number": "f", "string": "O"}
    for one in tables(folder):
        for name, fields in FIELDS.items():
            columns = getattr(one, name)
            assert list(columns) == [field.name for field in fields]
            assert {columns[field.name].dtype.kind == kinds[field.kind] for field in fields} == {True}
            assert len({len(column) for column in columns.values()}) == 1
            assert all(field.unit or field.kind == "string" for field in fields)


def test_meanings_of_columns_have_no_placeholder() -> None:
    assert [field.name for fields in FIELDS.values() for field in fields if "{" in field.text] == []


def test_completion_times_are_the_servers_less_one_tick(folder: Path) -> None:
    for path, one in zip(sorted(folder.glob("*.mcap")), tables(folder), strict=True):
        with Recording(path) as recording:
            attempts = recording.attempts()
        np.testing.assert_allclose(one.trials["completion"], [a.completion - 1e-3 for a in attempts], atol=1e-9)
        assert list(one.trials["outcome"]) == [a.outcome for a in attempts]
        np.testing.assert_allclose(one.trials["release"], [a.tick / RATE for a in attempts])


def test_class_durations_add_up_to_the_completion_time(folder: Path) -> None:
    whole = sum(column(folder, name) for name in ("cooperative", "competitive", "single", "still"))
    done = np.isfinite(column(folder, "completion"))
    np.testing.assert_allclose(np.asarray(whole)[done], column(folder, "completion")[done], atol=1e-9)


def test_peaks_equal_those_of_speed_filtered_by_scipy(folder: Path) -> None:
    from scipy.signal import butter, sosfiltfilt

    path = sorted(folder.glob("*.mcap"))[0]
    run = runs_of([path])[0]
    with Recording(path) as recording:
        block = BlockData.of(recording, run.config, Readings())
        p = recording.columns("p")["p"]
    take = next(block.takes())
    stop = block.placed[block.placed > take.trial.stop][0]
    fast, slow = (butter(5, cutoff, fs=1000, output="sos") for cutoff in (20, 5))
    ball = sosfiltfilt(fast, p[:stop], padlen=1000)
    speed = sosfiltfilt(slow, np.abs(np.gradient(ball, 1e-3, edge_order=2)), padlen=1000)
    window = take.trial.window()
    np.testing.assert_allclose(block.whole.speed[window], speed[window], atol=1e-9)
    assert (
        tables(folder)[0].trials["peaks"][0]
        == velocity_peaks(speed[window], least_prominence=1e-4, least_share=0.006).count
    )


@pytest.mark.parametrize(
    ("word", "name", "direction"),
    [
        ("peaks.window=whole", "peaks", 1),
        ("peaks.extrema=maxima_and_minima", "peaks", 1),
        ("peaks.least_prominence=0.02", "peaks", -1),
        ("movements.window=whole", "still", 1),
        ("movements.still_below=0.01", "still", 1),
        ("strategy.braking=rotation", "braking_onset", -1),
    ],
)
def test_settings_shift_their_measure_as_expected(folder: Path, word: str, name: str, direction: int) -> None:
    change = np.nanmean(column(folder, name, word)) - np.nanmean(column(folder, name))
    assert change * direction > 0


def test_whole_ball_completion_is_later_or_missing(folder: Path) -> None:
    centre, whole = column(folder, "completion"), column(folder, "completion", "completion.inside=whole_ball")
    assert ((whole > centre) | np.isnan(whole)).all()


@pytest.mark.parametrize("word", ["filters.unit=trial", "segments.ends=trial", "filters.velocity=device"])
def test_alternative_filter_units_give_similar_shares(folder: Path, word: str) -> None:
    np.testing.assert_array_equal(column(folder, "completion", word), column(folder, "completion"))
    for name in ("cooperative", "still"):
        np.testing.assert_allclose(column(folder, name, word).mean(), column(folder, name).mean(), atol=0.25)


@pytest.mark.parametrize("whole", [False, True])
def test_success_without_a_detectable_hold_has_no_measures_up_to_completion(folder: Path, whole: bool) -> None:
    words = ["completion.inside=whole_ball"]
    if whole:
        words += ["movements.window=whole", "peaks.window=whole"]
    succeeded = np.isfinite(column(folder, "completion"))
    lost = succeeded & np.isnan(column(folder, "completion", *words))
    assert lost.any()
    for name in ("peaks", "cooperative", "single"):
        np.testing.assert_array_equal(np.isnan(column(folder, name, *words)), lost & (not whole))
    for name in ("lag", "sparc", "left_reaction", "in_target", "left_given", "interaction"):
        assert np.isnan(column(folder, name, *words)[lost]).all()
    for name in ("peaks_whole", "braking_onset"):
        np.testing.assert_array_equal(column(folder, name, *words), column(folder, name))


def test_movements_lie_within_trials_and_paths_start_at_release(folder: Path) -> None:
    for one in tables(folder):
        duration = {
            place: value
            for *place_, value in zip(*(one.trials[n] for n in ("trial", "attempt", "duration")), strict=True)
            for place in [tuple(place_)]
        }
        for trial, attempt, onset in zip(*(one.movements[n] for n in ("trial", "attempt", "onset")), strict=True):
            assert 0 <= onset < duration[trial, attempt]
        starts = one.paths["time"] == 0
        assert starts.sum() == len(duration)
        np.testing.assert_allclose(np.abs(one.paths["p"][starts]), 0.15, atol=0.002)


def test_controls_are_computed_only_with_haptics_off(folder: Path) -> None:
    for one in tables(folder):
        rows = one.controls
        assert bool(len(rows["trial"])) == (not one.blocks["haptics"][0])
        if not len(rows["trial"]):
            continue
        assert set(rows["control"]) <= {control.name for control in CONTROLS}
        assert set(rows["arm"][rows["control"] == "passive"]) == {"", *(arm.name for arm in arms_of(ControlSettings()))}
        held = np.char.find(rows["arm"].astype(str), "device") >= 0
        assert rows["friction"][held] == pytest.approx(0.26)
        assert np.isnan(rows["friction"][~held]).all()


def test_control_without_a_force_is_the_attempt_itself(folder: Path) -> None:
    for one in tables(folder):
        rows, trials = one.controls, one.trials
        for place in np.flatnonzero((rows["control"] != "recorded partner") & (rows["arm"] == "")):
            (own,) = np.flatnonzero((trials["trial"] == rows["trial"][place]) & (trials["outcome"] == "success"))
            for name in ("cooperative", "single", "lag", "left_reaction", "right_effort", "interaction"):
                np.testing.assert_allclose(rows[name][place], trials[name][own], atol=1e-9)


def test_stiffer_arms_yield_less_and_few_attempts_have_controls(folder: Path) -> None:
    words = ("controls.attempts=1", "controls.stiffest=2000")
    found = [one.controls for one in tables(folder, *words) if len(one.controls["trial"])]
    assert found
    for every in found:
        rows = {name: values[every["control"] == "passive"] for name, values in every.items()}
        assert len(set(rows["trial"])) == 1
        effort = dict(zip(rows["arm"], rows["left_effort"], strict=True))
        soft, stiff = (abs(effort[f"{k} N/m, no friction"] - effort[""]) for k in (50, 2000))
        assert stiff < 0.3 * soft
    assert not any(len(one.controls["trial"]) for one in tables(folder, "controls.attempts=0"))


def test_missing_samples_count_as_unknown_movement(tmp_path: Path) -> None:
    rows = two_trials()
    holed = np.delete(rows, slice(6500, 6800))
    whole, less = (measure(runs_of([recorded(tmp_path, part)])[0], Readings()) for part in (rows, holed))
    assert less.blocks["missing"][0] == 300
    assert less.blocks["duration"][0] == whole.blocks["duration"][0]
    np.testing.assert_allclose(less.trials["unknown"] - whole.trials["unknown"], [0.0, 0.3], atol=1e-9)
    assert list(less.trials["completion_source"]) == ["recording", ""]
    np.testing.assert_allclose(less.trials["recorded_completion"], whole.trials["recorded_completion"])


@pytest.mark.parametrize("bridge", ["0", "0.02"])
def test_attempt_with_a_missing_release_is_timed_from_its_release(tmp_path: Path, bridge: str) -> None:
    rows, readings = two_trials(), parse("", overrides=[f"filters.bridge={bridge}"])
    holed = np.delete(rows, [*range(990, 1005), *range(5990, 6300)])
    whole, less = (measure(runs_of([recorded(tmp_path, part)])[0], readings) for part in (rows, holed))
    for name in ("completion", "release", "duration"):
        np.testing.assert_array_equal(less.trials[name], whole.trials[name])
    np.testing.assert_allclose(less.trials["unknown"][1], 0.3, atol=0.002)


def test_attempt_released_before_its_recording_is_excluded(tmp_path: Path) -> None:
    study = study_of([measure(runs_of([recorded(tmp_path, two_trials()[2000:])])[0], Readings())], Readings())
    assert list(study.trials["trial"]) == [2]
    reasons = study.exclusions.loc[study.exclusions["trial"] == 1, "why"]
    assert list(reasons) == [NO_RELEASE]


def test_attempts_with_equal_numbers_are_refused(tmp_path: Path) -> None:
    rows = two_trials()
    rows["trial"] = 1
    with pytest.raises(RecordingError, match="found 2 attempts with the number 1 at trial 1, expected one"):
        measure(runs_of([recorded(tmp_path, rows)])[0], Readings())
