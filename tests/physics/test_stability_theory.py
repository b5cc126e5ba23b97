"""The stability theory, compared with the kernels and the full equations."""

import math
from collections.abc import Iterator
from itertools import product
from typing import Any

import numpy as np
import pytest
from independent import rates, waving
from numpy.typing import NDArray
from scipy.integrate._ivp import dop853_coefficients
from trajectories import Scene, scene_of, trajectory

from netboard.physics.scene.linear import board_matrix, scene_matrix
from netboard.physics.stability.step_matrix import (
    POLYNOMIALS,
    is_stable,
    largest_step,
    solved_matrix,
    spectral_radius,
    step_matrix,
    stiffness,
    tilted_matrix,
)

EXPLICIT = ("euler", "semi_implicit", "heun", "rk4", "dop853")
CLASSICAL = (*EXPLICIT, "verlet", "midpoint")
EXPONENTIAL = ("etd2rk", "etdrk4")
TILT = math.radians(35)


def theory_matrix(scene: Scene, tilt: float = 0.0, p: float = 0.0) -> NDArray[np.float64]:
    """The theory's matrix of a scene."""
    return tilted_matrix(scene.parts, scene.record, scene.physics.balls, tilt, p)


def exact_part(scene: Scene, h: float) -> NDArray[np.float64]:
    """The part of the board's matrix that an exponential method solves exactly."""
    return solved_matrix(scene.parts, scene.record, scene.physics.balls, h)


def resting_state(scene: Scene, tilt: float, p: float = 0.0) -> tuple[tuple[float, ...], Any]:
    """State of a scene without gravity at rest at a tilt, and the hands that keep it there."""
    z = scene.physics.l * math.sin(tilt)
    return (0.0, 0.0, tilt, 0.0, *(p, 0.0) * scene.physics.balls), lambda t: (-z, 0.0, z, 0.0)


def jacobian(function: Any, x: tuple[float, ...], size: float = 1e-6) -> NDArray[np.float64]:
    """Jacobian of a function with respect to the board's state, by central differences."""
    columns = []
    for i in range(4):
        up, down = np.array(x), np.array(x)
        up[i] += size
        down[i] -= size
        columns.append((np.asarray(function(tuple(up))) - np.asarray(function(tuple(down))))[:4] / (2 * size))
    return np.array(columns).T


def weightless_scenes(**values: Any) -> Iterator[Scene]:
    """Scenes without gravity, in both models, with free and fixed balls."""
    for model in ("paper", "lagrangian"):
        for free in (True, False):
            yield scene_of(free=free, model=model, g=0.0, **values)


VARIANTS: tuple[dict[str, Any], ...] = (
    {},
    {"coupling": "left", "balls": 2, "b_z": 0.3, "b_theta": 0.002},
    {"board": "hinged", "ball_inertia": 0.4},
    {"balls": 0},
)


@pytest.mark.parametrize("values", [*VARIANTS, {"board": "level"}], ids=str)
def test_level_board_matrix_equals_the_linear_scene_matrix(values: dict[str, Any]) -> None:
    for scene in weightless_scenes(**values):
        bare = tilted_matrix(scene.parts, scene.record)
        assert bare == pytest.approx(board_matrix(scene.parts, scene.record), rel=1e-12, abs=1e-12)
        loaded = scene_matrix(scene.parts, scene.record, scene.length)[:4, :4]
        assert theory_matrix(scene) == pytest.approx(loaded, rel=1e-12, abs=1e-12)


@pytest.mark.parametrize("values", VARIANTS, ids=str)
@pytest.mark.parametrize(("tilt", "p"), [(0.0, 0.0), (TILT, 0.0), (-0.3, 0.2)])
def test_tilted_board_matrix_is_the_jacobian_of_the_equations(values: dict[str, Any], tilt: float, p: float) -> None:
    for scene in weightless_scenes(**values):
        x, hands = resting_state(scene, tilt, p)
        derivative = jacobian(lambda y, s=scene, u=hands: rates(np.array(y), u(0.0), s.physics, s.parts.free), x)
        first = 0 if scene.parts.heaves else 2
        assert theory_matrix(scene, tilt, p)[first:] == pytest.approx(derivative[first:], rel=1e-6, abs=1e-3)


