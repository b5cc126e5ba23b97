"""The doctor's checks of /proc, /sys and /dev on simulated machines."""

import sys
from pathlib import Path

import pytest

from netboard.base.files.sealed import write_sealed
from netboard.base.finding import Finding
from netboard.base.process.realtime import OFF, OK
from netboard.base.tables.rig import Network
from netboard.devices.setup import usb
from netboard.nodes.doctor import network, system


def write(root: Path, **files: str) -> Path:
    """Create the files of a simulated machine, with ``__`` for ``/`` in their names."""
    for name, text in files.items():
        path = root / name.replace("__", "/")
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(f"{text}\n", encoding="utf-8")
    return root


def test_machine_without_any_interface_is_green(tmp_path: Path) -> None:
    found = [
        system.throttle(tmp_path),
        system.governor(tmp_path),
        system.preemption(tmp_path),
        system.clock_source(tmp_path),
        system.core_sleep(False, tmp_path),
        usb.devices(tmp_path),
    ]
    assert {finding.colour for finding in found} == {"green"}
    assert {finding.advice for finding in found} == {""}


@pytest.mark.parametrize(
    ("runtime", "colour"), [("950000", "green"), ("1000000", "green"), ("-1", "yellow"), ("0", "red")]
)
def test_realtime_throttling(tmp_path: Path, runtime: str, colour: str) -> None:
    write(tmp_path, proc__sys__kernel__sched_rt_runtime_us=runtime, proc__sys__kernel__sched_rt_period_us="1000000")
    assert system.throttle(tmp_path).colour == colour


def test_differing_cpu_governor_is_yellow(tmp_path: Path) -> None:
    governor = "sys__devices__system__cpu__cpu{}__cpufreq__scaling_governor"
    write(tmp_path, **{governor.format(0): "performance", governor.format(1): "performance"})
    assert system.governor(tmp_path).colour == "green"
    write(tmp_path, **{governor.format(1): "powersave"})
    finding = system.governor(tmp_path)
    assert (finding.colour, finding.found) == ("yellow", "performance, powersave")
    assert "performance" in finding.advice


DEBIAN = "Linux version 6.12 (gcc 14) #1 SMP PREEMPT_DYNAMIC Debian"


@pytest.mark.parametrize(
    ("files", "colour", "found"),
    [
        ({"proc__version": "Linux 6.12 #1 SMP PREEMPT_RT"}, "green", "PREEMPT_RT"),
        ({"proc__version": "Linux 5.15", "sys__kernel__realtime": "1"}, "green", "PREEMPT_RT"),
        ({"proc__version": DEBIAN}, "green", "chosen at boot"),
        ({"proc__version": DEBIAN, "proc__cmdline": "ro preempt=voluntary quiet"}, "yellow", "voluntary"),
        (
            {"proc__version": DEBIAN, "sys__kernel__debug__sched__preempt": "none voluntary (full) lazy"},
            "green",
            "full",
        ),
        ({"proc__version": DEBIAN, "sys__kernel__debug__sched__preempt": "(none) voluntary full"}, "yellow", "none"),
        ({"proc__version": "Linux 5.10 #1 SMP"}, "yellow", "none"),
        ({"proc__version": "Linux 5.10 #1 SMP PREEMPT"}, "green", "full"),
    ],
)
def test_kernel_preemption_mode(tmp_path: Path, files: dict[str, str], colour: str, found: str) -> None:
    finding = system.preemption(write(tmp_path, **files))
    assert (finding.colour, finding.found) == (colour, found)


def test_deep_core_sleep_is_yellow_unless_prevented(tmp_path: Path) -> None:
    state = "sys__devices__system__cpu__cpu0__cpuidle__state{}__latency"
    write(tmp_path, **{state.format(0): "0", state.format(1): "2"})
    assert system.core_sleep(False, tmp_path).colour == "green"
    write(tmp_path, **{state.format(2): "133"})
    assert system.core_sleep(False, tmp_path).colour == "yellow"
    assert system.core_sleep(False, tmp_path).figures == {"latency_us": 133}
    assert system.core_sleep(True, tmp_path).colour == "green"


@pytest.mark.parametrize(("source", "colour"), [("tsc", "green"), ("hpet", "yellow")])
def test_clock_source(tmp_path: Path, source: str, colour: str) -> None:
    write(tmp_path, sys__devices__system__clocksource__clocksource0__current_clocksource=source)
    assert system.clock_source(tmp_path).colour == colour


