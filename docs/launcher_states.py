"""Draw the launcher's states and pages: docs/images/launcher-*.png, or at other sizes into a folder.

    python docs/launcher_states.py                      writes the images of the pages, 1366 x 768
    python docs/launcher_states.py FOLDER 3840 2160     writes every state at this size [pixels]

Run it after a change of the launcher. The processes are entries of a table: nothing is started.
"""

import os
import sys
import tempfile
import time
from dataclasses import replace
from pathlib import Path
from typing import get_type_hints

os.environ.setdefault("QT_QPA_PLATFORM", "offscreen")

from netboard.network.protocol.control import Status
from netboard.network.protocol.station import ProcessStatus
from netboard.services.loading import load, load_study
from netboard.windows.launcher.control import FileReaders, LauncherControl, SessionChoice
from netboard.windows.launcher.model import LaunchFacts, LaunchStage
from netboard.windows.launcher.window import LauncherWindow
from netboard.windows.participant.window import application

IMAGES = Path(__file__).parent / "images"
SIZE = 1366, 768
SHOWN = ("ready", "preparing", "running", "failed", "rig", "study", "machines")
"""States that the documentation shows."""

RIG = '[stations]\nleft = "10.77.0.2"\n[agents.left]\ndevice = "openhaptics"\n'
STATE = {"computer": "lab-pc-2", "cores": "8", "load": "0.31", "free disk": "412.0 GiB", "screen": "opens"}
LOG = {
    "preparation": "folder         recordings: is missing; created: mkdir -p recordings\nkernels        97 compiled\n",
    "left agent": "left hand: haptic device (backend openhaptics)\nthe device does not answer: unplugged?\n",
}


class ShownControl(LauncherControl):
    """A control that shows given facts."""

    shown = LaunchFacts()

    def facts(self) -> LaunchFacts:
        """Return the given facts."""
        return replace(self.shown, places=self.places, tasks=self.tasks)

    def poll(self) -> None:
        """Do nothing."""

    def log_of(self, name: str) -> str:
        """Return an example of a log."""
        return LOG.get(name, "")

    def station_states(self) -> dict[str, dict[str, str]]:
        """Return an example of a station's state."""
        return {"left station": STATE | {"device": "openhaptics: haptic device", "keys": "complete"}}

    def watch_stations(self) -> None:
        """Do nothing."""


def processes(control: LauncherControl, phase: str = "running", **others: ProcessStatus) -> dict[str, ProcessStatus]:
    """Return all processes of the session in one phase, and others."""
    found = {
        name: ProcessStatus(name, phase, None, 4700 + number, 754.0 - number, 2048 * (number + 1))
        for number, name in enumerate(control.places)
    }
    return {**found, "preparation": ProcessStatus("preparation", "ended", 0, 4699, 21.0, 160), **others}


def status(**changes: object) -> Status:
    """Return the state of a session in a trial; what is not given is empty."""
    empty = {str: "", int: 0, float: 0.0, bool: False}
    values = {name: empty.get(kind, ()) for name, kind in get_type_hints(Status).items()}
    trial = {"name": "S01", "dyad": "D03", "opened": True, "phase": "running", "trial": 12, "block": 3, "blocks": 18}
    return Status(**(values | trial | changes))  # type: ignore[arg-type]


def states(control: LauncherControl) -> dict[str, tuple[LaunchFacts, int, str]]:
    """Every state: the facts, the page, and the row that is selected."""
    run = LaunchFacts(
        LaunchStage.RUNNING, processes=processes(control), status=status(), silence=0.1, on_disk=182_400_000
    )
    failed = ProcessStatus("left agent", "ended", 1, 4712, 431.0, 5120)
    preparing = {"preparation": ProcessStatus("preparation", "running", None, 4699, 3.0, 160)}
    return {
        "ready": (LaunchFacts(), 0, "server"),
        "preparing": (LaunchFacts(LaunchStage.PREPARING, processes=preparing), 0, "preparation"),
        "form": (replace(run, status=status(opened=False)), 0, "console"),
        "running": (run, 0, "server"),
        "failed": (
            replace(run, processes={**run.processes, "left agent": failed}, broken=frozenset(["left agent"])),
            0,
            "left agent",
        ),
        "silent-station": (
            replace(run, troubles={"left station": "the left station does not answer at 10.77.0.2:5560"}),
            3,
            "left agent",
        ),
        "stopping": (replace(run, stage=LaunchStage.STOPPING, processes=processes(control, "stopping")), 0, "logger"),
        "rig": (LaunchFacts(), 1, "server"),
        "study": (LaunchFacts(), 2, "server"),
        "machines": (LaunchFacts(), 3, "left doctor"),
    }


def main(folder: Path, size: tuple[int, int], names: tuple[str, ...]) -> None:
    """Draw the states."""
    app = application()
    with tempfile.TemporaryDirectory() as place:
        os.chdir(place)
        Path("rig.toml").write_text(RIG, encoding="utf-8")
        control = ShownControl(SessionChoice("rig.toml", "paper", 3), FileReaders(load, load_study))
        window = LauncherWindow(control, lambda: {**STATE, "computer": "lab-pc-1"}, lambda _: None)
        window.show()
        window.resize(*size)
        for name, (facts, page, row) in states(control).items():
            control.shown = facts
            if name == "failed":
                control.say(
                    "The left agent ended with exit code 1; it is not started again; all others go on", stays=True
                )
            window.show_page(page)
            window.poll()
            window.table.select(row)
            window.poll()
            until = time.monotonic() + 0.2
            while time.monotonic() < until:
                app.processEvents()
            control.notices.read()
            if not names or name in names:
                window.grab().save(str(folder / f"launcher-{name}.png"))
        window._timer.stop()
        window.hide()
        control.close()


if __name__ == "__main__":
    if len(sys.argv) > 1:
        main(Path(sys.argv[1]).resolve(), (int(sys.argv[2]), int(sys.argv[3])), ())
    else:
        main(IMAGES, SIZE, SHOWN)
