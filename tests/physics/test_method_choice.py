"""The choice of an integration method: chosen and rejected methods, and stability of the choice."""

import math
import re
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from independent import waving
from trajectories import scene_of, trajectory

from netboard.base.errors import ConfigError
from netboard.base.tables.scene import Physics
from netboard.physics.stability.method_choice import MAX_SUBSTEPS, MethodChoice, choose

H = 1e-3
METHODS = ("euler", "semi_implicit", "heun", "verlet", "midpoint", "rk4", "etd2rk", "etdrk4", "dop853")


def scaled(stiffer: float = 1.0, damped: float = 1.0, **values: Any) -> Physics:
    """The paper's scene with other couplings."""
    return Physics(k_h=200.0 * stiffer, c_h=2.0 * damped, **values)


def chosen(physics: Physics) -> tuple[str, int]:
    """The chosen method and number of substeps."""
    choice = choose(physics, H)
    return choice.method, choice.substeps


# Substeps of RK4 by scalings of k_h and c_h; 0 is one step of ETDRK4.
SUBSTEPS = {
    (1, 1): 1, (10, 1): 1, (100, 1): 3, (1000, 1): 8,
    (1, 2): 2, (1, 4): 3, (1, 10): 7, (1, 100): 0, (1, 1000): 0,
    (10, 3): 2, (100, 10): 5, (10, 10): 7, (10, 100): 0, (10, 1000): 0,
    (1000, 10): 8, (100, 100): 0, (1000, 100): 0, (100, 1000): 0, (1000, 1000): 0,
}  # fmt: skip


@pytest.mark.parametrize("scales", SUBSTEPS, ids=str)
def test_stiffness_and_damping_determine_method_and_substeps(scales: tuple[float, float]) -> None:
    substeps = SUBSTEPS[scales]
    assert chosen(scaled(*scales)) == (("rk4", substeps) if substeps else ("etdrk4", 1))


def test_paper_scene_uses_one_rk4_step_per_tick() -> None:
    """The fastest pole is rotational, 500 /s; the slowest at a tilt of 35 degrees is the other rotational one."""
    choice = choose(Physics(), H)
    assert choice == MethodChoice("rk4", 1, choice.radius, choice.stiffness, choice.reason)
    assert choice.stiffness == pytest.approx(0.5)
    assert choice.radius == pytest.approx(math.exp(-0.125), abs=1e-5)
    assert choice.reason.startswith("A tick is 0.5 of the board's shortest time constants: rk4 in 1 step")


@pytest.mark.parametrize("model", ["paper", "lagrangian"])
def test_smallest_accepted_board_under_the_heaviest_balls_has_a_stable_method(model: Any) -> None:
    choice = choose(Physics(M=1e-9, I=1e-12, l=1e-3, m=10.0, balls=4, model=model), H)
    assert choice.method == "etdrk4"
    assert choice.radius <= 1.0 + 1e-6


@pytest.mark.parametrize("model", ["paper", "lagrangian"])
@pytest.mark.parametrize("scales", [(1, 1), (1000, 1000), (1000, 0)], ids=str)
def test_level_board_uses_the_exact_method(model: Any, scales: tuple[float, float]) -> None:
    assert chosen(scaled(*scales, board="level", model=model)) == ("exact", 1)


@pytest.mark.parametrize("model", ["paper", "lagrangian"])
@pytest.mark.parametrize("board", ["free", "hinged"])
def test_board_without_restoring_forces_uses_one_rk4_step(board: Any, model: Any) -> None:
    for values in ({"coupling": "none"}, {"k_h": 0.0, "c_h": 0.0}):
        choice = choose(Physics(k_s=0.0, board=board, model=model, **values), H)
        assert (choice.method, choice.substeps, choice.radius) == ("rk4", 1, 1.0)


def test_undamped_spectral_radius_of_symplectic_methods_is_one() -> None:
    for method in ("verlet", "midpoint", "semi_implicit"):
        assert choose(scaled(1, 0, method=method), H).radius == pytest.approx(1.0, abs=1e-12)


