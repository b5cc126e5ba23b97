"""An agent of a Touch: compiled runs equal single steps to the bit, whatever the device and the server do.

The Touch is a stand-in for the vendor's library, whose servo the test steps; the servo callback is the one in C.
"""

import shutil
from collections.abc import Callable, Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from stepped_agent import START_NS, SteppedAgent, answers, fixed_form

from libhd import FIRST, Fake, configured, fake_library
from netboard.base.config import Config
from netboard.base.errors import DeviceError
from netboard.base.safeguards import Safeguard
from netboard.base.tick import TICK_NS
from netboard.devices.contract.profile import Identity, Placement, Profile, save
from netboard.devices.safety.arming import KNOWN
from netboard.devices.touch import library as touch_library
from netboard.devices.touch.api import Error
from netboard.devices.touch.device import OpenHaptics
from netboard.devices.touch.shim import ShimServo
from netboard.network.protocol.motion import Force, Heartbeat, Stylus
from netboard.network.transport import sockets

TICKS = 3000

STOP, CONSENT = 1, 2
"""Buttons."""


class Touch(SteppedAgent):
    """An agent of a device that a copy of the stand-in simulates, so that each agent has a servo of its own."""

    device: OpenHaptics

    def __init__(self, context: sockets.Context, config: Config, fake: Fake, *, compiled: bool) -> None:
        self.fake = fake
        device = OpenHaptics(
            "left", configured(config, library=fake.path, servo="c", name="Default Device", force_timeout_ms=20.0)
        )
        device.open()
        assert isinstance(device._servo, ShimServo)
        assert device._rig is not None
        self.servo, self.library = device._servo, device._rig.state
        fake.calls.fake_stall(1)
        fake.calls.fake_restart()
        self.library["since_ns"] = START_NS - 10 * TICK_NS
        super().__init__(context, config, device, None, self._memory_of_device, compiled=compiled)

    def _memory_of_device(self) -> list[np.ndarray[Any, Any]]:
        sample = self.servo.sample.copy()
        sample["tick"] = 0  # the servos have run for different times before the test
        state = self.device._state.copy()
        state["servo"] = 0
        estimator = self.device._estimator
        motors = np.array(self.fake.motor_force())
        return [sample, state, self.library, motors, *([] if estimator is None else [estimator.state])]

    def step(self, servo_ticks: int = 1, late_ns: int = 0) -> str:
        """Run the servo, then the agent; return the error of the device, if there is one."""
        now_ns = self.pacer.due_ns + late_ns
        for number in range(servo_ticks):
            self.servo.simulate(now_ns - 400_000 * (servo_ticks - number))
            self.fake.calls.fake_step()
        self.servo.simulate(now_ns)
        try:
            self.tick(late_ns)
        except DeviceError as error:
            self.agent._close_lost_device(error)
            return f"{type(error).__name__}: {error}"
        return ""


@pytest.fixture
def make(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Callable[..., Touch]]:
    """Makes agents of the stand-in in a session; each has a copy of the library."""
    monkeypatch.setattr(touch_library, "SETTLE_NS", 0)  # a stepped servo takes no zero force while it is awaited
    every: list[Touch] = []
    with sockets.open_context() as context:

        def new(config: Config, *, compiled: bool) -> Touch:
            path = tmp_path / str(len(every)) / "libHD.so"
            path.parent.mkdir()
            shutil.copy(fake_library(), path)
            fake = Fake(path)
            fake.reset()
            fake.calls.fake_sway(15.0)
            made = Touch(context, config, fake, compiled=compiled)
            every.append(made)
            made.step()
            made.enter_session()
            return made

        yield new
        for one in every:
            one.close()
            one.fake.calls.fake_stall(0)
            touch_library.rig_of(one.fake.path).clear()


def pair(make: Callable[..., Touch], config: Config) -> list[Touch]:
    """An agent that runs compiled and one that runs single steps."""
    return [make(config, compiled=compiled) for compiled in (True, False)]


