"""The mouse as a device: the contract, the closed form of its motion, and a compliant hand."""

from collections import deque
from collections.abc import Iterator
from dataclasses import replace
from itertools import pairwise
from math import exp, inf, nan
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from netboard.base.config import Config, parse
from netboard.base.errors import ConfigError
from netboard.devices.contract import profile
from netboard.devices.contract.device import Device, Reading
from netboard.devices.contract.profile import Identity, Placement, Profile
from netboard.devices.mouse import MAX_FORCE, SILENCE_TIMEOUT_NS, MouseOptions, MouseStylus, follow
from netboard.testing.device import MS, DeviceContract

RATE = 1.0 / MouseOptions().smoothing
heights = st.floats(-0.2, 0.2)
pauses = st.floats(1e-4, 0.2)


def configured(**options: float | str) -> Config:
    words = [f"agents.left.options.{name}={value}" for name, value in options.items()]
    return parse("", overrides=["agents.left.device=mouse", *words])


def opened(config: Config | None = None) -> MouseStylus:
    device = MouseStylus("left", config or configured())
    device.open()
    device.read(0)
    return device


def readings(device: MouseStylus, count: int, first: int = 1) -> list[Reading]:
    return [device.read(k * MS) for k in range(first, first + count)]


class TestMouseStylus(DeviceContract):
    def make(self, config: Config) -> Device:
        return MouseStylus("left", config)

    def motor_force(self, device: Device) -> tuple[float, float, float]:
        assert isinstance(device, MouseStylus)
        return device._written


class TestMovedMouseStylus(DeviceContract):
    """The contract while the participant points out of reach."""

    def make(self, config: Config) -> Device:
        return MouseStylus("left", config)

    def motor_force(self, device: Device) -> tuple[float, float, float]:
        assert isinstance(device, MouseStylus)
        return device._written

    @pytest.fixture
    def device(self) -> Iterator[Device]:
        device = MouseStylus("left", Config())
        device.point(1.0, 1000 * MS)
        yield device
        device.close()


# --- the path ----------------------------------------------------------------------------------------------------


def test_step_response_from_rest_matches_the_closed_form() -> None:
    z = vz = 0.0
    for k in range(1, 200):
        z, vz = follow(z, vz, 0.02, 0.02, 1e-3, RATE)
        t = k * 1e-3
        assert z == pytest.approx(0.02 * (1.0 - (1.0 + RATE * t) * exp(-RATE * t)), abs=1e-15)
        assert vz == pytest.approx(0.02 * RATE**2 * t * exp(-RATE * t), abs=1e-12)


def test_stylus_lags_a_uniformly_moving_pointer_by_two_time_constants() -> None:
    z = vz = 0.0
    for k in range(1000):
        z, vz = follow(z, vz, 1e-4 * k, 1e-4 * (k + 1), 1e-3, RATE)
    assert vz == pytest.approx(0.1, rel=1e-12)
    assert 0.1 - z == pytest.approx(0.1 * 2.0 * MouseOptions().smoothing, rel=1e-9)


@settings(deadline=None)
@given(st.lists(st.tuples(heights, pauses), min_size=1, max_size=8), st.integers(2, 7))
def test_path_is_independent_of_the_step_length(corners: list[tuple[float, float]], parts: int) -> None:
    whole = split = (0.0, 0.0)
    before = 0.0
    for after, dt in corners:
        whole = follow(*whole, before, after, dt, RATE)
        for k in range(parts):
            here, there = (before + (after - before) * (k + i) / parts for i in (0, 1))
            split = follow(*split, here, there, dt / parts, RATE)
        before = after
    assert split == pytest.approx(whole, rel=1e-9, abs=1e-11)


def test_path_solves_the_equation_of_motion() -> None:
    """z'' = w^2 (aim - z) - 2 w z', by differences of the closed form."""
    dt, times = 1e-5, np.arange(1, 4000) * 1e-5
    path = np.array([follow(0.01, -0.3, 0.0, 0.5 * t, t, RATE) for t in times])
    z, vz = path.T
    acceleration = (vz[2:] - vz[:-2]) / (2 * dt)
    wanted = RATE**2 * (0.5 * times - z) - 2.0 * RATE * vz
    assert np.abs((z[2:] - z[:-2]) / (2 * dt) - vz[1:-1]).max() < 1e-5
    assert np.abs(acceleration - wanted[1:-1]).max() < 1e-3 * np.abs(wanted).max()


@settings(deadline=None)
@given(st.lists(st.tuples(st.floats(-2, 2), st.floats(-9, 9), st.integers(1, 60)), min_size=1, max_size=12))
def test_stylus_stays_within_speed_limit_and_reach(turns: list[tuple[float, float, int]]) -> None:
    device, now = opened(), 0
    most, reach = MouseOptions().max_speed, MouseOptions().reach
    for z, force, milliseconds in turns:
        device.point(z, now * MS)
        device.write(0.0, 0.0, force)
        for _ in range(3):
            now += milliseconds
            reading = device.read(now * MS)
            assert abs(reading.vz) <= most * (1 + 1e-9)
            assert abs(reading.z) <= reach + 1e-9
            assert reading.ready


