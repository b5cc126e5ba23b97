"""The analysis measures synthetic trials with known values correctly."""

from pathlib import Path

import numpy as np
import pytest

from evidence.analysis import ground_truth
from evidence.analysis.ground_truth_bench import measured_block, table


@pytest.mark.slow
def test_measures_of_synthetic_trials_equal_their_known_values(tmp_path: Path) -> None:
    known, found = measured_block(tmp_path, 6, 1)
    part = table(known, [found])
    rows = {str(row[0]): row for row in part.rows}
    assert "6 included, 1 of them" in part.title
    for name in ("completion", "entries", "in_target", "overshoots", "overshoot", "movements of the board"):
        assert rows[name][3] == 100.0, name
    assert rows["completion"][5] == 0.0
    assert rows["peaks, none near the completion"][3] == 100.0
    for name in ("cooperative", "competitive", "single", "still", "onset of a movement", "delay at 20 % of own peaks"):
        assert float(str(rows[name][5])) < 0.01, name
    assert list(found.trials["completion_source"]).count("recording") == 1


def test_synthetic_trial_ends_with_the_hold_after_completion() -> None:
    for short in (False, True):
        one = ground_truth.trial(np.random.default_rng(3), side=-1, short=short)
        p = one.columns["p"]
        assert p[0] == pytest.approx(ground_truth.REACH)
        assert np.abs(p[-ground_truth.HOLD :] + ground_truth.REACH).max() <= ground_truth.HALF_WIDTH
        assert p.size == round(one.values["completion"] * ground_truth.RATE) + ground_truth.HOLD + 1 - short
