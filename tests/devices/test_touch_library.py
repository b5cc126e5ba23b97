"""Opening and closing OpenHaptics devices: release order, remaining state, and two devices in one process."""

import subprocess
import sys
import threading
from pathlib import Path
from time import monotonic_ns

import pytest
from contract import MS

from libhd import FIRST, SECOND, STALL_NS, Fake, Opener, made
from netboard.base.errors import DeviceError, DeviceLost, DeviceNotFound, DeviceTimeout
from netboard.devices.touch import library as hdrig
from netboard.devices.touch.api import Error
from netboard.devices.touch.device import SERVOS

SHUTDOWN = ["stop", "unschedule", "disable 40512001"]

TESTS = Path(__file__).parent.parent

FORGETFUL = """
import atexit, sys
from libhd import Fake, made
fake = Fake()
atexit.register(lambda: print(*fake.said(), sep="\\n"))  # what is registered first is called last
device = made(fake, servo=sys.argv[1])
device.open()
fake.said()
device.write(0.0, 0.0, 1.0)
fake.wait()
"""


def test_the_force_is_taken_away_before_the_servo_is_stopped(open_one: Opener, fake: Fake) -> None:
    device = open_one()
    device.write(0.0, 0.0, 1.0)
    fake.wait()
    assert fake.said() == [f"init {FIRST}", "schedule", "start", "stop", "start", f"force {FIRST}"]
    device.close()
    assert fake.said() == [f"zero {FIRST}", *SHUTDOWN]


@pytest.mark.parametrize("servo", SERVOS)
@pytest.mark.parametrize(
    ("function", "after", "code"),
    [
        ("hdInitDevice", 0, Error.COMM_ERROR),
        ("hdGetString", 2, Error.COMM_ERROR),
        ("hdGetDoublev", 0, Error.INVALID_VALUE),
        ("hdGetDoublev", 2, Error.INVALID_VALUE),
        ("hdScheduleAsynchronous", 0, Error.SCHEDULER_FULL),
        ("hdStartScheduler", 0, Error.TIMER_ERROR),
        ("hdBeginFrame", 0, Error.COMM_ERROR),
        ("hdGetIntegerv", 1, Error.DEVICE_FAULT),
        ("hdCheckCalibration", 0, Error.DEVICE_FAULT),
        ("hdEnable", 5, Error.INVALID_OPERATION),
    ],
)
def test_whatever_fails_in_opening_leaves_nothing_behind(
    fake: Fake, servo: str, function: str, after: int, code: Error, monkeypatch: pytest.MonkeyPatch
) -> None:
    if function == "hdStartScheduler":
        monkeypatch.setattr("netboard.devices.touch.device.FIRST_TICK_NS", MS)
        monkeypatch.setattr(hdrig, "SETTLE_NS", MS)
    device = made(fake, servo=servo, name="Default Device")
    fake.fail(function, code, after)
    with pytest.raises(DeviceError, match=f"HD_{code.name}"):
        device.open()
    assert not fake.is_open()
    assert not fake.calls.fake_running()
    assert fake.calls.fake_jobs() == 0
    said = fake.said()
    assert [line for line in said if line in SHUTDOWN][-1] == f"disable {FIRST}"
    assert "unschedule while running" not in said
    assert ("unschedule" in said) == ("schedule" in said)
    for name in ("device.FIRST_TICK_NS", "library.SETTLE_NS"):
        monkeypatch.setattr(f"netboard.devices.touch.{name}", STALL_NS)
    device.open()
    assert device.read(monotonic_ns()).ready