def config_of(tmp_path: Path, velocity: Any = "device", **safety: Any) -> Config:
    config = Config()
    left = replace(
        config.agents.left,
        stop_buttons=STOP,
        consent_buttons=CONSENT,
        velocity=velocity,
        options={"force_timeout_ms": 20.0},
    )
    agents = replace(config.agents, left=left, profiles=str(tmp_path / "profiles"))
    return replace(config, agents=agents, safety=replace(config.safety, arm_time=0.05, max_speed=5.0, **safety))


def events(number: int, rng: np.random.Generator) -> list[Callable[[Fake], None]]:
    """What happens at the device before a tick."""
    match number:
        case 0:
            return [lambda fake: fake.calls.fake_press(FIRST.encode(), CONSENT)]
        case 600:
            return [lambda fake: fake.calls.fake_press(FIRST.encode(), 0)]  # the hand lets go
        case 640:
            return [lambda fake: fake.calls.fake_press(FIRST.encode(), CONSENT)]
        case 1000:
            return [lambda fake: fake.calls.fake_press(FIRST.encode(), CONSENT | STOP)]
        case 1050:
            return [lambda fake: fake.calls.fake_press(FIRST.encode(), CONSENT)]
        case 1300:
            return [lambda fake: fake.calls.fake_dock(FIRST.encode(), 1)]
        case 1350:
            return [lambda fake: fake.calls.fake_dock(FIRST.encode(), 0)]
    if 1800 <= number < 1803:
        code = int(rng.choice([Error.WARM_MOTORS, Error.EXCEEDED_MAX_VELOCITY]))
        return [lambda fake: fake.calls.fake_error(code, 4, fake.calls.fake_handle(FIRST.encode()))]
    return []


def sent(number: int, rng: np.random.Generator) -> list[Any]:
    """What the server sends: it commands forces, forbids and allows arming, as around a fault, and falls silent."""
    for first in (0, 640, 1060, 1350, 2850):
        if first <= number < first + 40:
            allows = number >= first + 10
            return [fixed_form(Heartbeat(2 * number, number, number, 300_000, allows))]
    return [] if 900 <= number < 940 else answers(number, number + 1, rng)


def run_both(both: list[Touch], ticks: int, seed: int) -> None:
    """Run both agents, and require the same of both after each tick."""
    rng = np.random.default_rng(seed)
    for number in range(ticks):
        happens, messages = events(number, rng), sent(number, rng)
        late_ns = 30 * TICK_NS if rng.integers(300) == 0 else int(rng.integers(0, 200_000))
        # At times the servo misses a tick, or the agent sees two at once; for some it is dead, but not lost.
        servo_ticks = 0 if 2400 <= number < 2430 else int(rng.choice([1, 1, 1, 1, 0, 2]))
        errors = set()
        for one in both:
            for event in happens:
                event(one.fake)
            for message in messages:
                one.deliver(message)
            errors.add(one.step(servo_ticks, late_ns))
        assert errors == {""}
        assert both[0].state() == both[1].state(), number
    first, second = both
    assert first.received == second.received
    assert first.agent._ring.rows.tobytes() == second.agent._ring.rows.tobytes()


def test_undisturbed_ticks_of_a_touch_equal_the_single_steps(make: Callable[..., Touch], tmp_path: Path) -> None:
    both = pair(make, config_of(tmp_path))
    run_both(both, TICKS, 7)
    samples = [message for message in both[0].received if isinstance(message, Stylus)]
    assert both[0].completed > 0.75 * TICKS
    assert both[1].completed == 0
    seen = 0
    for sample in samples:
        seen |= sample.safeguards
    for safeguard in (Safeguard.ARMED, Safeguard.NOT_READY, Safeguard.STOPPED, Safeguard.STALE, Safeguard.RAMPING):
        assert seen & safeguard, safeguard
    assert max(abs(sample.rendered) for sample in samples) > 0.2
    assert np.ptp([sample.z for sample in samples]) > 0.01
    assert {sample.buttons for sample in samples} == {0, CONSENT, CONSENT | STOP}


