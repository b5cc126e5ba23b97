"""The virtual device: the contract, and the behaviour of the modelled hardware."""

from dataclasses import replace

import numpy as np
import pytest
from contract import MS, DeviceContract

from netboard.base.config import Config
from netboard.base.errors import ConfigError
from netboard.base.tables.simulated import VirtualDevice
from netboard.devices.contract.device import Device
from netboard.devices.simulated.virtual import CATCH_UP_NS, VirtualTouch
from netboard.participants.device_models import resolved
from netboard.participants.hand import STEP
from netboard.participants.submovement import Submovement

FLAWS = {"cable_stiffness": "model", "thermal_time": "model", "read_latency_ms": 3.0, "write_latency_ms": 2.0}


def configured(options: dict | None = None, **virtual: float | str) -> Config:
    config = Config(virtual=VirtualDevice(**virtual))
    left = replace(config.agents.left, options=options or {})
    return replace(config, agents=replace(config.agents, left=left))


class TestVirtualTouch(DeviceContract):
    def make(self, config: Config) -> Device:
        return VirtualTouch("left", config)

    def motor_force(self, device: Device) -> tuple[float, float, float]:
        assert isinstance(device, VirtualTouch)
        return device._written


class TestFlawedFalcon(TestVirtualTouch):
    def make(self, config: Config) -> Device:
        return VirtualTouch("left", replace(config, virtual=VirtualDevice(model="falcon", **FLAWS)))


def opened(config: Config) -> VirtualTouch:
    device = VirtualTouch("left", config)
    device.open()
    return device


def test_positions_come_in_encoder_steps() -> None:
    device = opened(configured())
    device.command([Submovement("left", 0.0, 0.3, 0.02)])
    step = resolved(Config().virtual).resolution
    heights = np.array([device.read(k * MS).z for k in range(800)])
    assert len(np.unique(heights)) > 100
    assert np.abs(heights / step - np.round(heights / step)).max() < 1e-6


def test_the_velocity_follows_the_movement_with_little_delay() -> None:
    device, exact = opened(configured()), opened(configured(resolution=0.0))
    for each in (device, exact):
        each.command([Submovement("left", 0.0, 0.3, 0.02)])
    true, said = [], []
    for k in range(600):
        true.append(exact.read(k * MS).vz)
        said.append(device.read(k * MS).vz)
    assert np.abs(np.array(said) - true).max() < 0.02
    lags = [np.abs(np.array(said)[lag:] - np.array(true)[: 600 - lag]).mean() for lag in range(15)]
    assert int(np.argmin(lags)) <= 5


def test_a_hand_at_rest_has_no_velocity() -> None:
    device = opened(configured())
    assert {device.read(k * MS).vz for k in range(200)} == {0.0}


def test_it_gives_way_to_its_motors() -> None:
    """An arm that does not compensate the load, as a practised one does, is a spring."""
    config = configured(friction=0.0)
    device = opened(replace(config, participant=replace(config.participant, load_skill=0.0)))
    device.read(0)
    device.write(0.0, 0.0, 0.6)
    for k in range(1, 1500):
        reading = device.read(k * MS)
    assert reading.z == pytest.approx(0.6 / Config().participant.arm_stiffness, abs=5e-4)
    assert device.felt == 0.6


def test_the_force_felt_is_what_the_motors_can_give() -> None:
    device = opened(configured(max_force=2.0))
    device.write(0.0, 0.0, -50.0)
    assert device.felt == -2.0


def test_after_a_long_pause_it_lives_through_a_bounded_part_of_it() -> None:
    """A free stylus under a constant force shows by its way how much time has passed for it."""
    device = opened(configured({"held": False}, friction=0.0, damping=0.0, resolution=0.0, workspace=1.0))
    device.read(0)
    device.write(0.0, 0.0, 0.045)
    reading = device.read(10_000 * MS)
    lived = CATCH_UP_NS * 1e-9
    assert reading.z == pytest.approx(0.5 * lived**2, rel=0.02)


