"""Corrupted samples, and long runs through random scenes with their audit of energy."""

import numpy as np
import pytest

from evidence.physics.batch import LANES, in_blocks, make_batch, scene_blocks
from evidence.stability.corrupted_samples import corrupted_samples
from evidence.stability.soak import BALANCE, soak_kind
from evidence.stability.soak_audit import GROWTH, IMBALANCE, SUMS, SUPPLY, THROUGH, make_audit
from evidence.stability.soak_dyads import DYADS, HAND, KINDS, RANGE, draw_hands, draw_scene, move_hands
from netboard.base.config import Config
from netboard.base.tables.scene import Physics
from netboard.base.tick import TICK_SECONDS
from netboard.physics.scene.parameters import pack_scene, parts_of
from netboard.physics.stability.method_choice import choose


@pytest.mark.slow
def test_live_tick_survives_invalid_hand_samples() -> None:
    part = corrupted_samples(Config())
    assert part.holds, part.verdicts


@pytest.mark.slow
@pytest.mark.parametrize("name", ["paper", "lagrangian"])
@pytest.mark.sampled(1, of="quick benchmarks")
def test_short_soak_finds_no_energy_error(name: str) -> None:
    found = soak_kind(KINDS[name], 300_000, seed=5, scenes=16)
    assert found.steps >= 300_000
    assert found.within.checks + found.beyond.checks == found.steps // 100
    assert found.within.lost == 0
    assert found.within.excess < 0.0
    assert found.within.imbalance < BALANCE


@pytest.mark.slow
def test_audit_detects_spurious_energy() -> None:
    physics = Physics()
    parts, scenes = parts_of(physics), scene_blocks(np.repeat(pack_scene(physics), LANES))
    step, audit = make_batch(parts, 6, True), make_audit(parts, 6)
    before = in_blocks(np.random.default_rng(1).normal(size=(LANES, 6)) * 0.05)
    after, hands = before.copy(), np.zeros((1, 8, LANES))
    hands[:, 0], hands[:, 4] = 1.0, 2.0
    step(after, hands, scenes, TICK_SECONDS)
    sums = np.zeros((2, SUMS, LANES))
    audit(before, after, hands, scenes, sums[:1])
    audit(before, 1.05 * after, hands, scenes, sums[1:])
    honest, imbalance = sums
    assert np.all(np.abs(honest[IMBALANCE]) < 1e-2 * honest[THROUGH])
    assert np.all(honest[GROWTH] < honest[SUPPLY])
    assert np.median(np.abs(imbalance[IMBALANCE]) / imbalance[THROUGH]) > 0.1


def test_drawn_scenes_need_one_rk4_step_per_tick() -> None:
    rng = np.random.default_rng(1)
    for kind in KINDS.values():
        choice = choose(draw_scene(rng, kind), TICK_SECONDS)
        assert (choice.method, choice.substeps) == ("rk4", 1)


@pytest.mark.slow
def test_random_hands_rest_move_and_jump_within_their_range() -> None:
    scenes = scene_blocks(np.repeat(pack_scene(Physics(k_h=1.0, c_h=0.0)), DYADS))
    hand, rng = np.zeros((DYADS // LANES, HAND, LANES)), np.random.default_rng(1)
    draw_hands(rng, hand, 1.0)
    drives = np.zeros((DYADS // LANES, 8, LANES))
    heights = []
    for _ in range(200):
        move_hands(hand, 0, scenes, drives)
        heights.append(drives[:, 0].ravel().copy())
    z = np.array(heights)
    assert np.abs(z).max() <= RANGE + 0.001
    assert not drives[:, 4:].any()
    moved = np.abs(np.diff(z, axis=0))
    assert 0.02 < np.mean(moved.max(axis=0) == 0.0) < 0.5
    assert np.count_nonzero(moved > 0.0005) > 100
