"""The virtual device: the contract, and the behaviour of the modelled hardware."""

from dataclasses import replace

import numpy as np
import pytest

from netboard.base.config import Config
from netboard.base.errors import ConfigError
from netboard.base.tables.simulated import VirtualDevice
from netboard.devices.contract.device import Device
from netboard.devices.simulated.device import CATCH_UP_NS
from netboard.devices.simulated.virtual import VirtualTouch
from netboard.participants.body.device_models import resolved
from netboard.participants.body.stylus import STEP
from netboard.participants.people.submovement import Submovement
from netboard.testing.device import MS, DeviceContract

IMPERFECTIONS = {"cable_stiffness": "model", "thermal_time": "model", "read_latency_ms": 3.0, "write_latency_ms": 2.0}


def configured(options: dict | None = None, **virtual: float | str) -> Config:
    config = Config(virtual=VirtualDevice(**virtual))
    left = replace(config.agents.left, options=options or {})
    return replace(config, agents=replace(config.agents, left=left))


class TestVirtualTouch(DeviceContract):
    def make(self, config: Config) -> Device:
        return VirtualTouch("left", config)

    def motor_force(self, device: Device) -> tuple[float, float, float]:
        assert isinstance(device, VirtualTouch)
        x, y, z = device._written.tolist()
        return x, y, z


class TestImperfectFalcon(TestVirtualTouch):
    def make(self, config: Config) -> Device:
        return VirtualTouch("left", replace(config, virtual=VirtualDevice(model="falcon", **IMPERFECTIONS)))


def opened(config: Config) -> VirtualTouch:
    device = VirtualTouch("left", config)
    device.open()
    return device


def test_positions_are_multiples_of_the_encoder_step() -> None:
    device = opened(configured())
    device.command([Submovement("left", 0.0, 0.3, 0.02)])
    step = resolved(Config().virtual).resolution
    heights = np.array([device.read(k * MS).z for k in range(800)])
    assert len(np.unique(heights)) > 100
    assert np.abs(heights / step - np.round(heights / step)).max() < 1e-6


def test_velocity_follows_the_movement_within_5_ms() -> None:
    device, exact = opened(configured()), opened(configured(resolution=0.0))
    for each in (device, exact):
        each.command([Submovement("left", 0.0, 0.3, 0.02)])
    true, estimated = [], []
    for k in range(600):
        true.append(exact.read(k * MS).vz)
        estimated.append(device.read(k * MS).vz)
    assert np.abs(np.array(estimated) - true).max() < 0.02
    lags = [np.abs(np.array(estimated)[lag:] - np.array(true)[: 600 - lag]).mean() for lag in range(15)]
    assert int(np.argmin(lags)) <= 5


def test_hand_at_rest_has_zero_velocity() -> None:
    device = opened(configured())
    assert {device.read(k * MS).vz for k in range(200)} == {0.0}


def test_hand_yields_to_the_motors_like_a_spring() -> None:
    """An arm without the load compensation of a practised one is a spring."""
    config = configured(friction=0.0)
    device = opened(replace(config, participant=replace(config.participant, load_skill=0.0)))
    device.read(0)
    device.write(0.0, 0.0, 0.6)
    for k in range(1, 1500):
        reading = device.read(k * MS)
    assert reading.z == pytest.approx(0.6 / Config().participant.arm_stiffness, abs=5e-4)
    assert device.felt == 0.6


def test_rendered_force_saturates_at_max_force() -> None:
    device = opened(configured(max_force=2.0))
    device.write(0.0, 0.0, -50.0)
    assert device.felt == -2.0


def test_simulated_time_after_a_long_pause_is_bounded() -> None:
    """The displacement of a free stylus under a constant force shows how much time was simulated."""
    device = opened(configured({"held": False}, friction=0.0, damping=0.0, resolution=0.0, workspace=1.0))
    device.read(0)
    device.write(0.0, 0.0, 0.045)
    reading = device.read(10_000 * MS)
    simulated = CATCH_UP_NS * 1e-9
    assert reading.z == pytest.approx(0.5 * simulated**2, rel=0.02)


def test_force_acts_from_the_next_call_of_live() -> None:
    """Compared with the closed form for a free stylus under a constant force from 0.5 ms on."""
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


def test_reading_between_calls_of_live_extrapolates_at_constant_velocity() -> None:
    explicit, plain = opened(configured(resolution=0.0)), opened(configured(resolution=0.0))
    for each in (explicit, plain):
        each.command([Submovement("left", 0.0, 0.3, 0.02)])
        each.read(0)
    for k in range(1, 400):
        extrapolated, true = explicit.read(k * MS), plain.read(k * MS)
        explicit.live(k * MS + 400_000)
        assert extrapolated.z == pytest.approx(true.z, abs=2e-6)


