"""Backend ``playback``: replays a recorded stylus. No hand holds it, and it has no haptic feedback.

Use it as a partner that does not react, for rehearsals without hardware, and for tests. Playback starts with the first
reading. The stylus rests at the start of the file until ``delay`` is over, and at its end afterwards. It is then no
longer ready, so that no block continues with a partner who has stopped; with ``loop`` it starts again.

The file is a recording or a CSV file. A recording provides the stylus samples as the server received them, with
vertical velocities; laterally it has positions only, or none if it was imported: then x = y = 0. A CSV file has the
columns ``time,x,y,z`` and optionally ``vx,vy,vz`` and ``buttons``, in any order. An invalid file raises an error with
file, line and column; nothing is repaired silently.

Options (``agents.<side>.options``): see `PlaybackOptions`.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from math import isnan
from pathlib import Path
from typing import Annotated, Any, Literal, final

import numpy as np
from numpy.typing import NDArray
from pydantic import StrictBool

from netboard.base.config import SIDES, Config, Side
from netboard.base.errors import ConfigError, DeviceNotFound
from netboard.base.settings import FORBID_UNKNOWN_KEYS, about
from netboard.devices.contract.device import Device, DeviceInfo, Reading
from netboard.recording.files.reader import Recording
from netboard.recording.importing.tables import Portion, TableFile
from netboard.stage.styluses import MAX_STYLUS_HEIGHT

NEEDED = ("time", "x", "y", "z")
RATES = ("vx", "vy", "vz")
UNITS = {"time": "s", "x": "m", "y": "m", "z": "m", "vx": "m/s", "vy": "m/s", "vz": "m/s", "buttons": "1"}
"""Columns of a CSV file (required, optional, all) and their units."""

MAX_CURVE = 0.5
"""Longest time between two samples that a cubic joins: over a pause it would swing far beyond both [s]."""

Vector = tuple[float, float, float]


@dataclass(frozen=True, slots=True)
class PlaybackOptions:
    """Options of the recorded stylus."""

    __pydantic_config__ = FORBID_UNKNOWN_KEYS
    file: Annotated[str, about("file to play: a recording (.mcap) or a .csv file")] = ""
    side: Annotated[Literal["same", "left", "right"], about("whose stylus in a recording; same: of this side")] = "same"
    trial: Annotated[int, about("number of the trial that is played; 0: the whole recording", "1", ge=0)] = 0
    delay: Annotated[float, about("time from the first reading to the start", "s", ge=0, le=86_400)] = 0.0
    scale: Annotated[float, about("factor of the movement", "1", ge=-10, le=10)] = 1.0
    noise: Annotated[float, about("standard deviation of white noise on each reading", "m", ge=0, le=0.1)] = 0.0
    loop: Annotated[StrictBool, about("true: playback starts again at the end of the file")] = False
    seed: Annotated[int, about("seed of the noise", "1", ge=0, lt=2**31)] = 1


@final
class Playback(Device):
    """A recorded stylus as a device."""

    in_scene = True

    def __init__(self, side: Side, config: Config) -> None:
        super().__init__(side, config)
        self._options = self.read_options(PlaybackOptions)
        if not self._options.file:
            raise ConfigError(f"[agents.{side}.options] file: found none, expected the recording or .csv file to play")
        self._track: Track | None = None
        self._start_ns: int | None = None
        self._rng = np.random.default_rng()

    def require_files(self) -> None:
        """Refuse a file that cannot be played back."""
        self._read_track()

    def _read_track(self) -> "Track":
        side = self.side if self._options.side == "same" else self._options.side
        return read_track(Path(self._options.file), side, self._options.trial)

    def _open(self) -> DeviceInfo:
        options = self._options
        side = self.side if options.side == "same" else options.side
        self._track = self._read_track().scaled(options.scale)
        self._start_ns = None
        self._rng = np.random.default_rng((options.seed, SIDES.index(self.side)))
        details = {
            "file": options.file,
            "stylus": f"{side}, trial {options.trial}" if options.trial else side,
            "duration": f"{self._track.duration:.3f} s",
            "delay": f"{options.delay!r} s",
            "scale": f"{options.scale!r}",
            "noise": f"{options.noise!r} m",
        }
        return DeviceInfo("recorded stylus", f"playback-{self.side}", 0.0, 0.0, 0.0, details=details)

    def _read(self, now_ns: int) -> Reading:
        assert self._track is not None
        if self._start_ns is None:
            self._start_ns = now_ns + round(self._options.delay * 1e9)
        when = (now_ns - self._start_ns) * 1e-9
        duration = self._track.duration
        if self._options.loop and when > duration:
            when %= duration
        (x, y, z), (vx, vy, vz), buttons = self._track.at(when)
        if self._options.noise > 0.0:
            dx, dy, dz = (self._options.noise * self._rng.standard_normal(3)).tolist()
            x, y, z = x + dx, y + dy, z + dz
        return Reading(now_ns, x, y, z, vx, vy, vz, buttons, when <= duration)

    def _write(self, fx: float, fy: float, fz: float) -> None:
        """Ignore the force: no hand feels it."""

    def _close(self) -> None:
        self._track = None


@dataclass(frozen=True)
class Track:
    """Trajectory of a stylus, in the scene's frame."""

    times: NDArray[np.float64]  # sample times, from 0, increasing [s]
    places: NDArray[np.float64]  # positions [m]
    rates: NDArray[np.float64]  # velocities; NaN along axes where they are unknown [m/s]
    buttons: NDArray[np.int64]

    @property
    def duration(self) -> float:
        """Time from the first to the last position [s]."""
        return float(self.times[-1])

    def scaled(self, scale: float) -> "Track":
        """Return the trajectory scaled by a factor [1]."""
        return replace(self, places=scale * self.places, rates=scale * self.rates)

    def at(self, when: float) -> tuple[Vector, Vector, int]:
        """Return position, velocity and buttons at a time.

        Between two samples the position follows the cubic Hermite curve through both positions and velocities, and the
        velocity is interpolated linearly. Where velocities are unknown, and in a pause longer than `MAX_CURVE`, the
        position is interpolated linearly and the velocity is the slope. Before the first sample and after the last one
        the stylus rests.
        """
        if when < 0.0 or when > self.duration:
            end = 0 if when < 0.0 else -1
            x, y, z = self.places[end].tolist()
            return (x, y, z), (0.0, 0.0, 0.0), int(self.buttons[end])
        k = min(int(np.searchsorted(self.times, when, side="right")), len(self.times) - 1)
        start, end_time = self.times[k - 1 : k + 1].tolist()
        span = end_time - start
        share = (when - start) / span
        ends = np.concatenate((self.places[k - 1 : k + 1], self.rates[k - 1 : k + 1])).T.tolist()
        (x, vx), (y, vy), (z, vz) = (_between(share, span, *values) for values in ends)
        return (x, y, z), (vx, vy, vz), int(self.buttons[k - 1])


