"""The simulated distant dyad agrees with the eigenvalue analysis, with and without the remedies for delay."""

from dataclasses import replace

import numpy as np
import pytest

from evidence.coupling.boundary import AGREED, Case, predicted, scene, simulated_is_stable
from evidence.coupling.distant_dyad import DistantDyad
from evidence.coupling.remedies import everyday_part, make_loop, move_and_release, rendered
from netboard.base.config import Config
from netboard.base.tables.simulated import VirtualDevice

pytestmark = pytest.mark.slow

BARE = VirtualDevice(friction=0.0)


@pytest.mark.parametrize(
    "case",
    [
        Case("bare stylus", "server", "fixed", 2),
        Case("light finger", "server", "fixed", 5),
        Case("bare stylus", "both", "board", 10),
        Case("hand", "both", "board", 10),
    ],
    ids=str,
)
@pytest.mark.sampled(1, of="quick benchmarks")
def test_simulated_service_is_stable_below_the_predicted_stiffness(case: Case) -> None:
    stiffness, mode = predicted(case)
    assert simulated_is_stable(case, stiffness * (1.0 - AGREED), mode)
    assert not simulated_is_stable(case, stiffness * (1.0 + AGREED), mode)


def test_released_stylus_at_20_ms_is_stable_only_with_a_remedy() -> None:
    assert not move_and_release(make_loop("server alone", BARE, 20)).quiet
    for remedy in ("with passivity control", "both"):
        assert move_and_release(make_loop(remedy, BARE, 20)).quiet


def test_local_coupling_renders_full_stiffness_at_20_ms() -> None:
    stiffness, damping = rendered("both", 20, 2.0)
    assert stiffness == pytest.approx(200.0, rel=0.02)
    assert damping == pytest.approx(2.0, rel=0.05)


def test_passivity_control_restores_damping_lost_to_delay() -> None:
    _, alone = rendered("server alone", 5, 2.0)
    assert alone == pytest.approx(2.0 - 200.0 * 0.010, abs=0.1)
    _, helped = rendered("with passivity control", 5, 2.0)
    assert helped == pytest.approx(2.0, abs=0.3)


def test_both_coupling_modes_are_equal_without_delay() -> None:
    found = []
    for at in ("server", "both"):
        dyad = DistantDyad(Config(physics=scene(at, "board"), virtual=replace(BARE, resolution=0.0)), 0)  # type: ignore[arg-type]
        dyad.settle()
        dyad.place(0.001, -0.0005)
        dyad.run(300)
        found.append(np.array(dyad.heights))
    np.testing.assert_allclose(found[0], found[1], atol=1e-12)


def test_passivity_control_costs_little_without_delay() -> None:
    part = everyday_part((0,), lambda text, share: None)
    assert part.holds
