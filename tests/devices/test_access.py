"""The limit of a force that device kernels share."""

from math import hypot, inf, nan

import pytest

from netboard.participants.body.device_forces import within


@pytest.mark.parametrize("limit", [3.3, 0.0, 1e-300, 1e308, inf])
def test_force_is_scaled_down_to_its_limit(limit: float) -> None:
    force = within(limit, 1.0, -2.0, 2.0)
    assert hypot(*force) == pytest.approx(min(3.0, limit))
    assert force == pytest.approx(tuple(min(1.0, limit / 3.0) * part for part in (1.0, -2.0, 2.0)))


@pytest.mark.parametrize("limit", [nan, -1.0, -inf])
@pytest.mark.parametrize("force", [(1.0, 0.0, 0.0), (0.0, 0.0, 0.0)])
def test_limit_that_is_none_gives_zero(limit: float, force: tuple[float, float, float]) -> None:
    assert within(limit, *force) == (0.0, 0.0, 0.0)


@pytest.mark.parametrize("limit", [3.3, 0.0, inf, nan])
@pytest.mark.parametrize("part", [nan, inf, -inf])
@pytest.mark.parametrize("place", range(3))
def test_force_that_is_not_finite_gives_zero(limit: float, part: float, place: int) -> None:
    force = [1.0, 1.0, 1.0]
    force[place] = part
    assert within(limit, *force) == (0.0, 0.0, 0.0)
