"""Environments: the libraries' own checkers, resets of vectors, seeds, images, rewards and recordings."""

import warnings
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from typer.testing import CliRunner

gymnasium = pytest.importorskip("gymnasium", reason="needs netboard[environments]")
pettingzoo_test = pytest.importorskip("pettingzoo.test", reason="needs netboard[environments]")

from gymnasium.utils.env_checker import check_env  # noqa: E402
from gymnasium.vector import AutoresetMode  # noqa: E402
from pettingzoo.utils.conversions import parallel_to_aec  # noqa: E402

from netboard.base.config import Config  # noqa: E402
from netboard.base.errors import ConfigError  # noqa: E402
from netboard.participants.batch.spaces import SceneOptions  # noqa: E402
from netboard.participants.environments.parallel import BoardParallelEnv  # noqa: E402
from netboard.participants.environments.registration import BOARD  # noqa: E402
from netboard.participants.environments.single import BoardEnv  # noqa: E402
from netboard.participants.environments.vector import BoardVectorEnv  # noqa: E402
from netboard.recording.files.offline_writer import BlockWriter  # noqa: E402
from netboard.services.cli import app  # noqa: E402

pytestmark = pytest.mark.slow

PLAIN = replace(Config(), block=replace(Config().block, force="none"))
SHORT: dict[str, Any] = {"config": PLAIN, "seat": "both", "max_seconds": 0.05}


def test_gymnasium_finds_the_environment_and_its_vector_form() -> None:
    one = gymnasium.make(f"netboard:{BOARD}", config=PLAIN, seat="both")
    assert isinstance(one.unwrapped, BoardEnv)
    many = gymnasium.make_vec(f"netboard:{BOARD}", num_envs=3, config=PLAIN, seat="both")
    assert isinstance(many.unwrapped, BoardVectorEnv)
    assert many.num_envs == 3


def test_checker_of_gymnasium_accepts_the_environment() -> None:
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        check_env(gymnasium.make(BOARD, config=PLAIN, seat="both", render_mode="rgb_array").unwrapped)


def test_checkers_of_pettingzoo_accept_the_environment() -> None:
    def make(**keys: Any) -> BoardParallelEnv:
        return BoardParallelEnv(config=PLAIN, **keys)

    pettingzoo_test.parallel_api_test(make(), num_cycles=300)
    pettingzoo_test.parallel_seed_test(make)
    pettingzoo_test.max_cycles_test(
        SimpleNamespace(parallel_env=make, env=lambda **keys: parallel_to_aec(make(**keys)))
    )
    from pettingzoo.test.render_test import collect_render_results

    images = collect_render_results(parallel_to_aec(make(render_mode="rgb_array")))
    assert all(image.shape == (640, 480, 3) and image.dtype == np.uint8 for image in images)


def actions_of(environment: Any, steps: int) -> np.ndarray:
    return np.random.default_rng(0).uniform(-0.5, 0.5, (steps, *environment.action_space.shape)).astype(np.float32)


def test_vector_has_the_results_of_single_environments() -> None:
    many = BoardVectorEnv(5, autoreset_mode="Disabled", **SHORT | {"max_seconds": 1.0})
    observed, _ = many.reset(seed=3)
    actions = actions_of(many, 20)
    ones = [BoardEnv(**SHORT | {"max_seconds": 1.0}) for _ in range(5)]
    for place, one in enumerate(ones):
        assert one.reset(seed=3 + place)[0].tobytes() == observed[place].tobytes()
    for action in actions:
        results = many.step(action)
        for place, one in enumerate(ones):
            seen, reward, terminated, truncated, _ = one.step(action[place])
            assert seen.tobytes() == results[0][place].tobytes()
            assert (reward, terminated, truncated) == tuple(result[place] for result in results[1:4])


