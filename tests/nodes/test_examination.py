"""The doctor's examination, its report and its command."""

import json
import os
import socket as net
from dataclasses import replace
from pathlib import Path

import pytest
from typer.testing import CliRunner

from netboard.base.config import Config
from netboard.base.errors import ConfigError, NetboardError
from netboard.base.finding import Finding
from netboard.base.process import display_server
from netboard.base.tables.rig import Network, RecordingSettings
from netboard.network import keys
from netboard.network.protocol.joining import Welcome
from netboard.nodes.doctor import disk, network, system, timing
from netboard.nodes.doctor.report import DoctorReport, Effort, examine
from netboard.nodes.doctor.timing import WakeUps
from netboard.recording.files.provenance import doctor_report_path, provenance
from netboard.services.cli import app

SHORT = Effort(timer_seconds=0.2, exchanges=5, chunks=2, pulses=3)
runner = CliRunner()


def ignore_progress(done: float) -> None:
    """Discard the progress."""


@pytest.fixture(autouse=True)
def _isolated_state(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("XDG_STATE_HOME", str(tmp_path / "state"))
    monkeypatch.setenv("QT_QPA_PLATFORM", "offscreen")
    monkeypatch.setenv("COLUMNS", "200")
    monkeypatch.chdir(tmp_path)


def wake_ups(p999_us: float, scheduling: str = "ok") -> WakeUps:
    return WakeUps({"scheduling": scheduling}, 10.0, 50.0, p999_us, 2 * p999_us, 1, 1000)


@pytest.mark.parametrize(("p999_us", "colour"), [(120.0, "green"), (800.0, "yellow"), (1500.0, "red")])
def test_timer_finding_depends_on_the_p999_latency(p999_us: float, colour: str) -> None:
    finding = timing.verdict(wake_ups(p999_us))
    assert finding.colour == colour
    assert f"p99.9 {p999_us:.0f}" in finding.found
    assert finding.figures["p999_us"] == p999_us
    assert timing.comparison(wake_ups(p999_us)).colour == "green"


def test_percentiles_are_returned_in_microseconds() -> None:
    percentiles = timing.percentiles([1000 * k for k in range(1001)])
    assert percentiles == pytest.approx({"p50_us": 500, "p99_us": 990, "p999_us": 999, "max_us": 1000})


def test_disk_checks_use_the_recording_folder(tmp_path: Path) -> None:
    settings = RecordingSettings(directory=str(tmp_path / "not" / "yet" / "there"))
    assert disk.nearest(Path(settings.directory)) == tmp_path
    progress: list[float] = []
    finding = disk.speed(settings, 4, progress.append)
    assert progress == [0.25, 0.5, 0.75, 1.0]
    assert 0 < finding.figures["p50_ms"] <= finding.figures["max_ms"]
    assert disk.space(settings).figures["hours"] > 0
    assert list(tmp_path.iterdir()) == []


@pytest.mark.skipif(not hasattr(os, "geteuid") or os.geteuid() == 0, reason="root may write everywhere")
def test_read_only_folder_is_red(tmp_path: Path) -> None:
    tmp_path.chmod(0o500)
    finding = disk.speed(RecordingSettings(directory=str(tmp_path)), 1, ignore_progress)
    tmp_path.chmod(0o700)
    assert finding.colour == "red"


def test_nearly_full_disk_is_red(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    class Usage:
        free = 10**9

    monkeypatch.setattr("netboard.nodes.doctor.disk.shutil.disk_usage", lambda folder: Usage)
    finding = disk.space(RecordingSettings(directory=str(tmp_path)))
    assert finding.colour == "red"
    assert "1.0 GB free" in finding.found


def test_clock_offset_to_the_same_machine_is_within_its_bound() -> None:
    estimator = network.compare(20, ignore_progress)
    assert estimator.accepted == 20
    assert estimator.rejected == estimator.restarts == 0
    assert abs(estimator.offset_ns) <= estimator.bound_ns


def test_clock_bound_beyond_the_limit_is_red() -> None:
    finding = network.clock_bound(Network(clock_bound_ms=1e-6), 3, ignore_progress)
    assert finding.colour == "red"
    assert "armed" in finding.advice


def test_ports_in_use_are_yellow() -> None:
    with net.socket() as listener:
        listener.bind(("127.0.0.1", 0))
        listener.listen()
        finding = network.ports(Network(port=listener.getsockname()[1]))
    assert finding.colour == "yellow"
    assert "is a server running?" in finding.advice


def test_ports_of_another_machine_are_not_checked() -> None:
    finding = network.ports(Network(bind="192.0.2.1"))
    assert (finding.colour, finding.advice) == ("green", "")


OUTSIDE = Network(bind="192.0.2.1", host="192.0.2.1")


def test_keys_are_required_beyond_loopback(tmp_path: Path) -> None:
    assert network.secrets(Network()).colour == "green"
    assert network.secrets(replace(OUTSIDE, curve="off")).colour == "yellow"
    assert network.secrets(OUTSIDE).colour == "red"
    keys.init(Path("keys"))
    keys.add(Path("keys"), "logger", "", Path("keys"))
    assert network.secrets(OUTSIDE) == Finding("keys", "green", "logger.key, server.key in keys")


@pytest.mark.skipif(os.name != "posix", reason="modes of POSIX")
def test_key_readable_by_other_users_is_red() -> None:
    keys.init(Path("keys"))
    Path("keys/server.key").chmod(0o640)
    finding = network.secrets(OUTSIDE)
    assert finding.colour == "red"
    assert "is accessible to other users (mode 0640)" in finding.found


@pytest.mark.parametrize(
    ("variables", "colour", "found", "advice"),
    [
        ({}, "yellow", "there is no screen", "a display or a console cannot run here"),
        ({"QT_QPA_PLATFORM": "offscreen"}, "yellow", "drawn off screen, where nobody sees them", "unset"),
        ({"DISPLAY": ":4711"}, "yellow", "DISPLAY=:4711 cannot be opened", "screen"),
    ],
)
def test_machine_without_a_screen_is_not_green(
    variables: dict[str, str], colour: str, found: str, advice: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    for name in (display_server.PLATFORM, *display_server.SCREENS):
        monkeypatch.delenv(name, raising=False)
    for name, value in variables.items():
        monkeypatch.setenv(name, value)
    qt, screen = system.windows(lambda: "")
    assert (qt.colour, screen.colour) == ("green", colour)
    assert found in screen.found
    assert advice in screen.advice


def test_qt_that_cannot_be_loaded_says_nothing_of_a_screen() -> None:
    (finding,) = system.windows(lambda: "no libEGL.so.1")
    assert finding.colour == "yellow"
    assert "cannot be loaded: no libEGL.so.1" in finding.found


# --- the report --------------------------------------------------------------------------------------------------

GREEN, YELLOW, RED = (
    Finding("a", "green", "fine"),
    Finding("b", "yellow", "so so", "do this"),
    Finding("c", "red", "bad"),
)


def report(*findings: Finding) -> DoctorReport:
    return DoctorReport("2026-01-02T03:04:05+00:00", {"platform": "made up"}, findings)


def test_report_has_a_one_line_summary() -> None:
    result = report(GREEN, GREEN, YELLOW, timing.verdict(wake_ups(123.4)))
    assert result.summary == "3 green, 1 yellow, 0 red; timer p99.9 123 us"
    assert result.fit
    assert not report(GREEN, RED).fit


def test_report_is_embedded_in_recordings_with_its_age() -> None:
    report(GREEN).save(doctor_report_path())
    report(GREEN, YELLOW).save(doctor_report_path())
    assert [file.name for file in doctor_report_path().parent.iterdir()] == ["doctor.json"]
    result = provenance(Welcome("s", 1, 0, ""), Config(), 1, 1_767_323_045_000_000_000 + 5400 * 10**9, 0)
    assert result["doctor"] == "1 green, 1 yellow, 0 red; 1.5 h before"
    assert [finding["name"] for finding in json.loads(result["doctor_report"])["findings"]] == ["a", "b"]


def test_recording_without_a_report_states_so() -> None:
    result = provenance(Welcome("s", 1, 0, ""), Config(), 1, 10**18, 0)
    assert (result["doctor"], result["doctor_report"]) == ("not asked", "")


def test_user_without_a_home_folder_can_record(monkeypatch: pytest.MonkeyPatch) -> None:
    def homeless() -> Path:
        raise RuntimeError("Could not determine home directory.")

    monkeypatch.delenv("XDG_STATE_HOME")
    monkeypatch.setattr(Path, "home", homeless)
    result = provenance(Welcome("s", 1, 0, ""), Config(), 1, 10**18, 0)
    assert (result["doctor"], result["doctor_report"]) == ("not asked", "")
    with pytest.raises(ConfigError, match="this user has no home folder; set the environment variable HOME"):
        doctor_report_path()


@pytest.mark.parametrize("text", ["", "[]", "{}", '{"summary": "x", "utc": "yesterday"}', '{"summary": "x", "utc": 3}'])
def test_invalid_report_does_not_prevent_a_recording(text: str) -> None:
    doctor_report_path().parent.mkdir(parents=True)
    doctor_report_path().write_text(text, encoding="utf-8")
    result = provenance(Welcome("s", 1, 0, ""), Config(), 1, 10**18, 0)
    assert result["doctor"].startswith("its report cannot be read")


def test_unwritable_report_raises_an_error(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("in the way")
    with pytest.raises(NetboardError, match="cannot be written"):
        report(GREEN).save(tmp_path / "file" / "doctor.json")


@pytest.mark.slow
def test_examination_runs_every_check_and_reports_progress() -> None:
    progress: list[tuple[str, float]] = []
    result = examine(Config(), SHORT, lambda what, done: progress.append((what, done)))
    names = [finding.name for finding in result.findings]
    assert len(set(names)) == len(names)
    assert {"real-time scheduling", "timer", "clock bound", "disk speed", "disk space", "Qt", "USB devices"} <= set(
        names
    )
    assert all(0 <= done <= 1 for _, done in progress)
    assert "timer p99.9" in result.summary
    platform_name = os.uname().nodename if hasattr(os, "uname") else ""
    assert not platform_name or platform_name not in result.machine.values()
    parsed = json.loads(result.text())
    assert parsed["summary"] == result.summary
    assert all(bool(finding["advice"]) == (finding["colour"] != "green") for finding in parsed["findings"])


def test_doctor_command_writes_its_json_even_if_the_state_folder_is_not_writable(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("netboard.nodes.doctor.report.examine", lambda *given: report(GREEN))
    (tmp_path / "file").touch()
    monkeypatch.setenv("XDG_STATE_HOME", str(tmp_path / "file"))
    result = runner.invoke(app, ["doctor", "--json", "copy.json"])
    assert result.exit_code == 1
    assert "doctor.json: cannot be written" in result.stderr
    assert json.loads((tmp_path / "copy.json").read_text(encoding="utf-8"))["findings"][0]["name"] == "a"

    def homeless() -> Path:
        raise RuntimeError("Could not determine home directory.")

    monkeypatch.delenv("XDG_STATE_HOME")
    monkeypatch.setattr(Path, "home", homeless)
    result = runner.invoke(app, ["doctor", "--json", "homeless.json"])
    assert result.exit_code == 1
    assert "this user has no home folder" in result.stderr
    assert (tmp_path / "homeless.json").exists()


@pytest.mark.slow
def test_doctor_command_prints_and_saves_its_report(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("netboard.nodes.doctor.report.QUICK", SHORT)
    result = runner.invoke(app, ["doctor", "--quick", "--json", "copy.json", "--set", "realtime.lock_memory=false"])
    saved = json.loads(doctor_report_path().read_text(encoding="utf-8"))
    assert result.exit_code == (1 if " 0 red" not in saved["summary"] else 0)
    assert saved["summary"] in result.output
    assert "[realtime] lock_memory = true" in result.output
    assert json.loads((tmp_path / "copy.json").read_text(encoding="utf-8")) == saved
