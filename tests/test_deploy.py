"""The files in deploy/ parse, name existing commands, and grant no unneeded access."""

import configparser
import os
import re
import shlex
import shutil
import subprocess
import sys
from pathlib import Path

import pytest
import typer.main

from netboard.base.config import parse
from netboard.base.process.realtime import IO_PRIORITY_STEP, Priority
from netboard.devices.contract.registry import UsbLink
from netboard.devices.setup import udev
from netboard.devices.setup.usb import MODELS
from netboard.network.keys import encrypted
from netboard.nodes.operator.launcher import STOP_SECONDS
from netboard.nodes.server.record_keeping import FINISH_NS
from netboard.services.cli import app

DEPLOY = Path(__file__).parent.parent / "deploy"
UNITS = sorted(DEPLOY.glob("systemd/*/*.service"))
INSTALLED = "/opt/netboard/.venv/bin/netboard"


def unit(path: Path) -> configparser.ConfigParser:
    # What is given several times is a list: the last one counts here, `directives` has them all.
    parsed = configparser.ConfigParser(interpolation=None, strict=False)
    parsed.optionxform = str  # type: ignore[assignment,method-assign]
    parsed.read_string(path.read_text(encoding="utf-8"))
    return parsed


def called(words: list[str]) -> None:
    """Parse a command as the shell would run it, without running it; raises if the command has no such option."""
    group = typer.main.get_command(app)
    assert isinstance(group, typer.core.TyperGroup)
    command = group.commands[words[0]]
    command.make_context(words[0], words[1:])


def test_example_configuration_requires_keys() -> None:
    config = parse((DEPLOY / "two-stations/netboard.toml").read_text(encoding="utf-8"))
    assert encrypted(config.network)
    assert config.network.host == config.network.bind == "10.77.0.1"


def test_every_command_in_the_examples_header_exists() -> None:
    text = (DEPLOY / "two-stations/netboard.toml").read_text(encoding="utf-8")
    commands = re.findall(r"netboard (up .*? netboard\.toml)", text)
    assert len(commands) == 4
    for command in commands:
        called(command.split())


def test_every_process_has_a_unit() -> None:
    commands = {shlex.split(unit(path)["Service"]["ExecStart"])[1] for path in UNITS}
    assert commands == {"server", "logger", "agent", "display", "station", "trigger"}


@pytest.mark.parametrize("path", UNITS, ids=lambda path: path.name)
def test_units_run_existing_commands(path: Path) -> None:
    program, *words = shlex.split(unit(path)["Service"]["ExecStart"].replace("%i", "left"))
    assert program == INSTALLED
    assert ("%i" in unit(path)["Service"]["ExecStart"]) == ("@" in path.name)
    called(words)


@pytest.mark.parametrize("path", UNITS, ids=lambda path: path.name)
def test_units_set_watchdog_restart_and_stop_timeout(path: Path) -> None:
    service = unit(path)["Service"]
    assert service["Type"] == "notify"
    assert int(service["WatchdogSec"]) >= 10
    assert "CPUSchedulingPolicy" not in service
    if "server" in path.name:
        assert int(service["TimeoutStopSec"]) > FINISH_NS * 1e-9 + 15
        assert int(service["WatchdogSec"]) > FINISH_NS * 1e-9 + 15
        assert service["Restart"] == "no"
    else:
        assert service["Restart"] == "on-failure"
        assert service["RestartPreventExitStatus"] == "2"
    if "station" in path.name:
        assert int(service["TimeoutStopSec"]) > STOP_SECONDS
    if "logger" in path.name:
        assert int(service["TimeoutStopSec"]) > STOP_SECONDS + FINISH_NS * 1e-9


@pytest.mark.parametrize("name", ["netboard-server.service", "netboard-agent@.service", "netboard-trigger.service"])
def test_real_time_units_grant_priority_and_locked_memory(name: str) -> None:
    service = unit(DEPLOY / "systemd/system" / name)["Service"]
    assert int(service["LimitRTPRIO"]) >= max(Priority) + IO_PRIORITY_STEP
    assert service["LimitMEMLOCK"] == "infinity"
    assert "PrivateDevices" not in service


# --- what units may do -------------------------------------------------------------------------------------------

SANDBOX = DEPLOY / "systemd/user/netboard-display@.service.d/sandbox.conf"

EVERYWHERE = {
    "NoNewPrivileges=yes",
    "CacheDirectory=netboard",
    "RestrictAddressFamilies=AF_UNIX AF_INET AF_INET6 AF_NETLINK",
    "RestrictNamespaces=yes",
    "RestrictSUIDSGID=yes",
    "LockPersonality=yes",
    "SystemCallArchitectures=native",
    "SystemCallFilter=@system-service",
    "SystemCallFilter=~@privileged",
    "SystemCallErrorNumber=EPERM",
    "MemoryDenyWriteExecute=no",
}
"""ZeroMQ aborts a server that may not ask for interfaces by netlink; numba maps what it has compiled as executable."""

