"""The virtual device: the contract, and that it behaves like what it stands for."""

from dataclasses import replace

import numpy as np
import pytest
from contract import MS, DeviceContract

from netboard.config import Config, VirtualDevice
from netboard.devices.base import Device
from netboard.devices.virtual import CATCH_UP_NS, VirtualTouch
from netboard.errors import ConfigError
from netboard.participants.submovement import Submovement


def configured(options: dict | None = None, **virtual: float) -> Config:
    config = Config(virtual=VirtualDevice(**virtual))
    left = replace(config.agents.left, options=options or {})
    return replace(config, agents=replace(config.agents, left=left))


class TestVirtualTouch(DeviceContract):
    def make(self, config: Config) -> Device:
        return VirtualTouch("left", config)

    def motor_force(self, device: Device) -> tuple[float, float, float]:
        assert isinstance(device, VirtualTouch)
        return device._written


def opened(config: Config) -> VirtualTouch:
    device = VirtualTouch("left", config)
    device.open()
    return device


def test_positions_come_in_encoder_steps() -> None:
    device = opened(configured())
    device.command([Submovement("left", 0.0, 0.3, 0.02)])
    step = Config().virtual.resolution
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
    device = opened(configured(friction=0.0))
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
    mass, when = Config().virtual.mass, MS // 2
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


@pytest.mark.parametrize(("options", "message"), [({"hold": True}, "unknown option"), ({"held": 1}, "true or false")])
def test_wrong_options_are_named(options: dict, message: str) -> None:
    with pytest.raises(ConfigError, match=rf"agents\.left\.options.*{message}"):
        VirtualTouch("left", configured(options))
