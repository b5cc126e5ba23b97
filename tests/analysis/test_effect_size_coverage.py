"""Coverage of the confidence intervals of effect sizes in simulated studies whose true effect is known."""

import numpy as np
import pytest

from netboard.analysis.statistics.effect_sizes import (
    Correction,
    contrast_effect,
    hedges_factor,
    hedges_g,
    paired_effect,
)

STUDIES = 600
"""Simulated studies of each case [1]."""

ERROR = 3.0 * np.sqrt(0.95 * 0.05 / STUDIES)
"""Three Monte Carlo standard errors of a coverage of .95 [1]."""


@pytest.mark.evidence("truth", paired_effect)
@pytest.mark.parametrize("correction", ["none", "hedges"])
@pytest.mark.parametrize(("dyads", "true"), [(4, 0.0), (4, 1.5), (8, 0.8), (16, 2.0)])
def test_intervals_of_dz_and_gz_cover_the_true_effect(dyads: int, true: float, correction: Correction) -> None:
    """Times Hedges' factor, the limits for four dyads would cover a true effect of 1.5 less often."""
    drawn = np.random.default_rng(dyads).normal(true, 1.0, (STUDIES, dyads))
    found = [paired_effect(own, correction=correction) for own in drawn]
    covered = np.mean([one.low <= true <= one.high for one in found])
    assert covered == pytest.approx(0.95, abs=ERROR)
    factor = hedges_factor(dyads - 1)
    shrunk = np.mean([factor * one.low <= true <= factor * one.high for one in found])
    if dyads == 4 and true:
        assert shrunk < 0.95 - ERROR


@pytest.mark.evidence("truth", hedges_g, contrast_effect)
def test_intervals_of_g_between_groups_cover_the_true_effect() -> None:
    source = np.random.default_rng(3)
    first, second = source.normal(1.2, 1.0, (STUDIES, 3)), source.normal(0.0, 1.0, (STUDIES, 4))
    for found in (
        [hedges_g(x, y) for x, y in zip(first, second, strict=True)],
        [contrast_effect([x, y], [1.0, -1.0]) for x, y in zip(first, second, strict=True)],
    ):
        assert np.mean([one.low <= 1.2 <= one.high for one in found]) == pytest.approx(0.95, abs=ERROR)
