"""Scenes at reduced fidelity: one among many, close to strict ones, the same rules of a trial, and what is refused."""

import warnings
from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

gymnasium = pytest.importorskip("gymnasium", reason="needs netboard[environments]")
pettingzoo_test = pytest.importorskip("pettingzoo.test", reason="needs netboard[environments]")

from gymnasium.utils.env_checker import check_env  # noqa: E402

from netboard.base.config import Config  # noqa: E402
from netboard.base.errors import ConfigError  # noqa: E402
from netboard.participants.batch.reduced import step_length  # noqa: E402
from netboard.participants.batch.reduced_steps import OMEGA, THETA, VP  # noqa: E402
from netboard.participants.batch.spaces import TRUTH, SceneOptions  # noqa: E402
from netboard.participants.environments.parallel import BoardParallelEnv  # noqa: E402
from netboard.participants.environments.registration import BOARD  # noqa: E402
from netboard.participants.environments.single import BoardEnv  # noqa: E402
from netboard.participants.environments.vector import BoardVectorEnv  # noqa: E402
from netboard.stage.stage import MAX_TILT  # noqa: E402

PLAIN = replace(Config(), block=replace(Config().block, force="none"))
SCALES = np.array([one.scale for one in TRUTH])
VIEW = 8  # numbers of a view


def boards(fidelity: str, count: int, config: Config = PLAIN, **keys: Any) -> BoardVectorEnv:
    keys = {"seat": "both", "truth": True, "autoreset_mode": "Disabled"} | keys
    return BoardVectorEnv(count, config=config, fidelity=fidelity, **keys)


def balance(observed: np.ndarray) -> np.ndarray:
    """Tilt the board with both hands by what is observed of the true state: a competent policy."""
    z, _, theta, omega, p, vp = (observed[:, -len(TRUTH) :] * SCALES).T[:6]
    released, target = observed[:, 0] == 0.0, observed[:, 6] * 0.1
    wanted = np.where(released, np.clip((2.0 * (p - target) + 2.5 * vp) / 9.81, -0.06, 0.06), 0.0)
    turn, lift = 0.3 * (wanted + 0.5 * (wanted - theta) - 0.02 * omega), -0.5 * z
    return np.clip(np.stack([lift - turn, lift + turn], axis=1) / 0.075, -1.0, 1.0)


def drop(observed: np.ndarray) -> np.ndarray:
    """Keep the board level until the ball is released, then tip it off the board."""
    away = np.array([[1.0, -1.0]]) * np.sign(observed[:, [6]])
    return np.where(observed[:, [0]] + (observed[:, [7]] == 0.0) > 0.0, 0.0, away)


def play(fleet: BoardVectorEnv, policy: Callable[[np.ndarray], np.ndarray]) -> dict[str, np.ndarray]:
    """Play an episode on each board; return the returns, the successes and the seconds."""
    observed, _ = fleet.reset(seed=0)
    count = fleet.num_envs
    results = {name: np.zeros(count) for name in ("returns", "success", "seconds")}
    alive = np.ones(count, bool)
    while alive.any():
        observed, reward, terminated, truncated, infos = fleet.step(policy(observed))
        results["returns"] += np.where(alive, reward, 0.0)
        over = terminated | truncated
        if over.any():
            for name in ("success", "seconds"):
                results[name] = np.where(alive & over, infos[name], results[name])
            alive &= ~over
            fleet.reset(options={"reset_mask": over})
    return results


@pytest.mark.slow
@pytest.mark.parametrize("keys", [{}, {"act": ("target", "stiffness", "damping", "force"), "ticks": 7, "views": 3}])
def test_scene_among_others_has_the_bits_of_the_scene_alone(keys: dict[str, Any]) -> None:
    many = boards("reduced", 37, **keys)
    seen = [many.reset(seed=3)[0]]
    actions = np.random.default_rng(1).uniform(-0.4, 0.4, (40, *many.action_space.shape)).astype(np.float32)
    seen += [many.step(action)[0] for action in actions]
    assert np.ptp(seen[-1], axis=0).max() > 0.1, "the scenes differ"
    for place in (0, 16, 36):
        one = BoardEnv(config=PLAIN, seat="both", truth=True, fidelity="reduced", **keys)
        alone = [one.reset(seed=3 + place)[0]] + [one.step(action[place])[0] for action in actions]
        assert all(mine.tobytes() == all_[place].tobytes() for mine, all_ in zip(alone, seen, strict=True))


