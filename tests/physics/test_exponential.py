"""The exponential one-step methods: order, stiff boards, closed forms and bit-identical results."""

import json
import os
import subprocess
import sys
from pathlib import Path
from typing import Any

import numba
import numpy as np
import pytest
from exponential_bits import CASES, digests
from independent import rates as independent_rates
from independent import solution, waving
from scipy.linalg import expm
from trajectories import Scene, changed, convergence_order, drive, scene_of, trajectory

import sampling
from netboard.physics.methods.catalogue import METHODS, NUMBER
from netboard.physics.methods.exponential import etdrk4, exact_tables
from netboard.physics.methods.march import make_grid, run
from netboard.physics.methods.semilinear import remainder
from netboard.physics.scene.linear import scene_matrix

SCRIPT = Path(__file__).with_name("exponential_bits.py")
BITS = sampling.some("bits of exponential methods", CASES, 1)
KINDS: dict[str, dict[str, Any]] = {
    "both hands": {},
    "one hand, two balls, friction": {"coupling": "left", "balls": 2, "b_z": 0.3, "b_theta": 0.001},
    "hinge": {"board": "hinged"},
    "no ball": {"balls": 0},
    "no hand": {"coupling": "none"},
    "printed sign": {"ball_sign": "printed", "ball_inertia": 0.4},
    "lagrangian": {"model": "lagrangian", "ball_inertia": 0.4, "ball_height": 0.02},
    "lagrangian, one hand, two balls": {"model": "lagrangian", "coupling": "right", "balls": 2},
}
kinds = pytest.mark.parametrize("values", KINDS.values(), ids=KINDS)
both = pytest.mark.parametrize("free", [True, False], ids=["rolling", "fixed"])


