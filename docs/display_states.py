"""Draw every state of the participants' display into one figure, docs/images/display-states.png, and each by itself.

Run it after a change of the display: ``python docs/display_states.py``, or with a folder for the single figures.
"""

import os
import sys
from dataclasses import replace
from pathlib import Path

os.environ.setdefault("QT_QPA_PLATFORM", "offscreen")

from PySide6.QtCore import QRect, Qt
from PySide6.QtGui import QColor, QImage, QPainter

from netboard.base.config import Config
from netboard.base.tables.experiment import Block, Session
from netboard.base.tables.rig import Display
from netboard.stage.view import View
from netboard.windows.participant.language import load_words
from netboard.windows.participant.scene import DisplayPicture
from netboard.windows.participant.screens import blank, compose
from netboard.windows.participant.window import BoardWindow, application

SHEET = Path(__file__).parent / "images" / "display-states.png"
WIDTH, HEIGHT, COLUMNS, TITLE, GAP = 960, 560, 3, 40, 16
SCALE = 0.5

EN, DE = load_words("en"), load_words("de")
CONFIG = replace(Config(), block=Block(number=3, blocks=18))
PILOT = replace(CONFIG, session=Session(pilot=True))
PATCHED = replace(CONFIG, display=Display(patch=True))
VIEW = View(
    *("left", 0, 0, "running", 0.0, 0.0, -0.15, 0.15, 0.0, None),
    *(12, 60, 1, 3.42, 2.90, "", 0, 0.0, 3, 18, None),
)


def of(words: object = EN, config: Config = CONFIG, result: str = "", **changes: object) -> DisplayPicture:
    """Compose the display of a view that differs from the usual one."""
    return compose(replace(VIEW, **changes), config, words, result)  # type: ignore[arg-type]


def states() -> dict[str, DisplayPicture]:
    """Every state, by what it is called."""
    both = {"left": 0.012, "right": -0.006}
    level = {"phase": "levelling", "left": 0.004}
    return {
        "waiting for the server": blank(CONFIG, EN, EN.waiting, EN.server.format(host="10.0.0.1", port=5550)),
        "rest before a block": of(phase="idle", rest=74.3),
        "before a block": of(phase="idle"),
        "levelling: the left end is too low": of(phase="levelling", theta=0.06, z=-0.014, left=-0.03),
        "levelling: both ends are too high": of(phase="levelling", z=0.022, left=0.024),
        "levelling: level for a while": of(**level, share=0.6),
        "running": of(theta=-0.03, p=-0.04, left=0.007),
        "holding": of(phase="holding", p=0.142, theta=0.004, share=0.55),
        "succeeded: what follows": of(**level, result="succeeded", p=0.15, target=-0.15, trial=13),
        "succeeded: the best time": of(**level, result="succeeded", p=0.15, target=-0.15, completion=2.9, trial=13),
        "failed: what follows": of(**level, result="failed", notice="again", failures=2),
        "paused by the operator": of(phase="paused", p=0.03, theta=-0.01, notice="pause_operator"),
        "bimanual: both hands of the one participant": of(theta=-0.036, **both),
        "bimanual: the other station": of(phase="away", p=None, left=None, z=0.0, theta=0.0),
        "after a block": of(phase="finished"),
        "after the last block": of(phase="finished", block=18),
        "after a block whose trials may be repeated": of(phase="finished", block=18, notice="pause_decision"),
        "no view comes": blank(CONFIG, EN, EN.lost, EN.server.format(host="10.0.0.1", port=5550), lost=True),
        "a pilot run, in German": of(DE, PILOT, phase="idle"),
        "a patch for a photodiode": of(config=PATCHED, theta=-0.03, p=-0.04, left=0.007),
        "a board without a ball": of(p=None, theta=-0.03, left=0.007),
        "a pilot run": of(config=PILOT, **level, share=0.3),
    }


def main(folder: Path | None) -> None:
    """Draw them all."""
    app = application()
    window = BoardWindow("states")
    window.present(Display(width=WIDTH, height=HEIGHT))
    pictures = states()
    rows = -(-len(pictures) // COLUMNS)
    cell = QRect(0, 0, round(WIDTH * SCALE) + GAP, round(HEIGHT * SCALE) + TITLE)
    sheet = QImage(COLUMNS * cell.width() + GAP, rows * cell.height() + GAP, QImage.Format.Format_RGB32)
    sheet.fill(QColor("#ffffff"))
    with QPainter(sheet) as painter:
        font = painter.font()
        font.setPixelSize(17)
        painter.setFont(font)
        painter.setRenderHint(QPainter.RenderHint.SmoothPixmapTransform)
        for i, (title, picture) in enumerate(pictures.items()):
            window.board.show_picture(picture)
            app.processEvents()
            image = window.grab().toImage()
            if folder is not None:
                image.save(str(folder / f"{i:02}-{title.split(':')[0].replace(' ', '-')}.png"))
            x, y = GAP + i % COLUMNS * cell.width(), i // COLUMNS * cell.height()
            size = image.size() * SCALE
            painter.drawText(QRect(x, y, cell.width() - GAP, TITLE), Qt.AlignmentFlag.AlignVCenter, title)
            shrunk = image.scaled(size, mode=Qt.TransformationMode.SmoothTransformation)
            painter.drawImage(x, y + TITLE, shrunk)
    window.close()
    sheet.save(str(SHEET))


if __name__ == "__main__":
    main(Path(sys.argv[1]) if len(sys.argv) > 1 else None)
