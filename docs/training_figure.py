"""Draw the learning curves on docs/explanation/robots.md from the folders of several trainings.

    python docs/training_figure.py s1 s2 s3 s4 s5

Each folder is one of ``netboard train partner``; its curve is named by its seed. Needs netboard[train].
"""

import csv
import json
import sys
from pathlib import Path

from netboard.base.files.figure import save_figure
from netboard.training.progress import TrainingRound
from netboard.training.results import CURVE, figure_of
from netboard.training.selection import RoundPlayed
from netboard.training.weights import WEIGHTS

IMAGE = Path(__file__).parent / "images" / "training.png"


def read(folder: Path) -> tuple[list[TrainingRound], list[RoundPlayed]]:
    """Read the learning curve of a training, and how the network of each round plays."""
    with (folder / CURVE).open(encoding="utf-8", newline="") as file:
        rows = [{name: float(value) for name, value in row.items()} for row in csv.DictReader(file)]
    played = [RoundPlayed(*(row.pop(name) for name in RoundPlayed._fields)) for row in rows]
    return [TrainingRound(**row) for row in rows], played


def main(folders: list[str]) -> None:
    """Write the figure."""
    trainings = {}
    for folder in map(Path, folders):
        card = json.loads((folder / WEIGHTS).read_text(encoding="utf-8"))["card"]
        trainings[str(card["trained on"]["seed"])] = read(folder)
    IMAGE.unlink(missing_ok=True)
    save_figure(figure_of(dict(sorted(trainings.items()))), IMAGE, 150)


if __name__ == "__main__":
    main(sys.argv[1:])
