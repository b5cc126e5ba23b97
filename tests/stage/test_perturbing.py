"""Perturbations: a known force in some trials, at its place, for its time, and to the bit again."""

import json
import os
import subprocess
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from netboard.base.config import parse
from netboard.base.errors import ConfigError
from netboard.base.tables.perturbations import Perturbation
from netboard.base.tick import TICK
from netboard.stage.perturbing import NOWHERE, begins_perturbation, pack_perturbing, perturbation_of, perturbing_of

SHORT: dict[str, Any] = {"time": 0.05, "duration": 0.04, "trials": [1]}
CASES: dict[str, dict[str, Any]] = {
    "none": {"table": {}},
    "ball": {"table": {"at": "ball", "force": 0.05, **SHORT}},
    "opposite": {"table": {"at": "ball", "force": 0.05, **SHORT, "opposite": [1]}},
    "place": {"table": {"at": "ball", "force": 0.05, **SHORT, "onset": "ball", "position": -0.1}, "lift": 0.02},
    "other trial": {"table": {"at": "ball", "force": 0.05, **SHORT, "trials": [2]}},
    "board": {"table": {"at": "board", "force": 2.0, **SHORT, "duration": 0.3}},
    "stylus": {"table": {"at": "left", "force": 1.5, **SHORT}},
    "plain lagrangian": {"table": {}, "lagrangian": True},
    "lagrangian": {"table": {"at": "ball", "force": 0.05, **SHORT}, "lagrangian": True},
}


@pytest.fixture(scope="module")
def blocks() -> dict[str, Any]:
    """The rows of each case, computed without compiling a block for each."""
    script = Path(__file__).with_name("perturbed_blocks.py")
    done = subprocess.run(
        [sys.executable, str(script)],
        input=json.dumps(CASES),
        capture_output=True,
        text=True,
        check=True,
        env=os.environ | {"NUMBA_DISABLE_JIT": "1"},
    )
    return {
        name: {column: np.array(values) for column, values in found.items()}
        for name, found in json.loads(done.stdout).items()
    }


def perturbed_rows(rows: dict[str, NDArray[Any]]) -> NDArray[np.int64]:
    return np.flatnonzero(rows["perturbation"])


@pytest.mark.parametrize("name", CASES)
def test_perturbed_rows_are_computed_again_to_the_bit(blocks: dict[str, Any], name: str) -> None:
    assert blocks[name]["identical"]


def test_force_lasts_as_declared_from_the_declared_time_after_the_release(blocks: dict[str, Any]) -> None:
    rows = blocks["ball"]
    at = perturbed_rows(rows)
    assert len(at) == 40
    assert np.all(np.diff(at) == 1)
    assert rows["run_ticks"][at[0]] == 50
    assert rows["perturbation"][at].tolist() == [0.05] * 40
    assert rows["perturbed_ticks"][at].tolist() == list(range(40))


def test_force_begins_where_the_ball_is_declared_to_be(blocks: dict[str, Any]) -> None:
    rows = blocks["place"]
    first = perturbed_rows(rows)[0]
    assert rows["p"][first - 1] < -0.1 <= rows["p"][first]


def test_only_the_listed_trials_are_perturbed(blocks: dict[str, Any]) -> None:
    assert not perturbed_rows(blocks["none"]).size
    assert not perturbed_rows(blocks["other trial"]).size
    for column in ("p", "z", "theta", "left_force"):
        assert blocks["other trial"][column].tolist() == blocks["none"][column].tolist()


def test_impulse_changes_the_speed_of_the_ball(blocks: dict[str, Any]) -> None:
    at = perturbed_rows(blocks["ball"])
    after = at[-1] + 1
    gained = (blocks["ball"]["vp"] - blocks["none"]["vp"])[after]
    assert gained == pytest.approx(0.05 * 0.04 / parse("").physics.m, rel=0.02)
    lost = (blocks["opposite"]["vp"] - blocks["none"]["vp"])[after]
    assert lost == pytest.approx(-gained, rel=0.02)