@pytest.mark.parametrize(("flags", "colour"), [("fpu tsc sse", "green"), ("fpu hypervisor sse", "yellow")])
def test_virtual_machine_is_yellow(tmp_path: Path, flags: str, colour: str) -> None:
    write(tmp_path, proc__cpuinfo=f"processor : 0\nflags : {flags}\n")
    assert system.virtual_machine(tmp_path).colour == colour


def test_system_needs_a_core_for_each_loop_and_one_more() -> None:
    assert system.cores(range(4)).colour == "green"
    assert system.cores(range(3)).colour == "yellow"
    assert "needs 4" in system.cores([0]).advice


def test_isolated_core_requires_a_loop_pinned_to_it(tmp_path: Path) -> None:
    assert system.isolation("3", range(4), tmp_path).colour == "yellow"
    assert system.isolation("1", range(2), tmp_path).colour == "green"
    write(tmp_path, sys__devices__system__cpu__isolated="2-3")
    assert system.isolation("3", range(2), tmp_path).colour == "green"
    for server in ("1", ""):
        assert system.isolation(server, range(2), tmp_path).advice == '[realtime] server_cpus = "2-3"'


def cards(root: Path) -> Path:
    """A machine with two cards, one of them wireless, one that is down, and a loopback."""
    write(
        root,
        **{f"{name}__operstate": state for name, state in (("eth0", "up"), ("wlan0", "up"), ("eth1", "down"))},
        **{f"{name}__device__x": "" for name in ("eth0", "wlan0", "eth1")},
        wlan0__wireless__x="",
        lo__operstate="unknown",
    )
    return root


def test_network_card_that_delays_frames_is_yellow(tmp_path: Path) -> None:
    outside = Network(bind="192.0.2.1", host="192.0.2.1")
    assert network.card(Network(), cards(tmp_path)).colour == "green"
    assert network.card(outside, tmp_path).found == "wlan0: wireless"
    (tmp_path / "wlan0" / "operstate").write_text("down")
    slow = network.card(outside, tmp_path, lambda name: 50)
    assert (slow.colour, slow.advice) == ("yellow", "ethtool -C eth0 rx-usecs 0")
    assert network.card(outside, tmp_path, lambda name: 0).found == "delay of interrupts: eth0: 0 us"
    assert network.card(outside, tmp_path, lambda name: None).colour == "green"
    assert network.card(outside, tmp_path / "nowhere").found == "no network card is up"


def test_missing_network_card_has_no_coalescing_time() -> None:
    assert network.coalescing_us("nosuchcard0") is None


@pytest.mark.parametrize("check", [system.scheduling, system.memory])
def test_scheduling_and_memory_findings_follow_the_granted_settings(
    check: object, monkeypatch: pytest.MonkeyPatch
) -> None:
    assert callable(check)
    monkeypatch.setattr(sys, "platform", "linux")
    granted, off, refused = check(OK), check(OFF), check("Operation not permitted")
    assert (granted.colour, granted.advice) == ("green", "")
    assert off.colour == "yellow"
    assert refused.colour in {"yellow", "red"}
    assert "deploy/limits.d/netboard.conf" in refused.advice
    monkeypatch.setattr(sys, "platform", "darwin")
    assert check("not offered on darwin").colour == "yellow"


