"""Draw the learning curves on docs/explanation/robots.md from the folders of several trainings.

    python docs/training_figure.py s1 s2 s3 s4 s5

Each folder is one of ``netboard train partner``; its curve is named by its seed. Needs netboard[train].
"""

import json
import sys
from pathlib import Path

from netboard.base.files.figure import save_figure
from netboard.training.progress import PROGRESS, TrainingRound
from netboard.training.results import figure_of

IMAGE = Path(__file__).parent / "images" / "training.png"


def main(folders: list[str]) -> None:
    """Write the figure."""
    curves = {}
    for folder in folders:
        progress = json.loads((Path(folder) / PROGRESS).read_text(encoding="utf-8"))
        curves[str(progress["request"]["seed"])] = [TrainingRound(**one) for one in progress["curve"]]
    IMAGE.unlink(missing_ok=True)
    save_figure(figure_of(dict(sorted(curves.items()))), IMAGE, 150)


if __name__ == "__main__":
    main(sys.argv[1:])
