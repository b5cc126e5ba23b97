"""The partner's height inferred from the felt force, compared with the statics of the scene."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from netboard.base.tables.experiment import Task
from netboard.base.tables.scene import Physics
from netboard.base.tables.simulated import Participant
from netboard.participants.controller import pack_constants
from netboard.participants.partner import SIGN, haptic_weight, partner_height, partner_seen
from netboard.physics.scene.parameters import pack_scene, parts_of
from netboard.physics.scene.statics import equilibrium

PHYSICS = Physics()
KNOWN = pack_constants(Participant(), PHYSICS, Task(), ("left",))[0]
PARTS, SCENE = parts_of(PHYSICS), pack_scene(PHYSICS)[0]

height = st.floats(-0.02, 0.02)


@given(height, height, st.floats(-0.3, 0.3))
def test_equilibrium_force_determines_the_partner_height(left: float, right: float, p: float) -> None:
    rest = equilibrium(left, right, (p,), parts_of(PHYSICS), SCENE)
    assert partner_height(-rest.left, left, p, SIGN["left"], KNOWN) == pytest.approx(right, abs=2e-4)
    assert partner_height(-rest.right, right, p, SIGN["right"], KNOWN) == pytest.approx(left, abs=2e-4)


def test_ten_millimetres_of_partner_height_change_the_force_by_0_26_newtons() -> None:
    """dF/dz of the partner is 25.93 N/m."""
    lower = partner_height(-0.3, 0.0, 0.0, SIGN["left"], KNOWN)
    higher = partner_height(-0.3 - 0.2593, 0.0, 0.0, SIGN["left"], KNOWN)
    assert higher - lower == pytest.approx(0.010, rel=1e-3)


@given(height, height)
def test_tilt_determines_the_partner_height(left: float, right: float) -> None:
    theta = (right - left) / (2 * PHYSICS.l)
    assert partner_seen(left, theta, SIGN["left"], PHYSICS.l) == pytest.approx(right, abs=1e-12)
    assert partner_seen(right, theta, SIGN["right"], PHYSICS.l) == pytest.approx(left, abs=1e-12)


def test_haptic_weight_minimises_the_variance() -> None:
    """The best linear combination of a noisy delayed view and a noisy touch, found by brute force."""
    seen, drift, apart, felt = 0.002, 1.4e-4, 0.105, 0.003
    rng = np.random.default_rng(1)
    truth = rng.normal(0.0, np.sqrt(drift * apart), 200_000)
    view, touch = rng.normal(0.0, seen, truth.size), truth + rng.normal(0.0, felt, truth.size)
    weights = np.linspace(0.0, 1.0, 201)
    variances = [np.var(weight * touch + (1 - weight) * view - truth) for weight in weights]
    assert haptic_weight(seen, drift, apart, felt) == pytest.approx(weights[np.argmin(variances)], abs=0.01)


@pytest.mark.parametrize(("seen", "felt", "weight"), [(0.0, 0.0, 0.0), (0.0, 0.01, 0.0), (0.01, 0.0, 1.0)])
def test_noise_free_sense_gets_the_full_weight(seen: float, felt: float, weight: float) -> None:
    assert haptic_weight(seen, 0.0, 0.1, felt) == weight
