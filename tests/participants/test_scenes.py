"""Many scenes in one kernel: the bits of a scene alone, of a rehearsal, and of the stage that verifies a recording."""

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from netboard.base.compiled import inlined
from netboard.base.config import Config, Side
from netboard.base.errors import ConfigError
from netboard.base.tables.simulated import Participant
from netboard.participants.batch.agents import block_of
from netboard.participants.batch.scenes import Scenes
from netboard.participants.batch.spaces import RewardWeights, SceneOptions
from netboard.participants.body.device_models import resolved
from netboard.participants.body.stylus import HandMechanics
from netboard.participants.people.muscles import hand_mechanics
from netboard.participants.policy import Policy, identity_of
from netboard.participants.seat import block as rehearsed
from netboard.participants.seat import partners
from netboard.recording.integrity.verification import verify
from netboard.stage.stage import make_stage

SEED = 4


def config_of(**keys: Any) -> Config:
    config = Config()
    return replace(config, block=replace(config.block, **keys))


def scenes_of(config: Config, seat: str, other: str, count: int, **options: Any) -> Scenes:
    made, agents = block_of(config, seat, other)
    return Scenes(made, agents, count, SceneOptions(**options))


def play(scenes: Scenes, seeds: Sequence[int], actions: np.ndarray) -> np.ndarray:
    """Play all scenes; ``actions``: steps x scenes x numbers. Return the observations of the first agent."""
    scenes.reset(np.arange(scenes.count), seeds)
    hands = len(scenes.agents[0].sides)
    out = np.zeros((len(actions), scenes.count, len(scenes.options.observed(hands))), np.float32)
    for step, action in enumerate(actions):
        for agent in range(len(scenes.agents)):
            scenes.act(agent, action)
        scenes.step()
        scenes.observe(0, out[step])
    return out


def rows_of(scenes: Scenes, scene: int) -> np.ndarray:
    scenes.finish(scene)
    return scenes.finished.pop().rows


CASES = [("left", "person", "full"), ("both", "still", "none")]


@pytest.mark.slow
@pytest.mark.parametrize(("seat", "other", "force"), CASES)
@pytest.mark.parametrize("record", [True, False])
def test_scene_among_others_has_the_bits_of_the_scene_alone(seat: str, other: str, force: str, record: bool) -> None:
    config, count, chosen = config_of(force=force), 37, (0, 16, 36)
    hands = 2 if seat == "both" else 1
    actions = np.random.default_rng(1).uniform(-0.3, 0.3, (40, count, hands))
    many = scenes_of(config, seat, other, count, truth=True, record=record)
    observed = play(many, range(count), actions)
    assert np.ptp(observed[-1], axis=0).max() > 0.1, "the scenes differ"
    for scene in chosen:
        one = scenes_of(config, seat, other, 1, truth=True, record=record)
        alone = play(one, [scene], actions[:, scene : scene + 1])
        assert alone[:, 0].tobytes() == observed[:, scene].tobytes()
        if record:
            assert rows_of(one, 0).tobytes() == rows_of(many, scene).tobytes()


@pytest.mark.slow
@pytest.mark.parametrize(("seat", "other", "force"), CASES)
def test_rows_are_recorded_without_a_change_of_the_bits(seat: str, other: str, force: str) -> None:
    hands = 2 if seat == "both" else 1
    actions = np.random.default_rng(2).uniform(-1.0, 1.0, (60, 20, hands))
    kept = scenes_of(config_of(force=force), seat, other, 20, truth=True, record=True)
    plain = scenes_of(config_of(force=force), seat, other, 20, truth=True)
    assert play(kept, range(20), actions).tobytes() == play(plain, range(20), actions).tobytes()


@pytest.mark.slow
@pytest.mark.parametrize(("seat", "other", "force"), CASES)
def test_recorded_rows_verify_bit_for_bit(seat: str, other: str, force: str) -> None:
    hands = 2 if seat == "both" else 1
    scenes = scenes_of(config_of(force=force), seat, other, 3, record=True)
    play(scenes, range(3), np.random.default_rng(3).uniform(-1.0, 1.0, (100, 3, hands)))
    for scene in range(3):
        scenes.finish(scene)
        config, rows = scenes.finished.pop()
        checked = verify(make_stage(config), rows)
        assert checked.identical
        assert (checked.checked, checked.gaps) == (len(rows), 0)


