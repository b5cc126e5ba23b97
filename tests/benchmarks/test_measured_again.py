"""A recording is measured again: by its own readings to the same tables, by others and disturbed to what must be."""

from dataclasses import replace
from functools import partial
from pathlib import Path

import numpy as np
import pytest
from rehearsed_plan import rehearsed_plan

from made_recordings import recorded as written
from made_recordings import two_trials
from netboard.analysis.extraction.recordings import measure
from netboard.analysis.extraction.settings import Readings
from netboard.analysis.extraction.trials import Block
from netboard.benchmarks.analysis.again import Fulfilled, Wish, again, fulfil, of_attempts, opened, recorded
from netboard.benchmarks.analysis.disturbances import BALL, HANDS, Disturbance, lost, noise, offset
from netboard.benchmarks.analysis.readings import readings_of
from netboard.recording.export.runs import Run, runs_of
from netboard.recording.files.reader import Recording


@pytest.fixture(scope="module")
def run(tmp_path_factory: pytest.TempPathFactory) -> Run:
    """A rehearsed block of eight trials."""
    (path,) = rehearsed_plan(tmp_path_factory.mktemp("plan"), 8, blocks=1)
    return runs_of([path])[0]


def fulfilled(run: Run, *settings: str, disturbances: tuple[Disturbance, ...] = ()) -> Fulfilled:
    others = tuple(readings_of((one,)) for one in settings)
    left = readings_of(("filters.bridge=0",))
    return fulfil(Wish(run, Readings(), others, disturbances, (left,) * len(disturbances)))


@pytest.mark.slow
def test_its_own_readings_give_the_same_tables(run: Run) -> None:
    base, block = measure(run, Readings()), opened(run, Readings())
    found = again(base, list(block.takes()))
    for name, values in base.trials.items():
        assert np.array_equal(found.trials[name], values, equal_nan=values.dtype.kind == "f"), name
    for name, values in found.movements.items():
        assert np.array_equal(base.movements[name], values, equal_nan=values.dtype.kind == "f"), name


@pytest.mark.parametrize("setting", ["filters.order_of=each_pass", "filters.unit=trial", "segments.ends=trial"])
def test_other_readings_give_what_they_give_by_themselves(run: Run, setting: str) -> None:
    other = readings_of((setting,))
    alone = measure(run, other)
    found = fulfilled(run, "peaks.window=whole", setting, "delays.search=inside").others[1]
    for name in ("peaks", "cooperative", "braking_distance"):
        assert np.array_equal(found.trials[name], alone.trials[name], equal_nan=True), name
    assert np.array_equal(found.movements["delay_20"], alone.movements["delay_20"], equal_nan=True)


def test_what_stays_the_same_is_not_filtered_again(run: Run) -> None:
    block = opened(run, Readings())
    whole = block.whole
    assert block.again(readings_of(("peaks.window=whole",))).whole is whole
    assert block.again(readings_of(("segments.turning=either_way",))).whole is whole
    assert block.again(readings_of(("filters.order_of=each_pass",))).whole is not whole
    assert block.again(Readings(), p=block.raw("p")).whole is not whole
    assert block.whole is whole


def test_velocities_that_were_not_read_cannot_be_measured(run: Run) -> None:
    with Recording(run.path) as recording:
        block = Block.of(recording, run.config, Readings())
    with pytest.raises(ValueError, match=r"filters\.velocity=device"):
        block.again(readings_of(("filters.velocity=device",)))


def test_a_disturbance_of_nothing_changes_nothing(run: Run) -> None:
    nothing = Disturbance("nothing", "0", partial(noise, names=(*HANDS, *BALL), deviation=0.0))
    found = fulfilled(run, disturbances=(nothing,))
    for name, values in found.calm[0].items():
        assert np.array_equal(found.disturbed[0][name], values, equal_nan=True), name


def test_what_is_drawn_does_not_depend_on_when_it_is_measured(run: Run) -> None:
    noisy = Disturbance("noise", "0.2 mm", partial(noise, names=BALL, deviation=2e-4))
    one, other = (fulfilled(run, disturbances=(noisy,)).disturbed[0] for _ in range(2))
    assert all(np.array_equal(one[name], other[name], equal_nan=True) for name in one)


