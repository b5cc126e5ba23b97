"""The quality of recordings, counted by hand, and a known clock drift."""

import numpy as np
import pytest

from made_modern import modern_blocks, modern_study
from made_study import Block, made_study, times
from netboard.analysis.topics.quality import picture, quality


def test_attempts_of_a_block_are_counted_by_outcome() -> None:
    attempts = [
        *times(2.0, 8.0),
        {"outcome": "fell"},
        {"outcome": "timed_out"},
        {"completion": 4.0, "flags": "lost_samples"},
    ]
    study = made_study([Block("D01", "D01", "dyadic", "full", attempts), Block("D01", "D01", "dyadic", "none", [])])
    found = quality(study)
    first, second = found.blocks.to_dict("records")
    expected = {"attempts": 5, "success": 3, "fell": 1, "timed_out": 1, "counts": 2, "excluded": 1, "missing": 0}
    assert {name: first[name] for name in expected} == expected
    assert first["time"] == pytest.approx(4.0)
    assert {second[name] for name in expected} == {0}
    assert np.isnan(second["time"])
    assert sum(found.reasons.values()) == 1
    rows = {(row.quantity, row.group): row.value for row in found.results}
    assert rows["attempts", "all"] == 5
    assert rows["attempts that fell", "dyadic, haptics on"] == 1
    assert rows["attempts excluded", next(iter(found.reasons))] == 1


def test_drift_is_estimated_within_performers_and_conditions() -> None:
    """Times grow by a tenth per block, besides differences between performers and conditions."""
    plan = [("A", "full"), ("B", "none"), ("A", "none"), ("B", "full")] * 3
    blocks = [
        Block("D01", f"D01{who}", "bimanual", force, times(*[3.0 * 1.1**number * (2.0 if who == "A" else 1.0)] * 2))
        for number, (who, force) in enumerate(plan)
    ]
    found = quality(made_study(blocks))
    assert found.drift.value == pytest.approx(1.1)
    assert found.dyads == ("D01",)
    assert np.isnan(found.drift.low)


def test_single_block_per_condition_gives_no_drift() -> None:
    study = made_study([Block("D01", "D01", "dyadic", force, times(3.0, 4.0)) for force in ("full", "none")])
    assert np.isnan(quality(study).drift.value)
    (row,) = [row for row in quality(study).results if row.quantity.startswith("drift")]
    assert row.n == 0
    assert row.note


def test_drift_interval_covers_1_without_a_drift() -> None:
    blocks = [block for seed in range(3) for block in modern_blocks(seed=seed, dyads=6)]
    found = quality(modern_study(blocks))
    assert found.drift.n == 6
    assert found.drift.low <= 1.0 <= found.drift.high


def test_figure_of_many_dyads_labels_some_of_them() -> None:
    blocks = [Block(f"D{n:02}", f"D{n:02}", "dyadic", "full", times(3.0)) for n in range(1, 62)]
    labels = [label.get_text() for label in picture(made_study(blocks)).shown.axes[0].get_yticklabels()]
    assert labels == [f"D{n:02}" for n in range(1, 62, 3)]