def test_next_step_mode_resets_in_the_step_after_the_end() -> None:
    many = BoardVectorEnv(3, **SHORT)
    assert many.metadata["autoreset_mode"] == AutoresetMode.NEXT_STEP
    first, _ = many.reset(seed=1)
    for action in actions_of(many, 5):
        *_, truncated, infos = many.step(action)
    assert truncated.all()
    assert not infos["success"].any()
    assert infos["_success"].all()
    assert infos["seconds"] == pytest.approx(0.05)
    observed, reward, terminated, truncated, infos = many.step(many.action_space.sample())
    assert observed.tobytes() == first.tobytes(), "before the first view, all episodes look alike"
    assert not reward.any()
    assert not (terminated | truncated).any()
    assert infos == {}
    assert many.scenes.seconds.tolist() == [0.0] * 3


def test_same_step_mode_returns_the_next_episode_and_the_last_observation() -> None:
    many, ones = BoardVectorEnv(2, autoreset_mode=AutoresetMode.SAME_STEP, **SHORT), BoardEnv(**SHORT)
    first, _ = many.reset(seed=1)
    ones.reset(seed=1)
    for action in actions_of(many, 5):
        observed, _, _, truncated, infos = many.step(action)
        last = ones.step(action[0])[0]
    assert truncated.all()
    assert observed.tobytes() == first.tobytes()
    assert infos["_final_obs"].all()
    assert infos["final_obs"][0].tobytes() == last.tobytes()
    assert infos["final_info"]["seconds"] == pytest.approx(0.05)


def test_disabled_mode_wants_the_ended_boards_to_be_reset() -> None:
    many = BoardVectorEnv(3, autoreset_mode="Disabled", **SHORT)
    many.reset(seed=1)
    for action in actions_of(many, 5):
        many.step(action)
    with pytest.raises(RuntimeError, match="reset_mask"):
        many.step(many.action_space.sample())
    for wrong in ([True] * 3, np.zeros(3, bool), np.ones(2, bool)):
        with pytest.raises(ValueError, match="reset_mask"):
            many.reset(options={"reset_mask": wrong})
    many.reset(options={"reset_mask": np.ones(3, bool)})
    many.step(many.action_space.sample())
    many.reset(options={"reset_mask": np.array([False, True, False])})
    assert many.scenes.seconds == pytest.approx([0.01, 0.0, 0.01])


def test_arrays_are_copied_unless_asked_otherwise() -> None:
    for copy in (True, False):
        many = BoardVectorEnv(2, copy=copy, **SHORT)
        many.reset(seed=1)
        one, *_ = many.step(actions_of(many, 1)[0])
        other, *_ = many.step(actions_of(many, 1)[0])
        assert (one is not other) == copy


def test_seeds_determine_the_episodes() -> None:
    def play(seed: Any) -> bytes:
        many = BoardVectorEnv(4, config=PLAIN, other="person")
        many.reset(seed=seed)
        return b"".join(many.step(action)[0].tobytes() for action in actions_of(many, 60))

    assert play(5) == play(5) == play([5, 6, 7, 8])
    assert play(5) != play(6)
    with pytest.raises(ValueError, match="seed"):
        play([1, 2])


def test_images_show_the_view_of_the_seat_and_close_twice() -> None:
    many = BoardVectorEnv(2, render_mode="rgb_array", config=PLAIN, seat="both")
    many.reset(seed=1)
    empty = many.render()
    for action in actions_of(many, 4):
        many.step(action)
    images = many.render()
    assert len(images) == 2
    assert all(image.shape == (320, 480, 3) and image.dtype == np.uint8 for image in images)
    assert len(np.unique(empty[0].reshape(-1, 3), axis=0)) == 1, "nothing is seen before the first view"
    assert len(np.unique(images[0].reshape(-1, 3), axis=0)) > 20
    many.close()
    many.close()
    assert BoardVectorEnv(1, **SHORT).render() is None
    with pytest.raises(ValueError, match="render_mode"):
        BoardEnv(render_mode="ansi")


def test_truth_is_seen_only_if_it_is_declared() -> None:
    blind, seeing = SceneOptions(), SceneOptions(truth=True)
    assert len(seeing.observed(1)) == len(blind.observed(1)) + 10
    assert not [one.name for one in blind.observed(2) if "true" in one.name or "left" in one.name]


