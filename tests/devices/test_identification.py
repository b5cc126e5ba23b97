"""Identification recovers the configured parameters of a virtual device, held and free."""

import numpy as np
import pytest
from simulated import SimulatedTime, configured, virtual

from netboard.base.config import Config
from netboard.base.errors import DeviceError, NetboardError
from netboard.base.tables.rig import Safety
from netboard.devices.setup import excitation
from netboard.devices.setup.excitation import Chirp
from netboard.devices.setup.identification import AxisRun, Identified, ParameterEstimate, identify
from netboard.devices.setup.loop import DeviceRun

MODELS = [
    (0.045, 0.1, 0.26),
    (0.045, 0.5, 0.0),
    (0.045, 0.3, 0.5),
    (0.1, 0.2, 0.0),
    (0.1, 0.1, 0.26),
    (0.1, 0.5, 0.5),
    (0.5, 0.5, 0.0),
    (0.5, 1.0, 0.26),
    (0.5, 2.0, 0.5),
]
"""Mass [kg], damping [N s/m], friction [N]."""


def run(config: Config, chirp: Chirp | None = None) -> DeviceRun:
    return excitation.run(virtual(config), SimulatedTime(), chirp or Chirp(), config.safety)


def within(estimate: ParameterEstimate, true: float, share: float, slack: float = 0.0) -> bool:
    return abs(estimate.value - true) <= share * true + slack


@pytest.mark.slow
@pytest.mark.parametrize(("mass", "damping", "friction"), MODELS)
def test_free_device_parameters_are_identified_within_5_percent(mass: float, damping: float, friction: float) -> None:
    result = excitation.identified(run(configured(mass=mass, damping=damping, friction=friction)), held=False)
    assert within(result.mass, mass, 0.01), result
    assert within(result.damping, damping, 0.05), result
    assert within(result.friction, friction, 0.01, 0.001), result
    assert abs(result.load.value) < 0.001
    assert result.delay.value < 2e-4
    assert result.stiffness == (0.0, 0.0)


@pytest.mark.slow
@pytest.mark.parametrize(("mass", "damping", "friction"), MODELS[::2])
def test_held_device_parameters_are_identified_within_5_percent(mass: float, damping: float, friction: float) -> None:
    config = configured(held=True, mass=mass, damping=damping, friction=friction)
    arm = config.participant
    result = excitation.identified(run(config), held=True)
    assert within(result.mass, mass + arm.arm_mass, 0.05), result
    assert within(result.damping, damping + arm.arm_damping, 0.05), result
    assert within(result.friction, friction, 0.05, 0.01), result
    assert within(result.stiffness, arm.arm_stiffness, 0.05), result


# --- variations of one run ------------------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def motion() -> AxisRun:
    return excitation.motion_of(run(configured()))


def check_touch_parameters(result: Identified) -> None:
    assert within(result.mass, 0.045, 0.05), result
    assert within(result.friction, 0.26, 0.05), result
    assert within(result.damping, 0.1, 0.3), result


@pytest.mark.slow
def test_delay_is_identified(motion: AxisRun) -> None:
    result = identify(motion._replace(written=motion.written - 0.003), held=False)
    check_touch_parameters(result)
    assert result.delay.value == pytest.approx(0.003, abs=2e-4)


@pytest.mark.slow
def test_constant_weight_is_identified_as_load(motion: AxisRun) -> None:
    result = identify(motion._replace(force=motion.force + 0.1), held=False)
    check_touch_parameters(result)
    assert result.load.value == pytest.approx(-0.1, abs=1e-3)


@pytest.mark.slow
def test_missing_readings_do_not_bias_the_identification(motion: AxisRun) -> None:
    kept = np.random.default_rng(1).random(len(motion.time)) > 0.1
    check_touch_parameters(identify(motion._replace(time=motion.time[kept], place=motion.place[kept]), held=False))


@pytest.mark.slow
def test_noise_widens_the_confidence_intervals_around_the_true_values(motion: AxisRun) -> None:
    noise = 2e-4 * np.random.default_rng(1).standard_normal(len(motion.place))
    plain, noisy = identify(motion, held=False), identify(motion._replace(place=motion.place + noise), held=False)
    check_touch_parameters(noisy)
    for name, true in (("mass", 0.045), ("damping", 0.1), ("friction", 0.26)):
        estimate = getattr(noisy, name)
        assert estimate.half_width > getattr(plain, name).half_width
        assert abs(estimate.value - true) < 2.0 * estimate.half_width


def test_identification_of_a_stationary_stylus_is_rejected() -> None:
    with pytest.raises(NetboardError, match="hardly moved"):
        excitation.identified(run(configured(friction=4.0)), held=False)


def test_identification_of_a_short_run_is_rejected(motion: AxisRun) -> None:
    short = AxisRun(*(values[:2000] for values in motion))
    with pytest.raises(NetboardError, match="too short"):
        identify(short, held=False)


def test_chirp_keeps_force_speed_and_amplitude_low() -> None:
    track = run(configured())
    assert np.abs(track.force).max() <= Chirp().max_force
    assert np.linalg.norm(track.velocity, axis=1).max() < 0.5
    assert np.ptp(track.place[:, 2]) < 2.5 * 2 * Chirp().swing
    assert np.abs(track.place[:, :2]).max() < 1e-3


def test_excitation_without_room_renders_no_force() -> None:
    device = virtual(configured(workspace=0.03))
    with pytest.raises(DeviceError, match="40 mm of room up and down"):
        excitation.run(device, SimulatedTime(), Chirp(), Safety())
    assert device.felt == 0.0
