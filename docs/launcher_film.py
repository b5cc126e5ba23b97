"""Film a newcomer's session, from an empty folder to the report, as frames and as docs/images/launcher-film.png.

    python docs/launcher_film.py [FOLDER]     FOLDER gets the single frames

Everything is real but the people and the screen: the launcher is driven by its keys, its processes run with simulated
devices, and the operator's commands in the console are given by ``netboard control``. It takes some minutes.
"""

import os
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
from pathlib import Path

os.environ.setdefault("QT_QPA_PLATFORM", "offscreen")

from PySide6.QtCore import QRect, Qt
from PySide6.QtGui import QColor, QImage, QKeySequence, QPainter, QShortcut
from PySide6.QtTest import QTest

from netboard.network.transport.ports import free_port
from netboard.nodes.launching.station import changing_state, fixed_state
from netboard.services.loading import load, load_study
from netboard.windows.launcher.control import ANALYSIS, CHECK, FileReaders, LauncherControl, SessionChoice
from netboard.windows.launcher.model import LaunchStage
from netboard.windows.launcher.window import LauncherWindow
from netboard.windows.participant.window import application

SHEET = Path(__file__).resolve().parent / "images" / "launcher-film.png"
SIZE, SCALE, COLUMNS, TITLE, GAP = (1366, 768), 0.42, 3, 30, 12
TIMEOUT = 900.0

STUDY = """name = "first"
text = "A first block"

[orders]
main = "dyadic"

[kinds.dyadic]
performers = "dyad"
block.trials = 2
"""


class Film:
    """A launcher in a folder of its own, the keys pressed in it, and the frames so far."""

    def __init__(self) -> None:
        self.app = application()
        self.control = LauncherControl(SessionChoice(study=""), FileReaders(load, load_study), offscreen=True)
        self.window = LauncherWindow(
            self.control, lambda: fixed_state() | changing_state(self.control.config, "left"), lambda _: None
        )
        self.window.show()
        self.window.resize(*SIZE)
        self.frames: list[tuple[str, QImage]] = []
        self.keys, self.began = 0, time.monotonic()

    def take(self, title: str) -> None:
        """Take a frame."""
        self.wait(0.3)
        self.frames.append((title, self.window.grab().toImage()))
        print(f"{time.monotonic() - self.began:6.1f} s  {self.keys:3} keys  {title}", flush=True)  # noqa: T201

    def wait(self, seconds: float) -> None:
        """Let the window work for a time [s]."""
        end = time.monotonic() + seconds
        while time.monotonic() < end:
            self.app.processEvents()
            time.sleep(0.01)

    def until(self, condition: Callable[[], object]) -> None:
        """Wait until a condition holds."""
        end = time.monotonic() + TIMEOUT
        while not condition():
            if time.monotonic() > end:
                raise TimeoutError(f"{self.control.stage}: {self.control.processes}")
            self.wait(0.2)

    def press(self, key: str) -> None:
        """Press a key of the window."""
        self.keys += 1
        shortcuts = self.window.findChildren(QShortcut)
        next(one for one in shortcuts if one.key() == QKeySequence(key)).activated.emit()

    def fill(self, page: object, key: str, text: str) -> None:
        """Type into a field of a form."""
        field = page.form.inputs[key]  # type: ignore[attr-defined]
        self.keys += len(text) + 1
        if hasattr(field, "setCurrentText"):
            field.setCurrentText(text)
            field.textActivated.emit(text)
        else:
            field.selectAll()
            QTest.keyClicks(field, text)
            field.editingFinished.emit()

    def task(self, name: str) -> None:
        """Select a task in the table, press Enter, and wait for its end."""
        self.press("Ctrl+T")
        self.window.table.select(name)
        QTest.keyClick(self.window.table, Qt.Key.Key_Return)
        self.keys += 2
        self.until(lambda: self.control.processes.get(name) and self.control.processes[name].code is not None)

    def operator(self, *words: str) -> bool:
        """Give a command as the operator does in the console; return whether it was accepted."""
        command = [sys.executable, "-m", "netboard.services.cli", *words, "-c", "rig.toml"]
        process = subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
        while process.poll() is None:
            self.wait(0.1)
        return process.returncode == 0

    def picture(self, title: str, *words: str) -> None:
        """Take a frame of another window of netboard."""
        if self.operator(*words, "--offscreen", "--screenshot", f"{len(self.frames)}.png"):
            self.frames.append((title, QImage(f"{len(self.frames)}.png")))


