"""What is in deploy/ is true: it parses, names commands that there are, and lets nobody in who need not be."""

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

from netboard.config import parse
from netboard.doctor.usb import NAMES
from netboard.keys import encrypted
from netboard.nodes.launcher import STOP_SECONDS
from netboard.nodes.session import FINISH_NS
from netboard.process import IO_ABOVE, Priority
from netboard.services.cli import app

DEPLOY = Path(__file__).parent.parent / "deploy"
UNITS = sorted(DEPLOY.glob("systemd/*/*.service"))
INSTALLED = "/opt/netboard/.venv/bin/netboard"


def unit(path: Path) -> configparser.ConfigParser:
    parsed = configparser.ConfigParser(interpolation=None, strict=True)
    parsed.optionxform = str  # type: ignore[assignment,method-assign]
    parsed.read_string(path.read_text(encoding="utf-8"))
    return parsed


def called(words: list[str]) -> None:
    """Parse a command as the shell would run it, without running it; raises if the command has no such option."""
    group = typer.main.get_command(app)
    assert isinstance(group, typer.core.TyperGroup)
    command = group.commands[words[0]]
    command.make_context(words[0], words[1:])


def test_the_example_is_a_configuration_that_asks_for_keys() -> None:
    config = parse((DEPLOY / "two-stations/netboard.toml").read_text(encoding="utf-8"))
    assert encrypted(config.network)
    assert config.network.host == config.network.bind == "10.77.0.1"


def test_every_command_of_the_examples_head_is_there() -> None:
    text = (DEPLOY / "two-stations/netboard.toml").read_text(encoding="utf-8")
    commands = re.findall(r"netboard (up .*? netboard\.toml)", text)
    assert len(commands) == 4
    for command in commands:
        called(command.split())


def test_there_is_a_unit_for_every_process() -> None:
    commands = {shlex.split(unit(path)["Service"]["ExecStart"])[1] for path in UNITS}
    assert commands == {"server", "logger", "agent", "display"}


@pytest.mark.parametrize("path", UNITS, ids=lambda path: path.name)
def test_units_run_commands_that_there_are(path: Path) -> None:
    program, *words = shlex.split(unit(path)["Service"]["ExecStart"].replace("%i", "left"))
    assert program == INSTALLED
    assert ("%i" in unit(path)["Service"]["ExecStart"]) == ("@" in path.name)
    called(words)


@pytest.mark.parametrize("path", UNITS, ids=lambda path: path.name)
def test_units_watch_and_wait(path: Path) -> None:
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
    if "logger" in path.name:
        assert int(service["TimeoutStopSec"]) > STOP_SECONDS + FINISH_NS * 1e-9


@pytest.mark.parametrize("name", ["netboard-server.service", "netboard-agent@.service"])
def test_loops_may_have_what_they_ask_for(name: str) -> None:
    service = unit(DEPLOY / "systemd/system" / name)["Service"]
    assert int(service["LimitRTPRIO"]) >= max(Priority) + IO_ABOVE
    assert service["LimitMEMLOCK"] == "infinity"
    assert "PrivateDevices" not in service


@pytest.mark.skipif(shutil.which("systemd-analyze") is None, reason="systemd-analyze is not installed")
@pytest.mark.parametrize("kind", ["system", "user"])
def test_systemd_finds_nothing_wrong(kind: str, tmp_path: Path) -> None:
    units = []
    for path in (DEPLOY / "systemd" / kind).iterdir():
        units.append(tmp_path / path.name.replace("@", "@left"))
        # What it runs must be there: anything that is will do.
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


def test_limits_suffice_for_the_priorities() -> None:
    lines = (DEPLOY / "limits.d/netboard.conf").read_text(encoding="utf-8").splitlines()
    limits = [line.split() for line in lines if not line.startswith("#")]
    assert {(group, kind, what) for group, kind, what, _ in limits} == {
        ("@netboard", "-", "rtprio"),
        ("@netboard", "-", "memlock"),
    }
    assert int(limits[0][3]) >= max(Priority) + IO_ABOVE


# --- udev --------------------------------------------------------------------------------------------------------

RULES = [
    line
    for line in (DEPLOY / "udev/70-netboard.rules").read_text(encoding="utf-8").splitlines()
    if line and not line.startswith("#")
]
PART = re.compile(r'([A-Z]+)(?:\{(\w+)\})?(==|=|\+=)"([^"]*)"')


@pytest.mark.parametrize("rule", RULES)
def test_rules_let_in_a_group_and_nobody_else(rule: str) -> None:
    parts = PART.findall(rule)
    assert ", ".join(f'{key}{f"{{{of}}}" if of else ""}{how}"{value}"' for key, of, how, value in parts) == rule
    given = {key: value for key, _, how, value in parts if how == "="}
    assert (given["GROUP"], given["MODE"]) == ("netboard", "0660")


def test_rules_and_doctor_know_the_same_devices() -> None:
    ruled: dict[str, set[tuple[str, str]]] = {}
    for rule in RULES:
        parts = {of or key: value for key, of, _, value in PART.findall(rule)}
        for product in parts.get("idProduct", "").split("|"):
            for subsystem in parts.get("SUBSYSTEM", "").split("|"):
                ruled.setdefault(subsystem, set()).add((parts.get("idVendor", ""), product))
    assert ruled["usb"] == set(NAMES)
    assert ruled["hidraw"] | {("0403", "cb48")} == set(NAMES)


@pytest.mark.skipif(shutil.which("udevadm") is None, reason="udevadm is not installed")
def test_udev_finds_nothing_wrong() -> None:
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


def test_the_container_copies_what_there_is() -> None:
    root = DEPLOY.parent
    text = (DEPLOY / "Containerfile").read_text(encoding="utf-8")
    for line in re.findall(r"^COPY (.*) \S+$", text, re.MULTILINE):
        for source in line.split():
            assert (root / source).exists(), source
    assert text.count("\nUSER netboard\n") == 1
    run = re.search(r"netboard (server --config \S+)$", text, re.MULTILINE)
    assert run is not None
    called(run[1].split())