def test_extrapolated_reading_stays_within_the_mechanical_stop() -> None:
    """Free styluses are pushed against the stop and read during the impact; a position outside would not be ready."""
    for force in np.linspace(-1.5, -0.5, 20):
        device = opened(configured({"held": False}, friction=0.0, damping=0.0))
        device.read(0)
        device.write(0.0, 0.0, float(force))
        readings = [device.read(k * MS * 7 // 10) for k in range(1, 300)]
        assert min(reading.z for reading in readings) == pytest.approx(-device.info.workspace.z_max, abs=6e-5)
        assert all(reading.ready for reading in readings)


def test_reading_an_earlier_time_returns_the_latest_position() -> None:
    device = opened(configured())
    device.command([Submovement("left", 0.0, 0.2, 0.02)])
    latest = [device.read(k * MS) for k in range(100)][-1]
    assert device.read(50 * MS).z == latest.z


def test_hand_movement_is_independent_of_the_reading_rate() -> None:
    frequent, rare = opened(configured()), opened(configured())
    for each in (frequent, rare):
        each.command([Submovement("left", 0.0, 0.2, 0.02)])
        each.read(0)
    for k in range(1, 300):
        frequent.read(k * MS)
    for k in range(1, 30):
        rare.read(k * 10 * MS)
    assert frequent.read(300 * MS).z == rare.read(300 * MS).z


def test_free_stylus_is_held_in_place_by_friction() -> None:
    device = opened(configured({"held": False}))
    device.read(0)
    for k in range(1, 500):
        reading = device.read(k * MS)
    assert (reading.x, reading.y, reading.z) == (0.0, 0.0, 0.0)


def test_two_hands_of_a_session_have_different_tremor() -> None:
    config = configured(friction=0.0, resolution=0.0)
    left, right = VirtualTouch("left", config), VirtualTouch("right", config)
    with left, right:
        paths = [[device.read(k * MS).z for k in range(100)] for device in (left, right)]
    assert paths[0] != paths[1]


def test_command_for_the_other_side_is_rejected() -> None:
    with pytest.raises(ValueError, match="other one"):
        opened(configured()).command([Submovement("right", 0.0, 0.2, 0.02)])


@pytest.mark.parametrize(
    ("options", "message"), [({"hold": True}, "did you mean held"), ({"held": "no"}, "true or false")]
)
def test_error_names_invalid_option(options: dict, message: str) -> None:
    with pytest.raises(ConfigError, match=rf"agents\.left\.options.*{message}"):
        VirtualTouch("left", configured(options))


def test_default_model_is_the_touch() -> None:
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


def test_model_provides_values_that_are_not_configured() -> None:
    info = opened(configured(model="falcon", max_force=5.0)).info
    assert (info.model, info.max_force, info.continuous_force) == ("virtual Novint Falcon", 5.0, 3.0)
    assert info.resolution == 0.0635e-3


def test_device_details_list_the_imperfections() -> None:
    details = opened(configured(**IMPERFECTIONS)).info.details
    assert details["cable stiffness"] == "1020.0 N/m"
    assert details["thermal time"] == "100.0 s"
    assert details["read latency"] == "3.0 ms"
    assert details["write latency"] == "2.0 ms"


def test_cable_stretches_while_friction_holds_the_encoders() -> None:
    """Friction holds the motors against the arm; only the cables stretch, by force over stiffness."""
    config = configured(friction=5.0, cable_stiffness=1000.0)
    device = opened(replace(config, participant=replace(config.participant, force_noise=0.0)))
    device.read(0)
    device.command([Submovement("left", 0.0, 0.3, 0.004)])
    for k in range(1, 3000):
        reading = device.read(k * MS)
    stiffness = Config().participant.arm_stiffness
    assert reading.z == 0.0
    cable_force = stiffness * 0.004 / (1.0 + stiffness / 1000.0)
    assert device.tip[2] == pytest.approx(cable_force / 1000.0)


def test_hot_motors_are_unready_and_limited_to_the_continuous_force() -> None:
    """They become hot after ``time ln(r / (r - 1))``; r is the squared ratio of force to continuous force."""
    device = opened(configured({"held": False}, friction=5.0, thermal_time=1.0))
    hot_at = float(np.log(3.75**2 / (3.75**2 - 1.0)))
    readings = []
    for k in range(200):
        readings.append(device.read(k * MS).ready)
        device.write(0.0, 0.0, 3.3)
    assert readings.index(False) * 1e-3 == pytest.approx(hot_at, abs=2.1e-3)
    assert device.felt == pytest.approx(0.88)
    assert device.temperature > 1.0
    device.write(0.0, 0.0, 0.0)
    ready = [device.read(k * MS).ready for k in range(200, 1000)]
    assert True in ready
    assert device.temperature < 0.8
    device.write(0.0, 0.0, 3.3)
    assert device.felt == 3.3


def test_read_latency_delays_the_readings() -> None:
    late, plain = opened(configured(read_latency_ms=7.0)), opened(configured())
    for each in (late, plain):
        each.command([Submovement("left", 0.0, 0.3, 0.02)])
    heights = [(late.read(k * MS).z, plain.read(k * MS).z) for k in range(600)]
    delayed, true = np.array(heights).T
    assert (delayed[7:] == true[:-7]).all()
    assert (delayed[:7] == true[0]).all()


def test_write_latency_delays_the_force() -> None:
    """Compared with the closed form for a free stylus; the force is written at 10 ms and delayed by 5 ms."""
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


def test_close_discards_delayed_forces() -> None:
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
