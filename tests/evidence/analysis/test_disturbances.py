"""Disturbances of recordings: noise, quantisation, lost samples, lower rates, jitter and offsets."""

import pickle

import numpy as np
import pytest
from numpy.typing import NDArray

from evidence.analysis.disturbances import (
    BALL,
    DISTURBANCES,
    HANDS,
    RATES,
    TILT,
    downsampled,
    jitter,
    lost,
    noise,
    offset,
    quantised,
)
from netboard.analysis.extraction.trials import RATE

COUNT = 200_000


@pytest.fixture
def columns() -> dict[str, NDArray[np.float64]]:
    generator = np.random.default_rng(7)
    return {name: np.cumsum(generator.normal(0, 1e-5, COUNT)) for name in (*HANDS, *RATES, *BALL, *TILT)}


@pytest.fixture
def generator() -> np.random.Generator:
    return np.random.default_rng(1)


def test_noise_is_white_with_zero_mean_and_the_given_deviation(columns, generator) -> None:
    found = noise(columns, generator, names=HANDS, deviation=2e-4)
    assert set(found) == set(HANDS)
    for name in HANDS:
        added = found[name] - columns[name]
        assert added.std() == pytest.approx(2e-4, rel=0.01)
        assert abs(added.mean()) < 4 * 2e-4 / np.sqrt(COUNT)
        assert abs(np.corrcoef(added[1:], added[:-1])[0, 1]) < 0.01
    assert abs(np.corrcoef(*(found[name] - columns[name] for name in HANDS))[0, 1]) < 0.01


@pytest.mark.slow
def test_quantised_values_are_the_nearest_multiples(columns, generator) -> None:
    found = quantised(columns, generator, names=HANDS[:1], step=5.5e-5)
    assert set(found) == {HANDS[0]}
    counts = found[HANDS[0]] / 5.5e-5
    assert counts == pytest.approx(np.round(counts), abs=1e-6)
    assert np.abs(found[HANDS[0]] - columns[HANDS[0]]).max() <= 5.5e-5 / 2 * (1 + 1e-9)


@pytest.mark.parametrize(("share", "length", "width"), [(0.01, 0.0, 1), (0.01, 0.01, 10), (0.05, 0.05, 50)])
def test_samples_are_lost_in_all_columns_at_once(columns, generator, share: float, length: float, width: int) -> None:
    found = lost(columns, generator, share=share, length=length)
    gone = np.isnan(found["p"])
    assert set(found) == set(columns)
    assert gone.mean() == pytest.approx(share, rel=0.15)
    for name, values in found.items():
        assert np.array_equal(np.isnan(values), gone)
        assert np.array_equal(values[~gone], columns[name][~gone])
    edges = np.flatnonzero(np.diff(np.concatenate([[False], gone, [False]]).astype(int)))
    inner = np.diff(edges.reshape(-1, 2), axis=1).ravel()[:-1]
    assert inner.min() == width
    assert np.median(inner) == width


def test_bridged_gaps_are_linearly_interpolated(columns, generator) -> None:
    found = lost(columns, generator, share=0.01, bridged=True)["p"]
    gone = np.isnan(lost(columns, np.random.default_rng(1), share=0.01)["p"])
    alone = np.flatnonzero(gone[1:-1] & ~gone[:-2] & ~gone[2:]) + 1
    assert alone.size > 1000
    assert found[alone] == pytest.approx((columns["p"][alone - 1] + columns["p"][alone + 1]) / 2, abs=1e-15)


def test_long_gaps_are_not_bridged(columns, generator) -> None:
    found = lost(columns, generator, share=0.05, length=0.05, bridged=True)
    assert np.isnan(found["p"]).mean() == pytest.approx(0.05, rel=0.15)


@pytest.mark.parametrize(("rate", "every"), [(500, 2), (250, 4), (100, 10)])
def test_downsampling_keeps_every_nth_sample_and_interpolates_linearly(
    columns, generator, rate: float, every: int
) -> None:
    found = downsampled(columns, generator, rate=rate)
    for name, values in found.items():
        assert values.size == COUNT
        assert np.array_equal(values[::every], columns[name][::every])
        whole = values[: COUNT // every * every + 1 - every]
        assert np.abs(np.diff(whole, 2)[np.arange(whole.size - 2) % every != every - 1]).max() < 1e-15


def test_rate_that_does_not_divide_1_khz_is_refused(columns, generator) -> None:
    with pytest.raises(ValueError, match="300 Hz"):
        downsampled(columns, generator, rate=300)


@pytest.mark.slow
def test_jitter_shifts_all_columns_by_the_same_times(generator) -> None:
    ramp = {name: slope * np.arange(COUNT) / RATE for name, slope in (("p", 0.1), ("theta", -0.3))}
    found = jitter(ramp, generator, deviation=1e-3)
    inner = slice(100, -100)
    late = (found["p"] - ramp["p"])[inner] / 0.1
    assert late.std() == pytest.approx(1e-3, rel=0.01)
    assert (found["theta"] - ramp["theta"])[inner] / -0.3 == pytest.approx(late, abs=1e-9)


def test_offset_is_constant(columns, generator) -> None:
    found = offset(columns, generator, names=HANDS[:1], by=5e-3)
    assert found[HANDS[0]] - columns[HANDS[0]] == pytest.approx(5e-3)


def test_disturbances_leave_their_input_unchanged_and_can_be_pickled(columns) -> None:
    before = {name: values.copy() for name, values in columns.items()}
    for one in DISTURBANCES:
        found = pickle.loads(pickle.dumps(one)).change(columns, np.random.default_rng(3))
        assert found.keys() <= columns.keys()
        assert any(not np.array_equal(found[name], columns[name], equal_nan=True) for name in found), one
    assert all(np.array_equal(before[name], columns[name]) for name in columns)


def test_disturbances_of_zero_size_change_nothing(columns, generator) -> None:
    for found in (
        noise(columns, generator, names=BALL, deviation=0.0),
        lost(columns, generator, share=0.0),
        downsampled(columns, generator, rate=RATE),
        jitter(columns, generator, deviation=0.0),
        offset(columns, generator, names=HANDS, by=0.0),
    ):
        assert all(np.array_equal(found[name], columns[name]) for name in found)
