"""A trainee whose speed a network sets is the learned partner, to the bit: what is trained is what plays."""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from netboard.base.compiled import kernel
from netboard.base.config import Config
from netboard.base.errors import ConfigError
from netboard.base.tables.simulated import Participant
from netboard.participants.batch.agents import block_of
from netboard.participants.batch.scenes import Scenes
from netboard.participants.batch.spaces import SceneOptions
from netboard.participants.robots.learned import INPUTS, PERIOD, read_weights
from netboard.participants.robots.network import TrainedNetwork, pack_network, run, units_of
from netboard.participants.seat import block as rehearsed

pytest.importorskip("stable_baselines3")  # its kernels take a minute to compile: only where partners are trained

SEED, STEPS = 4, 60


@kernel
def _one(weights: Any, units: Any, inputs: Any) -> float:
    for j in range(inputs.shape[1]):
        units[0]["units_0"][j] = inputs[0, j]
    return float(run(weights[0], units[0]))


def played(scenes: Scenes, network: TrainedNetwork) -> Any:
    """Let a network play the one scene; return the rows."""
    scenes.reset(np.arange(1), [SEED])
    weights, units = pack_network(network), np.zeros(1, units_of(network.sizes))
    inputs = np.zeros((1, len(INPUTS)))
    for _ in range(STEPS):
        scenes.observe(0, inputs)
        scenes.act(0, np.array([[_one(weights, units, inputs)]]))
        scenes.step()
    scenes.finish(0)
    return scenes.finished.pop().rows


def test_trainee_gets_the_bits_of_the_learned_partner(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(rehearsed, "START_TICK", 0)
    network, _ = read_weights("learned")
    person, config = Participant(lateral_sd=0.0, forearm=2.0), Config()
    block = replace(config.block, seed=SEED, number=1, trials=1, first_target="left", right="learned")
    config = replace(config, block=block, participant=person)
    expected = next(rehearsed.Rehearsal(config, {"A": person, "B": person}).pieces(PERIOD * STEPS))
    made, agents = block_of(config, "right", "person")
    scenes = Scenes(made, agents, 1, SceneOptions(learned_hand=True, ticks=PERIOD, record=True))
    scenes.policy.initial = lambda seed: type(scenes.policy).initial(scenes.policy, (SEED, 1))
    rows = played(scenes, network)[: len(expected)]
    for name in rows.dtype.names:
        if name not in ("left_x", "left_y", "right_x", "right_y"):
            assert rows[name].tobytes() == expected[name][: len(rows)].tobytes(), name
    assert np.ptp(rows["right_sent_z"]) > 0.001, "the network moves its hand"


@pytest.mark.parametrize(("seat", "ticks", "word"), [("both", PERIOD, "more than one hand"), ("left", 10, "ticks")])
def test_learned_hand_is_one_hand_in_steps_of_its_period(seat: str, ticks: int, word: str) -> None:
    made, agents = block_of(Config(), seat, "still")
    with pytest.raises(ConfigError, match=word):
        Scenes(made, agents, 1, SceneOptions(learned_hand=True, ticks=ticks))