@pytest.mark.slow
@pytest.mark.parametrize(
    ("keys", "physics"),
    [
        ({}, {}),
        ({"act": ("target", "stiffness", "damping", "force")}, {"fixed_ball": "carried"}),
        ({"seat": "right", "other": "still", "ticks": 4}, {"model": "lagrangian", "b_p": 0.01}),
    ],
)
def test_states_and_views_are_close_to_those_of_strict_scenes(keys: dict[str, Any], physics: dict[str, Any]) -> None:
    config = replace(PLAIN, physics=replace(PLAIN.physics, **physics))
    fleets = [boards(fidelity, 24, config, **keys) for fidelity in ("strict", "reduced")]
    rng, action, apart = np.random.default_rng(2), np.zeros(fleets[0].action_space.shape), []
    first = [fleet.reset(seed=5)[0] for fleet in fleets]
    assert np.array_equal(*first)
    for _ in range(120):
        action = np.clip(0.9 * action + 0.05 * rng.standard_normal(action.shape), -1.0, 1.0)
        strict, reduced = (fleet.step(action.astype(np.float32))[0] for fleet in fleets)
        for column in (0, 1, 2, 6, 7):
            assert reduced[:, column] == pytest.approx(strict[:, column], abs=1e-6), "phase, target and age of the view"
        apart.append((reduced - strict)[:, -len(TRUTH) :] * SCALES)
    errors = np.sqrt(np.mean(np.square(apart), axis=(0, 1)))
    bounds = (1e-3, 0.02, 0.006, 0.08, 1e-9, 1e-9, 6e-4, 0.006, 6e-4, 0.006)
    assert (errors <= bounds).all(), errors
    assert np.abs(strict[:, -len(TRUTH) + 6 :] * SCALES[6:]).max() > 0.002, "a hand moves"


@pytest.mark.slow
def test_trials_end_as_strict_ones_do() -> None:
    strict, reduced = (play(boards(fidelity, 16), balance) for fidelity in ("strict", "reduced"))
    assert strict["success"].all()
    assert reduced["success"].all()
    assert reduced["seconds"] == pytest.approx(strict["seconds"], abs=0.15)
    assert reduced["returns"] == pytest.approx(strict["returns"], abs=0.05)
    strict, reduced = (play(boards(fidelity, 16), drop) for fidelity in ("strict", "reduced"))
    assert not strict["success"].any()
    assert not reduced["success"].any()
    assert reduced["seconds"] == pytest.approx(strict["seconds"], abs=0.05)
    assert reduced["returns"] == pytest.approx(strict["returns"], abs=0.02)


@pytest.mark.slow
def test_board_that_turns_over_ends_the_trial() -> None:
    fleet = boards("reduced", 2)
    fleet.reset(seed=1)
    fleet.scenes._arrays.rows[0, 2, 1] = 2.5
    observed, reward, terminated, truncated, infos = fleet.step(np.zeros((2, 2), np.float32))
    assert terminated.tolist() == [False, True]
    assert not truncated.any()
    assert not infos["success"].any()
    assert reward[1] < -5.0
    assert np.abs(observed[1, -len(TRUTH) :][:4]).max() < 0.2, "at rest, then loaded by its ball"


@pytest.mark.slow
def test_board_that_turns_over_within_a_step_ends_the_trial() -> None:
    fleet = boards("reduced", 2)
    fleet.reset(seed=1)
    rows = fleet.scenes._arrays.rows
    rows[0, THETA, 1], rows[0, OMEGA, 1] = MAX_TILT + 0.1, -30.0
    *_, terminated, _, infos = fleet.step(np.zeros((2, 2), np.float32))
    assert terminated.tolist() == [False, True]
    assert not infos["success"].any()


