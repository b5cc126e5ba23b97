"""Trials whose numbers are known beforehand: the analysis finds them."""

from pathlib import Path

import numpy as np
import pytest

from netboard.benchmarks.analysis import truth
from netboard.benchmarks.analysis.truth_table import measured_block, table


@pytest.mark.slow
def test_known_trials_are_measured_as_they_are(tmp_path: Path) -> None:
    known, found = measured_block(tmp_path, 6, 1)
    part = table(known, [found])
    rows = {str(row[0]): row for row in part.rows}
    assert "6 count, 1 of them" in part.title
    for name in ("completion", "entries", "in_target", "overshoots", "overshoot", "movements of the board"):
        assert rows[name][3] == 100.0, name
    assert rows["completion"][5] == 0.0
    assert rows["peaks, none near the completion"][3] == 100.0
    for name in ("cooperative", "competitive", "single", "still", "onset of a movement", "delay at 20 % of own peaks"):
        assert float(str(rows[name][5])) < 0.01, name
    assert list(found.trials["completion_source"]).count("recording") == 1


def test_a_known_trial_does_what_it_says() -> None:
    for short in (False, True):
        one = truth.trial(np.random.default_rng(3), side=-1, short=short)
        p = one.columns["p"]
        assert p[0] == pytest.approx(truth.REACH)
        assert np.abs(p[-truth.HOLD :] + truth.REACH).max() <= truth.HALF_WIDTH
        assert p.size == round(one.values["completion"] * truth.RATE) + truth.HOLD + 1 - short