@pytest.mark.slow
@pytest.mark.parametrize("method", [*CLASSICAL, *EXPONENTIAL])
@pytest.mark.sampled(3)
def test_step_matrix_is_the_jacobian_of_the_compiled_step(method: str) -> None:
    for scene, tilt in product(weightless_scenes(c_h=6.0), (0.0, TILT)):
        x, hands = resting_state(scene, tilt)
        for h in (2e-4, 2e-3):
            found = jacobian(lambda y, s=scene, u=hands, t=h: trajectory(s, y, u, t, 1, method)[-1], x)
            theory = step_matrix(method, theory_matrix(scene, tilt), h, exact_part(scene, h))
            # Velocities are hundreds of times larger than positions.
            unit = np.array([500.0, 1.0, 500.0, 1.0])
            assert found * unit[:, None] / unit == pytest.approx(theory * unit[:, None] / unit, rel=1e-6, abs=1e-6)


@pytest.mark.slow
def test_step_matrix_is_the_jacobian_of_the_exact_step() -> None:
    for scene in weightless_scenes(board="level", c_h=6.0):
        x, hands = resting_state(scene, 0.0)
        found = jacobian(lambda y, s=scene, u=hands: trajectory(s, y, u, 2e-3, 1, "exact")[-1], x)
        unit = np.array([500.0, 1.0, 500.0, 1.0])
        theory = step_matrix("exact", theory_matrix(scene), 2e-3)
        assert found[:2, :2] == pytest.approx(theory[:2, :2], rel=1e-6, abs=1e-6 * unit[0])


def test_dop853_stability_polynomial_follows_from_its_coefficients() -> None:
    a, b = dop853_coefficients.A[:12, :12], dop853_coefficients.B
    power, found = np.ones(12), [1.0]
    for _ in range(12):
        found.append(float(b @ power))
        power = a @ power
    assert POLYNOMIALS["dop853"] == pytest.approx(found, rel=1e-9)


def test_unknown_method_is_rejected_by_name() -> None:
    with pytest.raises(ValueError, match="'magic'"):
        step_matrix("magic", np.zeros((4, 4)), 1e-3)


def scaled(stiffer: float = 1.0, more_damped: float = 1.0, **values: Any) -> Scene:
    """The paper's scene with other couplings."""
    return scene_of(k_h=200.0 * stiffer, c_h=2.0 * more_damped, **values)


# By scalings of k_h and c_h: Euler, semi-implicit, Heun, Verlet, RK4, DOP853.
LIMITS = {
    (1, 1): (4.00, 2.81, 4.00, 8.00, 5.57, 12.8),
    (10, 1): (0.966, 1.72, 2.32, 2.53, 3.42, 8.53),
    (100, 1): (0.0997, 0.706, 0.460, 0.800, 1.18, 2.52),
    (1000, 1): (0.0100, 0.243, 0.0926, 0.253, 0.366, 0.781),
    (1, 10): (0.320, 0.320, 0.320, 8.00, 0.446, 1.03),
    (1, 100): (0.0320, 0.0320, 0.0320, 8.00, 0.0446, 0.102),
    (1, 1000): (0.00320, 0.00320, 0.00320, 8.00, 0.00446, 0.0102),
    (1000, 1000): (0.00320, 0.00320, 0.00320, 0.253, 0.00446, 0.0102),
}


@pytest.mark.slow
@pytest.mark.parametrize("scales", LIMITS, ids=str)
def test_largest_stable_step_of_each_method(scales: tuple[float, float]) -> None:
    a = theory_matrix(scaled(*scales))
    methods = ("euler", "semi_implicit", "heun", "verlet", "rk4", "dop853")
    assert [largest_step(method, a) * 1e3 for method in methods] == pytest.approx(LIMITS[scales], rel=6e-3)
    assert largest_step("midpoint", a) == math.inf


def test_verlet_step_is_limited_by_stiffness_and_not_by_damping() -> None:
    """The limit is two over the fastest frequency: here that of the tilt, sqrt(2 k l2 / I) = 250 /s."""
    for damping in (0.0, 1.0, 1e3):
        assert largest_step("verlet", theory_matrix(scaled(1, damping))) == pytest.approx(2 / 250, rel=1e-6)


def test_stability_limits_of_rk4_at_a_one_millisecond_tick() -> None:
    """RK4 is stable with a hundredfold stiffness but not with a fivefold damping."""
    for stiffer, damped, stable in ((135, 1, True), (142, 1, False), (1, 4.3, True), (1, 4.6, False)):
        assert is_stable("rk4", theory_matrix(scaled(stiffer, damped)), 1e-3) == stable