def test_environment_before_its_reset_and_with_two_agents_is_refused() -> None:
    for environment in (BoardEnv(**SHORT), BoardVectorEnv(2, **SHORT)):
        with pytest.raises(RuntimeError, match="reset"):
            environment.step(environment.action_space.sample())
    wrong = BoardEnv(**SHORT)
    wrong.reset()
    with pytest.raises(ValueError, match="found nan"):
        wrong.step(np.array([0.0, np.nan]))
    with pytest.raises(ValueError, match="two agents"):
        BoardEnv(seat="each")
    with pytest.raises(ConfigError, match="robot partner"):
        BoardEnv(other="nobody at all")


def balance(observed: np.ndarray) -> np.ndarray:
    """Tilt the board with both hands by what is observed of the true state: a competent policy."""
    z, _, theta, omega, p, vp = (observed[:, -10:] * (0.05, 0.5, 0.2, 2.0, 0.35, 0.5, 1, 1, 1, 1)).T[:6]
    released, target = observed[:, 0] == 0.0, observed[:, 6] * 0.1
    wanted = np.where(released, np.clip((2.0 * (p - target) + 2.5 * vp) / 9.81, -0.06, 0.06), 0.0)
    turn, lift = 0.3 * (wanted + 0.5 * (wanted - theta) - 0.02 * omega), -0.5 * z
    return np.clip(np.stack([lift - turn, lift + turn], axis=1) / 0.075, -1.0, 1.0)


def returns_of(policy: Callable[[np.ndarray], np.ndarray]) -> tuple[np.ndarray, np.ndarray]:
    """Return the sum of the rewards and the success of an episode on each of 16 boards."""
    many = BoardVectorEnv(16, autoreset_mode="Disabled", seat="both", truth=True, config=PLAIN)
    observed, _ = many.reset(seed=0)
    total, alive, success = np.zeros(16), np.ones(16, bool), np.zeros(16, bool)
    while alive.any():
        observed, reward, terminated, truncated, infos = many.step(policy(observed))
        total += np.where(alive, reward, 0.0)
        over = terminated | truncated
        if over.any():
            success |= infos["success"] & alive
            alive &= ~over
            many.reset(options={"reset_mask": over})
    return total, success


def test_reward_prefers_competence_to_a_ball_that_is_never_released_and_that_to_dropping_it() -> None:
    def level_then_drop(observed: np.ndarray) -> np.ndarray:
        steady, away = balance(np.where(np.arange(observed.shape[1]) == 0, 1.0, observed)), np.array([[-1.0, 1.0]])
        towards = np.sign(observed[:, 6])[:, None]
        return np.where(observed[:, [0]] == 0.0, away * -towards, steady)

    competent, succeeded = returns_of(balance)
    idle, none = returns_of(lambda observed: np.zeros((16, 2)))
    dropped, fell = returns_of(level_then_drop)
    assert succeeded.all()
    assert not none.any()
    assert not fell.any()
    unreleased, never = returns_of(lambda observed: np.tile([-1.0, 1.0], (16, 1)))
    assert not never.any()
    assert competent.min() > 3.0 > -2.0 > unreleased.max()
    assert unreleased.min() > -3.5 > dropped.max()
    assert dropped.max() <= idle.min() + 0.02, "a fall costs the same whenever it happens, within a step"


def test_episode_written_as_a_recording_verifies(tmp_path: Path) -> None:
    many = BoardVectorEnv(2, seat="both", truth=True, record=True, config=PLAIN)
    observed, _ = many.reset(seed=2)
    while len(many.scenes.finished) < 2:
        observed, *_ = many.step(balance(observed))
    for number, (config, rows) in enumerate(many.scenes.finished):
        writer = BlockWriter(tmp_path, config, f"{number:08x}{0:024x}", 0)
        writer.take(rows)
        writer.finish()
        result = CliRunner().invoke(app, ["check", "--verify", str(writer.path)])
        assert result.exit_code == 0, result.output
        assert "identical to the bit" in result.output
