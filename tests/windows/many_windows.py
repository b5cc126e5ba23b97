"""Create, show, paint and close many windows in this process, with the most eager garbage collection.

Run by `test_many_windows.py` in a process of its own: ``python -X dev many_windows.py KIND COUNT``.
"""

import gc
import sys
import weakref
from collections.abc import Callable
from dataclasses import replace

from display_parts import VIEW, WORDS
from PySide6.QtWidgets import QWidget

from netboard.base.config import Config
from netboard.base.process.resources import NAME
from netboard.devices.contract.device import Reading
from netboard.windows.monitor import MonitorWindow
from netboard.windows.operator.lamps import limits_of
from netboard.windows.operator.window import ConsoleWindow
from netboard.windows.participant.grip import grip_of
from netboard.windows.participant.screens import compose
from netboard.windows.participant.window import BoardWindow, application

CONFIG = Config()


def participant() -> QWidget:
    window = BoardWindow("a test")
    window.present(CONFIG.display)
    tilted = replace(VIEW, theta=0.05, left=0.02)
    grip = grip_of(tilted, CONFIG, WORDS, "left", 0.03, 1.0, keys=False)
    window.board.show_picture(replace(compose(tilted, CONFIG, WORDS), grip=grip))
    return window


def console() -> QWidget:
    window = ConsoleWindow(CONFIG, limits_of(CONFIG, NAME), NAME)
    window.show()
    return window


def monitor() -> QWidget:
    window = MonitorWindow(lambda: Reading(0, *(6 * (0.0,)), 0, True), "a test")
    window.show()
    window.take()
    window.redraw()
    window.closed.connect(window.dismantle)
    return window


KINDS: dict[str, Callable[[], QWidget]] = {"participant": participant, "console": console, "monitor": monitor}


def main(kind: str, count: int) -> None:
    app = application()
    KINDS[kind]().close()  # loads the modules once, before the count
    gc.set_threshold(1, 1, 1)
    made = []
    for _ in range(count):
        window = KINDS[kind]()
        window.cycle = window.close  # type: ignore[attr-defined]  # a reference cycle: only the collector can free it
        made.append(weakref.ref(window))
        app.processEvents()
        assert not window.grab().isNull()
        window.close()
        del window
    gc.collect()
    if kind != "console":  # the process has one console, and its parts keep it alive until exit
        assert not any(one() for one in made), "a window was never freed"
    sys.stdout.write(f"{count} windows\n")


if __name__ == "__main__":
    main(sys.argv[1], int(sys.argv[2]))
