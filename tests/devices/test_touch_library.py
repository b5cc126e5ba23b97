"""Opening and closing OpenHaptics devices: order of release, leftover state, and two devices in one process."""

import gc
import subprocess
import sys
import threading
import weakref
from pathlib import Path
from time import monotonic_ns

import pytest

from libhd import FIRST, SECOND, STALL_NS, Fake, Opener, make_device
from netboard.base.errors import DeviceError, DeviceLost, DeviceNotFound, DeviceTimeout
from netboard.devices.touch import library as touch_library
from netboard.devices.touch.api import Error
from netboard.devices.touch.device import SERVOS
from netboard.devices.touch.servo import PythonServo
from netboard.devices.touch.shim import ShimServo
from netboard.testing.device import MS

SHUTDOWN = ["stop", "unschedule", "disable 40512001"]

TESTS = Path(__file__).parent.parent

EXIT_WITHOUT_CLOSE = """
import atexit, sys
from libhd import Fake, make_device
fake = Fake()
atexit.register(lambda: print(*fake.call_log(), sep="\\n"))  # handlers run in reverse order of registration
device = make_device(fake, servo=sys.argv[1])
device.open()
fake.call_log()
device.write(0.0, 0.0, 1.0)
fake.wait()
"""


def test_close_sets_zero_force_before_stopping_the_servo(open_device: Opener, fake: Fake) -> None:
    device = open_device()
    device.write(0.0, 0.0, 1.0)
    fake.wait()
    assert fake.call_log() == [f"init {FIRST}", "schedule", "start", "stop", "start", f"force {FIRST}"]
    device.close()
    assert fake.call_log() == [f"zero {FIRST}", *SHUTDOWN]


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
def test_failure_while_opening_releases_everything(
    fake: Fake, servo: str, function: str, after: int, code: Error, monkeypatch: pytest.MonkeyPatch
) -> None:
    if function == "hdStartScheduler":
        monkeypatch.setattr("netboard.devices.touch.device.FIRST_TICK_NS", MS)
        monkeypatch.setattr(touch_library, "SETTLE_NS", MS)
    device = make_device(fake, servo=servo, name="Default Device")
    fake.fail(function, code, after)
    with pytest.raises(DeviceError, match=f"HD_{code.name}"):
        device.open()
    assert not fake.is_open()
    assert not fake.calls.fake_running()
    assert fake.calls.fake_jobs() == 0
    calls = fake.call_log()
    assert [line for line in calls if line in SHUTDOWN][-1] == f"disable {FIRST}"
    assert "unschedule while running" not in calls
    assert ("unschedule" in calls) == ("schedule" in calls)
    for name in ("device.FIRST_TICK_NS", "library.SETTLE_NS"):
        monkeypatch.setattr(f"netboard.devices.touch.{name}", STALL_NS)
    device.open()
    assert device.read(monotonic_ns()).ready


