"""The vendor's ABI, compared with a second transcription of its reference; and errors of a missing library."""

import ctypes
import locale
import sys
from ctypes import c_char_p, c_double, c_int32, c_long, c_ubyte, c_uint32, c_ulong, c_void_p, sizeof
from pathlib import Path

import pytest

from libhd import Fake, fake_library
from netboard.base.errors import DeviceNotFound
from netboard.devices.touch import api

TYPES = {
    "HHD": c_uint32,
    "HDenum": c_uint32,
    "HDerror": c_uint32,
    "HDstring": c_char_p,
    "HDboolean": c_ubyte,
    "HDdouble": c_double,
    "HDulong": c_ulong,
    "HDSchedulerHandle": c_ulong,
    "HDushort": ctypes.c_ushort,
    "HDWaitCode": c_uint32,
    "HDCallback": api.CALLBACK,
    "HDErrorInfo": api.ErrorInfo,
    "HDboolean*": ctypes.POINTER(c_ubyte),
    "HDint*": ctypes.POINTER(c_int32),
    "HDfloat*": ctypes.POINTER(ctypes.c_float),
    "HDdouble*": ctypes.POINTER(c_double),
    "HDlong*": ctypes.POINTER(c_long),
    "void*": c_void_p,
    "void": None,
}

FUNCTIONS = """
hdInitDevice HHD HDstring
hdDisableDevice void HHD
hdMakeCurrentDevice void HHD
hdBeginFrame void HHD
hdEndFrame void HHD
hdGetError HDErrorInfo
hdGetErrorString HDstring HDerror
hdEnable void HDenum
hdIsEnabled HDboolean HDenum
hdGetBooleanv void HDenum HDboolean*
hdGetIntegerv void HDenum HDint*
hdGetDoublev void HDenum HDdouble*
hdSetDoublev void HDenum HDdouble*
hdGetString HDstring HDenum
hdCheckCalibration HDenum
hdUpdateCalibration void HDenum
hdStartScheduler void
hdStopScheduler void
hdScheduleAsynchronous HDSchedulerHandle HDCallback void* HDushort
hdUnschedule void HDSchedulerHandle
"""

CONSTANTS = {
    api.Error: """
        SUCCESS 0000  INVALID_ENUM 0100  INVALID_VALUE 0101  INVALID_OPERATION 0102  INVALID_INPUT_TYPE 0103
        BAD_HANDLE 0104  WARM_MOTORS 0200  EXCEEDED_MAX_FORCE 0201  EXCEEDED_MAX_FORCE_IMPULSE 0202
        EXCEEDED_MAX_VELOCITY 0203  FORCE_ERROR 0204  DEVICE_FAULT 0300  DEVICE_ALREADY_INITIATED 0301
        COMM_ERROR 0302  COMM_CONFIG_ERROR 0303  TIMER_ERROR 0304  ILLEGAL_BEGIN 0400  ILLEGAL_END 0401
        FRAME_ERROR 0402  INVALID_PRIORITY 0500  SCHEDULER_FULL 0501  INVALID_LICENSE 0600
    """,
    api.Parameter: """
        CURRENT_BUTTONS 2000  CURRENT_INKWELL_SWITCH 2002  CURRENT_POSITION 2050  CURRENT_VELOCITY 2051
        VERSION 2500  DEVICE_MODEL_TYPE 2501  DEVICE_DRIVER_VERSION 2502  DEVICE_VENDOR 2503
        DEVICE_SERIAL_NUMBER 2504  DEVICE_FIRMWARE_VERSION 2505  MAX_WORKSPACE_DIMENSIONS 2550
        USABLE_WORKSPACE_DIMENSIONS 2551  CALIBRATION_STYLE 2555  UPDATE_RATE 2600  NOMINAL_MAX_STIFFNESS 2602
        NOMINAL_MAX_FORCE 2603  NOMINAL_MAX_CONTINUOUS_FORCE 2604  SOFTWARE_VELOCITY_LIMIT 2606
        SOFTWARE_FORCE_IMPULSE_LIMIT 2607  FORCE_RAMPING_RATE 2608  NOMINAL_MAX_DAMPING 2609  CURRENT_FORCE 2700
    """,
    api.Capability: """
        FORCE_OUTPUT 4000  MAX_FORCE_CLAMPING 4001  FORCE_RAMPING 4002  SOFTWARE_FORCE_LIMIT 4003
        ONE_FRAME_LIMIT 4004  SOFTWARE_VELOCITY_LIMIT 2606  SOFTWARE_FORCE_IMPULSE_LIMIT 2607
    """,
    api.Calibration: "CALIBRATION_OK 5000  CALIBRATION_NEEDS_UPDATE 5001  CALIBRATION_NEEDS_MANUAL_INPUT 5002",
    api.Style: "CALIBRATION_ENCODER_RESET 1  CALIBRATION_AUTO 2  CALIBRATION_INKWELL 4",
    api.After: "CALLBACK_DONE 0  CALLBACK_CONTINUE 1",
}
"""Names without HD_, and values in hexadecimal."""


@pytest.fixture
def library() -> api.Library:
    return api.load(str(fake_library()))