KERNEL = {
    "CapabilityBoundingSet=",
    "ProtectSystem=strict",
    "ProtectProc=invisible",
    "ProtectKernelTunables=yes",
    "ProtectKernelModules=yes",
    "ProtectKernelLogs=yes",
    "ProtectControlGroups=yes",
    "ProtectClock=yes",
    "ProtectHostname=yes",
}

OF_THE_SYSTEM = KERNEL | {
    "User=netboard",
    "AmbientCapabilities=",
    "UMask=0027",
    "StateDirectory=netboard",
    "ProtectHome=yes",
    "PrivateTmp=yes",
    "DevicePolicy=closed",
    "RemoveIPC=yes",
    "KeyringMode=private",
}

OWN = {
    "netboard-server.service": {"RestrictRealtime=no", "DeviceAllow=/dev/cpu_dma_latency rw"},
    "netboard-logger.service": {"RestrictRealtime=yes", "PrivateDevices=yes", "PrivateUsers=yes"},
    "netboard-agent@.service": {
        "RestrictRealtime=no",
        *(
            f"DeviceAllow={device} rw"
            for device in ("/dev/cpu_dma_latency", "char-usb_device", "char-hidraw", "char-ttyACM", "char-ttyUSB")
        ),
    },
    "netboard-trigger.service": {
        "RestrictRealtime=no",
        "SupplementaryGroups=dialout lp",
        *(
            f"DeviceAllow={device} rw"
            for device in (
                "/dev/cpu_dma_latency",
                "char-usb_device",
                "char-ttyACM",
                "char-ttyUSB",
                "char-ttyS",
                "char-ppdev",
            )
        ),
    },
    "netboard-display@.service": {"RestrictRealtime=yes", "UMask=0077"},
    "netboard-station@.service": {"RestrictRealtime=no", "UMask=0077", "KillMode=mixed"},
}

EXPOSURE = {"system": 25, "user": 70, "sandbox": 30}
"""Tenths of what `systemd-analyze security` says at most; a user's service cannot drop capabilities: it has none."""

analysed = pytest.mark.skipif(shutil.which("systemd-analyze") is None, reason="systemd-analyze is not installed")


def directives(path: Path) -> set[str]:
    lines = path.read_text(encoding="utf-8").splitlines()
    return {line for line in lines if "=" in line and not line.startswith("#")}


@pytest.mark.parametrize("path", UNITS, ids=lambda path: path.name)
def test_units_are_confined_to_the_access_they_need(path: Path) -> None:
    found = directives(path)
    wanted = EVERYWHERE | OWN[path.name] | (OF_THE_SYSTEM if path.parent.name == "system" else set())
    assert wanted - found == set()
    allowed = {line for line in found if line.startswith("DeviceAllow=")}
    assert allowed <= OWN[path.name]
    if "PrivateUsers=yes" in found:
        assert "LimitRTPRIO=80" not in found  # its effect within a user namespace is untested


def test_units_on_one_machine_share_their_sockets() -> None:
    joins = {path.name: unit(path)["Unit"].get("JoinsNamespaceOf", "").split() for path in UNITS}
    assert joins["netboard-server.service"] == ["netboard-logger.service"]
    assert joins["netboard-logger.service"] == ["netboard-server.service"]
    for name in ("netboard-agent@.service", "netboard-trigger.service"):
        assert joins[name] == ["netboard-server.service", "netboard-logger.service"]
    for name in (
        "netboard-server.service",
        "netboard-agent@.service",
        "netboard-trigger.service",
    ):  # the unit that starts second joins the first
        assert "netboard-logger.service" in unit(DEPLOY / "systemd/system" / name)["Unit"]["After"].split()


def test_sandbox_drop_in_confines_the_display_further() -> None:
    in_a_namespace = {"ProtectProc=invisible", "ProtectKernelLogs=yes"}  # which a user's manager could not set up
    assert directives(SANDBOX) >= KERNEL - in_a_namespace | {"PrivateUsers=yes", "ProtectHome=read-only"}


def exposure(path: Path, most: int) -> subprocess.CompletedProcess[str]:
    """Run `systemd-analyze security`, which fails above this exposure [tenths]."""
    command = ["systemd-analyze", "security", "--offline=true", f"--threshold={most}", "--no-pager", path]
    return subprocess.run(command, capture_output=True, text=True, check=False)


@analysed
@pytest.mark.parametrize("path", UNITS, ids=lambda path: path.name)
def test_exposure_of_units_is_below_the_limit(path: Path, tmp_path: Path) -> None:
    alone = tmp_path / path.name  # without its drop-in
    shutil.copy(path, alone)
    judged = exposure(alone, EXPOSURE[path.parent.name])
    if "--offline" in judged.stderr:
        pytest.skip("this systemd-analyze judges no files")
    assert judged.returncode == 0, judged.stdout + judged.stderr
    assert exposure(alone, 5).returncode != 0


