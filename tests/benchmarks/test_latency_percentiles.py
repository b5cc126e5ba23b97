"""Percentiles, ratios and histograms of durations."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra import numpy as arrays

from netboard.benchmarks.loop.timing import (
    EDGES_NS,
    HEADS,
    MAX_NS,
    MIN_NS,
    draw_histograms,
    histogram,
    histogram_part,
    ratio_row,
    spread_rows,
)

DURATIONS = arrays.arrays(np.int64, st.integers(0, 50), elements=st.integers(-(2**40), 2**40))


def test_percentiles_are_in_milliseconds() -> None:
    ((name, count, *found),) = spread_rows({"loop": np.arange(1, 1001) * 1000})
    assert (name, count, len(found)) == ("loop", 1000, len(HEADS))
    assert found == pytest.approx([0.5005, 0.99001, 0.999001, 1.0])


def test_empty_durations_have_no_percentiles() -> None:
    ((_, count, *found),) = spread_rows({"loop": np.empty(0, np.int64)})
    assert count == 0
    assert all(isinstance(value, float) and math.isnan(value) for value in found)


def test_ratios_are_of_equal_percentiles() -> None:
    below = np.arange(1, 1001) * 1000
    assert ratio_row("ratio", 3 * below, below) == ("ratio", *[pytest.approx(3.0)] * 4)


def test_ratio_to_zero_is_nan() -> None:
    _, *found = ratio_row("ratio", np.array([5]), np.array([0]))
    assert all(isinstance(value, float) and math.isnan(value) for value in found)


@given(DURATIONS)
def test_histogram_counts_every_duration_once(times: np.ndarray) -> None:
    assert histogram(times).sum() == times.size


def test_durations_fall_into_their_bins() -> None:
    middle = np.sqrt(EDGES_NS[:-1] * EDGES_NS[1:]).astype(np.int64)
    assert histogram(middle).tolist() == [1] * (len(EDGES_NS) - 1)
    ends = histogram(np.array([-5, 0, MIN_NS, MAX_NS, 100 * MAX_NS]))
    assert (ends[0], ends[-1], ends.sum()) == (3, 2, 5)


def test_empty_bins_are_left_out() -> None:
    part = histogram_part({"loop": np.array([51_000, 52_000]), "echo": np.array([2_000_000])})
    assert len(part.rows) == 2
    assert [row[2:] for row in part.rows] == [(2, 0), (0, 1)]
    for low, high, *_ in part.rows:
        assert isinstance(low, float)
        assert isinstance(high, float)
        assert low < high


def test_histograms_have_logarithmic_axes() -> None:
    pytest.importorskip("matplotlib")
    loops = {"loop": np.arange(1, 1001) * 1000, "nothing": np.empty(0, np.int64)}
    figure = draw_histograms([loops, {"timer": np.array([5_000])}], "title")
    for ax, names in zip(figure.axes, (["loop", "nothing"], ["timer"]), strict=True):
        assert ax.get_xscale() == ax.get_yscale() == "log"
        assert [text.get_text() for text in ax.get_legend().get_texts()] == names
