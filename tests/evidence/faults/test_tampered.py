"""The tampered device behaves like the virtual device until a fault is switched on."""

import os
from dataclasses import replace
from math import isnan
from pathlib import Path

import numpy as np
import pytest

from evidence.faults.devices import (
    JUMP,
    NAME,
    TamperedTouch,
    install,
    read_trace,
    read_traces,
    set_device_fault,
    trace_file,
)
from netboard.base.config import Config
from netboard.base.errors import ConfigError, DeviceLost
from netboard.devices.contract import registry
from netboard.devices.contract.device import Device
from netboard.nodes.agent.stylus_source import SimulatedHandDevice
from netboard.testing.device import DeviceContract

MS = 1_000_000


def in_folder(config: Config, folder: Path) -> Config:
    left = replace(config.agents.left, device=NAME, options={"folder": str(folder), **config.agents.left.options})
    return replace(config, agents=replace(config.agents, left=left))


class TestTampered(DeviceContract):
    @pytest.fixture(autouse=True)
    def _folder(self, tmp_path: Path) -> None:
        self.folder = tmp_path

    def make(self, config: Config) -> Device:
        return TamperedTouch("left", in_folder(config, self.folder))

    def motor_force(self, device: Device) -> tuple[float, float, float]:
        assert isinstance(device, TamperedTouch)
        x, y, z = device._touch._written.tolist()
        return x, y, z


@pytest.fixture
def device(tmp_path: Path):
    with TamperedTouch("left", in_folder(Config(), tmp_path)) as device:
        yield device


def test_forces_are_traced_at_once_including_the_final_zero(tmp_path: Path) -> None:
    with TamperedTouch("left", in_folder(Config(), tmp_path)) as device:
        device.read(MS)
        device.write(0.1, 0.2, 0.3)
        file = trace_file(tmp_path, "left", os.getpid())
        assert [*map(tuple, read_trace(file)[["fx", "fy", "fz"]])] == [(0.1, 0.2, 0.3)]
        device.write(0.0, 0.0, 0.4)
        assert read_trace(file, 1)["fz"].tolist() == [0.4]
    (trace,) = read_traces(tmp_path, "left")
    assert trace["fz"].tolist() == [0.3, 0.4, 0.0]
    assert np.all(np.diff(trace["time_ns"]) >= 0)
    assert read_traces(tmp_path, "right") == []


def test_missing_trace_file_gives_an_empty_trace(tmp_path: Path) -> None:
    assert read_trace(trace_file(tmp_path, "left", 1)).size == 0


def test_device_can_be_held_by_a_simulated_hand(device: TamperedTouch) -> None:
    assert isinstance(device, SimulatedHandDevice)
    device.write(0.0, 0.0, 0.5)
    assert device.felt == 0.5
    device.command(())


def test_nan_fault_gives_nan_readings(device: TamperedTouch, tmp_path: Path) -> None:
    assert not isnan(device.read(MS).z)
    set_device_fault(tmp_path, "left", "nan")
    reading = device.read(2 * MS)
    assert all(map(isnan, (reading.x, reading.y, reading.z, reading.vz)))


def test_frozen_fault_repeats_the_reading_until_cleared(device: TamperedTouch, tmp_path: Path) -> None:
    before = device.read(MS)
    set_device_fault(tmp_path, "left", "frozen")
    assert device.read(5 * MS) == before
    set_device_fault(tmp_path, "left", "none")
    assert device.read(6 * MS).stamp_ns == 6 * MS


def test_jump_fault_shifts_the_position_and_raises_the_velocity(device: TamperedTouch, tmp_path: Path) -> None:
    before = device.read(MS)
    set_device_fault(tmp_path, "left", "jump")
    after = device.read(2 * MS)
    assert after.z - before.z == pytest.approx(JUMP, abs=1e-3)
    assert after.vz > 10.0


def test_gone_fault_loses_the_device_after_zero_force(device: TamperedTouch, tmp_path: Path) -> None:
    device.write(0.0, 0.0, 0.5)
    set_device_fault(tmp_path, "left", "gone")
    with pytest.raises(DeviceLost):
        device.read(MS)
    with pytest.raises(DeviceLost):
        device.close()
    (trace,) = read_traces(tmp_path, "left")
    assert trace["fz"].tolist() == [0.5, 0.0, 0.0]  # written twice, because the first was refused


@pytest.mark.parametrize("options", [{"folder": 3}, {"folder": "", "held": True}])
def test_error_names_invalid_option(options: dict) -> None:
    config = Config()
    left = replace(config.agents.left, options=options)
    with pytest.raises(ConfigError, match=r"\[agents\.left\.options\] (folder|held)"):
        TamperedTouch("left", replace(config, agents=replace(config.agents, left=left)))


def test_tampered_device_is_registered_only_where_installed(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    assert NAME not in registry.names()
    environment = install(tmp_path / "plug-in")
    monkeypatch.syspath_prepend(environment["PYTHONPATH"].split(os.pathsep)[0])
    assert registry.find(NAME) is TamperedTouch
