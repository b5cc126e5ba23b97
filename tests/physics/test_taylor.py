"""The Taylor method: its coefficients, its steps, its events, its rows."""

import hashlib
import math
import os
import subprocess
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from netboard.base.errors import ConfigError
from netboard.base.tables.scene import Physics
from netboard.physics.hands.sampled import Hands
from netboard.physics.methods.taylor import first_touch, order_for
from netboard.physics.scene.series import MAX_ORDER
from netboard.physics.simulation import TOLERANCE, Steps, choose_steps, is_stably_integrated, simulate

Array = NDArray[np.float64]

COLD = (0.0, 0.0, 0.0, 0.0, -0.03, 0.0)
FIRST_TOUCH: Any = getattr(first_touch, "py_func", first_touch)
"""In plain Python: the tests of single series compile nothing."""


def waved(t: Array, size: float = 0.02) -> Hands:
    angle = 2 * np.pi * 0.8 * t
    z, vz = size * np.sin(angle), size * 2 * np.pi * 0.8 * np.cos(angle)
    return Hands(t, np.stack([-z, z], 1), np.stack([-vz, vz], 1))


def still(duration: float) -> Hands:
    return Hands(np.array([0.0, duration]), np.zeros((2, 2)), np.zeros((2, 2)))


# --- coefficients ------------------------------------------------------------------------------------------------


def test_series_of_every_kind_of_scene_equals_its_equations_of_motion() -> None:
    """In plain Python, where a new kind of scene costs no compilation."""
    script = Path(__file__).with_name("series_scenes.py")
    environment = {**os.environ, "NUMBA_DISABLE_JIT": "1"}
    found = subprocess.run(
        [sys.executable, script], check=False, env=environment, capture_output=True, text=True, timeout=120
    )
    assert found.returncode == 0, found.stderr
    lines = found.stdout.splitlines()
    assert len(lines) > 40
    for line in lines:
        name, first, all_orders = line.rsplit(" ", 2)
        assert float(first) < 1e-14, f"{name}: coefficients of order 1 against the rates"
        assert float(all_orders) < 1e-12, f"{name}: the sum of the series against dop853"


# --- orders and steps --------------------------------------------------------------------------------------------


def test_order_follows_from_the_tolerance() -> None:
    orders = [order_for(10.0**-i) for i in range(17)]
    assert orders == sorted(orders)
    assert orders[0] == 5
    assert orders[9] == 8  # those that are written out
    assert orders[10] == 13
    assert orders[16] == 20  # Jorba and Zou
    assert order_for(1e-300) == MAX_ORDER


@pytest.mark.parametrize("c_h", [2.0, 100.0])
def test_automatic_choice_agrees_with_dop853_in_short_steps(c_h: float) -> None:
    hands, physics = waved(np.arange(101) / 1000), Physics(c_h=c_h)
    motion = simulate(hands, physics, COLD)
    assert motion.steps.method == "taylor"
    assert is_stably_integrated(motion, physics)
    exact = simulate(hands, physics, COLD, steps=Steps("dop853", 0.1 / motion.steps.fastest, 1, motion.steps.fastest))
    assert motion.count <= exact.count / 5
    assert np.abs(motion.states - exact.states).max() < 100 * TOLERANCE


def test_rows_are_the_same_however_many_there_are() -> None:
    """Values of a series within a step, and states at ends of steps."""
    hands = waved(np.arange(31) / 300)
    few, many = (simulate(hands, Physics(), COLD, dt=dt) for dt in (0.01, 0.0005))
    np.testing.assert_array_equal(few.states, many.states[::20])
    assert few.count == many.count
    fine = simulate(hands, Physics(), COLD, dt=0.0005, steps=choose_steps(Physics(), substeps=4))
    np.testing.assert_allclose(many.states, fine.states, rtol=0, atol=1e-11)


def test_a_long_interval_is_divided_by_the_tolerance() -> None:
    motion = simulate(still(1.0), Physics(), COLD, hold="zoh", dt=0.1)
    assert 50 < motion.count < 500
    assert 0.002 < motion.longest < 0.02
    fine = simulate(still(1.0), Physics(), COLD, hold="zoh", dt=0.1, steps=choose_steps(Physics(), substeps=200))
    np.testing.assert_allclose(motion.states, fine.states, rtol=0, atol=1e-11)