@pytest.mark.parametrize("stiffer", [1.0, 1000.0])
@pytest.mark.parametrize("coupling", ["both", "left"])
def test_spectral_radius_of_each_method_without_damping(stiffer: float, coupling: str) -> None:
    a = theory_matrix(scaled(stiffer, 0.0, coupling=coupling))
    for method in ("midpoint", "exact", "etd2rk", "etdrk4"):
        assert spectral_radius(method, a, 1e-3) == pytest.approx(1.0, abs=1e-12)
    for method in ("verlet", "semi_implicit"):
        assert spectral_radius(method, a, 0.5 / stiffness(a, 1.0)) == pytest.approx(1.0, abs=1e-12)
    assert spectral_radius("euler", a, 1e-3) > 1.01
    assert spectral_radius("heun", a, 1e-3) > 1 + 1e-6
    assert largest_step("euler", a) == 0.0


UNRESTRAINED: tuple[dict[str, Any], ...] = (
    {"coupling": "none"},
    {"coupling": "none", "k_s": 0.0},
    {"k_h": 0.0, "c_h": 0.0},
)


@pytest.mark.parametrize(
    ("method", "values"),
    [
        (method, values)
        for method, values in product([*CLASSICAL, *EXPONENTIAL, "exact"], UNRESTRAINED)
        # Euler and Heun amplify the undamped oscillation on the board's own spring.
        if method not in ("euler", "heun") or "k_s" in values
    ],
)
def test_board_without_restoring_forces_has_spectral_radius_one(method: str, values: dict[str, Any]) -> None:
    a = theory_matrix(scene_of(**values))
    assert spectral_radius(method, a, 1e-3) == pytest.approx(1.0, abs=1e-12)


def test_free_rotation_about_one_hand_has_spectral_radius_one() -> None:
    """The board turns freely about the coupled point; a defective double pole at 0 must not lose half its digits."""
    for values in ({"c_h": 0.0}, {"c_h": 2.0}, {"k_h": 1e4, "c_h": 100.0}):
        a = theory_matrix(scene_of(coupling="left", k_s=0.0, **values))
        for method in ("midpoint", "exact", "etd2rk", "etdrk4", "rk4"):
            assert spectral_radius(method, a, 2e-5) == pytest.approx(1.0, abs=1e-12)


def test_overflow_counts_as_unstable() -> None:
    a = theory_matrix(scaled(1e200, 1e200))
    assert not is_stable("rk4", a, 1e-3)
    assert spectral_radius("dop853", a, 1e3) == math.inf


@pytest.mark.parametrize("method", EXPONENTIAL)
@pytest.mark.parametrize("scales", [(1, 1), (10, 3), (100, 10), (1000, 1), (1, 1000), (1000, 1000)], ids=str)
def test_exponential_methods_are_stable_for_a_tilted_board_in_the_paper_model(
    method: str, scales: tuple[float, float]
) -> None:
    """They solve the level board exactly; the change due to the tilt is soft enough at every step."""
    scene = scaled(*scales)
    for tilt in np.radians([20, 35]):
        for h in np.geomspace(1e-5, 1.0, 21):
            assert is_stable(method, theory_matrix(scene, tilt), float(h), exact_part(scene, float(h)))


def test_undamped_tilted_board_grows_slowly_with_etdrk4() -> None:
    """The growth is too slow to be visible within an hour, but it exists."""
    scene = scaled(1, 0)
    factor = spectral_radius("etdrk4", theory_matrix(scene, TILT), 1e-3, theory_matrix(scene))
    assert 1 + 1e-10 < factor < 1 + 1e-7


def step_halving_difference(scene: Scene, method: str, h: float, steps: int) -> float:
    """Largest difference between steps of h and h / 2, with hands that tilt the board by 5 degrees [m]."""
    start = (0.0,) * 4
    coarse = trajectory(scene, start, waving, h, steps, method)
    fine = trajectory(scene, start, waving, h / 2, 2 * steps, method)[::2]
    with np.errstate(all="ignore"):
        apart = np.abs(coarse - fine)[steps // 2 :, [0, 2]] * [1.0, scene.physics.l]
    return float(np.max(np.nan_to_num(apart, nan=math.inf)))


@pytest.mark.slow
@pytest.mark.parametrize("method", [*EXPLICIT, "verlet"])
@pytest.mark.parametrize("scales", [(1, 1), (10, 1), (100, 1), (1, 10)], ids=str)
@pytest.mark.sampled(4)
def test_full_equations_become_unstable_at_the_predicted_step(method: str, scales: tuple[float, float]) -> None:
    """To within 4 %, although the board swings."""
    scene = scaled(*scales, balls=0)
    limit = largest_step(method, theory_matrix(scene))
    growth = math.log(spectral_radius(method, theory_matrix(scene), 1.04 * limit))
    steps = max(math.ceil(math.log(1e10) / growth), 500)
    assert step_halving_difference(scene, method, 0.97 * limit, steps) < 1e-3
    assert step_halving_difference(scene, method, 1.04 * limit, steps) > 3e-3