def test_touch_with_a_profile_an_estimator_and_passivity_equals_the_single_steps(
    make: Callable[..., Touch], tmp_path: Path
) -> None:
    placement = Placement(zero_y=0.01, zero_z=-0.02, scale=1.5, z_max=0.014, calibrated="for this test")
    save(tmp_path / "profiles", Profile(Identity("Touch", FIRST), placement=placement))
    config = config_of(tmp_path, "adaptive", passivity=True)
    left = replace(config.agents.left, zero=0.003)
    both = pair(make, replace(config, agents=replace(config.agents, left=left)))
    run_both(both, 1000, 8)
    assert both[0].completed > 0.7 * 1000
    heights = [message.z for message in both[0].received if isinstance(message, Stylus)]
    # The hand sways by 15 mm about the device's origin, which is 20 mm above the scene's.
    assert max(heights) == pytest.approx(1.5 * 0.035 - 0.003, abs=0.006)


@pytest.mark.parametrize("code", [Error.COMM_ERROR, Error.TIMER_ERROR])
def test_fatal_error_loses_the_device_in_the_same_tick(make: Callable[..., Touch], tmp_path: Path, code: Error) -> None:
    both = pair(make, config_of(tmp_path))
    run_both(both, 300, 9)
    assert both[0].agent._rendered != 0.0
    for one in both:
        one.fake.calls.fake_error(int(code), -28, one.fake.calls.fake_handle(FIRST.encode()))
    found = [one.step() for one in both]
    assert code.name in found[0]
    assert found[0] == found[1]
    assert both[0].agent._safety.chain.tobytes() == both[1].agent._safety.chain.tobytes()
    assert both[0].agent._rendered == 0.0
    assert [one.fake.motor_force() for one in both] == [(0.0, 0.0, 0.0)] * 2


def test_dead_servo_loses_the_device_in_the_same_tick(make: Callable[..., Touch], tmp_path: Path) -> None:
    both = pair(make, config_of(tmp_path))
    run_both(both, 300, 10)
    found: list[list[str]] = [[], []]
    for one, errors in zip(both, found, strict=True):
        while not errors or not errors[-1]:
            one.deliver(fixed_form(Force(10_000 + len(errors), 0, one.agent._seq - 1, 0.1, 300_000)))
            errors.append(one.step(servo_ticks=0))
    assert found[0] == found[1]
    assert 45 < len(found[0]) < 55
    assert "has stalled for" in found[0][-1]


def test_emergency_stop_lasts_until_the_server_knows_of_it(make: Callable[..., Touch], tmp_path: Path) -> None:
    """As in single steps: a heartbeat that answers a sample from before the stop clears nothing."""
    both = pair(make, config_of(tmp_path))
    run_both(both, 300, 11)
    for one in both:
        before = one.agent._seq - 1
        one.fake.calls.fake_press(FIRST.encode(), CONSENT | STOP)
        one.step()
        one.fake.calls.fake_press(FIRST.encode(), CONSENT)
        for number in range(5):
            one.deliver(fixed_form(Heartbeat(5000 + number, 0, before, 300_000, False)))
            one.step()
            assert one.stop_seq != KNOWN
        assert one.agent._rendered == 0.0
        one.deliver(fixed_form(Heartbeat(6000, 0, one.agent._seq - 1, 300_000, False)))
        one.step()
        one.step()
        assert one.stop_seq == KNOWN
    assert both[0].state() == both[1].state()


def test_second_device_of_the_process_is_left_to_the_single_steps(make: Callable[..., Touch], tmp_path: Path) -> None:
    """Its servo may take this one's errors off the stack that both share."""
    one = make(config_of(tmp_path), compiled=True)
    one.library["devices"] = 2
    one.deliver(fixed_form(Heartbeat(1, 0, 1, 300_000, True)))
    before = one.completed
    assert one.step() == ""
    assert one.completed == before
