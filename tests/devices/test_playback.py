"""Playback of a recorded stylus: the contract, the files and their errors, and the reproduced movement."""

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from netboard.base.config import Config
from netboard.base.errors import ConfigError, DeviceNotFound, RecordingError
from netboard.base.tables.rig import RecordingSettings
from netboard.base.tick import TICK
from netboard.devices.contract.device import Device, Reading
from netboard.devices.simulated.playback import Playback, Track, read_csv, read_track
from netboard.devices.simulated.virtual import VirtualTouch
from netboard.network.protocol.joining import Welcome
from netboard.network.protocol.records import TickRecord
from netboard.participants.people.submovement import Submovement
from netboard.recording.files.provenance import provenance
from netboard.recording.files.writer import RecordingWriter
from netboard.recording.importing.table_import import ImportOptions, import_table
from netboard.testing.device import MS, DeviceContract

S = 1000 * MS
TURN = 2.0 * np.pi
STEP = 0.055e-3


def sine(path: Path, rates: bool, every: float = 0.01) -> Path:
    """Write one second of a sine of 2 cm along z and a cosine of 1 cm along y; a button is pressed from 0.5 s on."""
    t = np.arange(0.0, 1.0 + every / 2, every)
    columns = {"time": t + 5.0, "z": 0.02 * np.sin(TURN * t), "y": 0.01 * np.cos(TURN * t), "x": 0.0 * t}
    if rates:
        columns["vz"], columns["vy"] = TURN * 0.02 * np.cos(TURN * t), -TURN * 0.01 * np.sin(TURN * t)
        columns["vx"] = 0.0 * t
    columns["buttons"] = (t >= 0.5).astype(int)
    rows = zip(*(column.tolist() for column in columns.values()), strict=True)
    path.write_text("\n".join([",".join(columns), *(",".join(map(repr, row)) for row in rows)]) + "\n")
    return path


def record(path: Path) -> tuple[Path, np.ndarray]:
    """Write a recording of two virtual styluses, two trials of one second each; the left one is silent for 20 ms."""
    config = Config()
    rows = np.zeros(2000, TICK)
    devices = {side: VirtualTouch(side, config) for side in ("left", "right")}
    for side, device in devices.items():
        device.open()
        device.command([Submovement(side, 0.1, 0.3, 0.02), Submovement(side, 1.2, 0.4, -0.03)])
        for k in range(len(rows)):
            reading = device.read(k * MS - 300_000 + (k % 7) * 10_000)
            row = rows[k]
            row[f"{side}_live"], row[f"{side}_seq"], row[f"{side}_stamp_ns"] = 1, k, 10**12 + reading.stamp_ns
            row[f"{side}_x"], row[f"{side}_y"], row[f"{side}_buttons"] = reading.x, reading.y, k // 1500
            row[f"{side}_sent_z"], row[f"{side}_sent_vz"] = reading.z, reading.vz
    rows["tick"], rows["time_ns"], rows["trial"] = np.arange(2000), 10**12 + np.arange(2000) * MS, 1
    rows["trial"][1000:] = 2
    rows["left_live"][400:420] = 0
    for name in ("left_seq", "left_stamp_ns", "left_sent_z", "left_sent_vz"):
        rows[name][700:704] = rows[name][699]  # a repeated sample
    text = '[session]\nname = "S01"\n'
    about = provenance(Welcome("3f2a9c1e00000000", 1, 7, text), config, 1, S, 42)
    writer = RecordingWriter(path, about, text, RecordingSettings(), S)
    for k, row in enumerate(rows):
        writer.write(TickRecord(row.tobytes()), k, S + k * MS)
    writer.finish(S + len(rows) * MS)
    return path, rows


def playback(path: Path, **options: object) -> Playback:
    plain = Config()
    left = replace(plain.agents.left, options={"file": str(path), **options})
    device = Playback("left", replace(plain, agents=replace(plain.agents, left=left)))
    device.open()
    return device


def read(device: Device, times: np.ndarray, start_ns: int = 7 * S) -> list[Reading]:
    return [device.read(start_ns + round(t * 1e9)) for t in times]


