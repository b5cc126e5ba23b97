"""Screenshots of every state of every window, at three sizes and in both themes, and what is not whole in them.

The report of an analysis is photographed in a browser, if this machine has one (``deploy/setup.sh site``).

The folder has a PNG for each; its subfolder ``docs`` has those of the documentation, to be copied to docs/images.
"""

import os
import tempfile
from collections.abc import Iterable, Iterator
from contextlib import chdir, contextmanager
from dataclasses import dataclass
from itertools import product
from pathlib import Path
from typing import Any

os.environ.setdefault("QT_QPA_PLATFORM", "offscreen")

from PySide6.QtWidgets import QWidget

from browser import find_browser  # type: ignore[import-not-found]
from evidence.looks import console_states, display_states, launcher_states, report_pages
from evidence.looks.reading import cut_texts, unreached
from netboard.base.looks import ThemeName
from netboard.benchmarks.harness.results import Folder, ResultPart
from netboard.benchmarks.harness.running import Tell
from netboard.windows.participant.window import application
from netboard.windows.style import choose_theme

SIZES = ((1366, 768), (1920, 1080), (3840, 2160))
THEMES: tuple[ThemeName, ...] = ("dark", "light")

DOCUMENTED = {
    "console": ("form", "running", "pilot", "trouble", "lost-trials", "unrecorded", "stopped", "lost"),
    "launcher": ("ready", "preparing", "running", "failed", "rig", "study", "study-form", "machines"),
}
"""States that the documentation shows, dark and in the smallest size."""


@dataclass(frozen=True)
class Photographed:
    """A window: the module that makes it and shows its states, and the themes that it has."""

    module: Any
    states: tuple[str, ...]
    themes: tuple[ThemeName, ...] = THEMES


WINDOWS = {
    "console": Photographed(console_states, tuple(console_states.NAMES)),
    "display": Photographed(display_states, display_states.NAMES, ("dark",)),
    "launcher": Photographed(launcher_states, launcher_states.NAMES),
}
"""The windows; the participants' display is dark always, since it is a part of the experiment."""


@contextmanager
def opened(name: str, size: tuple[int, int], theme: ThemeName) -> Iterator[QWidget]:
    """Open a window in a folder of its own."""
    application()
    choose_theme(theme)
    with tempfile.TemporaryDirectory() as place, chdir(place):
        window = WINDOWS[name].module.make()
        window.resize(*size)
        window.show()
        yield window
        WINDOWS[name].module.leave(window)


def shown(name: str, window: QWidget, state: str) -> None:
    """Show a state, and let the window lay it out."""
    WINDOWS[name].module.show(window, state)
    for _ in range(5):
        application().processEvents()


def study(folder: Folder, tell: Tell, *, quick: bool) -> Iterable[ResultPart]:
    """Yield a table of the windows."""
    part = ResultPart("windows", "Windows, by size and theme", "window | size | theme | states | cut texts | no key")
    (folder.path / "docs").mkdir(exist_ok=True)
    sizes = SIZES[:1] if quick else SIZES
    runs = [(name, size, theme) for name in WINDOWS for size in sizes for theme in WINDOWS[name].themes]
    cut: list[str] = []
    for number, (name, size, theme) in enumerate(runs):
        tell(f"{name}, {size[0]} x {size[1]}, {theme}", number / len(runs))
        here, lacking = _photograph(folder.path, name, size, theme)
        cut += here + lacking
        label = f"{size[0]} x {size[1]}"
        part.add(name, label, theme, len(WINDOWS[name].states), len(here), len(lacking))
    part.claim("no text is cut, and every control has a key", not cut, "; ".join(cut) or "none is")
    yield part
    if find_browser():
        yield _report(folder.path, sizes)


def _report(folder: Path, sizes: Iterable[tuple[int, int]]) -> ResultPart:
    """Save screenshots of a report in a browser; return a table of them."""
    part = ResultPart("report", "Report in a browser, by size and theme", "size | theme | outside of the window")
    outside: list[str] = []
    with tempfile.TemporaryDirectory() as place:
        made = report_pages.made_report(Path(place))
        for size, theme in product(sizes, THEMES):
            here = report_pages.photograph(folder, made, size, theme)
            outside += here
            part.add(f"{size[0]} x {size[1]}", theme, len(here))
    part.claim("nothing of the report is outside of the window", not outside, "; ".join(outside) or "nothing is")
    return part


def _photograph(folder: Path, name: str, size: tuple[int, int], theme: ThemeName) -> tuple[list[str], list[str]]:
    """Save the screenshots of a window; return what is cut in them, and what no key reaches."""
    cut, lacking = [], []
    with opened(name, size, theme) as window:
        for state in WINDOWS[name].states:
            shown(name, window, state)
            image = window.grab().toImage()
            image.save(str(folder / f"{name}-{state}-{size[0]}x{size[1]}-{theme}.png"))
            if size == SIZES[0] and theme == "dark" and state in DOCUMENTED.get(name, ()):
                image.save(str(folder / "docs" / f"{name}-{state}.png"))
            where = f"{name} {state} {size[0]} x {size[1]}"
            cut += [f"{where}: {words}" for words in cut_texts(window)]
            lacking += [f"{where}: {words}" for words in unreached(window)]
    return cut, lacking