def initial_state(scene: Scene) -> tuple[float, ...]:
    """A moving state near the level position."""
    board = (0.002, 0.01) if scene.parts.heaves else (0.0, 0.0)
    turn = (0.05, 0.2) if scene.parts.tilts else (0.0, 0.0)
    balls = [(0.06 - 0.15 * i, 0.03 if scene.parts.free else 0.0) for i in range((scene.length - 4) // 2)]
    return (*board, *turn, *(value for ball in balls for value in ball))


@pytest.mark.slow
@pytest.mark.parametrize(
    ("kind", "free"), [*((kind, True) for kind in KINDS), ("both hands", False), ("lagrangian", False)]
)
@pytest.mark.parametrize("method", ["etd2rk", "etdrk4"])
@pytest.mark.sampled(2)
def test_exponential_methods_converge_with_their_nominal_order(method: str, kind: str, free: bool) -> None:
    scene = scene_of(free, **KINDS[kind])
    start = initial_state(scene)
    end = solution(start, waving, np.array([0.0, 0.04]), scene.physics, free)[-1]
    errors = [
        float(np.max(np.abs(trajectory(scene, start, waving, 0.04 / n, n, method)[-1] - end)[::2]))
        for n in ((80, 160, 320) if method == "etd2rk" else (20, 40, 80))
    ]
    slope, order = convergence_order(errors), METHODS[NUMBER[method]].order
    # With one hand, a transient dominates the first errors, which fall faster.
    assert order - 0.3 < slope < order + (1.5 if scene.physics.coupling in ("left", "right") else 0.4)


@kinds
@both
def test_linear_part_and_remainder_add_up_to_the_equations(free: bool, values: dict[str, Any]) -> None:
    scene, random = scene_of(free, **values), np.random.default_rng(3)
    a = scene_matrix(scene.parts, scene.record, scene.length)
    tables = (np.ascontiguousarray(a.T)[None, None], 0)
    for _ in range(20):
        x = random.normal(size=scene.length) * np.array([0.01, 0.1, 0.5, 2.0, *(0.2, 0.3) * scene.physics.balls])
        if not free:
            x[5::2] = 0.0
        if not scene.parts.heaves:
            x[:2] = 0.0
        hand = tuple(random.normal(size=4) * 0.05)
        rest = remainder(tuple(x.tolist()), *drive(hand, scene.record), tables, scene.parts, scene.record)
        assert a @ x + rest == pytest.approx(independent_rates(x, hand, scene.physics, free), rel=1e-11, abs=1e-9)


@pytest.mark.slow
@pytest.mark.parametrize("values", [{}, {"coupling": "left"}, {"model": "lagrangian", "balls": 2, "coupling": "left"}])
def test_mirrored_step_is_bit_identical(values: dict[str, Any]) -> None:
    scene = scene_of(**values)
    swapped = {"k_left": "k_right", "k_right": "k_left", "c_left": "c_right", "c_right": "c_left"}
    mirrored = changed(scene.record, **{name: float(scene.record[other]) for name, other in swapped.items()})
    signs = np.array([1.0, 1.0, *[-1.0] * (scene.length - 2)])
    x, u = np.array(initial_state(scene)), (1.3, 20.0, -300.0, 0.0, -0.4, 3.0, 50.0, 7.0)
    ends = []
    for state, hands, record in ((x, u, scene.record), (signs * x, (*u[4:], *u[:4]), mirrored)):
        tables = METHODS[NUMBER["etdrk4"]].tables(record, scene.parts, scene.length, 1e-3)[np.newaxis]
        ends.append(etdrk4(tuple(state.tolist()), 1e-3, hands, (tables, 0), scene.parts, record))
    assert ends[1] == tuple((signs * ends[0]).tolist())


def exact_level_end(scene: Scene, start: tuple[float, ...], u: Any, h: float) -> Any:
    """Height and rate after a step of a level board, by the exponential of one matrix for board, drives and weight."""
    k, mass = scene.physics, scene.physics.M
    load = 1.0 if k.fixed_ball == "loads_board" or scene.parts.free else 0.0
    if k.model == "lagrangian":
        mass += load * k.balls * k.m
    a = scene_matrix(scene.parts, scene.record, scene.length)[:2, :2]
    large = np.zeros((7, 7))
    large[:2, :2] = a
    large[1, 2], large[1, 6] = 1 / mass, -k.g * (k.M + load * k.balls * k.m) / mass
    large[2, 3], large[3, 4], large[4, 5] = 1.0, 1.0, 1.0  # the sum of the drives and its derivatives
    both = np.add(u[:4], u[4:]) * [1.0, 1.0, 2.0, 6.0]
    return (expm(h * large) @ [*start[:2], *both, 1.0])[:2]


@pytest.mark.slow
@both
@pytest.mark.parametrize("model", ["paper", "lagrangian"])
@pytest.mark.parametrize("coupling", ["both", "left", "none"])
@pytest.mark.parametrize("h", [1e-4, 1e-3, 5e-2])
@pytest.mark.sampled(3)
def test_exact_method_solves_a_level_board_exactly(h: float, coupling: Any, model: Any, free: bool) -> None:
    scene = scene_of(free, board="level", model=model, coupling=coupling, b_z=0.2, balls=2, ball_height=0.02)
    start = (0.004, -0.1, 0.0, 0.0, 0.1, 0.3, -0.2, 0.4)
    u = np.array([1.0, 30.0, -400.0, 5e3, -0.3, 8.0, 200.0, -1e4])
    grid = make_grid("exact", np.array([h]), np.array([1]), scene.parts, scene.length, scene.packed)
    by_coefficients = run("exact", start, u[np.newaxis], grid, scene.parts, scene.packed)[1]
    times = h * np.array(METHODS[NUMBER["exact"]].nodes)
    values = [[np.polyval(side[::-1], t) for side in (u[:4], u[4:])] for t in times]
    by_values = run("exact", start, np.array([values]), grid, scene.parts, scene.packed)[1]
    expected = exact_level_end(scene, start, u, h)
    scale = 1e-12 * np.maximum(np.abs(expected), [1e-2, 1.0])
    for end in (by_coefficients, by_values):
        assert np.all(np.abs(end[:2] - expected) <= scale)
        assert tuple(end[2:4]) == (0.0, 0.0)
        assert end[4:] == pytest.approx([0.1 + h * 0.3, 0.3, -0.2 + h * 0.4, 0.4] if free else start[4:], abs=1e-15)


@pytest.mark.slow
@pytest.mark.parametrize("model", ["paper", "lagrangian"])
def test_etdrk4_is_exact_for_a_linear_scene(model: Any) -> None:
    scene = scene_of(board="level", model=model)
    start, u = (0.004, -0.1, 0.0, 0.0, 0.1, 0.3), np.array([[1.0, 30.0, -400.0, 0.0, -0.3, 8.0, 200.0, 0.0]] * 50)
    ends = []
    for method in ("etdrk4", "exact"):
        grid = make_grid(method, np.full(50, 2e-3), np.full(50, 1), scene.parts, scene.length, scene.packed)
        ends.append(run(method, start, u, grid, scene.parts, scene.packed))
    assert ends[0] == pytest.approx(ends[1], rel=1e-12, abs=1e-14)


def test_exact_tables_are_rejected_for_a_tilting_board() -> None:
    scene = scene_of()
    with pytest.raises(ValueError, match="tilts"):
        exact_tables(scene.record, scene.parts, scene.length, 1e-3)


@pytest.mark.slow
@pytest.mark.parametrize("method", ["etd2rk", "etdrk4"])
@pytest.mark.parametrize(("k", "c"), [(1000.0, 1.0), (1.0, 1000.0), (1000.0, 1000.0)])
@pytest.mark.parametrize("h", [1e-3, 1e-2, 1e-1])
@pytest.mark.sampled(4)
def test_stiff_board_stays_bounded_and_settles_at_the_hands(h: float, k: float, c: float, method: str) -> None:
    scene = scene_of(balls=0)
    packed = scene.packed.copy()
    for side in ("left", "right"):
        packed[f"k_{side}"] *= k
        packed[f"c_{side}"] *= c
    n, (left, right) = 400, drive((-0.02, 0.0, 0.02, 0.0), packed[0])
    grid = make_grid(method, np.full(n, h), np.full(n, 1), scene.parts, scene.length, packed)
    hands = np.tile([left, 0.0, 0.0, 0.0, right, 0.0, 0.0, 0.0], (n, 1))
    states = run(method, (0.01, 0.0, -0.1, 0.0), hands, grid, scene.parts, packed)
    assert np.abs(states[:, [0, 2]]).max() <= 0.2
    if h * n * k / c > 4.0:  # time enough to come to rest
        assert states[-1, 2] == pytest.approx(np.arcsin(0.02 / 0.25), rel=1e-6)


def run_script(**environment: str) -> Any:
    """The output of the script in a new process."""
    done = subprocess.run(
        [sys.executable, str(SCRIPT), *BITS], env=os.environ | environment, capture_output=True, text=True, check=True
    )
    return json.loads(done.stdout)


@pytest.mark.slow
@pytest.mark.timeout(300)
@pytest.mark.sampled(1, of="plain Python")
def test_plain_python_gives_the_same_bits() -> None:
    assert run_script(NUMBA_DISABLE_JIT="1") == digests(BITS)


@pytest.mark.skipif(bool(numba.config.DISABLE_JIT), reason="nothing is compiled")
@pytest.mark.slow
@pytest.mark.timeout(300)
@pytest.mark.sampled(1, of="processors")
def test_another_processor_gives_the_same_bits(tmp_path: Path) -> None:
    """Compile for a processor without AVX or fused multiply-add."""
    plain = {"NUMBA_CPU_NAME": "generic", "NUMBA_CPU_FEATURES": "", "NUMBA_CACHE_DIR": str(tmp_path)}
    assert run_script(**plain) == digests(BITS)
