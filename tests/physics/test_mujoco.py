"""The Lagrangian equations, compared with MuJoCo, which derives its own from a description of the bodies.

Each scene is a board on a slide and a hinge, a ball on a slide along the board, and a coupling that is an actuator
between a site on the board and the world. Both simulations take the same Runge-Kutta steps and read the hands at the
stages, so that only the equations can differ.
"""

from collections.abc import Callable, Iterator
from typing import Any

import numpy as np
import pytest
from independent import waving
from numpy.typing import NDArray
from trajectories import Scene, drive, scene_of, trajectory

from netboard.physics.scene.models import stopped

mujoco: Any = pytest.importorskip("mujoco")

TINY = 1e-9  # MuJoCo bodies need a moment of inertia; it is taken from the board's [kg m2]


def ball_body(i: int, p: float, scene: Scene) -> str:
    """A ball as a sliding point; rolling adds armature to its joint, as long as it is not above the board.

    A fixed ball is a body without a joint that turns with the board.
    """
    k = scene.physics
    if scene.parts.free:
        joint, place, turn = f'<joint type="slide" axis="1 0 0" armature="{k.ball_inertia * k.m}"/>', 0.0, TINY
    else:
        joint, place, turn = "", p, TINY + k.ball_inertia * k.m * k.ball_height**2
    return f"""
      <body name="ball{i}" pos="{place} 0 {k.ball_height}">
        {joint}
        <inertial pos="0 0 0" mass="{k.m}" diaginertia="{turn} {turn} {turn}"/>
      </body>"""


def scene_xml(scene: Scene, p: tuple[float, ...], h: float) -> str:
    """The scene in MuJoCo's XML; x to the right, z up, tilt about -y."""
    k, record = scene.physics, scene.record
    sides = (("left", -k.l), ("right", k.l))
    joints = {
        "heave": f'<joint type="slide" axis="0 0 1" stiffness="{k.k_s}" damping="{k.b_z}"/>',
        "tilt": f'<joint type="hinge" axis="0 -1 0" damping="{k.b_theta}"/>',
    }
    moves = [joints["heave"]] * scene.parts.heaves + [joints["tilt"]] * scene.parts.tilts
    turn = k.I - k.balls * TINY
    actuators = "".join(
        f'<general site="{side}" refsite="world" gear="0 0 1 0 0 0" gaintype="fixed" gainprm="1" biastype="affine" '
        f'biasprm="0 {-record[f"k_{side}"]} {-record[f"c_{side}"]}"/>'
        for side, _ in sides
    )
    return f"""
<mujoco>
  <compiler angle="radian"/>
  <option integrator="RK4" timestep="{h}" gravity="0 0 {-k.g}">
    <flag contact="disable" constraint="disable" autoreset="disable"/>
  </option>
  <worldbody>
    <site name="world"/>
    <body name="board">
      {"".join(moves)}
      <inertial pos="0 0 0" mass="{k.M}" diaginertia="{turn} {turn} {turn}"/>
      {"".join(f'<site name="{side}" pos="{x} 0 0"/>' for side, x in sides)}
      {"".join(ball_body(i, place, scene) for i, place in enumerate(p))}
    </body>
  </worldbody>
  <actuator>{actuators}</actuator>
</mujoco>"""


@pytest.fixture
def control() -> Iterator[Callable[[Any], None]]:
    """Installs a callback for every stage and removes it afterwards."""
    yield mujoco.set_mjcb_control
    mujoco.set_mjcb_control(None)


def mujoco_trajectory(
    scene: Scene, start: tuple[float, ...], h: float, steps: int, control: Callable[[Any], None]
) -> NDArray[np.float64]:
    """States at the start and after each step, in our order."""
    model = mujoco.MjModel.from_xml_string(scene_xml(scene, start[4::2], h))
    data = mujoco.MjData(model)
    heave, tilt = [0] if scene.parts.heaves else [], [2] if scene.parts.tilts else []
    places = np.array([*heave, *tilt, *(range(4, scene.length, 2) if scene.parts.free else ())])
    state = np.array(start)
    data.qpos[:], data.qvel[:] = state[places], state[places + 1]

    def at_stage(model: Any, data: Any) -> None:
        data.ctrl[:] = drive(waving(data.time), scene.record)

    control(at_stage)
    states = np.tile(state, (steps + 1, 1))
    for i in range(steps):
        mujoco.mj_step(model, data)
        states[i + 1, places], states[i + 1, places + 1] = data.qpos, data.qvel
    return states


SCENES = {
    "one ball": {},
    "no ball": {"balls": 0},
    "two balls, damped board": {"balls": 2, "b_z": 0.3, "b_theta": 0.002},
    "a ball that rolls": {"ball_inertia": 0.4},
    "a ball above the board": {"ball_height": 0.025},
    "two balls above the board": {"balls": 2, "ball_height": 0.04},
    "hinged": {"board": "hinged", "ball_height": 0.025},
    "level": {"board": "level", "balls": 2},
    "left hand only": {"coupling": "left", "ball_inertia": 0.4},
    "fixed balls": {"free": False, "balls": 2, "ball_height": 0.05, "ball_inertia": 0.4},
    "fixed ball on a hinged board": {"free": False, "board": "hinged", "ball_height": 0.025},
    "heavy board": {"M": 0.4, "I": 0.02, "k_h": 350.0, "c_h": 1.0},
}


@pytest.mark.slow
@pytest.mark.parametrize("values", SCENES.values(), ids=SCENES.keys())
def test_lagrangian_trajectory_agrees_with_mujoco(values: dict[str, Any], control: Callable[[Any], None]) -> None:
    scene = scene_of(model="lagrangian", **values)
    tilted = 0.05 if scene.parts.tilts else 0.0
    start = (0.0, 0.0, tilted, 0.0, *(0.03, -0.1, -0.06, 0.2)[: scene.length - 4])
    if not scene.parts.free:
        start = tuple(0.0 if i in (5, 7) else value for i, value in enumerate(start))
    h, steps = 1e-3, 1200
    ours = trajectory(scene, start, waving, h, steps)
    theirs = mujoco_trajectory(scene, start, h, steps, control)
    assert np.abs(ours - theirs)[:, 0::2].max() < 1e-12
    assert np.abs(ours - theirs)[:, 1::2].max() < 1e-11


def test_impact_at_a_stop_agrees_with_the_mujoco_inertia_matrix() -> None:
    """The impulse acts between ball and board, along the board: in the first ball's slide joint alone."""
    scene = scene_of(model="lagrangian", balls=2, ball_height=0.025, ball_stop=0.3, restitution=0.7)
    state = np.array([0.01, 0.2, 0.3, -1.5, 0.31, 0.9, -0.1, 0.2])
    model = mujoco.MjModel.from_xml_string(scene_xml(scene, (0.0, 0.0), 1e-3))
    data = mujoco.MjData(model)
    data.qpos[:] = [0.01, 0.3, 0.3, -0.1]
    mujoco.mj_forward(model, data)
    response = np.zeros((1, 4))
    mujoco.mj_solveM(model, data, response, np.array([[0.0, 0.0, 1.0, 0.0]]))
    after = stopped(tuple(state.tolist()), scene.parts, scene.record)
    impulse = -1.7 * 0.9 / response[0, 2]
    assert after[1::2] == pytest.approx(state[1::2] + impulse * response[0], rel=1e-9)
    assert after[0::2] == (0.01, 0.3, 0.3, -0.1)