class TestPlayback(DeviceContract):
    @pytest.fixture(autouse=True)
    def file(self, tmp_path: Path) -> None:
        self.path = sine(tmp_path / "sine.csv", rates=True)

    def make(self, config: Config) -> Device:
        options = {"file": str(self.path), **config.agents.left.options}
        left = replace(config.agents.left, options=options)
        return Playback("left", replace(config, agents=replace(config.agents, left=left)))

    def motor_force(self, device: Device) -> tuple[float, float, float]:
        return 0.0, 0.0, 0.0


@pytest.mark.parametrize(("rates", "place", "rate"), [(True, 1e-8, 1e-4), (False, 1.1e-5, 5e-3)])
def test_sine_is_reproduced_within_interpolation_error(tmp_path: Path, rates: bool, place: float, rate: float) -> None:
    """Error bounds: ``h^4/384`` times the fourth derivative for cubics, ``h^2/8`` times the second for lines."""
    t = 1e-3 * np.arange(1001)
    readings = read(playback(sine(tmp_path / "a.csv", rates)), t)
    found = np.array([(r.x, r.y, r.z, r.vx, r.vy, r.vz) for r in readings]).T
    assert np.abs(found[0]).max() == 0.0
    assert np.abs(found[1] - 0.01 * np.cos(TURN * t)).max() < place
    assert np.abs(found[2] - 0.02 * np.sin(TURN * t)).max() < place
    assert np.abs(found[4] + TURN * 0.01 * np.sin(TURN * t)).max() < rate
    assert np.abs(found[5] - TURN * 0.02 * np.cos(TURN * t)).max() < rate
    assert [r.buttons for r in readings] == [int(k >= 500) for k in range(1000)] + [1]
    assert all(r.ready for r in readings)


def test_playback_starts_after_the_delay_and_rests_before_and_after(tmp_path: Path) -> None:
    device = playback(sine(tmp_path / "a.csv", rates=True), delay=0.5)
    before, peak, end, after = read(device, np.array([0.0, 0.5 + 0.25, 1.5, 1.6]))
    assert (before.y, before.z, before.vz, before.ready) == (0.01, 0.0, 0.0, True)
    assert peak.z == pytest.approx(0.02)
    assert end.ready
    assert (after.vy, after.vz, after.ready, after.buttons) == (0.0, 0.0, False, 1)
    assert after.z == pytest.approx(0.0, abs=1e-12)


def test_loop_option_restarts_at_the_beginning(tmp_path: Path) -> None:
    device = playback(sine(tmp_path / "a.csv", rates=True), loop=True)
    first, again, third = read(device, np.array([0.0, 1.25, 2.75]))
    assert first.z == 0.0
    assert (again.z, again.ready) == (pytest.approx(0.02), True)
    assert (third.z, third.ready) == (pytest.approx(-0.02), True)


def test_reopening_restarts_the_playback(tmp_path: Path) -> None:
    device = playback(sine(tmp_path / "a.csv", rates=True), noise=1e-4)
    first = read(device, np.arange(5) * 0.2)
    device.close()
    device.open()
    assert [r[1:] for r in read(device, np.arange(5) * 0.2, 99 * S)] == [r[1:] for r in first]


def test_scale_multiplies_positions_and_velocities(tmp_path: Path) -> None:
    path, t = sine(tmp_path / "a.csv", rates=True), 1e-3 * np.arange(0, 1000, 37)
    once, twice = read(playback(path), t), read(playback(path, scale=-2.0), t)
    for a, b in zip(once, twice, strict=True):
        assert b[1:7] == pytest.approx(tuple(-2.0 * value for value in a[1:7]), abs=1e-12)


def test_noise_has_the_configured_level_and_depends_on_the_seed(tmp_path: Path) -> None:
    path, t = sine(tmp_path / "a.csv", rates=True), 1e-3 * np.arange(1000)
    plain = read(playback(path), t)
    noisy = [read(playback(path, noise=2e-4, seed=seed), t) for seed in (1, 1, 2)]
    assert noisy[0] == noisy[1] != noisy[2]
    deviation = np.array([[b.x - a.x, b.y - a.y, b.z - a.z] for a, b in zip(plain, noisy[0], strict=True)])
    assert deviation.std(axis=0) == pytest.approx([2e-4] * 3, rel=0.1)
    assert [r.vz for r in noisy[0]] == [r.vz for r in plain]


