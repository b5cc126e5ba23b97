"""Keys of all peers of a dyad, for benchmarks that run real processes."""

from pathlib import Path

from netboard.base.config import SIDES
from netboard.network import keys


def add_dyad_keys(folder: Path, destination: Path) -> None:
    """Add a key for every peer that a dyad may have to a server's folder of keys, and write it to `destination`."""
    for side in SIDES:
        keys.add(folder, "agent", side, destination)
        keys.add(folder, "display", side, destination)
    keys.add(folder, "logger", "", destination)
    keys.add(folder, "console", "", destination)
