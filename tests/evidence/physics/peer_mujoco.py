"""MuJoCo (https://mujoco.org): the Lagrangian scene as an MJCF model with all unused features disabled.

The virtual couplings are actuators between a site of the board and one of the world, along the world's vertical: the
paper's spring and damper, driven by ``k z_s + c vz_s``. The equations equal netboard's Lagrangian ones, so errors can
be compared; MuJoCo cannot express the paper's equations.

MuJoCo's controls are usually set once per step: this is run and timed by its rollout, in C, with the controls as an
array. It is also run with the controls of each stage, which require a callback. Then the error is that with the
callback, while the time is that of steps in C with constant controls, a lower bound.

A step of one simulation is a chain of dependent operations in either program. `many_at_once` therefore compares steps
of many simulations as well, on one core.
"""

from collections.abc import Callable
from functools import cached_property, partial
from typing import Any

import numpy as np

from evidence.physics.batch import LANES, in_blocks, make_batch, out_of_blocks, scene_blocks
from evidence.physics.work_precision import Solution, Solver
from netboard.base.tables.scene import Physics
from netboard.base.tick import TICK_SECONDS
from netboard.benchmarks.harness.running import in_turns
from netboard.benchmarks.physics.problem import SPACING, Array, Problem, drives_at, multiples

LIBRARY = "MuJoCo"
STEPS = (0.004, 0.002, 0.001, 0.0005, 0.00025)
COARSE = (0.002, 0.0005)
HELD = ("Euler", "implicitfast", "RK4")
"""Integrators that are run with controls that are constant in each step."""

TIMED = 2000
"""Steps that are timed; each costs the same [1]."""

MANY, MANY_STEPS = 1024, 20
"""Simulations that are run at once, and their steps in one timing [1]."""

STAGES = "RK4, controls of each stage"
MIDDLE = "RK4, controls of mid-step"

_SWITCHED_OFF = (
    *("constraint", "equality", "frictionloss", "limit", "contact", "clampctrl", "warmstart", "filterparent"),
    *("refsafe", "sensor", "midphase", "eulerdamp", "autoreset", "nativeccd", "island"),
)


def scene_xml(physics: Physics, integrator: str, step: float) -> str:
    """Return the scene in MJCF."""
    flags = " ".join(f'{name}="disable"' for name in _SWITCHED_OFF)
    hands = "".join(
        f'<general site="{side}" refsite="origin" gear="0 0 1 0 0 0" gaintype="fixed" gainprm="1" '
        f'biastype="affine" biasprm="0 {-physics.k_h!r} {-physics.c_h!r}"/>'
        for side in ("left", "right")
    )
    return f"""
<mujoco>
  <option timestep="{step!r}" integrator="{integrator}" gravity="0 0 {-physics.g!r}"><flag {flags}/></option>
  <worldbody>
    <site name="origin"/>
    <body>
      <inertial pos="0 0 0" mass="{physics.M!r}" diaginertia="{physics.I!r} {physics.I!r} {physics.I!r}"/>
      <joint type="slide" axis="0 0 1" stiffness="{physics.k_s!r}"/>
      <joint type="hinge" axis="0 -1 0"/>
      <site name="left" pos="{-physics.l!r} 0 0"/>
      <site name="right" pos="{physics.l!r} 0 0"/>
      <body>
        <inertial pos="0 0 0" mass="{physics.m!r}" diaginertia="1e-14 1e-14 1e-14"/>
        <joint type="slide" axis="1 0 0"/>
      </body>
    </body>
  </worldbody>
  <actuator>{hands}</actuator>
</mujoco>"""