def test_a_servo_that_never_starts_is_found_when_opening(fake: Fake, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("netboard.devices.touch.device.FIRST_TICK_NS", 20 * MS)
    monkeypatch.setattr(hdrig, "SETTLE_NS", MS)
    fake.calls.fake_stall(1)
    with pytest.raises(DeviceTimeout, match="does not run"):
        made(fake).open()
    assert fake.said() == [f"init {FIRST}", "schedule", "start", *SHUTDOWN]


def test_a_servo_that_does_not_answer_is_not_waited_for(
    open_one: Opener, fake: Fake, monkeypatch: pytest.MonkeyPatch
) -> None:
    device = open_one()
    monkeypatch.setattr(hdrig, "ANSWER_S", 0.01)
    monkeypatch.setattr(hdrig, "SETTLE_NS", MS)
    assert device._rig is not None
    assert device._opened is not None
    fake.calls.fake_stall(1)
    with pytest.raises(DeviceTimeout, match="did nothing"):
        device._rig.ask(device._opened, "asking", lambda: 0)
    assert fake.calls.fake_jobs() == 1


def test_an_interruption_while_opening_leaves_nothing_behind(fake: Fake, monkeypatch: pytest.MonkeyPatch) -> None:
    def interrupted(*_: object) -> None:
        raise KeyboardInterrupt

    monkeypatch.setattr("netboard.devices.touch.device.calibrate", interrupted)
    with pytest.raises(KeyboardInterrupt):
        made(fake).open()
    assert fake.said() == [f"init {FIRST}", "schedule", "start", *SHUTDOWN]


@pytest.mark.slow
@pytest.mark.parametrize("servo", SERVOS)
def test_at_the_interpreter_s_exit_devices_are_let_go(servo: str) -> None:
    done = subprocess.run(
        [sys.executable, "-c", FORGETFUL, servo], cwd=TESTS, capture_output=True, text=True, check=True
    )
    assert done.stderr == ""
    assert done.stdout.splitlines() == [f"force {FIRST}", f"zero {FIRST}", *SHUTDOWN]


def test_there_is_one_rig_for_a_library(fake: Fake) -> None:
    odd = str(Path(fake.path).parent / "." / ".." / Path(fake.path).parent.name / Path(fake.path).name)
    assert hdrig.rig_of(odd) is hdrig.rig_of(fake.path)


# --- two devices --------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("servo", SERVOS)
def test_two_devices_share_the_scheduler(fake: Fake, servo: str) -> None:
    left, right = made(fake, serial=FIRST, servo=servo), made(fake, "right", serial=SECOND, servo=servo)
    left.open()
    right.open()
    fake.place((1.0, 2.0, 3.0), serial=FIRST)
    fake.place((4.0, 5.0, 6.0), serial=SECOND)
    assert left.read(monotonic_ns()).z == pytest.approx(0.002)
    assert right.read(monotonic_ns()).z == pytest.approx(0.005)
    left.write(0.0, 0.0, 0.5)
    right.write(0.0, 0.0, -0.25)
    fake.wait()
    assert (fake.felt(FIRST), fake.felt(SECOND)) == ((0.0, 0.5, 0.0), (0.0, -0.25, 0.0))
    fake.said()
    left.close()
    assert fake.said() == [f"zero {FIRST}", "stop", "unschedule", f"disable {FIRST}", "start"]
    fake.wait()
    assert right.read(monotonic_ns()).z == pytest.approx(0.005)
    right.close()
    assert not fake.calls.fake_running()


def test_an_error_is_that_device_s_only_whoever_takes_it_off_the_stack(fake: Fake) -> None:
    left, right = made(fake, serial=FIRST), made(fake, "right", serial=SECOND, servo="c")
    left.open()
    right.open()
    fake.error(Error.COMM_ERROR, -28, fake.calls.fake_handle(SECOND.encode()))
    assert left.read(monotonic_ns()).ready
    with pytest.raises(DeviceLost):
        right.read(monotonic_ns())
    right.close()
    fake.wait()
    assert left.read(monotonic_ns()).ready


def test_one_of_two_can_be_pulled_out_and_put_in_again(fake: Fake) -> None:
    left, right = made(fake, serial=FIRST), made(fake, "right", serial=SECOND)
    left.open()
    right.open()
    fake.plug(False, SECOND)
    fake.wait()
    with pytest.raises(DeviceLost, match="HD_COMM_ERROR"):
        right.read(monotonic_ns())
    right.close()
    with pytest.raises(DeviceNotFound):
        right.open()
    fake.plug(True, SECOND)
    right.open()
    fake.wait()
    assert right.read(monotonic_ns()).ready
    assert left.read(monotonic_ns()).ready


def test_while_the_scheduler_stands_still_for_another_device_it_is_not_ready_and_not_lost(
    open_one: Opener, fake: Fake
) -> None:
    device = open_one()
    rig = hdrig.rig_of(fake.path)
    later = monotonic_ns() + 2 * STALL_NS
    with rig.paused():
        assert not device.read(later).ready
        found: list[bool] = []
        other = threading.Thread(target=lambda: found.append(device.read(later).ready))
        other.start()
        other.join()
        assert found == [False]
    fake.wait()
    assert device.read(monotonic_ns()).ready