def test_noise_of_the_ball_adds_peaks_and_less_of_them_that_stand_out(run: Run) -> None:
    block, base = opened(run, Readings()), measure(run, Readings())
    windows = list(block.takes())
    shaken = noise(recorded(block), np.random.default_rng(1), names=BALL, deviation=4e-4)
    more = {}
    for least in (0.0, 0.01):
        readings = readings_of((f"peaks.least_prominence={least}",))
        calm = of_attempts(again(base, list(block.again(readings).takes())))
        takes = [
            replace(one, trial=window.trial)
            for one, window in zip(block.again(readings, **shaken).takes(), windows, strict=True)
        ]
        more[least] = float(np.mean(of_attempts(again(base, takes))["peaks"] - calm["peaks"]))
    assert more[0.0] > 0
    assert more[0.01] < more[0.0]


def test_noise_of_the_styluses_takes_stillness_away_and_an_offset_nothing(run: Run) -> None:
    disturbances = (
        Disturbance("noise", "1 mm", partial(noise, names=HANDS, deviation=1e-3)),
        Disturbance("offset", "5 mm", partial(offset, names=HANDS[:1], by=5e-3)),
    )
    found = fulfilled(run, disturbances=disturbances)
    assert np.nanmean(found.disturbed[0]["still"] - found.calm[0]["still"]) < -0.05
    for name, values in found.calm[1].items():
        assert found.disturbed[1][name] == pytest.approx(values, abs=1e-9, nan_ok=True), name


@pytest.mark.slow
def test_a_lost_tick_in_the_hold_loses_the_completion_unless_it_is_bridged(run: Run) -> None:
    disturbances = (
        Disturbance("lost", "1 %", partial(lost, share=0.01)),
        Disturbance("bridged", "1 %", partial(lost, share=0.01, bridged=True)),
    )
    found = fulfilled(run, disturbances=disturbances)
    assert np.isnan(found.disturbed[0]["completion"]).all()
    assert found.disturbed[1]["completion"] == pytest.approx(found.calm[1]["completion"], abs=0.002)


def test_searching_inside_only_shortens_delays_at_the_lowest_threshold(run: Run) -> None:
    found = fulfilled(run, "delays.search=inside")
    before, after = (np.nanmean(np.abs(one.movements["delay_10"])) for one in (found.base, found.others[0]))
    assert after < before


def test_one_threshold_makes_the_larger_mover_look_earlier_and_own_peaks_do_not(tmp_path: Path) -> None:
    ticks = two_trials()
    after = np.clip((np.arange(len(ticks)) - 2000) / 500, 0, 1)
    done = after**3 * (10 - 15 * after + 6 * after**2)
    ticks["left_used_z"], ticks["right_used_z"] = -0.02 * done, 0.01 * done
    ticks["theta"] = 0.06 * done
    run = runs_of([written(tmp_path, ticks)])[0]
    found = fulfilled(run, "delays.threshold=own_peak")
    shared, own = (
        np.concatenate([one.movements[f"delay_{q}"] for q in (10, 40)]) for one in (found.base, found.others[0])
    )
    # Positive: the right side was first. Here the left one goes twice as far: 14 ms at 10 % and 34 ms at 40 %.
    assert shared == pytest.approx([-0.014, -0.034], abs=0.003)
    assert own == pytest.approx([0, 0], abs=0.001)


@pytest.mark.slow
def test_short_holes_are_filled_where_the_readings_say_so(run: Run) -> None:
    leaving, bridging = readings_of(("filters.bridge=0",)), readings_of(("filters.bridge=0.02",))
    base, block = measure(run, Readings()), opened(run, Readings())
    holed = lost(recorded(block), np.random.default_rng(1), share=0.01)
    left, filled = (of_attempts(again(base, list(block.again(how, **holed).takes()))) for how in (leaving, bridging))
    assert np.isnan(left["completion"]).all()
    assert filled["completion"] == pytest.approx(base.trials["completion"], abs=0.002)
    assert np.array_equal(measure(run, bridging).trials["peaks"], base.trials["peaks"])