def _between(share: float, span: float, x0: float, x1: float, v0: float, v1: float) -> tuple[float, float]:
    """Interpolate position and velocity along one axis from the values at both ends [m, m/s]."""
    slope = (x1 - x0) / span
    if isnan(v0) or isnan(v1) or span > MAX_CURVE:
        return x0 + share * (x1 - x0), slope
    bend = share * (1.0 - share) * span * ((1.0 - share) * (v0 - slope) - share * (v1 - slope))
    return x0 + share * (x1 - x0) + bend, v0 + share * (v1 - v0)


def read_track(path: Path, side: Side, trial: int) -> Track:
    """Read a trajectory; the file suffix determines the format. ``trial``: of a recording; 0 for all."""
    if not path.is_file():
        raise DeviceNotFound(f"{path}: no such file")
    match path.suffix.lower():
        case ".mcap":
            return read_recording(path, side, trial)
        case ".csv":
            if trial:
                raise ConfigError(f"{path}: found trial = {trial}, expected 0: a .csv file has no trials")
            return read_csv(path)
    raise ConfigError(f"{path}: expected a recording (.mcap) or a .csv file to play back")


def read_recording(path: Path, side: Side, trial: int) -> Track:
    """Read a stylus trajectory from a recording: each sample once, at its server time.

    ``trial``: use only this trial, with all its attempts; 0 for all.
    """
    with Recording(path) as recording:
        rows = recording.ticks()
    recorded = sorted({int(number) for number in rows["trial"]} - {0})
    if trial:
        rows = rows[rows["trial"] == trial]
    rows = rows[rows[f"{side}_live"] == 1]
    if len(rows):
        stamps = rows[f"{side}_stamp_ns"]
        # Stamps in server time may step back, where the estimate of the agent's clock has changed.
        rows = rows[np.concatenate(([True], np.diff(np.maximum.accumulate(stamps)) > 0))]
    if len(rows) < 2:
        trials = f"trials {recorded[0]} to {recorded[-1]}" if recorded else "no trial"
        where = f"in trial {trial}" if trial else "in it"
        raise ConfigError(f"{path}: there is no {side} stylus {where}; the recording has {trials}")
    return _track(rows, side)