def play(film: Film) -> None:
    """Run the session."""
    film.take("1. Nothing is there: no rig, no study")
    film.press("Ctrl+2")
    film.window.rig.path.setText("rig.toml")
    film.keys += len("rig.toml")
    for table, key, entry in (("session", "pilot", "true"), ("network", "port", str(free_port()))):
        names = [film.window.rig.tables.itemText(row) for row in range(film.window.rig.tables.count())]
        film.window.rig.tables.setCurrentIndex(names.index(table))
        film.fill(film.window.rig, key, entry)
    film.press("Ctrl+S")
    film.take("2. The rig: a pilot, in a form")
    film.press("Ctrl+3")
    film.window.study.editor.setPlainText(STUDY)
    film.press("Ctrl+S")
    film.take("3. A study of one block, checked as it is written")
    film.press("Ctrl+4")
    film.take("4. This machine")
    film.press("Ctrl+1")
    film.press("F2")
    film.wait(3.0)
    film.window.table.select("preparation")
    film.take("5. F2: what is missing is created")
    film.until(lambda: film.control.stage is LaunchStage.RUNNING)
    film.window.table.select("server")
    film.until(lambda: film.control.facts().status is not None)
    film.take("6. Everything is started")
    film.until(lambda: film.operator("control", "arm"))
    film.until(lambda: film.operator("control", "start"))
    film.wait(2.0)
    film.take("7. Armed and started in the console")
    film.picture("8. The console", "console")
    film.picture("9. The left participant's display", "display", "--station", "left")
    while film.control.facts().status.phase != "finished":  # type: ignore[union-attr]
        film.operator("control", "resume")  # after a stall of a busy machine
        film.wait(2.0)
    film.take("10. The block is finished")
    film.operator("control", "end")
    film.until(lambda: film.control.stage is LaunchStage.IDLE)
    film.take("11. Ended in the console: everything has ended")
    film.task(CHECK)
    film.take("12. Enter on check: every tick computed again")
    film.task(ANALYSIS)
    film.take("13. Enter on analysis: the report is there (F6)")


def sheet(frames: list[tuple[str, QImage]]) -> QImage:
    """Put the frames on one sheet, each below its title."""
    cell = QRect(0, 0, round(SIZE[0] * SCALE), round(SIZE[1] * SCALE))
    rows = -(-len(frames) // COLUMNS)
    whole = QImage(
        COLUMNS * (cell.width() + GAP) + GAP, rows * (cell.height() + TITLE + GAP), QImage.Format.Format_RGB32
    )
    whole.fill(QColor("#ffffff"))
    with QPainter(whole) as painter:
        for number, (title, image) in enumerate(frames):
            x = GAP + number % COLUMNS * (cell.width() + GAP)
            y = number // COLUMNS * (cell.height() + TITLE + GAP)
            painter.drawText(QRect(x, y, cell.width(), TITLE), Qt.AlignmentFlag.AlignVCenter, title)
            keep, smooth = Qt.AspectRatioMode.KeepAspectRatio, Qt.TransformationMode.SmoothTransformation
            painter.drawImage(x, y + TITLE, image.scaled(cell.size(), keep, smooth))
    return whole


def main(folder: Path | None) -> None:
    """Film the session."""
    with tempfile.TemporaryDirectory() as place:
        os.chdir(place)
        film = Film()
        try:
            play(film)
        finally:
            film.window._timer.stop()
            film.control.end_all()
            film.control.close()
        if folder is not None:
            for number, (_, image) in enumerate(film.frames, 1):
                image.save(str(folder / f"launcher-{number:02}.png"))
        sheet(film.frames).save(str(SHEET))


if __name__ == "__main__":
    main(Path(sys.argv[1]).resolve() if len(sys.argv) > 1 else None)
