"""Measurement of a recording with other settings and with disturbances."""

from dataclasses import replace
from functools import partial
from pathlib import Path

import numpy as np
import pytest

from evidence.analysis.disturbances import BALL, HANDS, Disturbance, lost, noise, offset
from evidence.analysis.open_questions import readings_of
from evidence.analysis.remeasuring import (
    Remeasured,
    Request,
    attempt_values,
    disturbable_columns,
    read_block,
    remeasure,
    update_measures,
)
from made_recordings import recorded as written
from made_recordings import two_trials
from netboard.analysis.extraction.recordings import measure
from netboard.analysis.extraction.settings import Readings
from netboard.analysis.extraction.trials import BlockData
from netboard.recording.export.runs import Run, runs_of
from netboard.recording.files.reader import Recording
from rehearsed_study import rehearse


@pytest.fixture(scope="module")
def run(tmp_path_factory: pytest.TempPathFactory) -> Run:
    """A rehearsed block of eight trials."""
    (path,) = rehearse(tmp_path_factory.mktemp("plan"), 1, (1,), 8)
    return runs_of([path])[0]


def remeasured(run: Run, *settings: str, disturbances: tuple[Disturbance, ...] = ()) -> Remeasured:
    others = tuple(readings_of((one,)) for one in settings)
    no_bridging = readings_of(("filters.bridge=0",))
    return remeasure(Request(run, Readings(), others, disturbances, (no_bridging,) * len(disturbances)))


@pytest.mark.slow
def test_remeasuring_with_default_settings_gives_the_same_tables(run: Run) -> None:
    base, block = measure(run, Readings()), read_block(run, Readings())
    found = update_measures(base, list(block.takes()))
    for name, values in base.trials.items():
        assert np.array_equal(found.trials[name], values, equal_nan=values.dtype.kind == "f"), name
    for name, values in found.movements.items():
        assert np.array_equal(base.movements[name], values, equal_nan=values.dtype.kind == "f"), name


@pytest.mark.parametrize("setting", ["filters.order_of=each_pass", "filters.unit=trial", "segments.ends=trial"])
def test_other_settings_equal_a_separate_measurement(run: Run, setting: str) -> None:
    other = readings_of((setting,))
    alone = measure(run, other)
    found = remeasured(run, "peaks.window=whole", setting, "delays.search=inside").others[other]
    for name in ("peaks", "cooperative", "braking_distance"):
        assert np.array_equal(found.trials[name], alone.trials[name], equal_nan=True), name
    assert np.array_equal(found.movements["delay_20"], alone.movements["delay_20"], equal_nan=True)


def test_signals_are_refiltered_only_if_filters_or_data_change(run: Run) -> None:
    block = read_block(run, Readings())
    whole = block.whole
    assert block.again(readings_of(("peaks.window=whole",))).whole is whole
    assert block.again(readings_of(("segments.turning=either_way",))).whole is whole
    assert block.again(readings_of(("filters.order_of=each_pass",))).whole is not whole
    assert block.again(Readings(), p=block.raw("p")).whole is not whole
    assert block.whole is whole


def test_device_velocities_must_be_read_first(run: Run) -> None:
    with Recording(run.path) as recording:
        block = BlockData.of(recording, run.config, Readings())
    with pytest.raises(ValueError, match=r"filters\.velocity=device"):
        block.again(readings_of(("filters.velocity=device",)))


def test_noise_of_zero_amplitude_changes_nothing(run: Run) -> None:
    nothing = Disturbance("nothing", "0", partial(noise, names=(*HANDS, *BALL), deviation=0.0))
    found = remeasured(run, disturbances=(nothing,))
    for name, values in found.undisturbed[0].items():
        assert np.array_equal(found.disturbed[0][name], values, equal_nan=True), name


def test_random_disturbances_are_reproducible(run: Run) -> None:
    noisy = Disturbance("noise", "0.2 mm", partial(noise, names=BALL, deviation=2e-4))
    one, other = (remeasured(run, disturbances=(noisy,)).disturbed[0] for _ in range(2))
    assert all(np.array_equal(one[name], other[name], equal_nan=True) for name in one)