def test_recorded_stylus_is_reproduced(tmp_path: Path) -> None:
    path, rows = record(tmp_path / "a.mcap")
    rows = rows[rows["right_live"] == 1]
    t = (rows["right_stamp_ns"] - rows["right_stamp_ns"][0]) * 1e-9
    readings = read(playback(path, side="right"), t)
    assert np.abs(np.array([r.z for r in readings]) - rows["right_sent_z"]).max() < 1e-9
    assert np.abs(np.array([r.x for r in readings]) - rows["right_x"]).max() < 1e-6
    assert np.abs(np.array([r.vz for r in readings]) - rows["right_sent_vz"]).max() < 1e-4
    assert [r.buttons for r in readings] == rows["right_buttons"].tolist()
    between = read(playback(path, side="right"), t[:-1] + 0.0005)
    assert np.abs(np.array([r.z for r in between]) - rows["right_sent_z"][:-1]).max() < 0.5e-3 * 0.3 + 2 * STEP


def test_imported_heights_are_played_without_a_lateral_position(tmp_path: Path) -> None:
    table = tmp_path / "theirs.csv"
    rows = "".join(f"{k / 100},{0.01 * k},0.02,{0.001 * k if k % 2 else ''},0.1\n" for k in range(5))
    table.write_text(f"time,left_z,right_z,left_y,p\n{rows}")
    path = import_table(table, tmp_path, Config(), ImportOptions(), 10**18, lambda *progress: None).path
    t = np.array([0.0, 0.01, 0.02, 0.03])
    readings = read(playback(path), t)
    assert [r.z for r in readings] == pytest.approx(t.tolist())
    assert [r.x for r in readings] == [0.0] * 4
    assert [r.y for r in readings] == pytest.approx([0.001, 0.001, 0.002, 0.003])
    assert np.isfinite([(r.vx, r.vy, r.vz) for r in readings]).all()


def test_repeated_and_missing_samples_are_skipped(tmp_path: Path) -> None:
    path, rows = record(tmp_path / "a.mcap")
    track = read_track(path, "left", 0)
    assert len(track.times) == 2000 - 20 - 4
    assert (np.diff(track.times) > 0).all()
    assert track.places[0, 2] == rows["left_sent_z"][0]


def test_trial_option_plays_one_trial(tmp_path: Path) -> None:
    path, rows = record(tmp_path / "a.mcap")
    device = playback(path, trial=2)
    assert device.info.details["stylus"] == "left, trial 2"
    assert device.info.details["duration"] == "0.999 s"
    assert device.read(0).z == pytest.approx(rows["left_sent_z"][1000])
    with pytest.raises(ConfigError, match=r"no left stylus in trial 3; the recording has trials 1 to 2"):
        playback(path, trial=3)
    with pytest.raises(ConfigError, match=r"found trial = 2, expected 0: a \.csv file has no trials"):
        playback(sine(tmp_path / "sine.csv", rates=True), trial=2)


def test_playback_device_renders_no_force(tmp_path: Path) -> None:
    info = playback(sine(tmp_path / "a.csv", rates=True)).info
    assert (info.max_force, info.continuous_force) == (0.0, 0.0)


def test_missing_or_unsuitable_file_is_rejected(tmp_path: Path) -> None:
    with pytest.raises(ConfigError, match=r"\[agents\.right\.options\] file: found none"):
        Playback("right", Config())
    with pytest.raises(DeviceNotFound, match=r"nowhere\.csv: no such file"):
        playback(tmp_path / "nowhere.csv")
    (tmp_path / "a.txt").write_text("time,x,y,z\n")
    with pytest.raises(ConfigError, match=r"a\.txt: expected a recording"):
        playback(tmp_path / "a.txt")
    (tmp_path / "a.mcap").write_text("no recording")
    with pytest.raises(RecordingError, match="not an MCAP file"):
        playback(tmp_path / "a.mcap")