class Scene:
    """MuJoCo's model of a problem, for one method and step length.

    - `step`: step length [s].
    """

    def __init__(self, problem: Problem, integrator: str, step: float) -> None:
        self.problem, self.step = problem, step
        self.steps = round(problem.duration / step)
        self._xml = scene_xml(problem.physics, integrator, step)

    @cached_property
    def model(self) -> Any:
        """MuJoCo's model."""
        import mujoco

        model = mujoco.MjModel.from_xml_string(self._xml)
        if tuple(model.body_inertia[2]) != (1e-14,) * 3:
            raise RuntimeError("MuJoCo changed the ball's inertia")
        return model

    @cached_property
    def data(self) -> Any:
        """MuJoCo's data."""
        import mujoco

        mujoco.set_mju_user_warning(lambda message: None)  # a run that fails would write a file into this folder
        return mujoco.MjData(self.model)

    def _rewind(self) -> Array:
        """Reset to the initial state, and return MuJoCo's full state."""
        import mujoco

        kind = mujoco.mjtState.mjSTATE_FULLPHYSICS
        mujoco.mj_resetData(self.model, self.data)
        self.data.qpos[:], self.data.qvel[:] = self.problem.first[0::2], self.problem.first[1::2]
        self.data.ctrl[:] = drives_at(self.problem.waves, np.zeros(1))[0]
        state = np.empty(mujoco.mj_stateSize(self.model, kind))
        mujoco.mj_getState(self.model, self.data, state, kind)
        return state

    def bare(self) -> None:
        """Step in C with constant controls."""
        import mujoco

        self._rewind()
        mujoco.mj_step(self.model, self.data, nstep=TIMED)

    def bare_held(self) -> None:
        """Step in C by rollout, with an array of controls."""
        self._rollout(self._controls[:TIMED])

    @cached_property
    def _controls(self) -> Array:
        return drives_at(self.problem.waves, multiples(self.steps, self.step))

    def _rollout(self, controls: Array) -> Array:
        """Step with an array of controls, and return MuJoCo's full states."""
        from mujoco import rollout

        states: Array = rollout.rollout(self.model, self.data, self._rewind(), controls)[0][0]
        return states

    def held(self, ahead: float) -> Solution:
        """Solve with controls that are constant in each step.

        - `ahead`: time in the step at which the controls are evaluated, in step lengths [1].
        """
        times = multiples(self.steps, self.step) + ahead * self.step
        states = self._rollout(drives_at(self.problem.waves, times))
        return self._solution(np.concatenate([self._rewind()[np.newaxis], states])[:, 1:7], self.steps)

    def sampled(self) -> Solution:
        """Solve with the controls of each stage, by a callback."""
        import mujoco

        waves = self.problem.waves
        time, states = np.empty(1), np.empty((self.steps + 1, 6))

        def control(model: Any, data: Any) -> None:
            time[0] = data.time
            data.ctrl[:] = drives_at(waves, time)[0]

        states[0] = self._rewind()[1:7]
        mujoco.set_mjcb_control(control)
        try:
            for i in range(self.steps):
                self.data.time = i * self.step
                mujoco.mj_step(self.model, self.data)
                states[i + 1, :3], states[i + 1, 3:] = self.data.qpos, self.data.qvel
        finally:
            mujoco.set_mjcb_control(None)
        return self._solution(states, 3 * self.steps)

    def _solution(self, states: Array, calls: int) -> Solution:
        """Return the states at points of the grid, in netboard's order of components."""
        every, stride = max(1, round(SPACING / self.step)), max(1, round(self.step / SPACING))
        return Solution(in_our_order(states[::every]), stride, self.steps, calls)


def in_our_order(states: Array) -> Array:
    """Return states with each rate after its coordinate, from states with all rates after all coordinates."""
    return np.ascontiguousarray(states[..., [0, 3, 1, 4, 2, 5]])


def many_at_once(problem: Problem, repeats: int) -> tuple[float, float, float]:
    """Time steps of RK4 of many simulations on one core, with constant controls and balls in different places.

    - returns the time of a step in MuJoCo and in netboard [ns], and their largest difference after the last step,
      relative to the largest value of each component [1].
    """
    from mujoco import rollout

    scene = Scene(problem, "RK4", TICK_SECONDS)
    states = np.tile(scene._rewind(), (MANY, 1))
    states[:, 3] += np.linspace(-0.1, 0.1, MANY)
    drives = drives_at(problem.waves, np.zeros(1))[0]
    controls = np.tile(drives, (MANY, MANY_STEPS, 1))
    step, x = make_batch(problem.parts, 6, False), in_blocks(in_our_order(states[:, 1:7]))
    hands, scenes = np.zeros((len(x), 8, LANES)), scene_blocks(problem.scene)
    hands[:, 0], hands[:, 4] = drives

    def theirs() -> Array:
        return in_our_order(rollout.rollout(scene.model, scene.data, states, controls)[0][:, -1, 1:7])

    def ours() -> Array:
        y = x.copy()
        for _ in range(MANY_STEPS):
            step(y, hands, scenes, TICK_SECONDS)
        return out_of_blocks(y)

    found = theirs()
    apart = float((np.abs(found - ours()) / np.abs(found).max(axis=0)).max())
    their_time, our_time = (min(taken) / (MANY * MANY_STEPS) * 1e9 for taken in in_turns([theirs, ours], repeats, 10.0))
    return their_time, our_time, apart


def solvers(problem: Problem, coarse: bool) -> list[Solver]:
    """Return the solvers under comparison: none for the paper's equations."""
    if problem.model != "lagrangian":
        return []
    found: list[Solver] = []
    for step in COARSE if coarse else STEPS:
        for integrator in HELD:
            scene = Scene(problem, integrator, step)
            found.append(_solver(f"{integrator}, controls held", scene, partial(scene.held, 0.0), held=True))
        scene = Scene(problem, "RK4", step)
        found.append(_solver(MIDDLE, scene, partial(scene.held, 0.5), held=True))
        found.append(_solver(STAGES, scene, scene.sampled, held=False))
    return found


def _solver(method: str, scene: Scene, solve: Callable[[], Solution], held: bool) -> Solver:
    share = TIMED / scene.steps
    bare = scene.bare_held if held else scene.bare
    return Solver(LIBRARY, method, f"{scene.step * 1e3:g} ms", solve, bare, inputs=False, held=held, share=share)