def test_a_force_acts_from_the_moment_on_in_which_the_hand_lives_after_it() -> None:
    """A free stylus under a constant force from 0.5 ms on: by its closed form."""
    device = opened(configured({"held": False}, friction=0.0, damping=0.0, resolution=0.0, workspace=1.0))
    device.read(0)
    mass, when = resolved(Config().virtual).mass, MS // 2
    device.write(0.0, 0.0, 0.045)
    device.live(when)
    for k in range(1, 100):
        reading = device.read(k * MS)
        device.live(k * MS + when)
        since = (k * MS - when) * 1e-9
        assert reading.z == pytest.approx(0.5 * 0.045 / mass * since**2, abs=2e-6 + 0.02 * since**2)


def test_a_reading_between_two_moments_of_life_carries_the_hand_on_at_its_speed() -> None:
    lively, plain = opened(configured(resolution=0.0)), opened(configured(resolution=0.0))
    for each in (lively, plain):
        each.command([Submovement("left", 0.0, 0.3, 0.02)])
        each.read(0)
    for k in range(1, 400):
        there, true = lively.read(k * MS), plain.read(k * MS)
        lively.live(k * MS + 400_000)
        assert there.z == pytest.approx(true.z, abs=2e-6)


def test_a_reading_between_two_moments_of_life_is_not_beyond_the_stop() -> None:
    """Free styluses are pushed against the stop, and read while they hit it; a place outside would count as left."""
    for force in np.linspace(-1.5, -0.5, 20):
        device = opened(configured({"held": False}, friction=0.0, damping=0.0))
        device.read(0)
        device.write(0.0, 0.0, float(force))
        readings = [device.read(k * MS * 7 // 10) for k in range(1, 300)]
        assert min(reading.z for reading in readings) == pytest.approx(-device.info.workspace.z_max, abs=6e-5)
        assert all(reading.ready for reading in readings)


def test_time_does_not_run_backwards() -> None:
    device = opened(configured())
    device.command([Submovement("left", 0.0, 0.2, 0.02)])
    here = [device.read(k * MS) for k in range(100)][-1]
    assert device.read(50 * MS).z == here.z


def test_how_often_it_is_read_does_not_change_what_the_hand_does() -> None:
    often, seldom = opened(configured()), opened(configured())
    for each in (often, seldom):
        each.command([Submovement("left", 0.0, 0.2, 0.02)])
        each.read(0)
    for k in range(1, 300):
        often.read(k * MS)
    for k in range(1, 30):
        seldom.read(k * 10 * MS)
    assert often.read(300 * MS).z == seldom.read(300 * MS).z


def test_an_unheld_stylus_stays_where_friction_leaves_it() -> None:
    device = opened(configured({"held": False}))
    device.read(0)
    for k in range(1, 500):
        reading = device.read(k * MS)
    assert (reading.x, reading.y, reading.z) == (0.0, 0.0, 0.0)


def test_the_two_hands_of_a_session_tremble_differently() -> None:
    config = configured(friction=0.0, resolution=0.0)
    left, right = VirtualTouch("left", config), VirtualTouch("right", config)
    with left, right:
        paths = [[device.read(k * MS).z for k in range(100)] for device in (left, right)]
    assert paths[0] != paths[1]


def test_it_moves_no_hand_but_its_own() -> None:
    with pytest.raises(ValueError, match="other one"):
        opened(configured()).command([Submovement("right", 0.0, 0.2, 0.02)])


@pytest.mark.parametrize(
    ("options", "message"), [({"hold": True}, "did you mean held"), ({"held": "no"}, "true or false")]
)
def test_wrong_options_are_named(options: dict, message: str) -> None:
    with pytest.raises(ConfigError, match=rf"agents\.left\.options.*{message}"):
        VirtualTouch("left", configured(options))


def test_it_is_the_touch_of_old_if_nothing_else_is_said() -> None:
    info = opened(configured()).info
    assert (info.model, info.max_force, info.continuous_force, info.resolution) == (
        "virtual Touch",
        3.3,
        0.88,
        0.055e-3,
    )
    assert info.workspace is not None
    assert info.workspace.x_max == 0.075 + 0.055e-3
    assert info.details == {"mass": "0.045 kg", "friction": "0.26 N", "damping": "0.1 N s/m"}


def test_a_model_says_what_is_not_written() -> None:
    info = opened(configured(model="falcon", max_force=5.0)).info
    assert (info.model, info.max_force, info.continuous_force) == ("virtual Novint Falcon", 5.0, 3.0)
    assert info.resolution == 0.0635e-3


def test_flaws_are_told() -> None:
    details = opened(configured(**FLAWS)).info.details
    assert details["cable stiffness"] == "1020.0 N/m"
    assert details["thermal time"] == "100.0 s"
    assert details["read latency"] == "3.0 ms"
    assert details["write latency"] == "2.0 ms"


def test_the_stylus_moves_where_the_encoders_do_not() -> None:
    """Motors that friction holds against the arm: only the cables give, by force over stiffness."""
    config = configured(friction=5.0, cable_stiffness=1000.0)
    device = opened(replace(config, participant=replace(config.participant, force_noise=0.0)))
    device.read(0)
    device.command([Submovement("left", 0.0, 0.3, 0.004)])
    for k in range(1, 3000):
        reading = device.read(k * MS)
    stiffness = Config().participant.arm_stiffness
    assert reading.z == 0.0
    pulled = stiffness * 0.004 / (1.0 + stiffness / 1000.0)
    assert device.tip[2] == pytest.approx(pulled / 1000.0)


def test_warm_motors_are_not_ready_and_give_no_more_than_the_continuous_force() -> None:
    """They get warm after ``time ln(r / (r - 1))``, with r the square of the force over the continuous one."""
    device = opened(configured({"held": False}, friction=5.0, thermal_time=1.0))
    warm_at = float(np.log(3.75**2 / (3.75**2 - 1.0)))
    readings = []
    for k in range(200):
        readings.append(device.read(k * MS).ready)
        device.write(0.0, 0.0, 3.3)
    assert readings.index(False) * 1e-3 == pytest.approx(warm_at, abs=2.1e-3)
    assert device.felt == pytest.approx(0.88)
    assert device.temperature > 1.0
    device.write(0.0, 0.0, 0.0)
    ready = [device.read(k * MS).ready for k in range(200, 1000)]
    assert True in ready
    assert device.temperature < 0.8
    device.write(0.0, 0.0, 3.3)
    assert device.felt == 3.3


def test_late_readings_are_those_of_before() -> None:
    late, plain = opened(configured(read_latency_ms=7.0)), opened(configured())
    for each in (late, plain):
        each.command([Submovement("left", 0.0, 0.3, 0.02)])
    heights = [(late.read(k * MS).z, plain.read(k * MS).z) for k in range(600)]
    seen, true = np.array(heights).T
    assert (seen[7:] == true[:-7]).all()
    assert (seen[:7] == true[0]).all()


def test_a_late_force_acts_later() -> None:
    """A free stylus under a force that is written at 10 ms and takes 5 ms: by its closed form."""
    options = {"friction": 0.0, "damping": 0.0, "resolution": 0.0, "workspace": 1.0, "write_latency_ms": 5.0}
    device = opened(configured({"held": False}, **options))
    mass = resolved(Config().virtual).mass
    for k in range(60):
        reading = device.read(k * MS)
        since = max(k - 15, 0) * 1e-3
        assert reading.z == pytest.approx(0.5 / mass * since * (since + STEP), abs=1e-12)
        assert device.felt == (1.0 if k >= 15 else 0.0)
        if k == 10:
            device.write(0.0, 0.0, 1.0)
            device.live(k * MS)


def test_a_device_that_was_closed_has_no_force_on_its_way() -> None:
    device = opened(configured(write_latency_ms=50.0))
    device.read(0)
    device.write(0.0, 0.0, 2.0)
    for k in range(1, 30):
        device.read(k * MS)
    device.close()
    device.open()
    for k in range(30, 200):
        device.read(k * MS)
        assert device.felt == 0.0
