"""Scenes for the kernels and trajectories through them."""

from itertools import pairwise
from typing import Any, NamedTuple

import numpy as np
from independent import Hands
from numpy.typing import NDArray

from netboard.base.tables.scene import Physics
from netboard.physics.hands.extrapolation import between
from netboard.physics.methods.catalogue import METHODS, NUMBER
from netboard.physics.methods.march import make_grid, run
from netboard.physics.scene.parameters import Parts, pack_scene, parts_of, state_length


class Scene(NamedTuple):
    """A scene in the form that the kernels take."""

    physics: Physics
    parts: Parts
    packed: NDArray[Any]
    length: int

    @property
    def record(self) -> Any:
        """The single packed record."""
        return self.packed[0]


def scene_of(free: bool = True, **values: Any) -> Scene:
    """The paper's scene with other values."""
    physics = Physics(**values)
    return Scene(physics, parts_of(physics, free), pack_scene(physics), state_length(physics))


def changed(record: Any, **values: float) -> Any:
    """A copy of a record with other values."""
    other = record.copy()
    for name, value in values.items():
        other[name] = value
    return other


def drive(hand: tuple[float, float, float, float], record: Any) -> tuple[float, float]:
    """The drives of two hands."""
    left_z, left_vz, right_z, right_vz = hand
    return (
        float(record["k_left"]) * left_z + float(record["c_left"]) * left_vz,
        float(record["k_right"]) * right_z + float(record["c_right"]) * right_vz,
    )


def trajectory(
    scene: Scene, start: tuple[float, ...], hands: Hands, h: float, steps: int, method: str = "rk4"
) -> NDArray[np.float64]:
    """States at the start and after each step; the method reads the hands at its nodes."""
    nodes = METHODS[NUMBER[method]].nodes
    table = [[drive(hands((i + node) * h), scene.record) for node in nodes] for i in range(steps)]
    grid = make_grid(method, np.full(steps, h), np.ones(steps, np.int64), scene.parts, scene.length, scene.packed)
    return run(method, tuple(float(value) for value in start), np.array(table), grid, scene.parts, scene.packed)


def sampled_trajectory(
    scene: Scene, start: tuple[float, ...], hands: Hands, h: float, steps: int, method: str = "dop853", counts: int = 1
) -> NDArray[np.float64]:
    """Like `trajectory`, with hands that follow a cubic between their samples at the ends of the steps."""
    record, ends = scene.record, [hands(i * h) for i in range(steps + 1)]
    table = []
    for now, then in pairwise(ends):
        left = between(now[0], now[1], then[0], then[1], h, float(record["k_left"]), float(record["c_left"]))
        right = between(now[2], now[3], then[2], then[3], h, float(record["k_right"]), float(record["c_right"]))
        table.append((*left, *right))
    grid = make_grid(method, np.full(steps, h), np.full(steps, counts), scene.parts, scene.length, scene.packed)
    return run(method, tuple(float(value) for value in start), np.array(table), grid, scene.parts, scene.packed)


def samples(hands: Hands, times: NDArray[np.float64]) -> NDArray[np.float64]:
    """The styluses at these times."""
    return np.array([hands(float(t)) for t in times])


def convergence_order(values: list[float]) -> float:
    """Order of convergence of errors, each at half the step of the one before."""
    return float(-np.polyfit(np.arange(len(values)), np.log2(values), 1)[0])