def test_open_times_out_if_the_servo_never_starts(fake: Fake, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("netboard.devices.touch.device.FIRST_TICK_NS", 20 * MS)
    monkeypatch.setattr(touch_library, "SETTLE_NS", MS)
    fake.calls.fake_stall(1)
    with pytest.raises(DeviceTimeout, match="does not run"):
        make_device(fake).open()
    assert fake.call_log() == [f"init {FIRST}", "schedule", "start", *SHUTDOWN]


def test_request_to_a_stalled_servo_times_out(open_device: Opener, fake: Fake, monkeypatch: pytest.MonkeyPatch) -> None:
    device = open_device()
    monkeypatch.setattr(touch_library, "ANSWER_S", 0.01)
    monkeypatch.setattr(touch_library, "SETTLE_NS", MS)
    assert device._rig is not None
    assert device._opened is not None
    fake.calls.fake_stall(1)
    with pytest.raises(DeviceTimeout, match="did nothing"):
        device._rig.ask(device._opened, "asking", lambda: 0)
    assert fake.calls.fake_jobs() == 1


def test_interrupted_request_is_unscheduled(open_device: Opener, fake: Fake, monkeypatch: pytest.MonkeyPatch) -> None:
    class Interrupted(threading.Event):
        def wait(self, timeout: float | None = None) -> bool:
            raise KeyboardInterrupt

    device = open_device()
    monkeypatch.setattr(touch_library, "SETTLE_NS", MS)
    assert device._rig is not None
    assert device._opened is not None
    fake.calls.fake_stall(1)
    monkeypatch.setattr(threading, "Event", Interrupted)
    with pytest.raises(KeyboardInterrupt):
        device._rig.ask(device._opened, "asking", lambda: 0)
    assert fake.calls.fake_jobs() == 1


def test_query_of_the_servo_thread_is_never_freed(open_device: Opener, fake: Fake) -> None:
    """Nothing tells when the thread has returned from a callback that was unscheduled or has answered."""

    class Query:
        def __call__(self) -> int:
            return 0

    device, query = open_device(), Query()
    assert device._rig is not None
    assert device._opened is not None
    device._rig.ask(device._opened, "asking", query)
    given = weakref.ref(query)
    for _ in range(3):
        device._rig.ask(device._opened, "asking", lambda: 0)
    del query
    gc.collect()
    assert given() is not None


@pytest.mark.parametrize("kind", SERVOS.values())
def test_servo_is_never_freed(fake: Fake, kind: type[PythonServo] | type[ShimServo]) -> None:
    rig = touch_library.rig_of(fake.path)
    with rig.paused():
        opened = rig.init("Default Device")
        servo = kind(rig.library, opened.handle, STALL_NS)
        rig.schedule(opened, servo)
    rig.release(opened)
    given = weakref.ref(servo)
    del servo, opened
    gc.collect()
    assert given() is not None


def test_keyboard_interrupt_while_opening_releases_everything(fake: Fake, monkeypatch: pytest.MonkeyPatch) -> None:
    def interrupted(*_: object) -> None:
        raise KeyboardInterrupt

    monkeypatch.setattr("netboard.devices.touch.device.calibrate", interrupted)
    with pytest.raises(KeyboardInterrupt):
        make_device(fake).open()
    assert fake.call_log() == [f"init {FIRST}", "schedule", "start", *SHUTDOWN]


@pytest.mark.slow
@pytest.mark.parametrize("servo", SERVOS)
def test_devices_are_released_at_interpreter_exit(servo: str) -> None:
    done = subprocess.run(
        [sys.executable, "-c", EXIT_WITHOUT_CLOSE, servo], cwd=TESTS, capture_output=True, text=True, check=True
    )
    assert done.stderr == ""
    assert done.stdout.splitlines() == [f"force {FIRST}", f"zero {FIRST}", *SHUTDOWN]


def test_paths_to_one_library_share_one_rig(fake: Fake) -> None:
    indirect = str(Path(fake.path).parent / "." / ".." / Path(fake.path).parent.name / Path(fake.path).name)
    assert touch_library.rig_of(indirect) is touch_library.rig_of(fake.path)


# --- two devices --------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("servo", SERVOS)
def test_two_devices_share_the_scheduler(fake: Fake, servo: str) -> None:
    left, right = make_device(fake, serial=FIRST, servo=servo), make_device(fake, "right", serial=SECOND, servo=servo)
    left.open()
    right.open()
    fake.place((1.0, 2.0, 3.0), serial=FIRST)
    fake.place((4.0, 5.0, 6.0), serial=SECOND)
    assert left.read(monotonic_ns()).z == pytest.approx(0.002)
    assert right.read(monotonic_ns()).z == pytest.approx(0.005)
    left.write(0.0, 0.0, 0.5)
    right.write(0.0, 0.0, -0.25)
    fake.wait()
    assert (fake.motor_force(FIRST), fake.motor_force(SECOND)) == ((0.0, 0.5, 0.0), (0.0, -0.25, 0.0))
    fake.call_log()
    left.close()
    assert fake.call_log() == [f"zero {FIRST}", "stop", "unschedule", f"disable {FIRST}", "start"]
    fake.wait()
    assert right.read(monotonic_ns()).z == pytest.approx(0.005)
    right.close()
    assert not fake.calls.fake_running()


def test_error_affects_only_the_device_of_its_handle(fake: Fake) -> None:
    left, right = make_device(fake, serial=FIRST), make_device(fake, "right", serial=SECOND, servo="c")
    left.open()
    right.open()
    fake.error(Error.COMM_ERROR, -28, fake.calls.fake_handle(SECOND.encode()))
    assert left.read(monotonic_ns()).ready
    with pytest.raises(DeviceLost):
        right.read(monotonic_ns())
    right.close()
    fake.wait()
    assert left.read(monotonic_ns()).ready


def test_one_of_two_devices_can_be_unplugged_and_replugged(fake: Fake) -> None:
    left, right = make_device(fake, serial=FIRST), make_device(fake, "right", serial=SECOND)
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


def test_device_is_unready_but_not_lost_while_the_scheduler_is_paused(open_device: Opener, fake: Fake) -> None:
    device = open_device()
    rig = touch_library.rig_of(fake.path)
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