# --- events ------------------------------------------------------------------------------------------------------

LEVEL = Physics(board="level", ball_stop=0.1, restitution=0.5)


def test_a_ball_is_reflected_at_the_time_of_its_touch() -> None:
    """On a level board, whose balls keep their speed between touches: 0.4, 0.2, 0.1 m/s."""
    motion = simulate(still(3.0), LEVEL, (*COLD[:4], 0.0, 0.4), dt=0.05)
    touches = np.array([0.0, 0.25, 0.25 + 1.0, 0.25 + 1.0 + 2.0])
    speeds = np.array([0.4, -0.2, 0.1])
    leg = np.searchsorted(touches, motion.t, side="right") - 1
    begins = np.array([0.0, 0.1, -0.1])
    for row in np.flatnonzero(~np.isin(motion.t, touches)):
        expected = begins[leg[row]] + speeds[leg[row]] * (motion.t[row] - touches[leg[row]])
        assert motion.states[row, 4] == pytest.approx(expected, abs=1e-12)
        assert motion.states[row, 5] == pytest.approx(speeds[leg[row]], abs=1e-14)


def test_a_ball_rests_on_its_stop() -> None:
    """Infinitely many touches in finite time end in a ball that leans on its stop."""
    physics = Physics(ball_stop=0.05, restitution=0.3)
    tilted = Hands(np.array([0.0, 1.0]), np.array([[0.01, -0.01]] * 2), np.zeros((2, 2)))
    motion = simulate(tilted, physics, (*COLD[:4], 0.0, 0.0), dt=0.01)
    assert np.all(motion.states[:, 4] <= 0.05 * (1 + 1e-12))
    assert motion.states[-1, 4] == pytest.approx(0.05, abs=1e-7)
    assert motion.count < 20_000


@pytest.mark.parametrize("depth", [1e-6, 1e-9, 1e-12])
def test_the_slightest_touch_is_found_and_a_near_miss_is_none(depth: float) -> None:
    """p = stop + depth - (t - 0.01)^2, whose peak is at 0.01 s."""
    stop, h = 0.1, 0.02
    for sign in (1.0, -1.0):
        table = sign * np.array([stop + depth - 1e-4, 0.02, -1.0, 0.0])
        touch = FIRST_TOUCH(table, 0, 3, h, stop, sign, 1e-15)
        assert touch == pytest.approx(0.01 - math.sqrt(depth), abs=1e-9)
        missed = sign * np.array([stop - depth - 1e-4, 0.02, -1.0, 0.0])
        assert FIRST_TOUCH(missed, 0, 3, h, stop, sign, 1e-15) == math.inf


def test_a_ball_that_leaves_its_stop_does_not_touch_it() -> None:
    table = np.array([0.1, -0.3, 0.5, 0.0])
    assert FIRST_TOUCH(table, 0, 3, 0.1, 0.1, 1.0, 1e-15) == math.inf


# --- bits --------------------------------------------------------------------------------------------------------


def digest() -> str:
    """Return a digest of a run with a stiff coupling, from irregular rows and steps of all kinds."""
    motion = simulate(waved(np.arange(6) / 500), Physics(c_h=60.0), COLD, hold="ca", dt=0.0007)
    assert motion.count > 40
    return hashlib.sha256(motion.states.tobytes()).hexdigest()


def test_compiled_steps_equal_plain_python_to_the_bit() -> None:
    plain = "import test_taylor; import sys; sys.stdout.write(test_taylor.digest())"
    environment = {**os.environ, "NUMBA_DISABLE_JIT": "1", "PYTHONPATH": str(Path(__file__).parent)}
    command = [sys.executable, "-c", plain]
    found = subprocess.run(command, check=False, env=environment, capture_output=True, text=True, timeout=120)
    assert found.returncode == 0, found.stderr
    assert found.stdout == digest()


# --- failures ----------------------------------------------------------------------------------------------------


def test_a_state_that_overflows_is_refused_in_words() -> None:
    with pytest.raises(ConfigError, match=r"the state is not finite from t = .* with taylor"):
        simulate(still(0.01), Physics(), (1e300, 0.0, 1e300, 1e300, 0.0, 1e300))
