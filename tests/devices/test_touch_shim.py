"""The servo in C: compiled on demand, with clear errors if that is impossible."""

import sys
from pathlib import Path

import numpy as np
import pytest

from libhd import FIRST, Fake, made
from netboard.base.errors import DeviceNotFound
from netboard.devices.touch import library as hdrig
from netboard.devices.touch import shim as hdshim
from netboard.devices.touch.servo import PythonServo


def test_the_shim_is_compiled_once(tmp_path: Path) -> None:
    first = hdshim.build(tmp_path / "kept")
    assert first.exists()
    before = first.stat().st_mtime_ns
    assert hdshim.build(tmp_path / "kept") == first
    assert first.stat().st_mtime_ns == before
    assert [at.name for at in first.parent.iterdir()] == [first.name]


def test_without_a_compiler_it_says_so(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delenv("CC", raising=False)
    monkeypatch.setenv("PATH", str(tmp_path))
    with pytest.raises(DeviceNotFound, match=r'needs a compiler.*\(cc, gcc, clang\).*servo = "python"'):
        hdshim.build(tmp_path)
    monkeypatch.setenv("CC", "no-such-compiler -m64")
    with pytest.raises(DeviceNotFound, match=r"\(no-such-compiler -m64\)"):
        hdshim.build(tmp_path)


def test_a_compiler_that_fails_is_quoted(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("CC", f"{sys.executable} -c 'raise SystemExit(\"no such luck\")'")
    with pytest.raises(DeviceNotFound, match=r"cannot be compiled by .*: no such luck"):
        hdshim.build(tmp_path)
    assert list(tmp_path.iterdir()) == []


def test_a_folder_that_cannot_be_written_is_named(tmp_path: Path) -> None:
    (tmp_path / "file").touch()
    with pytest.raises(DeviceNotFound, match=r"cannot be kept in .*file"):
        hdshim.build(tmp_path / "file" / "folder")


def test_without_the_shim_nothing_is_left_behind(fake: Fake, monkeypatch: pytest.MonkeyPatch) -> None:
    def refused(_: Path) -> Path:
        raise DeviceNotFound("no compiler")

    hdshim.shim.cache_clear()
    monkeypatch.setattr(hdshim, "build", refused)
    with pytest.raises(DeviceNotFound, match="no compiler"):
        made(fake, servo="c").open()
    assert fake.said() == [f"init {FIRST}", f"disable {FIRST}"]


@pytest.mark.parametrize("kind", [None, PythonServo, hdshim.ShimServo])
def test_a_watch_notes_when_a_callback_began_and_ended(
    fake: Fake, kind: type | None, monkeypatch: pytest.MonkeyPatch
) -> None:
    if kind is None:
        monkeypatch.setattr(hdrig, "SETTLE_NS", 1_000_000)
    rig = hdrig.rig_of(fake.path)
    with rig.paused():
        opened = rig.init("Default Device")
        servo = (kind or hdshim.ShimServo)(rig.library, opened.handle, 10**9)
        watch = hdshim.Watch(servo.entry if kind else None, 10)
        rig.schedule(opened, servo, watch.entry)
    fake.wait(15)
    rig.release(opened)
    began, ended = watch.times.T
    assert len(began) == 10
    assert (ended >= began).all()
    assert (np.diff(began) > 0).all()
    assert (servo.result() is None) == (kind is None)