@analysed
def test_exposure_of_a_sandboxed_display_is_below_the_limit(tmp_path: Path) -> None:
    display = tmp_path / "netboard-display@.service"
    text = (SANDBOX.parent.parent / display.name).read_text(encoding="utf-8")
    added = "\n".join(sorted(directives(SANDBOX)))
    display.write_text(text.replace("[Install]", f"{added}\n[Install]"), encoding="utf-8")
    judged = exposure(display, EXPOSURE["sandbox"])
    if "--offline" in judged.stderr:
        pytest.skip("this systemd-analyze judges no files")
    assert judged.returncode == 0, judged.stdout + judged.stderr


@analysed
@pytest.mark.parametrize("kind", ["system", "user"])
def test_systemd_verifies_the_units(kind: str, tmp_path: Path) -> None:
    units = []
    for path in (DEPLOY / "systemd" / kind).glob("*.service"):
        units.append(tmp_path / path.name.replace("@", "@left"))
        # The program that it runs must exist; any executable will do.
        units[-1].write_text(path.read_text(encoding="utf-8").replace(INSTALLED, sys.executable), encoding="utf-8")
    checked = subprocess.run(
        ["systemd-analyze", "verify", f"--{kind}", "--man=no", *units],
        env=os.environ | {"XDG_RUNTIME_DIR": str(tmp_path)},
        capture_output=True,
        text=True,
        check=False,
    )
    ours = [line for line in checked.stderr.splitlines() if "netboard" in line]
    assert (checked.returncode, ours) == (0, [])


def test_limits_file_allows_the_priorities() -> None:
    lines = (DEPLOY / "limits.d/netboard.conf").read_text(encoding="utf-8").splitlines()
    limits = [line.split() for line in lines if not line.startswith("#")]
    assert {(group, kind, what) for group, kind, what, _ in limits} == {
        ("@netboard", "-", "rtprio"),
        ("@netboard", "-", "memlock"),
    }
    assert int(limits[0][3]) >= max(Priority) + IO_PRIORITY_STEP


# --- udev --------------------------------------------------------------------------------------------------------

RULES = [
    line
    for line in (DEPLOY / "udev/70-netboard.rules").read_text(encoding="utf-8").splitlines()
    if line and not line.startswith("#")
]
PART = re.compile(r'([A-Z]+)(?:\{(\w+)\})?(==|=|\+=)"([^"]*)"')


@pytest.mark.parametrize("rule", RULES)
def test_udev_rules_grant_access_to_the_group_only(rule: str) -> None:
    parts = PART.findall(rule)
    assert ", ".join(f'{key}{f"{{{of}}}" if of else ""}{how}"{value}"' for key, of, how, value in parts) == rule
    given = {key: value for key, _, how, value in parts if how == "="}
    assert (given["GROUP"], given["MODE"]) == ("netboard", "0660")


def test_udev_rules_and_doctor_list_the_same_devices() -> None:
    ruled: dict[str, set[tuple[str, str]]] = {}
    for rule in RULES:
        parts = {of or key: value for key, of, _, value in PART.findall(rule)}
        for product in parts.get("idProduct", "").split("|"):
            for subsystem in parts.get("SUBSYSTEM", "").split("|"):
                ruled.setdefault(subsystem, set()).add((parts.get("idVendor", ""), product))
    assert ruled["usb"] == set(MODELS)
    for link, subsystem in udev.SUBSYSTEMS.items():
        assert ruled[subsystem] >= {ids for ids, model in MODELS.items() if model.link is link}
    raw = {ids for ids, model in MODELS.items() if model.link is UsbLink.RAW}
    assert not raw & (ruled["hidraw"] | ruled["tty"])


@pytest.mark.skipif(shutil.which("udevadm") is None, reason="udevadm is not installed")
def test_udevadm_verifies_the_rules() -> None:
    offered = subprocess.run(["udevadm", "verify", "--help"], capture_output=True, check=False)
    if offered.returncode:
        pytest.skip("this udevadm cannot verify rules")
    checked = subprocess.run(
        ["udevadm", "verify", "--resolve-names=never", DEPLOY / "udev/70-netboard.rules"],
        capture_output=True,
        text=True,
        check=False,
    )
    assert checked.returncode == 0, checked.stderr


# --- container ---------------------------------------------------------------------------------------------------


def test_container_copies_existing_files() -> None:
    root = DEPLOY.parent
    text = (DEPLOY / "Containerfile").read_text(encoding="utf-8")
    for line in re.findall(r"^COPY (.*) \S+$", text, re.MULTILINE):
        for source in line.split():
            assert (root / source).exists(), source
    assert text.count("\nUSER netboard\n") == 1
    run = re.search(r"netboard (server --config \S+)$", text, re.MULTILINE)
    assert run is not None
    called(run[1].split())
