"""The servo in C: compilation on demand, and its errors."""

import shutil
import sys
from collections.abc import Callable
from pathlib import Path
from time import monotonic_ns

import numpy as np
import pytest

from libhd import FIRST, Fake, make_device
from netboard.base.errors import DeviceNotFound
from netboard.base.system import c_library
from netboard.devices.touch import library as touch_library
from netboard.devices.touch import shim
from netboard.devices.touch.api import ERRORS_LOST, Error
from netboard.devices.touch.servo import KEPT_FAULTS, PythonServo, ticks_of

needs_compiler = pytest.mark.skipif(not any(map(shutil.which, ("cc", "gcc", "clang"))), reason="no C compiler here")


@needs_compiler
def test_shim_is_compiled_once(tmp_path: Path) -> None:
    first = shim.build(tmp_path / "kept")
    assert first.exists()
    before = first.stat().st_mtime_ns
    assert shim.build(tmp_path / "kept") == first
    assert first.stat().st_mtime_ns == before
    assert [at.name for at in first.parent.iterdir()] == [first.name]


@needs_compiler
@pytest.mark.parametrize(
    "damage", [lambda kept: b"", lambda kept: bytes(len(kept)), lambda kept: kept[: len(kept) // 2]]
)
def test_damaged_shim_is_compiled_again(
    tmp_path: Path, damage: Callable[[bytes], bytes], caplog: pytest.LogCaptureFixture
) -> None:
    """As a power cut leaves it. The linker would refuse an empty library, and a process would crash in a half one."""
    kept = shim.build(tmp_path)
    sound = kept.read_bytes()
    kept.write_bytes(damage(sound))
    assert shim.build(tmp_path) == kept
    assert kept.read_bytes() == sound
    assert [f"{kept}: " in line and "compiled again" in line for line in caplog.messages] == [True]
    assert shim.servo_library(kept).servo_size() > 0


def test_library_that_does_not_load_is_reported(tmp_path: Path) -> None:
    (tmp_path / "shim.so").write_bytes(b"not a library")
    with pytest.raises(DeviceNotFound, match=r'does not load: .*shim\.so.*servo = "python"'):
        shim.servo_library(tmp_path / "shim.so")


def test_compiler_that_writes_nothing_is_reported(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("CC", f"{sys.executable} -c pass")
    with pytest.raises(DeviceNotFound, match="cannot be compiled by"):
        shim.build(tmp_path)


def test_missing_compiler_is_reported(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delenv("CC", raising=False)
    monkeypatch.setenv("PATH", str(tmp_path))
    with pytest.raises(DeviceNotFound, match=r'needs a compiler.*\(cc, gcc, clang\).*servo = "python"'):
        shim.build(tmp_path)
    monkeypatch.setenv("CC", "no-such-compiler -m64")
    with pytest.raises(DeviceNotFound, match=r"\(no-such-compiler -m64\)"):
        shim.build(tmp_path)


def test_compiler_error_is_quoted(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("CC", f"{sys.executable} -c 'raise SystemExit(\"compiler error\")'")
    with pytest.raises(DeviceNotFound, match=r"cannot be compiled by .*: compiler error"):
        shim.build(tmp_path)
    assert list(tmp_path.iterdir()) == []


@needs_compiler
def test_error_names_unwritable_folder(tmp_path: Path) -> None:
    (tmp_path / "file").touch()
    with pytest.raises(DeviceNotFound, match=r"cannot be kept in .*file"):
        shim.build(tmp_path / "file" / "folder")


def test_missing_shim_releases_the_device(fake: Fake, monkeypatch: pytest.MonkeyPatch) -> None:
    def refused(_: Path) -> Path:
        raise DeviceNotFound("no compiler")

    shim.shim.cache_clear()
    monkeypatch.setattr(shim, "build", refused)
    with pytest.raises(DeviceNotFound, match="no compiler"):
        make_device(fake, servo="c").open()
    assert fake.call_log() == [f"init {FIRST}", f"disable {FIRST}"]


def test_default_servo_is_in_c_and_its_device_has_compiled_access(fake: Fake) -> None:
    device = make_device(fake)
    assert device.open().details["servo"] == "c"
    assert device.compiled is not None
    device.close()


def test_compiled_access_to_a_released_device_does_nothing(fake: Fake) -> None:
    device = make_device(fake, servo="c")
    device.open()
    access, servo = device.compiled, device._servo
    assert access is not None
    assert isinstance(servo, shim.ShimServo)
    assert any(part is servo.memory for part in access.parts[0])
    assert access.read(access.parts, monotonic_ns())[0]
    device.close()
    before = servo.memory.copy()
    assert not access.read(access.parts, monotonic_ns())[0]
    access.write(access.parts, 0.0, 0.0, 1.0)
    assert (servo.memory == before).all()


@pytest.mark.parametrize("kind", [PythonServo, shim.ShimServo])
@pytest.mark.parametrize("pending", [KEPT_FAULTS - 1, KEPT_FAULTS, 2 * KEPT_FAULTS + 3])
def test_servos_keep_as_many_errors_and_tell_of_lost_ones(
    fake: Fake, kind: type[PythonServo] | type[shim.ShimServo], pending: int
) -> None:
    rig = touch_library.rig_of(fake.path)
    with rig.paused():
        opened = rig.init("Default Device")
        servo = kind(rig.library, opened.handle, 10**9)
        rig.schedule(opened, servo)
    fake.calls.fake_stall(1)
    for number in range(pending):
        fake.calls.fake_error(Error.WARM_MOTORS, number, opened.handle)
        fake.calls.fake_step()
    fake.calls.fake_stall(0)
    lost = max(pending - (KEPT_FAULTS - 1), 0)
    found = servo.faults()
    assert [code for code, *_ in found].count(ERRORS_LOST) == (1 if lost else 0)
    assert [internal for code, internal, _ in found if code != ERRORS_LOST] == list(range(lost, pending))
    assert servo.faults() == []
    rig.release(opened)


def test_default_servo_is_in_python_without_a_compiler(
    fake: Fake, monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    def refused(_: Path) -> Path:
        raise DeviceNotFound("no compiler")

    shim.shim.cache_clear()
    monkeypatch.setattr(shim, "build", refused)
    device = make_device(fake)
    assert device.open().details["servo"] == "python"
    assert device.compiled is None
    assert "run in Python, which is slower: no compiler" in caplog.text
    device.close()


def test_on_windows_the_servo_is_in_python_whatever_compiler_is_there(
    fake: Fake, monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    shim.shim.cache_clear()
    monkeypatch.setattr(c_library, "HAS_POSIX", False)
    monkeypatch.setenv("CC", sys.executable)  # not run: it would compile nothing
    device = make_device(fake)
    assert device.open().details["servo"] == "python"
    assert device.compiled is None
    said = "the servo callback in C is not for Windows: it uses the clock and the threads of POSIX"
    assert f"run in Python, which is slower: {said}" in caplog.text
    device.close()
    with pytest.raises(DeviceNotFound, match=f'{said}; connect .* Linux, or set the option servo = "python"'):
        make_device(fake, servo="c").open()


@pytest.mark.parametrize("kind", [None, PythonServo, shim.ShimServo])
def test_watch_records_start_and_end_of_each_callback(
    fake: Fake, kind: type | None, monkeypatch: pytest.MonkeyPatch
) -> None:
    if kind is None:
        monkeypatch.setattr(touch_library, "SETTLE_NS", 1_000_000)
    rig = touch_library.rig_of(fake.path)
    with rig.paused():
        opened = rig.init("Default Device")
        servo = (kind or shim.ShimServo)(rig.library, opened.handle, 10**9)
        watch = shim.Watch(servo.entry if kind else None, 10)
        rig.schedule(opened, servo, watch.entry)
    fake.wait(15)
    rig.release(opened)
    began, ended = watch.times.T
    assert len(began) == 10
    assert (ended >= began).all()
    assert (np.diff(began) > 0).all()
    assert (ticks_of(servo) == 0) == (kind is None)
