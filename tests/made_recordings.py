"""Synthetic recordings with known content."""

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from netboard.base.config import Config, resolve
from netboard.base.tables.experiment import Block
from netboard.base.tables.rig import Display
from netboard.base.tick import TICK, TICK_NS
from netboard.network.protocol.joining import Welcome
from netboard.network.protocol.messages import PROTOCOL_VERSION
from netboard.network.protocol.records import EventRecord, TickRecord
from netboard.recording.files.provenance import next_recording, provenance
from netboard.recording.files.writer import RecordingWriter
from netboard.recording.replay.loaded import LoadedRecording
from netboard.task.trials.state_machine import Cause, Phase

CONFIG = replace(Config(), display=Display(width=840, height=600), block=Block(trials=6))


def two_trials(seconds: float = 10.0) -> NDArray[Any]:
    """A made-up recording: a trial that succeeds after 3 s of running, and one that fails."""
    ticks = np.zeros(round(seconds * 1000), TICK)
    number = np.arange(len(ticks))
    ticks["tick"] = number + 100
    ticks["time_ns"] = 5_000_000_000 + number * TICK_NS
    ticks["phase"] = Phase.LEVELLING
    ticks["phase"][:501] = Phase.IDLE
    ticks["phase"][1001:4001] = Phase.RUNNING
    ticks["phase"][6001:8001] = Phase.RUNNING
    ticks["run_ticks"][1001:4001] = np.arange(3000)
    ticks["run_ticks"][6001:8001] = np.arange(2000)
    ticks["mark_ticks"][4000] = 3000
    ticks["target"] = np.where(number <= 4000, 1, -1)
    ticks["trial"] = np.where(number <= 4000, 1, 2)
    ticks["attempt"] = 1
    ticks["completion"] = np.where(number <= 4000, 0.0, 3.0)
    ticks["p"] = -0.15
    ticks["p"][1000:4000] = np.linspace(-0.15, 0.15, 3000)
    ticks["left_used_z"], ticks["right_used_z"] = 0.01, -0.02
    for at, cause in (
        (500, Cause.START),
        (1000, Cause.LEVEL),
        (4000, Cause.HELD),
        (6000, Cause.LEVEL),
        (8000, Cause.FELL),
    ):
        ticks["event"][at] = cause
    return ticks


def loaded_recording(
    ticks: NDArray[Any], *events: EventRecord, name: str = "made.mcap", config: Config = CONFIG
) -> LoadedRecording:
    """Some ticks and events, ready to be played."""
    return LoadedRecording(name, resolve(config), ticks, events)


def recorded(directory: Path, ticks: NDArray[Any]) -> Path:
    """A finished recording of some ticks."""
    config = replace(CONFIG, recording=replace(CONFIG.recording, directory=str(directory)))
    welcome = Welcome("0123456789abcdef", PROTOCOL_VERSION, 0, resolve(config))
    path, part = next_recording(directory, config, welcome.session, 0)
    writer = RecordingWriter(path, provenance(welcome, config, part, 0, 0), welcome.config, config.recording, 0)
    for number, row in enumerate(ticks):
        writer.write(TickRecord(row.tobytes()), number, number)
    writer.finish(len(ticks))
    return path