def test_error_info_has_twelve_bytes() -> None:
    assert sizeof(api.ErrorInfo) == 12
    offsets = {name: getattr(api.ErrorInfo, name).offset for name, _ in api.ErrorInfo._fields_}
    assert offsets == {"code": 0, "internal": 4, "handle": 8}
    assert api.ErrorInfo(code=0, internal=-28, handle=0).internal == -28


def test_scheduler_handle_is_an_unsigned_long() -> None:
    wide = sizeof(c_void_p) if sys.platform != "win32" else 4
    assert sizeof(api.PROTOTYPES["hdScheduleAsynchronous"][0]) == wide
    assert sizeof(api.PROTOTYPES["hdUnschedule"][1]) == wide


def test_callback_takes_a_pointer_and_returns_a_code() -> None:
    called = api.CALLBACK(lambda data: api.After.CALLBACK_CONTINUE if data == 5 else api.After.CALLBACK_DONE)
    assert (called(5), called(6)) == (1, 0)


def test_function_prototypes_match_the_reference(library: api.Library) -> None:
    expected = {
        name: tuple(TYPES[word] for word in words) for name, *words in map(str.split, FUNCTIONS.split("\n")[1:-1])
    }
    assert expected == api.PROTOTYPES
    for functions in (library.calls, library.ticks):
        for name, (returns, *takes) in expected.items():
            function = getattr(functions, name)
            assert function.restype is returns, name
            assert list(function.argtypes) == takes, name


@pytest.mark.parametrize("kind", CONSTANTS, ids=lambda kind: kind.__name__)
def test_constants_match_the_reference(kind: type) -> None:
    words = CONSTANTS[kind].split()
    assert {member.name: int(member) for member in kind} == {
        name: int(value, 16) for name, value in zip(words[::2], words[1::2], strict=True)
    }


def test_invalid_handle_and_priorities_match_the_reference() -> None:
    assert api.INVALID_HANDLE == 2**32 - 1
    assert (api.MAX_PRIORITY, api.DEFAULT_PRIORITY) == (65535, 32767)


def test_drain_pops_all_errors_from_the_stack(library: api.Library) -> None:
    fake = Fake()
    fake.reset()
    for code, internal in ((0x0302, -28), (0x0200, 0), (0x0777, 3)):
        fake.error(code, internal, 9)
    unknown, warm, comm = library.drain()
    assert str(comm) == "HD_COMM_ERROR (0x0302, internal -28, handle 9): fake library error"
    assert str(warm) == "HD_WARM_MOTORS (0x0200, internal 0, handle 9): the motors are warm"
    assert str(unknown).startswith("an unknown error (0x0777, internal 3, handle 9)")
    assert library.drain() == []


def test_drain_of_an_endless_stack_stops_at_the_limit(library: api.Library) -> None:
    fake = Fake()
    fake.reset()
    fake.calls.fake_pin_errors(1)
    assert len(library.drain()) == api.MAX_ERRORS
    fake.reset()


def test_load_sets_a_decimal_point_in_a_locale_with_decimal_comma(library: api.Library) -> None:
    kept = locale.setlocale(locale.LC_NUMERIC)
    for locale_name in ("de_DE.UTF-8", "fr_FR.UTF-8", "de_DE", "German_Germany"):
        try:
            locale.setlocale(locale.LC_NUMERIC, locale_name)
        except locale.Error:
            continue
        break
    else:
        pytest.skip("no locale with a decimal comma is installed here")
    try:
        assert Fake().calls.fake_decimal_point() == b","
        api.load(library.path)
        assert Fake().calls.fake_decimal_point() == b"."
    finally:
        locale.setlocale(locale.LC_NUMERIC, kept)


def test_library_is_searched_by_name_and_in_the_vendors_variable(monkeypatch: pytest.MonkeyPatch) -> None:
    name = "HD.dll" if sys.platform == "win32" else "libHD.so"
    monkeypatch.delenv("OH_SDK_BASE", raising=False)
    assert api.places() == [name]
    monkeypatch.setenv("OH_SDK_BASE", "somewhere")
    assert api.places() == [name, str(Path("somewhere", "lib", name))]


def test_missing_library_error_lists_paths_and_the_remedy(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    missing = [str(tmp_path / "one"), str(tmp_path / "other")]
    monkeypatch.setattr(api, "places", lambda: missing)
    with pytest.raises(DeviceNotFound) as found:
        api.load()
    message = str(found.value)
    assert all(f"{place} (" in message for place in missing)
    assert "install 3D Systems' Touch driver and OpenHaptics" in message
    assert "docs/how-to/touch.md" in message


def test_load_rejects_a_missing_or_unrelated_library(tmp_path: Path) -> None:
    with pytest.raises(DeviceNotFound, match="nothing-there"):
        api.load(str(tmp_path / "nothing-there"))
    with pytest.raises(DeviceNotFound, match="hdInitDevice"):
        api.load(_unrelated_library())


def _unrelated_library() -> str:
    """Return the path of a library that is not the vendor's."""
    import _ctypes

    return str(_ctypes.__file__)