def test_cache_of_kernels_is_green_if_every_file_is_sound_and_more_can_be_kept(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("NUMBA_CACHE_DIR", str(tmp_path))
    write_sealed(tmp_path / "a.nbc", bytes(2_000_000))
    assert system.kernels() == Finding("compiled kernels", "green", f"1 in {tmp_path}, 2.0 MB")
    (tmp_path / "b.nbc").touch()
    damaged = system.kernels()
    assert (damaged.colour, damaged.found) == ("yellow", f"1 of 2 in {tmp_path} are damaged: b.nbc is empty")
    assert f"delete {tmp_path}" in damaged.advice


@pytest.mark.skipif(sys.platform == "win32", reason="no such limit there")
def test_cache_of_kernels_on_a_full_disk_is_yellow(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A limit of the operating system replaces the full disk."""
    import resource

    monkeypatch.setenv("NUMBA_CACHE_DIR", str(tmp_path))
    limits = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (1000, limits[1]))
    try:
        found = system.kernels()
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, limits)
    assert found.colour == "yellow"
    assert found.found.endswith("no more can be kept: File too large")
    assert "NUMBA_CACHE_DIR" in found.advice


def test_missing_cpus_are_yellow() -> None:
    assert system.cpus("2", OK).colour == "green"
    assert system.cpus("64", "Invalid argument") == Finding(
        "server's CPUs", "yellow", "64: Invalid argument", "name CPUs of the server's machine in [realtime] server_cpus"
    )


# --- USB ---------------------------------------------------------------------------------------------------------


@pytest.fixture
def plugged(tmp_path: Path) -> Path:
    """A machine with a hub, a Touch (HID) and a Touch (USB)."""
    at = "sys__bus__usb__devices__"
    write(
        tmp_path,
        **{f"{at}usb1__idVendor": "1d6b", f"{at}usb1__idProduct": "0002"},
        **{
            f"{at}1-1__idVendor": "2988",
            f"{at}1-1__idProduct": "0304",
            f"{at}1-1__uevent": "DEVNAME=bus/usb/001/004",
        },
        **{f"{at}1-1__1-1:1.0__0003:2988:0304.0001__hidraw__hidraw3__dev": "242:3"},
        **{
            f"{at}1-2__idVendor": "2988",
            f"{at}1-2__idProduct": "0302",
            f"{at}1-2__uevent": "DEVNAME=bus/usb/001/005",
        },
        **{f"{at}1-2__1-2:1.0__tty__ttyACM0__dev": "166:0"},
        dev__hidraw3="",
        dev__ttyACM0="",
        dev__bus__usb__001__004="",
        dev__bus__usb__001__005="",
    )
    for node in ("hidraw3", "ttyACM0", "bus/usb/001/004", "bus/usb/001/005"):
        (tmp_path / "dev" / node).chmod(0o660)
    return tmp_path


def test_accessible_usb_devices_are_green(plugged: Path) -> None:
    finding = usb.devices(plugged)
    assert (finding.colour, finding.found) == ("green", "Touch (HID) at 1-1, Touch (USB) at 1-2")


def test_inaccessible_usb_device_is_red(plugged: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("netboard.devices.setup.usb.os.access", lambda node, how: node.name != "hidraw3")
    finding = usb.devices(plugged)
    assert finding.colour == "red"
    assert "no permission for" in finding.found
    assert "hidraw3" in finding.found
    assert "70-netboard.rules" in finding.advice


def test_world_accessible_usb_device_is_yellow(plugged: Path) -> None:
    (plugged / "dev" / "ttyACM0").chmod(0o666)
    finding = usb.devices(plugged)
    assert finding.colour == "yellow"
    assert "ttyACM0" in finding.found


def test_rule_file_that_opens_the_device_to_all_users_is_named(plugged: Path) -> None:
    """The driver of the Touch (HID) installs one, which comes after netboard's and so overrides it."""
    (plugged / "dev" / "hidraw3").chmod(0o666)
    rules = plugged / "etc/udev/rules.d"
    rules.mkdir(parents=True)
    vendors = 'SUBSYSTEMS=="usb", ATTRS{idVendor}=="2988", ATTRS{idProduct}=="0304", GROUP="users", MODE="0666"\n'
    for name, text in {
        "60-early.rules": vendors,
        "70-netboard.rules": vendors,
        "98-other.rules": vendors.replace("2988", "1234"),
        "99-3dsystems.rules": f"\n{vendors}",
        "99-tag.rules": vendors.replace('MODE="0666"', 'TAG+="x"'),
    }.items():
        (rules / name).write_text(text)
    finding = usb.devices(plugged)
    assert (finding.colour, finding.found.endswith("hidraw3")) == ("yellow", True)
    assert finding.advice.startswith(
        f"remove {rules / '99-3dsystems.rules'}, which comes after 70-netboard.rules; then "
    )


@pytest.mark.parametrize(
    ("gone", "why"),
    [
        ("hidraw3", "the Touch (HID) at 1-1 has no file /dev/hidraw*: load the kernel module usbhid"),
        ("ttyACM0", "the Touch (USB) at 1-2 has no file /dev/ttyACM*: load the kernel module cdc_acm"),
    ],
)
def test_usb_device_without_the_file_that_its_library_opens_is_red(plugged: Path, gone: str, why: str) -> None:
    (plugged / "dev" / gone).unlink()
    finding = usb.devices(plugged)
    assert finding.colour == "red"
    assert finding.advice.startswith(why)


def test_other_usb_devices_are_ignored(tmp_path: Path) -> None:
    at = "sys__bus__usb__devices__3-1__"
    write(tmp_path, **{f"{at}idVendor": "046d", f"{at}idProduct": "c52b"})
    assert usb.devices(tmp_path).found == "no USB haptic device found"
