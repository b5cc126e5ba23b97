"""An unknown word in the configuration fails wherever it selects a computation."""

import os
import subprocess
import sys
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from netboard.base.config import Config
from netboard.base.errors import ConfigError
from netboard.base.tables.declared import EXTRAPOLATIONS, number_of, require, words_of
from netboard.base.tables.experiment import Block
from netboard.base.tables.forces import FORCES, ForceInputs
from netboard.base.tables.scene import Physics
from netboard.participants.seat.partners import partners_of, problems_of
from netboard.physics.scene.parameters import parts_of
from netboard.physics.scene.rendering import GAINS, Rendering, force_on_hand, rendering_of
from netboard.stage.stage import make_stage

NEW_CONDITION = """
from dataclasses import replace
from netboard.base.tables import forces
source = forces.__spec__.loader.get_source(forces.__name__)
kernel = 'def _made_up(hand):\\n    return -hand.coupling\\n\\n'
entry = '"made_up": ForceCondition("a", "b", "made-up force", _made_up, local=True),'
start = 'CONDITIONS: dict[str, ForceCondition] = {'
source = source.replace(start, kernel + start + entry)
exec(compile(source, forces.__file__, "exec"), forces.__dict__)
from netboard.analysis.topics.figure import _SHAPES
from netboard.analysis.topics import groups
from netboard.base.config import parse
from netboard.physics.scene.rendering import GAINS, rendering_of, force_on_hand
import numpy as np
felt = rendering_of(parse('[block]\\nforce = "made_up"').block)
hand = forces.ForceInputs(0.25, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, np.ones(1, GAINS)[0])
assert force_on_hand(hand, 1.0, felt) == -0.25
assert groups.FORCE_LABELS["made_up"] == "made-up force"
assert "made_up" in _SHAPES
"""
"""A program that adds an entry to the registry of force conditions, and finds it everywhere."""


def block(**words: Any) -> Block:
    return replace(Config().block, **words)


def test_configuration_choices_equal_the_registries() -> None:
    assert words_of(Block, "force") == FORCES
    assert words_of(Physics, "hold") == EXTRAPOLATIONS


@pytest.mark.slow
def test_new_force_condition_needs_only_one_entry(tmp_path: Path) -> None:
    environment = {**os.environ, "NUMBA_CACHE_DIR": str(tmp_path)}
    program = [sys.executable, "-c", NEW_CONDITION]
    ended = subprocess.run(program, check=False, capture_output=True, text=True, env=environment)
    assert ended.returncode == 0, ended.stderr


def test_missing_and_surplus_registry_entries_are_named() -> None:
    with pytest.raises(RuntimeError, match=r"a kernel: lacks made_up; expected exactly .* none, made_up"):
        require("a kernel", ("none",), ("none", "made_up"))
    with pytest.raises(RuntimeError, match="a table: has old; expected"):
        require("a table", ("none", "old"), ("none",))
    with pytest.raises(ConfigError, match=r'\[block\] force: found "made_up", expected one of none, full'):
        number_of("made_up", FORCES, "[block] force")


def test_unknown_force_condition_is_refused() -> None:
    with pytest.raises(ConfigError, match=r'\[block\] force: found "made_up"'):
        rendering_of(block(force="made_up"))
    with pytest.raises(ConfigError, match=r'\[block\] force: found "made_up"'):
        make_stage(replace(Config(), block=block(force="made_up")))


@pytest.mark.parametrize("key", ["model", "board", "coupling", "ball_sign", "fixed_ball"])
def test_unknown_scene_setting_is_refused(key: str) -> None:
    made_up: dict[str, Any] = {key: "made_up"}
    with pytest.raises(ConfigError, match=rf'\[physics\] {key}: found "made_up"'):
        parts_of(replace(Physics(), **made_up))


def test_unknown_extrapolation_is_refused() -> None:
    physics = replace(Physics(), hold="made_up")  # type: ignore[arg-type]
    with pytest.raises(ConfigError, match=r'\[physics\] hold: found "made_up", expected one of zoh, cv, ca'):
        make_stage(replace(Config(), physics=physics))


def test_unknown_partner_is_refused() -> None:
    config = replace(Config(), block=block(left="made_up"))
    with pytest.raises(ConfigError, match=r"no robot partner 'made_up'; it has: .*robot"):
        partners_of(config)
    (problem,) = problems_of([config, config])
    assert problem.startswith("block 1 (): this machine has no robot partner 'made_up'")


def test_unknown_condition_number_gives_nan_instead_of_zero_force() -> None:
    felt = Rendering(len(FORCES), scaled=False, left=True, right=True, catches=False)
    hand = ForceInputs(1.0, 0.01, 0.01, 0.0, 0.0, 0.0, 0.5, np.ones(1, GAINS)[0])
    assert np.isnan(force_on_hand(hand, 1.0, felt))
    known = felt._replace(force=FORCES.index("full"))
    assert force_on_hand(hand, 1.0, known) == -1.0
