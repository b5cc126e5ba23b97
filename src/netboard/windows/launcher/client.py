"""Runs the launcher: one at a time on a computer, with what it remembers."""

import logging
from collections.abc import Callable

from netboard.base.looks import ThemeName
from netboard.nodes.launching.station import changing_state, fixed_state
from netboard.windows.launcher.control import FileReaders, LauncherControl, LauncherMemory, SessionChoice
from netboard.windows.launcher.memory import folder, only_launcher, remember, remembered
from netboard.windows.launcher.window import SMALLEST, LauncherWindow
from netboard.windows.participant import window as windows
from netboard.windows.style import choose_theme

log = logging.getLogger(__name__)


def run(
    given: Callable[[SessionChoice], SessionChoice],
    reading: FileReaders,
    stopping: Callable[[], bool],
    *,
    offscreen: bool = False,
    theme: ThemeName = "system",
) -> None:
    """Run the launcher until its window is closed or the process is asked to stop; then end everything in order.

    ``given``: puts what the command line gives into the remembered choice.
    """
    path = folder() / "launcher.toml"
    lock = only_launcher(folder() / "launcher.lock")
    memory, problem = remembered(path)
    windows.scale_to_screen(*SMALLEST)
    windows.application()
    choose_theme(theme)
    control = LauncherControl(given(memory.session), reading, offscreen=offscreen, theme=theme)
    if problem:
        control.say(problem, stays=True)
    remember(path, LauncherMemory(control.choice))

    def here() -> dict[str, str]:
        sides = control.here or ["left"]
        return fixed_state() | changing_state(control.config, sides[0])

    window = LauncherWindow(control, here, lambda choice: remember(path, LauncherMemory(choice)))
    window.resize(window.size().boundedTo(windows.largest_size(windows.screen_of(window))))
    window.show()
    log.info("the launcher is open")
    try:
        windows.run(window, stopping)
    finally:
        window.hide()
        control.end_all()
        control.close()
        lock.unlock()
