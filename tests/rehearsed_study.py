"""A small study with simulated people: four blocks of one dyad, of two trials each."""

from pathlib import Path

from netboard.throughput.specimen import make_study


def small_study(folder: Path) -> tuple[Path, ...]:
    """Make it: bimanual and dyadic blocks, with forces and without."""
    return make_study(folder, 1, 4, 2, 1, lambda done, total: None)
