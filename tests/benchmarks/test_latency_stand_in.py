"""The stand-in for a Touch in `netboard bench loop`: its device, its disclaimer, and the command that runs an agent."""

import subprocess
import sys
from dataclasses import replace
from time import monotonic_ns

import pytest

from libhd import fake_library
from netboard.base.config import Config
from netboard.base.device_kind import DeviceKind
from netboard.base.errors import NetboardError
from netboard.benchmarks.loop import stand_in
from netboard.benchmarks.loop.bench import Setting
from netboard.benchmarks.loop.stand_in import SWAY_MM, StandInTouch, with_device
from netboard.devices.touch.servo import wait_ticks


def test_touch_is_said_to_be_a_stand_in() -> None:
    setting = Setting(device="touch")
    head = " ".join(setting.lines)
    assert head.startswith("touch, tcp")
    assert "stand-in for the vendor's library" in head
    assert "Nothing has been measured on a real Touch" in head
    assert Setting().lines == (str(Setting()),)


def test_agents_of_both_sides_get_a_touch_of_the_library() -> None:
    fake_library()  # skips without a compiler
    config = Setting(device="touch").config
    assert {config.agents.left.device, config.agents.right.device} == {"openhaptics"}
    assert config.agents.left.options["name"] != config.agents.right.options["name"]
    assert config.agents.left.options["library"] == config.agents.right.options["library"]
    assert with_device(Config(), "virtual") == Config()


def test_missing_compiler_is_reported(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("CC", "no-such-compiler")
    with pytest.raises(NetboardError, match=r"the stand-in .* needs a compiler.*no-such-compiler.*install"):
        with_device(Config(), "touch")


@pytest.mark.parametrize("servo", ["c", "python"])
def test_sample_is_stamped_when_it_is_read(servo: str) -> None:
    fake_library()
    config = with_device(Config(), "touch")
    left = config.agents.left
    left = replace(left, options={**left.options, "servo": servo, "force_timeout_ms": 200.0})
    device = StandInTouch("left", replace(config, agents=replace(config.agents, left=left)))
    with device:
        heights = []
        for _ in range(20):
            now_ns = monotonic_ns()
            reading = device.read(now_ns)
            assert reading.stamp_ns == now_ns
            heights.append(reading.z)
            assert device._touch._servo is not None
            wait_ticks(device._touch._servo, 10, 60_000_000_000)
        assert 0.0 < max(map(abs, heights)) < 1.5e-3 * SWAY_MM
        access = device.compiled
        assert (access is None) == (servo == "python")
        if access is not None:
            now_ns = monotonic_ns()
            found, fields = access.read(access.parts, now_ns)
            assert found
            assert fields[0] == now_ns


def test_command_of_an_agent_runs_with_the_stand_in() -> None:
    """The command is netboard's own; only its device is another one, and its recordings say so."""
    code = (
        "import sys; from netboard.benchmarks.loop import stand_in; from netboard.devices.contract import registry; "
        "sys.argv = ['stand_in', sys.executable, '-m', 'this', 'agent']; stand_in.main(); "
        "print(registry.find('openhaptics').__name__, registry.kind_of('openhaptics'), sys.argv)"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    name, kind, *_ = done.stdout.strip().splitlines()[-1].split()
    assert name == StandInTouch.__name__
    assert kind == str(DeviceKind.SIMULATED)
    assert stand_in.AGENT[-1] == stand_in.__name__
