"""The states of the launcher. The processes are entries of a table: nothing is started."""

from dataclasses import replace
from pathlib import Path
from typing import get_type_hints

from netboard.network.protocol.control import Status
from netboard.network.protocol.station import ProcessStatus
from netboard.services.loading import load, load_study
from netboard.windows.launcher.control import FileReaders, LauncherControl, SessionChoice
from netboard.windows.launcher.model import LaunchFacts, LaunchStage
from netboard.windows.launcher.pages import WHOLE_TEXT
from netboard.windows.launcher.window import LauncherWindow

RIG = '[stations]\nleft = "10.77.0.2"\n[agents.left]\ndevice = "openhaptics"\n'
STATE = {"computer": "lab-pc-2", "cores": "8", "load": "0.31", "free disk": "412.0 GiB", "screen": "opens"}
LOG = {
    "preparation": "folder         recordings: is missing; created: mkdir -p recordings\n"
    "compiling kernels for this machine, once after an installation or an update: 38 kernels took 6 s; about 192 are "
    "left, for about 30 s\n",
    "left agent": "left hand: haptic device (backend openhaptics)\nthe device does not answer: unplugged?\n",
}


NAMES = (
    *("ready", "preparing", "form", "running", "failed", "silent-station", "stopping"),
    *("rig", "study", "study-form", "study-add", "machines"),
)


FORMS = {"study-form": "kinds.dyadic", "study-add": "factors.haptics.levels.on"}
"""Parts of the study whose forms are shown."""


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
        "study-form": (LaunchFacts(), 2, "server"),
        "study-add": (LaunchFacts(), 2, "server"),
        "machines": (LaunchFacts(), 3, "left doctor"),
    }


def make() -> LauncherWindow:
    """Return a launcher that shows given facts; call it in a folder of its own."""
    Path("rig.toml").write_text(RIG, encoding="utf-8")
    control = ShownControl(SessionChoice("rig.toml", "paper", 3), FileReaders(load, load_study))
    return LauncherWindow(control, lambda: {**STATE, "computer": "lab-pc-1"}, lambda _: None)


def show(window: LauncherWindow, state: str) -> None:
    """Show a state."""
    control = window.control
    assert isinstance(control, ShownControl)
    control.shown, page, row = states(control)[state]
    control.notices.read()
    if state == "failed":
        control.say("The left agent ended with exit code 1; it is not started again; all others go on", stays=True)
    window.show_page(page)
    window.study.part.setCurrentText(FORMS.get(state, WHOLE_TEXT))
    window.study.collection.setCurrentText("new in kinds")
    window.study.new_name.setText("dyadic" if state == "study-add" else "")  # a name that is taken
    window.poll()
    window.table.select(row)
    window.poll()


def leave(window: LauncherWindow) -> None:
    """Close a launcher."""
    window.hide()
    window.control.close()
