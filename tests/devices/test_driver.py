"""Moving a device without a server: through the safety chain, and with zero force on every exit path."""

from math import nan

import numpy as np
import pytest
from simulated import AT_REST, Puppet, SimulatedTime

from netboard.base.config import Config
from netboard.base.errors import ConfigError, DeviceError, DeviceLost
from netboard.base.tables.rig import Safety
from netboard.devices.contract.device import Reading
from netboard.devices.safety.chain import Vector
from netboard.devices.setup import excitation
from netboard.devices.setup.excitation import Chirp
from netboard.devices.setup.loop import Driver


def driver(*readings: Reading, **limits: float) -> tuple[Puppet, Driver]:
    device = Puppet(Config(), *readings)
    device.open()
    return device, Driver(device, SimulatedTime(), Safety(**limits))


def push(t: float, reading: Reading) -> Vector:
    return 0.0, 0.0, 5.0


def test_forces_are_clamped_slew_limited_and_end_at_zero() -> None:
    device, drive = driver(AT_REST, max_force=1.0, max_slew=100.0)
    track = drive.drive(0.1, push)
    heights = np.array([force[2] for force in device.forces])
    assert heights.max() == 1.0
    assert np.abs(np.diff(heights)).max() <= 0.1 + 1e-9
    assert device.forces[-1] == (0.0, 0.0, 0.0)
    assert len(track.force) == 100
    assert track.force[-1, 2] == 1.0


def test_no_force_is_rendered_before_arming_is_complete() -> None:
    device, drive = driver(AT_REST, arm_time=0.5)
    drive.drive(0.05, push)
    assert not any(map(any, device.forces[:500]))


@pytest.mark.parametrize(
    ("reading", "why"),
    [
        (AT_REST._replace(ready=False), "not ready for forces.*motors cool down"),
        (AT_REST._replace(x=0.2, ready=False), "outside of the workspace"),
        (AT_REST._replace(vz=2.0), r"moved at 2\.00 m/s, the limit is 1 m/s"),
        (AT_REST._replace(vz=nan), "not finite"),
    ],
)
def test_unsafe_reading_ends_the_drive_with_zero_force(reading: Reading, why: str) -> None:
    device, drive = driver(*[AT_REST] * 1050, reading)
    with pytest.raises(DeviceError, match=why):
        drive.drive(1.0, push)
    assert any(map(any, device.forces))
    assert device.forces[-1] == (0.0, 0.0, 0.0)
    device, drive = driver(reading)
    with pytest.raises(DeviceError, match=why):
        drive.drive(1.0, push)
    assert not any(map(any, device.forces))


def test_device_that_is_not_ready_for_a_moment_is_not_called_fast() -> None:
    _, drive = driver(*[AT_REST] * 50, AT_REST._replace(ready=False), AT_REST)
    with pytest.raises(DeviceError, match="not ready for forces"):
        drive.drive(1.0, push)


def test_lost_device_is_sent_zero_force() -> None:
    device, drive = driver(AT_REST)

    def lose(t: float, reading: Reading) -> Vector:
        if t > 0.01:
            raise DeviceLost("gone")
        return push(t, reading)

    with pytest.raises(DeviceLost, match="gone"):
        drive.drive(1.0, lose)
    assert device.forces[-1] == (0.0, 0.0, 0.0)


# --- the chirp -----------------------------------------------------------------------------------------------------


def test_chirp_stays_within_amplitude_and_speed_limits() -> None:
    chirp = Chirp()
    times = np.arange(0.0, chirp.seconds, 1e-3)
    place = np.array([chirp.lead(t) for t in times])
    assert np.abs(place).max() <= chirp.swing
    speed = np.gradient(place, times)
    assert 0.9 * chirp.speed < np.abs(speed).max() < 1.2 * chirp.speed
    assert place[0] == 0.0
    assert abs(place[-1]) < 1e-4
    assert chirp.lead(-1.0) == chirp.lead(chirp.seconds + 1.0) == 0.0


def test_stricter_limits_of_the_rig_apply_to_the_chirp() -> None:
    limits = excitation.limits_of(Chirp(), Safety(max_force=0.1, max_speed=0.2, arm_gate=0.05))
    assert (limits.max_force, limits.max_speed, limits.arm_gate) == (0.1, 0.2, 0.05)
    assert excitation.limits_of(Chirp(), Safety()).max_force == Chirp().max_force


def test_spring_that_would_oscillate_is_refused() -> None:
    device = Puppet(Config(), AT_REST)
    device.open()
    with pytest.raises(ConfigError, match=r"\[safety\] max_slew: found 20, expected at least 100 N/s"):
        excitation.run(device, SimulatedTime(), Chirp(), Safety(max_slew=20.0))
    assert device.forces == []


def test_stylus_far_from_where_it_started_ends_the_chirp() -> None:
    device = Puppet(Config(), *[AT_REST] * 2000, AT_REST._replace(y=0.03, z=-0.03))
    device.open()
    with pytest.raises(DeviceError, match="moved 42 mm away"):
        excitation.run(device, SimulatedTime(), Chirp(), Safety())
    assert any(map(any, device.forces))
    assert device.forces[-1] == (0.0, 0.0, 0.0)


def test_device_without_motors_cannot_be_identified() -> None:
    device = Puppet(Config(), AT_REST, max_force=0.0)
    device = Puppet(Config(), AT_REST, max_force=0.0)
    device.open()
    with pytest.raises(DeviceError, match="no motors"):
        excitation.run(device, SimulatedTime(), Chirp(), Safety())