STATE = np.dtype([("steps", "<i8")])


@inlined
def follow_wave(state: np.void, k: np.void, observation: np.void, actions: np.ndarray) -> None:
    """Decide every 10 ticks, as an agent does: a hand that moves in steps."""
    if (observation["tick"] + 1) % 10 == 0:
        step = (observation["tick"] + 1) // 10
        action = actions[0]
        action["target"][2] = 0.075 * (0.05 * (step % 7) - 0.1) if step > 1 else 0.0
        action["stiffness"], action["damping"] = k["stiffness"], k["damping"]


class Wave(Policy):
    kind = "wave"
    decide = staticmethod(follow_wave)
    sides: tuple[Side, ...] = ("left",)

    def __init__(self, config: Config, side: Side) -> None:
        self.constants = np.zeros(1, np.dtype([("stiffness", "<f8"), ("damping", "<f8")]))
        self.constants["stiffness"], self.constants["damping"] = 150.0, 8.0
        self._hand = hand_mechanics(config.participant, resolved(config.virtual))

    def initial(self, seed: tuple[int, ...]) -> np.ndarray:
        return np.zeros(1, STATE)

    def hand(self) -> HandMechanics:
        return self._hand

    @property
    def identity(self) -> dict[str, str]:
        return identity_of(self.kind)


@pytest.mark.slow
@pytest.mark.parametrize(("force", "delay"), [("full", 12), ("none", 0)])
def test_scene_has_the_bits_of_a_rehearsal(force: str, delay: int, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(partners.POLICIES, "wave", f"{__name__}:Wave")
    monkeypatch.setattr(rehearsed, "START_TICK", 0)
    person = Participant(lateral_sd=0.0, forearm=2.0)
    config = replace(
        config_of(force=force, force_delay_ms=delay, seed=SEED, number=1, trials=1, first_target="left"),
        participant=person,
    )
    reference = replace(config, block=replace(config.block, left="wave"))
    rehearsal = rehearsed.Rehearsal(reference, {"A": person, "B": person})
    rehearsal_rows = next(rehearsal.pieces(1500))
    scenes = scenes_of(config, "left", "person", 1, record=True)
    scenes.policy.initial = lambda seed: type(scenes.policy).initial(scenes.policy, (SEED, 1))
    steps = np.arange(150)
    actions = np.where(steps > 1, 0.05 * (steps % 7) - 0.1, 0.0)
    play(scenes, [SEED], actions[:, None, None])
    rows = rows_of(scenes, 0)[: len(rehearsal_rows)]
    for name in rows.dtype.names:
        if name not in ("left_x", "left_y", "right_x", "right_y"):
            assert rows[name].tobytes() == rehearsal_rows[name][: len(rows)].tobytes(), name
    assert np.ptp(rows["right_sent_z"]) > 0.001, "the participant moves"


@pytest.mark.parametrize(
    ("keys", "word"),
    [
        ({"act": ("jump",)}, "act"),
        ({"act": ()}, "act"),
        ({"ticks": 0}, "ticks"),
        ({"views": 0}, "views"),
        ({"max_seconds": 0.0}, "max_seconds"),
        ({"reward": RewardWeights(failure=-1.0)}, "failure -1.0"),
    ],
)
def test_impossible_options_are_refused(keys: dict[str, Any], word: str) -> None:
    with pytest.raises(ConfigError, match=word):
        SceneOptions(**keys)


@pytest.mark.parametrize(
    ("tables", "key"),
    [
        ({"virtual": {"cable_stiffness": 20000.0}}, "cable_stiffness"),
        ({"physics": {"ball_stop": 0.3}}, "ball_stop"),
        ({"block": {"force": "unrelated"}}, "force"),
        ({"physics": {"k_h": 2000.0, "c_h": 200.0}}, "etdrk4"),
    ],
)
def test_blocks_that_environments_do_not_simulate_are_refused(tables: dict[str, dict[str, Any]], key: str) -> None:
    config = Config()
    for table, keys in tables.items():
        config = replace(config, **{table: replace(getattr(config, table), **keys)})
    with pytest.raises(ConfigError, match=key):
        scenes_of(config, "left", "still", 1)


def test_unknown_seat_is_refused() -> None:
    with pytest.raises(ConfigError, match="seat"):
        block_of(Config(), "middle", "still")
