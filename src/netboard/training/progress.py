"""Progress of a training in its folder: what it was begun with, its learning curve, and its newest checkpoint.

Rule 1: ``progress.json`` names the checkpoint that it belongs to, with its hash, and is replaced in one step once that
checkpoint is on disk. The checkpoint before is deleted only then: a training that is killed at any time loses at most
the round that it was in. Rule 2: a training is resumed with what it was begun with, or refused. No PyTorch here.
"""

import hashlib
import json
import os
from collections.abc import Callable, Iterator
from dataclasses import asdict, dataclass, fields
from pathlib import Path
from typing import Any

from netboard.base.config import Config, parse, resolve
from netboard.base.errors import ConfigError, NetboardError, writing
from netboard.base.files.new import new_file, write_synced
from netboard.base.files.text import read_text
from netboard.base.settings import parse_json, tables, to_toml
from netboard.training.weights import WEIGHTS

PROGRESS = "progress.json"
"""File of the progress."""

CHECKPOINTS = "checkpoint-*.pt"
"""Files of the checkpoints, one of each round."""

STEPS = 64
"""Steps of each board between two updates of the network [1]."""


@dataclass(frozen=True, slots=True)
class TrainingRequest:
    """A training.

    ``rounds`` of ``updates`` updates each, with ``people`` participants and ``boards`` of each. Two hidden layers of
    ``units`` units.
    """

    seed: int = 1
    rounds: int = 6
    updates: int = 8
    people: int = 16
    boards: int = 16
    units: int = 32

    @property
    def steps(self) -> int:
        """Environment steps of the whole training."""
        return self.rounds * self.steps_of_round

    @property
    def steps_of_round(self) -> int:
        """Environment steps of a round."""
        return self.updates * STEPS * self.people * self.boards


@dataclass(frozen=True, slots=True)
class TrainingRound:
    """A point of the learning curve: the episodes that ended in a round, with the noise of exploration."""

    round: int
    steps: int
    episodes: int
    success: float  # share of them [1]
    truncated: float  # share that took too long [1]
    seconds: float  # mean length of the successful ones; NaN without any [s]
    exploration: float  # standard deviation of an action [1]
    cpu_seconds: float  # processor time of the training so far [s]
    wall_seconds: float  # elapsed time of the training so far [s]


@dataclass(frozen=True, slots=True)
class TrainingInputs:
    """All that the bits of a training depend on; ``posterior``: SHA-256 of what its participants are drawn from."""

    request: TrainingRequest
    posterior: str
    config: Config


class TrainingFolder:
    """The folder of a training that is begun in it or, with ``resume``, continued."""

    def __init__(self, folder: Path, inputs: TrainingInputs, *, resume: bool = False) -> None:
        self.path, self._inputs = folder, inputs
        self.curve: list[TrainingRound] = []
        self._sha256 = ""  # of the checkpoint; empty: none yet
        held = _names_in(folder)
        if PROGRESS in held and not resume:
            raise ConfigError(f"{folder}: has a training already; name another folder, or continue it by --resume")
        if WEIGHTS in held and resume:
            raise ConfigError(f"{folder / WEIGHTS}: this training is finished; name another folder")
        if PROGRESS in held:
            self._load()
        elif held:
            expected = "that of netboard train partner, to resume it" if resume else "a new or an empty one"
            raise ConfigError(f"{folder}: found a folder with other files, expected {expected}")
        else:
            with writing(folder, NetboardError):
                folder.mkdir(parents=True, exist_ok=True)
            self._write()

    @property
    def checkpoint(self) -> Path | None:
        """The checkpoint of the last round, None before the first; raise ConfigError if it is another file."""
        if not self.curve:
            return None
        path = self._checkpoint_of(len(self.curve))
        try:
            found = hashlib.sha256(path.read_bytes()).hexdigest()
        except OSError as error:
            raise ConfigError(f"{path}: cannot be read: {error.strerror or error}") from error
        if found != self._sha256:
            raise ConfigError(f"{path}: expected the checkpoint that {PROGRESS} names (SHA-256 {self._sha256[:12]})")
        return path

    def save(self, done: TrainingRound, write: Callable[[Path], None]) -> None:
        """Add a round; ``write`` writes its checkpoint to a path."""
        path = self._checkpoint_of(done.round)
        with new_file(path, force=True) as part:
            write(part)
            with part.open("rb+") as file:
                os.fsync(file.fileno())
            self._sha256 = hashlib.sha256(part.read_bytes()).hexdigest()
        self.curve.append(done)
        self._write()
        for old in self.path.glob(CHECKPOINTS):
            if old != path:
                old.unlink()

    def _checkpoint_of(self, number: int) -> Path:
        return self.path / CHECKPOINTS.replace("*", str(number))

    def _write(self) -> None:
        inputs = self._inputs
        progress = {
            "request": asdict(inputs.request),
            "posterior": inputs.posterior,
            "checkpoint": self._sha256,
            "curve": [asdict(one) for one in self.curve],
            "config": resolve(inputs.config),
        }
        with new_file(self.path / PROGRESS, force=True) as part:
            write_synced(part, json.dumps(progress, indent=1))

    def _load(self) -> None:
        """Read the progress, and refuse to continue it with other inputs."""
        path = self.path / PROGRESS
        text = read_text(path, "no such file")
        try:
            found = parse_json(text)
            curve = [TrainingRound(**one) for one in found["curve"]]
            request, config = TrainingRequest(**found["request"]), parse(found["config"], str(path))
            began = TrainingInputs(request, str(found["posterior"]), config)
            self._sha256 = str(found["checkpoint"])
        except (KeyError, TypeError, ValueError) as error:
            raise ConfigError(f"{path}: expected the progress of netboard train partner ({error!r})") from error
        if differences := list(differences_of(self._inputs, began)):
            raise ConfigError(
                f"{self.path}: cannot be resumed with other inputs than it was begun with: {'; '.join(differences)}"
            )
        self.curve = curve


def differences_of(found: TrainingInputs, expected: TrainingInputs) -> Iterator[str]:
    """Yield each input of a training that is not the expected one, in words."""
    for field in fields(TrainingRequest):
        here, there = (to_toml(getattr(one.request, field.name)) for one in (found, expected))
        if here != there:
            yield f"{field.name}: found {here}, expected {there}"
    if found.posterior != expected.posterior:
        yield f"posterior: found SHA-256 {found.posterior[:12]}, expected {expected.posterior[:12]}"
    for table in tables(Config):
        for key in table.keys:
            here, there = (to_toml(_value_at(one.config, (*table.path, key.name))) for one in (found, expected))
            if here != there:
                yield f"[{'.'.join(table.path)}] {key.name}: found {here}, expected {there}"


def _value_at(config: Config, path: tuple[str, ...]) -> Any:
    node: Any = config
    for name in path:
        node = getattr(node, name)
    return node


def _names_in(folder: Path) -> set[str]:
    """Return the names of the files in a folder, without the parts that a killed process has left."""
    with writing(folder, ConfigError):
        return {one.name for one in folder.iterdir() if one.suffix != ".part"} if folder.exists() else set()