def test_velocity_is_the_derivative_of_the_path() -> None:
    device = opened()
    path = []
    for k in range(1, 400):
        if k % 16 == 1:
            device.point(0.03 * np.sin(k * 0.01), k * MS)
        path.append(device.read(k * MS))
    z, vz = np.array([(reading.z, reading.vz) for reading in path]).T
    assert np.abs((z[2:] - z[:-2]) / 2e-3 - vz[1:-1]).max() < 0.03 * np.abs(vz).max()
    assert np.abs(np.diff(vz)).max() < 0.15 * np.abs(vz).max()


def test_stylus_moves_only_vertically() -> None:
    device = opened()
    device.point(0.03, 0)
    device.write(1.0, 1.0, 0.0)
    assert {(r.x, r.y, r.vx, r.vy) for r in readings(device, 100)} == {(0.0, 0.0, 0.0, 0.0)}


# --- the hand ----------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("stiffness", [150.0, 200.0, 300.0])
def test_constant_force_displaces_the_stylus_by_force_over_stiffness(stiffness: float) -> None:
    device = opened(configured(stiffness=stiffness))
    device.point(0.02, 0)
    device.write(0.0, 0.0, -0.3)
    assert readings(device, 400)[-1].z == pytest.approx(0.02 - 0.3 / stiffness, abs=1e-9)
    assert device.felt == -0.3


@pytest.mark.parametrize("delay", [1, 2, 5, 20])
def test_stylus_comes_to_rest_against_a_delayed_spring(delay: int) -> None:
    """The paper's virtual coupling to a fixed board over a network: 200 N/m on either side halve the displacement."""
    device = opened()
    late = deque([(0.0, 0.0)] * delay, maxlen=delay)
    heights = []
    for k in range(1, 2000):
        if k % 500 == 1:
            device.point(0.02, k * MS)
        reading = device.read(k * MS)
        z, vz = late[0]
        late.append((reading.z, reading.vz))
        device.write(0.0, 0.0, -200.0 * z - 2.0 * vz)
        heights.append(reading.z)
    assert np.allclose(heights[-200:], 0.01, atol=1e-8)


def test_rendered_force_saturates_at_max_force() -> None:
    device = opened()
    device.write(0.0, 0.0, -50.0)
    assert device.felt == pytest.approx(-MAX_FORCE, rel=1e-15)


# --- the window --------------------------------------------------------------------------------------------------


def test_stylus_is_ready_only_while_the_window_reports_the_pointer() -> None:
    device = opened()
    assert not device.read(MS).ready
    device.point(None, 2 * MS)
    assert not device.read(3 * MS).ready
    device.point(0.01, 4 * MS)
    assert device.read(5 * MS).ready
    assert device.read(4 * MS + SILENCE_TIMEOUT_NS).ready
    assert not device.read(5 * MS + SILENCE_TIMEOUT_NS).ready


def test_stylus_keeps_its_height_when_the_pointer_is_lost() -> None:
    device = opened()
    device.point(0.03, 0)
    settled = readings(device, 900)[-1]
    later = device.read(5 * SILENCE_TIMEOUT_NS)
    assert later.z == pytest.approx(settled.z, abs=1e-9)
    assert later.vz == pytest.approx(0.0, abs=1e-9)
    device.point(None, 5 * SILENCE_TIMEOUT_NS)
    assert device.read(6 * SILENCE_TIMEOUT_NS).z == pytest.approx(0.03, abs=1e-9)


def test_pointer_height_is_in_the_scene_frame_for_any_zero_and_profile(tmp_path: Path) -> None:
    place = Placement(zero_z=0.01, scale=2.0)
    profile.save(tmp_path, Profile(Identity("mouse pointer", "mouse-left"), placement=place))
    config = configured(reach=0.1)
    left = replace(config.agents.left, zero=0.02)
    config = replace(config, agents=replace(config.agents, left=left, profiles=str(tmp_path)))
    device = opened(config)
    device.point(0.03, 0)
    assert readings(device, 500)[-1].z == pytest.approx(0.03, abs=1e-9)


def test_reopened_stylus_starts_from_rest() -> None:
    device = opened()
    device.point(0.03, 0)
    readings(device, 100)
    device.close()
    device.open()
    reading = device.read(200 * MS)
    assert (reading.z, reading.vz, reading.ready) == (0.0, 0.0, False)


def test_reading_an_earlier_time_returns_the_latest_position() -> None:
    device = opened()
    device.point(0.03, 0)
    path = readings(device, 50)
    assert device.read(20 * MS).z == path[-1].z
    assert all(here.z < there.z for here, there in pairwise(path))


@pytest.mark.parametrize("bad", [nan, inf, -inf])
def test_non_finite_pointer_height_is_rejected(bad: float) -> None:
    with pytest.raises(ValueError, match="not a height"):
        opened().point(bad, 0)


@pytest.mark.parametrize(
    ("options", "message"),
    [({"stifness": 200}, "did you mean stiffness"), ({"input": "voice"}, "pointer.*keys"), ({"reach": 2}, "<= 0.5")],
)
def test_error_names_invalid_option(options: dict[str, float | str], message: str) -> None:
    with pytest.raises(ConfigError, match=rf"agents\.left\.options.*{message}"):
        MouseStylus("left", configured(**options))