def test_integer_stiffness_is_not_rounded_up_to_another_substep() -> None:
    """sqrt(2 k l2 / I) = 1000 /s."""
    physics = scaled(16, 0)
    assert choose(physics, 1e-3).stiffness == pytest.approx(1.0, rel=1e-12)
    assert [choose(physics, n * 1e-3).substeps for n in (1, 3, 7, 8)] == [1, 3, 7, 8]
    assert choose(scaled(16, 1), 8.1e-3).method == "etdrk4"


@pytest.mark.parametrize(
    ("physics", "expected"),
    [
        (scaled(1, 10, method="rk4"), ("rk4", 3)),
        (scaled(1, 10, method="rk4", substeps=5), ("rk4", 5)),
        (scaled(1, 10, method="euler"), ("euler", 4)),
        (scaled(1, 10, method="semi_implicit"), ("semi_implicit", 4)),
        (scaled(1, 10, method="heun"), ("heun", 4)),
        (scaled(1, 10, method="dop853"), ("dop853", 1)),
        (scaled(1, 1000, method="verlet"), ("verlet", 1)),
        (scaled(1000, 1, method="verlet"), ("verlet", 4)),
        (scaled(1000, 1000, method="midpoint"), ("midpoint", 1)),
        (scaled(1000, 1000, method="etdrk4"), ("etdrk4", 1)),
        (scaled(1, 1, method="etd2rk", substeps=3), ("etd2rk", 3)),
        (scaled(1, 1, substeps=3), ("rk4", 3)),
        (scaled(1, 10, substeps=10), ("rk4", 10)),
        (scaled(1, 10, substeps=3), ("etdrk4", 3)),
        (scaled(1, 1, substeps=3, board="level"), ("exact", 3)),
    ],
    ids=str,
)
def test_configured_method_and_substeps_are_used(physics: Physics, expected: tuple[str, int]) -> None:
    assert chosen(physics) == expected


REFUSED = [
    scaled(1, 10, method="rk4", substeps=1),
    scaled(1, 10, method="euler", substeps=1),
    scaled(1, 0, method="euler"),
    scaled(1, 0, method="heun"),
    scaled(1, 1000, method="semi_implicit"),
    scaled(1000, 1, method="verlet", substeps=2),
    scaled(1000, 1000, method="dop853"),
    scaled(100, 100, method="rk4", coupling="left", substeps=15),
    scaled(1, 10, method="rk4", substeps=1, model="lagrangian"),
    scaled(1, 1, method="euler", board="hinged", I=1e-6),
]

OFFER = re.compile(r"physics\.(\w+) = (\"?)([\w.+-]+?)\2(?=,| and |$)")


def offered_changes(message: str) -> list[dict[str, Any]]:
    """Configuration changes that an error message offers."""
    offers = message.split("; accepted: ")[1].split(", or ")
    found = []
    for offer in offers:
        keys = {key: text if quote else float(text) for key, quote, text in OFFER.findall(offer)}
        if "substeps" in keys:
            keys["substeps"] = int(keys["substeps"])
        assert keys, offer
        found.append(keys)
    return found


@pytest.mark.slow
@pytest.mark.parametrize("physics", REFUSED, ids=str)
def test_unstable_configuration_is_rejected_with_valid_alternatives(physics: Physics) -> None:
    with pytest.raises(ConfigError) as refusal:
        choose(physics, H)
    message = str(refusal.value)
    assert message.startswith(f"physics.k_h = {physics.k_h:g}, physics.c_h = {physics.c_h:g}: too stiff for a board of")
    assert f"M = {physics.M:g} kg, I = {physics.I:g} kg m2 in ticks of 1 ms" in message
    offers = offered_changes(message)
    assert {"method": "midpoint"}.items() <= {key: v for offer in offers for key, v in offer.items()}.items()
    for offer in offers:
        choose(replace(physics, **offer), H)


def test_rejection_message_in_full() -> None:
    with pytest.raises(ConfigError) as refusal:
        choose(Physics(c_h=10.0, method="rk4", substeps=1), H)
    assert str(refusal.value) == (
        "physics.k_h = 200, physics.c_h = 10: too stiff for a board of M = 0.01 kg, I = 0.0004 kg m2 in ticks of 1 ms, "
        "1 step of rk4 each: every tick would multiply its motion by 1.6 (spectral radius; at most 1 is stable); "
        'accepted: physics.substeps = 2, or physics.method = "auto" and physics.substeps = 0, '
        'or physics.method = "midpoint" and physics.substeps = 0, or physics.c_h = 8.98'
    )