def _track(rows: NDArray[Any], side: Side) -> Track:
    """Make a trajectory from rows with one sample each."""
    unknown = np.full(len(rows), np.nan)
    times = (rows[f"{side}_stamp_ns"] - rows[f"{side}_stamp_ns"][0]) * 1e-9
    x, y = (_lateral(times, rows[f"{side}_{axis}"]) for axis in ("x", "y"))
    return Track(
        times,
        np.stack([x, y, rows[f"{side}_sent_z"]], axis=1),
        np.stack([unknown, unknown, rows[f"{side}_sent_vz"]], axis=1),
        rows[f"{side}_buttons"].astype(np.int64),
    )


def _lateral(times: NDArray[np.float64], values: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return a lateral position without gaps: imported tables may lack it, and it has no effect on the board [m]."""
    known = np.isfinite(values)
    return np.interp(times, times[known], values[known]) if known.any() else np.zeros(len(values))


def read_csv(path: Path) -> Track:
    """Read a trajectory from a CSV file.

    Raises `ConfigError` if the file is invalid; the message gives the first error, with line and column.
    """
    file = TableFile(path)
    _check_names(path, file.names)
    columns: dict[str, list[NDArray[np.float64]]] = {name: [np.empty(0)] for name in file.names}
    before = -np.inf
    for portion in file.portions(file.names):
        read = {name: portion.numbers(name, UNITS[name], "complete") for name in file.names}
        before = _check_numbers(portion, read, before)
        for name, values in read.items():
            columns[name].append(values)
    table = {name: np.concatenate(parts) for name, parts in columns.items()}
    if len(table["time"]) < 2:
        raise ConfigError(f"{path}: found {len(table['time'])} positions, expected at least 2")
    unknown = np.full(len(table["time"]), np.nan)
    return Track(
        table["time"] - table["time"][0],
        np.stack([table[name] for name in NEEDED[1:]], axis=1),
        np.stack([table.get(name, unknown) for name in RATES], axis=1),
        table.get("buttons", np.zeros(len(unknown))).astype(np.int64),
    )


def _check_names(path: Path, names: Sequence[str]) -> None:
    """Raise an error if the header does not name the columns."""
    expected = f"{','.join(NEEDED)}, and {', '.join(name for name in UNITS if name not in NEEDED)} if they are known"
    missing = [name for name in NEEDED if name not in names]
    unknown = [name for name in names if name not in UNITS]
    twice = sorted({name for name in names if names.count(name) > 1})
    problems = [f"{', '.join(those)} {what}" for those, what in ((missing, "missing"), (unknown, "unknown")) if those]
    problems += [f"{', '.join(twice)} there twice"] if twice else []
    if problems:
        raise ConfigError(f"{path}: line 1: columns: {'; '.join(problems)}; expected {expected}")


def _check_numbers(portion: Portion, read: dict[str, NDArray[np.float64]], before: float) -> float:
    """Raise an error for implausible numbers in a batch, and times that do not increase; return the last time."""
    for name, values in read.items():
        if UNITS[name] == "m" and (far := np.abs(values) > MAX_STYLUS_HEIGHT).any():
            expected = f"at most {MAX_STYLUS_HEIGHT:g} m in each direction: are these mm?"
            raise ConfigError(portion.wrong(int(np.argmax(far)), name, expected))
        if name == "buttons" and (wrong := (values < 0) | (values != np.round(values)) | (values >= 2**31)).any():
            expected = "a bit mask, 0 or a whole number above it"
            raise ConfigError(portion.wrong(int(np.argmax(wrong)), name, expected))
    back = np.flatnonzero(np.diff(read["time"], prepend=before) <= 0).tolist()
    if back:
        newest = read["time"][back[0] - 1] if back[0] else before
        raise ConfigError(portion.wrong(back[0], "time", f"times that increase, after {newest:.12g}"))
    return float(read["time"][-1])