WRONG = {
    "time,x,y\n0,0,0\n1,0,0\n": r"line 1: columns: z missing; expected time,x,y,z, and vx, vy, vz, buttons if",
    "t,x,y,z\n0,0,0,0\n": r"line 1: columns: time missing; t unknown",
    "time,x,y,z,z\n0,0,0,0,0\n": r"line 1: columns: z there twice",
    "": r"line 1: found nothing, expected the names of columns",
    "time,x,y,z\n0,0,0,0\n": r"found 1 positions, expected at least 2",
    "time,x,y,z\n0,0,0,0\n1,0,0\n": r"line 3: found 3 columns, expected 4",
    "time,x,y,z\n0,0,0,0\n1,0,low,0\n": r'line 3, column y: found "low", expected a number \[m\]',
    "time,x,y,z\n0,0,0,0\n1,0,0,0.0_1\n": r'line 3, column z: found "0.0_1", expected a number \[m\]',
    "time,x,y,z\n0,0,0,0\n1_1,0,0,0\n": r'line 3, column time: found "1_1", expected a number \[s\]',
    "time,x,y,z\n0,0,0,0\n\n1,0,,0\n": r"line 4, column y: found nothing",
    "time,x,y,z\n0,0,0,0\n1,0,0,nan\n": r'line 3, column z: found "nan", expected a number \[m\]',
    "time,x,y,z\n0,0,0,0\n0,0,0,1\n": r'line 3, column time: found "0", expected times that increase, after 0',
    "time,x,y,z\n0,0,0,20.5\n1,0,0,0\n": r'line 2, column z: found "20.5", expected at most 1 m in each direction',
    "time,x,y,z,buttons\n0,0,0,0,1.5\n1,0,0,0,0\n": r'line 2, column buttons: found "1.5", expected a bit mask',
}


@pytest.mark.parametrize(("text", "message"), WRONG.items(), ids=range(len(WRONG)))
def test_csv_error_names_line_and_column(tmp_path: Path, text: str, message: str) -> None:
    (tmp_path / "a.csv").write_text(text)
    with pytest.raises(ConfigError, match=rf"a\.csv: {message}"):
        read_csv(tmp_path / "a.csv")


def test_binary_file_is_rejected(tmp_path: Path) -> None:
    (tmp_path / "a.csv").write_bytes(b"time,x,y,z\n\xff\xfe\n")
    with pytest.raises(ConfigError, match=r"a\.csv: line 2: is not UTF-8"):
        read_csv(tmp_path / "a.csv")


@pytest.mark.parametrize(
    "motion", [lambda t: t, lambda t: t**2 - t, lambda t: 4 * t**3 - t**2 + 0.5], ids=["line", "parabola", "cubic"]
)
def test_positions_with_rates_are_interpolated_by_a_cubic(motion: Callable[[np.ndarray], np.ndarray]) -> None:
    times = np.array([0.0, 0.1, 0.25, 0.7])
    rates = (motion(times + 1e-6) - motion(times - 1e-6)) / 2e-6
    track = Track(times, np.stack([motion(times)] * 3, 1), np.stack([rates] * 3, 1), np.zeros(4, np.int64))
    for when in np.linspace(0.0, 0.7, 50):
        assert track.at(when)[0] == pytest.approx((motion(when),) * 3, abs=1e-8)


def test_stylus_stays_between_the_samples_around_a_pause() -> None:
    times = np.array([0.0, 0.001, 60.0, 60.001])
    places = np.outer([0.0, 0.001, 0.02, 0.021], np.ones(3))
    track = Track(times, places, np.ones((4, 3)), np.zeros(4, np.int64))
    pause = np.linspace(0.001, 60.0, 500)
    heights = np.array([track.at(when)[0][2] for when in pause])
    assert heights.min() >= 0.001 - 1e-12
    assert heights.max() <= 0.02 + 1e-12
    assert track.at(30.0)[1] == pytest.approx((0.019 / 59.999,) * 3)