@pytest.mark.parametrize(("key", "value"), [("b_z", 50.0), ("b_theta", 1.0)])
def test_rejection_names_the_damping_of_the_board_that_causes_it(key: str, value: float) -> None:
    physics = replace(Physics(method="rk4", substeps=1), **{key: value})
    with pytest.raises(ConfigError) as refusal:
        choose(physics, H)
    assert f"physics.c_h = 2, physics.{key} = {value:g}: too stiff" in str(refusal.value)
    last = offered_changes(str(refusal.value))[-1]
    assert set(last) == {key}
    choose(replace(physics, **last), H)


def test_exact_method_is_rejected_for_a_tilting_board() -> None:
    with pytest.raises(ConfigError, match=r'physics.method = "exact": for physics.board = "level" alone, found "free"'):
        choose(Physics(method="exact"), H)


def test_lagrangian_stiffness_depends_on_the_range_of_the_ball() -> None:
    """A ball at the centre adds its mass to the heave; far from it, the board responds almost as without a ball."""
    physics = scaled(model="lagrangian", I=0.04)
    far, near = (choose(replace(physics, ball_stop=stop), H).stiffness for stop in (2.0, 0.01))
    bare = choose(replace(physics, balls=0), H).stiffness
    assert far == pytest.approx(0.80 * bare, rel=0.02)
    assert near < 0.5 * bare


def largest_displacement(physics: Physics, choice: MethodChoice, seconds: float, free: bool, p: float) -> float:
    """Largest displacement of the board from rest, with hands that tilt it by 5 degrees [m]."""
    scene = scene_of(free=free, **{key: getattr(physics, key) for key in physics.__dataclass_fields__})
    start = (0.0, 0.0, 0.0, 0.0, *(p, 0.0) * physics.balls)
    steps = round(seconds / H) * choice.substeps
    states = trajectory(scene, start, waving, H / choice.substeps, steps, choice.method)
    return float(np.max(np.abs(states[:, [0, 2]]) * [1.0, physics.l])) if np.all(np.isfinite(states)) else math.inf


@pytest.mark.slow
@pytest.mark.parametrize("scales", [(1, 1), (1, 10), (100, 1), (1000, 1), (1, 100), (1000, 1000)], ids=str)
def test_chosen_method_is_stable_for_the_full_equations(scales: tuple[float, float]) -> None:
    """Hands move by 25 mm; a tilt of 0.08 is 20 mm at the control points, and the start disturbs the board."""
    physics = scaled(*scales)
    assert largest_displacement(physics, choose(physics, H), 0.4, True, -0.15) < 0.05
    assert largest_displacement(physics, choose(physics, H), 0.4, False, -0.15) < 0.05


@pytest.mark.slow
@pytest.mark.parametrize("method", METHODS)
def test_configured_method_is_stable_for_the_full_equations(method: Any) -> None:
    for scales in ((1, 1), (1, 10), (30, 1), (1, 100)):
        physics = scaled(*scales, method=method)
        try:
            choice = choose(physics, H)
        except ConfigError:
            assert scales == (1, 100)
            assert method in ("euler", "semi_implicit", "heun", "rk4", "dop853")
        else:
            assert choice.substeps <= MAX_SUBSTEPS
            assert largest_displacement(physics, choice, 0.4, False, 0.1) < 0.05


@pytest.mark.slow
@pytest.mark.parametrize("p", [0.0, -0.15, 0.3])
def test_chosen_method_is_stable_for_the_lagrangian_model_at_any_ball_position(p: float) -> None:
    stable = 0
    for scales in ((1, 1), (1, 4), (1, 10), (10, 3), (1, 12), (1, 50), (100, 100)):
        physics = scaled(*scales, model="lagrangian")
        try:
            choice = choose(physics, H)
        except ConfigError as refusal:
            physics = replace(physics, **offered_changes(str(refusal))[0])
            choice = choose(physics, H)
        stable += largest_displacement(physics, choice, 0.3, True, p) < 0.05
    assert stable == 7