@pytest.mark.slow
@pytest.mark.parametrize(("row", "value"), [(OMEGA, 1e200), (VP, np.nan)])
def test_state_that_is_no_number_ends_the_trial(row: int, value: float) -> None:
    fleet = boards("reduced", 2)
    fleet.reset(seed=1)
    rows = fleet.scenes._arrays.rows
    rows[0, row, 1] = value
    _, reward, terminated, *_ = fleet.step(np.zeros((2, 2), np.float32))
    assert terminated.tolist() == [False, True]
    assert np.isfinite(reward).all()
    assert np.isfinite(rows).all()


@pytest.mark.slow
def test_checkers_of_the_libraries_accept_it() -> None:
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        made = gymnasium.make(BOARD, config=PLAIN, seat="both", fidelity="reduced", render_mode="rgb_array")
        check_env(made.unwrapped)
    keys: dict[str, Any] = {"config": PLAIN, "fidelity": "reduced"}
    pettingzoo_test.parallel_api_test(BoardParallelEnv(**keys), num_cycles=300)
    pettingzoo_test.parallel_seed_test(lambda: BoardParallelEnv(**keys))


@pytest.mark.slow
def test_images_show_the_newest_view() -> None:
    images = []
    for fidelity in ("strict", "reduced"):
        fleet = boards(fidelity, 1, render_mode="rgb_array")
        fleet.reset(seed=1)
        images.append([fleet.render()[0]])
        for _ in range(3):
            fleet.step(np.zeros((1, 2), np.float32))
        images[-1].append(fleet.render()[0])
    assert all(len(np.unique(empty.reshape(-1, 3), axis=0)) == 1 for empty, _ in images)
    assert np.abs(images[0][1].astype(int) - images[1][1]).max() <= 2, "hands that are still are where they were"


@pytest.mark.parametrize(
    ("options", "word"),
    [
        ({"fidelity": "low"}, "strict"),
        ({"fidelity": "reduced", "record": True}, "would not verify"),
        ({"fidelity": "reduced", "learned_hand": True, "ticks": 20}, "learned partner"),
    ],
)
def test_impossible_fidelities_are_refused(options: dict[str, Any], word: str) -> None:
    with pytest.raises(ConfigError, match=word):
        SceneOptions(**options)


@pytest.mark.parametrize(
    ("tables", "keys", "word"),
    [
        ({}, {"seat": "left", "other": "person"}, "nobody else moves a hand"),
        ({"block": {"force": "full"}}, {}, "no haptic feedback"),
        ({"perturbation": {"at": "ball", "trials": (1,)}}, {}, "no perturbations"),
    ],
)
def test_blocks_that_reduced_scenes_do_not_simulate_are_refused(
    tables: dict[str, dict[str, Any]], keys: dict[str, Any], word: str
) -> None:
    config = PLAIN
    for table, values in tables.items():
        config = replace(config, **{table: replace(getattr(config, table), **values)})
    with pytest.raises(ConfigError, match=word):
        boards("reduced", 1, config, **keys)


def test_integration_steps_divide_a_step_and_are_as_long_as_the_scene_permits() -> None:
    assert [step_length(PLAIN, ticks) for ticks in (1, 4, 7, 10, 12, 20)] == [1, 2, 1, 2, 2, 2]
    softer = replace(PLAIN, physics=replace(PLAIN.physics, M=0.04, I=0.0016))
    assert [step_length(softer, ticks) for ticks in (4, 10, 12)] == [4, 5, 4]
    stiffer = replace(PLAIN, physics=replace(PLAIN.physics, M=0.002, I=0.00008))
    with pytest.raises(ConfigError, match="several steps in a tick"):
        step_length(stiffer, 10)


@pytest.mark.parametrize("substeps", [0, 1])
def test_integration_steps_are_as_long_with_a_named_method(substeps: int) -> None:
    named = {"method": "rk4", "substeps": substeps}
    for constants in ({}, {"M": 0.006, "I": 0.00024}):
        physics = replace(PLAIN.physics, **constants)
        usual = step_length(replace(PLAIN, physics=physics), 10)
        assert step_length(replace(PLAIN, physics=replace(physics, **named)), 10) == usual
    with pytest.raises(ConfigError, match=r"physics\.method"):
        step_length(replace(PLAIN, physics=replace(PLAIN.physics, method="etdrk4")), 10)