def test_impulse_of_the_full_model_is_shared_with_a_level_board_by_its_height_only(blocks: dict[str, Any]) -> None:
    at = perturbed_rows(blocks["lagrangian"])
    gained = (blocks["lagrangian"]["vp"] - blocks["plain lagrangian"]["vp"])[at[-1] + 1]
    assert gained == pytest.approx(0.05 * 0.04 / parse("").physics.m, rel=0.05)


def test_board_yields_to_a_force_as_its_springs_say(blocks: dict[str, Any]) -> None:
    physics = parse("").physics
    at = perturbed_rows(blocks["board"])
    moved = (blocks["board"]["z"] - blocks["none"]["z"])[at[-1]]
    assert moved == pytest.approx(2.0 / (2 * physics.k_h + physics.k_s), rel=0.02)
    turned = np.abs(blocks["board"]["theta"] - blocks["none"]["theta"])[at[0] : at[0] + 20]
    assert turned.max() < 2e-4  # only the ball's weight turns it


def test_stylus_gets_the_force_in_addition(blocks: dict[str, Any]) -> None:
    at = perturbed_rows(blocks["stylus"])
    more = blocks["stylus"]["left_force"] - blocks["none"]["left_force"]
    np.testing.assert_allclose(more[at], 1.5, rtol=1e-12)
    assert not more[: at[0]].any()
    assert not more[at[-1] + 1 :].any()
    assert blocks["stylus"]["z"].tolist() == blocks["none"]["z"].tolist()


def test_event_names_place_force_and_onset() -> None:
    rows = np.zeros(3, TICK)
    rows["perturbation"], rows["perturbed_ticks"] = (0.0, -0.5, -0.5), (0, 0, 1)
    rows["run_ticks"], rows["trial"], rows["attempt"] = 120, 4, 2
    config = parse('[perturbation]\nat = "board"\nforce = 0.5\ntrials = [4]\n')
    assert begins_perturbation(rows, config).tolist() == [False, True, False]
    assert not begins_perturbation(rows, parse("")).any()
    assert perturbation_of(rows[1], config) == {
        "at": "board",
        "force": "-0.5",
        "duration": "0.1",
        "after_release": "0.12",
        "trial": "4",
        "attempt": "2",
    }


def test_block_without_perturbation_trials_has_no_perturbation() -> None:
    config = parse('[perturbation]\nat = "board"\n')
    assert perturbing_of(config).at == NOWHERE
    assert not pack_perturbing(config)["signs"].any()


def test_force_in_a_trial_has_its_sign() -> None:
    table = Perturbation(at="ball", force=0.2, trials=(2, 3), opposite=(3,))
    assert [table.force_in(trial) for trial in (1, 2, 3)] == [0.0, 0.2, -0.2]


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("trials = [1]", 'at: found "none"'),
        ('at = "ball"\nforce = 0.0', "force: found 0"),
        ('at = "ball"\ntrials = [0]', "trials: found 0"),
        ('at = "ball"\ntrials = [2]\nopposite = [3]', "opposite: found 3"),
        ('at = "left"\n[block]\nforce = "none"', "haptic feedback"),
        ('at = "left"\n[block]\nleft = "still"', "somebody holds"),
        ('at = "left"\ntrials = [2]\n[block]\ncatch = [2]', "catch trial"),
        ('at = "left"\nforce = 12.0', "max_force"),
        ('at = "left"\n[physics]\ncoupling_at = "both"', "coupling_at"),
        ('at = "board"\n[physics]\nboard = "hinged"', "heave"),
        ('at = "ball"\n[physics]\nballs = 0', "without a ball"),
        ('at = "table"', "at"),
    ],
)
def test_contradictory_perturbation_is_refused(text: str, said: str) -> None:
    with pytest.raises(ConfigError, match=r"\[perturbation\]") as found:
        parse(f"[perturbation]\n{text}\n")
    assert said in str(found.value)
