"""Files of weights in the folder of a training: one of each round, and that of the round that is kept."""

from pathlib import Path

from netboard.base.files.new import new_file
from netboard.participants.robots.learned import INPUTS, PERIOD
from netboard.participants.robots.network import TrainedNetwork

WEIGHTS = "weights.json"
"""File of the result."""


def weights_of_round(folder: Path, number: int) -> Path:
    """Return the file of a round's weights; rounds count from 1."""
    return folder / f"round-{number}.json"


def write_weights(path: Path, network: TrainedNetwork, *, force: bool = False) -> None:
    """Write a file of weights."""
    with new_file(path, force=force) as part:
        part.write_text(network.text(INPUTS, PERIOD), encoding="utf-8")
