"""Packing a scene, and turning down what the live step cannot hold."""

import re
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from netboard.config import Physics
from netboard.errors import ConfigError
from netboard.physics.kernels import rk4_bare
from netboard.physics.scene import SCENE, pack_scene
from netboard.physics.stability import is_stable, rk4_factor, spectral_radius
from netboard.tick import TICK_SECONDS


def test_the_record_holds_the_configuration() -> None:
    scene = pack_scene(Physics())
    assert scene.shape == (1,)
    assert scene.dtype == SCENE
    assert scene[0].item() == (0.01, 0.05, 9.81, 200.0, 2.0, 140.0, 0.25, 0.0004, -9.81, 1.0)


def test_the_readings_of_the_paper_are_in_the_record() -> None:
    scene = pack_scene(Physics(ball_sign="printed", fixed_ball="carried"))[0]
    assert (scene["ball_gravity"], scene["fixed_load"]) == (9.81, 0.0)


def test_factor_is_the_exponential_up_to_the_fifth_order() -> None:
    x = np.array([0.1, 0.05]) * (-1 + 0.5j)
    gaps = abs(np.array([rk4_factor(value) for value in x]) - np.exp(x))
    assert np.log2(gaps[0] / gaps[1]) == pytest.approx(5, abs=0.1)


def scaled(k: float, c: float) -> Any:
    """The paper's scene with a stiffer coupling, whether or not a step of 1 ms holds it."""
    scene = pack_scene(Physics())[0].copy()
    scene["k_h"] *= k
    scene["c_h"] *= c
    return scene


# Largest stable steps of RK4 [ms], from the step's full matrix, as tabulated for scaled couplings.
LIMITS = [(1, 1, 5.57), (10, 1, 3.42), (100, 1, 1.18), (1000, 1, 0.366), (1, 10, 0.446), (1, 100, 0.0446)]


@pytest.mark.parametrize(("k", "c", "limit_ms"), LIMITS)
def test_largest_stable_step_is_the_tabulated_one(k: float, c: float, limit_ms: float) -> None:
    assert is_stable(scaled(k, c), 0.995e-3 * limit_ms)
    assert not is_stable(scaled(k, c), 1.005e-3 * limit_ms)


@pytest.mark.parametrize(("k", "c"), [(138, 1), (1, 4.4), (31, 31**0.5)])
def test_the_live_step_holds_couplings_up_to_the_tabulated_scale(k: float, c: float) -> None:
    assert is_stable(scaled(0.97 * k, 0.97 * c), TICK_SECONDS)
    assert not is_stable(scaled(1.03 * k, 1.03 * c), TICK_SECONDS)


@pytest.mark.parametrize(("k", "c"), [(1, 4.4), (138, 1)])
@pytest.mark.parametrize(("off", "held"), [(0.95, True), (1.05, False)])
def test_the_kernel_itself_is_held_below_the_limit_and_lost_above(k: float, c: float, off: float, held: bool) -> None:
    scene = scaled(off * k, off * c)
    state = (0.0, 0.0, 0.1, 0.0, 0.0, 0.0)
    for _ in range(2000):
        state = rk4_bare(*state, 0.0, 0.0, 0.0, 0.0, TICK_SECONDS, scene)
    assert (abs(state[0]) + abs(state[2]) < 1e-3) == held


def test_a_scene_that_cannot_be_held_is_turned_down_with_what_would_be() -> None:
    with pytest.raises(ConfigError) as caught:
        pack_scene(Physics(c_h=10.0))
    message = str(caught.value)
    radius = spectral_radius(scaled(1, 5), TICK_SECONDS)
    assert "physics.k_h = 200" in message
    assert "physics.c_h = 10" in message
    assert f"{radius:.3g} (spectral radius" in message
    offer = re.search(r"accepted: physics\.c_h = ([0-9.e+-]+)$", message)
    assert offer
    assert float(offer[1]) == pytest.approx(2.0 * 4.4, rel=0.03)
    pack_scene(Physics(c_h=float(offer[1])))


@pytest.mark.parametrize(
    "wrong",
    [
        {"k_h": 10_000.0, "M": 1e-3},
        {"k_h": 10_000.0, "c_h": 100.0},
        {"M": 1e-9},
        {"M": 1e-300},
        {"I": 5e-324},
        {"M": 1e-6, "k_s": 10_000.0},
    ],
)
def test_every_offer_is_accepted(wrong: dict[str, float]) -> None:
    physics = replace(Physics(), **wrong)  # type: ignore[arg-type]
    with pytest.raises(ConfigError) as caught:
        pack_scene(physics)
    offers = str(caught.value).split("accepted: ")[1].split(" or ")
    for offer in offers:
        values = {key: float(value) for key, value in re.findall(r"physics\.(\w+) = (\S+?)(?:,|$)", offer)}
        assert values
        pack_scene(replace(physics, **values))  # type: ignore[arg-type]


@pytest.mark.parametrize(
    "free", [{"k_h": 0.0}, {"c_h": 0.0}, {"k_h": 0.0, "c_h": 0.0}, {"k_h": 0.0, "c_h": 0.0, "k_s": 0.0}]
)
def test_missing_springs_and_dampers_are_no_reason_to_refuse(free: dict[str, float]) -> None:
    scene = pack_scene(replace(Physics(), **free))[0]  # type: ignore[arg-type]
    assert {name: scene[name] for name in free} == free