def test_noise_of_the_ball_adds_fewer_prominent_peaks(run: Run) -> None:
    block, base = read_block(run, Readings()), measure(run, Readings())
    windows = list(block.takes())
    disturbed = noise(disturbable_columns(block), np.random.default_rng(1), names=BALL, deviation=4e-4)
    more = {}
    for least in (0.0, 0.01):
        readings = readings_of((f"peaks.least_prominence={least}",))
        undisturbed = attempt_values(update_measures(base, list(block.again(readings).takes())))
        takes = [
            replace(one, trial=window.trial)
            for one, window in zip(block.again(readings, **disturbed).takes(), windows, strict=True)
        ]
        more[least] = float(np.nanmean(attempt_values(update_measures(base, takes))["peaks"] - undisturbed["peaks"]))
    assert more[0.0] > 0
    assert more[0.01] < more[0.0]


def test_stylus_noise_reduces_stillness_and_offset_changes_nothing(run: Run) -> None:
    disturbances = (
        Disturbance("noise", "1 mm", partial(noise, names=HANDS, deviation=1e-3)),
        Disturbance("offset", "5 mm", partial(offset, names=HANDS[:1], by=5e-3)),
    )
    found = remeasured(run, disturbances=disturbances)
    assert np.nanmean(found.disturbed[0]["still"] - found.undisturbed[0]["still"]) < -0.05
    for name, values in found.undisturbed[1].items():
        assert found.disturbed[1][name] == pytest.approx(values, abs=1e-9, nan_ok=True), name


@pytest.mark.slow
def test_lost_samples_prevent_a_completion_time_unless_bridged(run: Run) -> None:
    disturbances = (
        Disturbance("lost", "1 %", partial(lost, share=0.01)),
        Disturbance("bridged", "1 %", partial(lost, share=0.01, bridged=True)),
    )
    found = remeasured(run, disturbances=disturbances)
    assert np.isnan(found.disturbed[0]["completion"]).all()
    assert found.disturbed[1]["completion"] == pytest.approx(found.undisturbed[1]["completion"], abs=0.002)


def test_search_inside_the_movement_shortens_delays_at_the_lowest_threshold(run: Run) -> None:
    found = remeasured(run, "delays.search=inside")
    (other,) = found.others.values()
    before, after = (np.nanmean(np.abs(one.movements["delay_10"])) for one in (found.base, other))
    assert after < before


def test_shared_threshold_biases_delays_and_own_peaks_do_not(tmp_path: Path) -> None:
    ticks = two_trials()
    after = np.clip((np.arange(len(ticks)) - 2000) / 500, 0, 1)
    done = after**3 * (10 - 15 * after + 6 * after**2)
    ticks["left_used_z"], ticks["right_used_z"] = -0.02 * done, 0.01 * done
    ticks["theta"] = 0.06 * done
    run = runs_of([written(tmp_path, ticks)])[0]
    found = remeasured(run, "delays.threshold=own_peak")
    (other,) = found.others.values()
    shared, own = (np.concatenate([one.movements[f"delay_{q}"] for q in (10, 40)]) for one in (found.base, other))
    # A positive delay means that the right side was first. The left one moves twice as far.
    assert shared == pytest.approx([-0.014, -0.034], abs=0.003)
    assert own == pytest.approx([0, 0], abs=0.001)


@pytest.mark.slow
def test_short_gaps_are_filled_if_configured(run: Run) -> None:
    leaving, bridging = readings_of(("filters.bridge=0",)), readings_of(("filters.bridge=0.02",))
    base, block = measure(run, Readings()), read_block(run, Readings())
    gapped = lost(disturbable_columns(block), np.random.default_rng(1), share=0.01)
    open_gaps, filled = (
        attempt_values(update_measures(base, list(block.again(how, **gapped).takes()))) for how in (leaving, bridging)
    )
    assert np.isnan(open_gaps["completion"]).all()
    assert filled["completion"] == pytest.approx(base.trials["completion"], abs=0.002)
    assert np.array_equal(measure(run, bridging).trials["peaks"], base.trials["peaks"])
