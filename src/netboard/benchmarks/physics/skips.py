"""Work that a scene does not need is skipped: the cost of a tick without it, and a check that nothing else changes.

Each simpler scene is compared with the full one in which that part exists and has no effect: a ball without mass, a
board without torque, a hand that follows the board without force. Both run with the hands of the test problem, and the
largest difference of any signal is reported.

The tick does the work of each millisecond: extrapolation of both hands with constant acceleration, one step, the forces
of both virtual couplings.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cache, partial
from math import inf
from typing import Any

import numpy as np
from numpy.typing import NDArray

from netboard.base.compiled import borrowed, inlined, kernel
from netboard.base.tables.scene import Physics
from netboard.base.tick import TICK_SECONDS
from netboard.benchmarks.harness.results import Part
from netboard.benchmarks.physics.problem import Array, Model, Problem, styluses_at
from netboard.benchmarks.physics.work_precision import in_turns
from netboard.physics.arithmetic.vectors import State, plus
from netboard.physics.hands.extrapolation import drives, moving
from netboard.physics.methods.catalogue import METHODS, NUMBER, advance
from netboard.physics.scene.models import coupling, rates
from netboard.physics.scene.parameters import Parts, pack_scene, parts_of, state_length

HUGE = 1e30
"""A moment of inertia so large that the board does not turn [kg m2]."""


@dataclass(frozen=True)
class Skip:
    """A simpler scene, and the full scene in which the omitted part has no effect.

    - `proof`: how the part has no effect in the full scene.
    - `scene`: settings that differ from the full scene.
    - `inert`: constants of the full scene with which the part has no effect [SI].
    - `limp`: whether the left and the right hand of the full scene follow the board without force.
    - `carried`: the hands of the full scene also carry the load of the hinge.
    - `still`: components of the state that are constant, and 0 at first.
    """

    name: str
    proof: str
    scene: Mapping[str, Any] = field(default_factory=dict)
    inert: Mapping[str, float] = field(default_factory=dict)
    method: str = "rk4"
    proof_method: str = "rk4"
    free: bool = True
    forces: bool = True
    limp: tuple[bool, bool] = (False, False)
    carried: bool = False
    still: tuple[int, ...] = ()
    ticks: int = 10_000


SKIPS = (
    Skip("nothing (the full scene)", "itself"),
    Skip("ball", "m = 0", {"balls": 0}, {"m": 0.0}),
    Skip(
        "ball's motion",
        "an inertia that keeps it",
        {},
        {"mass_ratio": 0.0, "ball_gravity": 0.0},
        free=False,
        still=(5,),
    ),
    Skip("tilt", "I = 1e30", {"board": "level"}, {"I": HUGE}, still=(2, 3)),
    Skip("tilt", "I = 1e30, by dop853", {"board": "level"}, {"I": HUGE}, "exact", "dop853", still=(2, 3)),
    Skip("heave", "the hands carry it", {"board": "hinged"}, carried=True, still=(0, 1)),
    Skip("right hand", "it follows the board", {"coupling": "left"}, limp=(False, True), ticks=500),
    Skip("both hands", "they follow the board", {"coupling": "none"}, limp=(True, True), ticks=200),
    Skip("forces", "the same with forces", forces=False),
)
"""Parts that a scene can omit. Without hands the board falls, so those runs are short."""


@inlined
def _hands(samples: Any, i: int, scene: Any) -> State:
    """Return the drives of both hands through a tick."""
    a = moving(samples[i, 0], samples[i, 1], samples[i, 2], scene["k_left"], scene["c_left"])
    b = moving(samples[i, 3], samples[i, 4], samples[i, 5], scene["k_right"], scene["c_right"])
    return (a[0], a[1], a[2], a[3], b[0], b[1], b[2], b[3])


@cache
def _make_loop(METHOD: int, PARTS: Parts, FORCES: bool) -> Callable[..., State]:
    @kernel
    def loop(x: State, samples: Any, tables: Any, scene: Any, forces: Any, out: Any) -> State:
        one, keep, table = scene[0], len(out) > 0, borrowed(tables)
        for i in range(len(samples)):
            if keep:
                for j in range(len(x)):
                    out[i, j] = x[j]
            hands = _hands(samples, i, one)
            if FORCES:
                forces[i, 0], forces[i, 1] = coupling(x, hands[0], hands[4], PARTS, one)
            x = advance(METHOD, x, TICK_SECONDS, hands, (table, 0), PARTS, one)
        return x

    return loop


@cache
def _make_inert(PARTS: Parts, LEFT: bool, RIGHT: bool, CARRIED: bool) -> Callable[..., None]:
    """Compile a loop of RK4 of the full scene, with hands that follow the board or carry it."""

    @inlined
    def rate_of(x: State, hands: State, node: int, t: float, scene: Any) -> State:
        left, right = drives(hands, node, t)
        by_board = coupling(x, 0.0, 0.0, PARTS, scene)
        left, right = -by_board[0] if LEFT else left, -by_board[1] if RIGHT else right
        if CARRIED:
            as_is = rates(x, left, right, PARTS, scene)[1]
            lift = rates(x, left + 0.5, right + 0.5, PARTS, scene)[1] - as_is
            carried = -as_is / lift
            return rates(x, left + 0.5 * carried, right + 0.5 * carried, PARTS, scene)
        return rates(x, left, right, PARTS, scene)

    @kernel
    def inert(x: State, samples: Any, tables: Any, scene: Any, forces: Any, out: Any) -> None:
        one, h = scene[0], TICK_SECONDS
        for i in range(len(samples)):
            for j in range(len(x)):
                out[i, j] = x[j]
            hands = _hands(samples, i, one)
            left, right = coupling(x, hands[0], hands[4], PARTS, one)
            forces[i, 0], forces[i, 1] = 0.0 if LEFT else left, 0.0 if RIGHT else right
            k1 = rate_of(x, hands, 0, 0.0, one)
            k2 = rate_of(plus(x, 0.5 * h, k1), hands, 1, 0.5 * h, one)
            k3 = rate_of(plus(x, 0.5 * h, k2), hands, 1, 0.5 * h, one)
            k4 = rate_of(plus(x, h, k3), hands, 2, h, one)
            x = plus(plus(plus(plus(x, h / 6.0, k1), h / 3.0, k2), h / 3.0, k3), h / 6.0, k4)

    return inert


def samples_of(ticks: int) -> Array:
    """Return height, velocity and acceleration of both styluses at each tick, shape (ticks, 6) [SI]."""
    times = np.arange(-1, ticks) * TICK_SECONDS
    z, vz = styluses_at(times)
    az = np.diff(vz, axis=0) / TICK_SECONDS
    return np.ascontiguousarray(np.stack([z[1:], vz[1:], az], axis=-1).reshape(ticks, 6))


def _simpler(model: Model, skip: Skip) -> Callable[[Array, Array], object]:
    """Return a function that runs the simpler scene, and writes forces and states into two arrays."""
    physics = Physics(model=model, **skip.scene)
    scene, parts = pack_scene(physics), parts_of(physics, skip.free)
    return _run(_make_loop(NUMBER[skip.method], parts, skip.forces), skip.method, skip, physics, scene, parts)


def _full(model: Model, skip: Skip) -> Callable[[Array, Array], object]:
    """Return a function that runs the full scene in which the omitted part has no effect."""
    physics = Physics(model=model)
    scene, parts = pack_scene(physics), parts_of(physics)
    for name, value in skip.inert.items():
        scene[name] = value
    if any(skip.limp) or skip.carried:
        loop: Callable[..., object] = _make_inert(parts, *skip.limp, skip.carried)
    else:
        loop = _make_loop(NUMBER[skip.proof_method], parts, True)
    return _run(loop, skip.proof_method, skip, physics, scene, parts)


def _run(
    loop: Callable[..., object], method: str, skip: Skip, physics: Physics, scene: NDArray[Any], parts: Parts
) -> Callable[[Array, Array], object]:
    """Prepare a loop over a scene, from the initial state of the test problem."""
    first = Problem(physics.model, "settled").first[: state_length(physics)]
    x = tuple(0.0 if i in skip.still else value for i, value in enumerate(first))
    tables = METHODS[NUMBER[method]].tables(scene[0], parts, len(x), TICK_SECONDS)[np.newaxis]
    return partial(loop, x, samples_of(skip.ticks), tables, scene)


def difference(model: Model, skip: Skip) -> float:
    """Return the largest difference of a position or force from the full scene without that effect [SI]."""
    length = state_length(Physics(model=model, **skip.scene))
    states, forces = np.empty((skip.ticks, length)), np.zeros((skip.ticks, 2))
    full_states, full_forces = np.empty((skip.ticks, 6)), np.zeros((skip.ticks, 2))
    _simpler(model, skip)(forces, states)
    _full(model, skip)(full_forces, full_states)
    largest = np.abs(states - full_states[:, :length])[:, ::2].max()
    return float(max(largest, np.abs(forces - full_forces).max()) if skip.forces else largest)


LEVEL, SAME = 4.0, 1e-8
"""Claimed speed-up of a board that cannot tilt; largest difference of a simpler scene from the full one [1, SI]."""


def skips_part(models: Sequence[Model], repeats: int) -> Part:
    """Measure the cost of simpler scenes, interleaved, and their difference from the full scene."""
    part = Part(
        "skips",
        "Simpler scenes: cost of a tick, and difference from the full scene in which the omitted part has no effect",
        "model | omitted | method | ns per tick | speed-up [1] | no effect by | largest difference [SI]",
    )
    level, worst = inf, 0.0
    for model in models:
        runs = [
            partial(
                _simpler(model, skip), np.empty((skip.ticks, 2)), np.empty((0, 6 if "balls" not in skip.scene else 4))
            )
            for skip in SKIPS
        ]
        differences = [difference(model, skip) for skip in SKIPS]
        times = in_turns(runs, repeats, 10.0)
        ns = [min(taken) / skip.ticks * 1e9 for taken, skip in zip(times, SKIPS, strict=True)]
        for skip, tick, largest in zip(SKIPS, ns, differences, strict=True):
            part.add(model, skip.name, skip.method, tick, ns[0] / tick, skip.proof, largest)
            worst = max(worst, largest)
            level = min(level, ns[0] / tick) if skip.method == "exact" else level
    part.claim(f"a board that cannot tilt at least {LEVEL:g} times cheaper", level >= LEVEL, f"{level:.3g} times")
    part.claim("omitting a part changes nothing else", worst <= SAME, f"at most {worst:.1e}")
    return part
