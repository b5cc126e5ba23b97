"""``netboard launch``: a window that starts, watches and stops a whole session."""

from dataclasses import replace
from typing import TYPE_CHECKING, Annotated

import typer

from netboard.services.loading import load, load_study
from netboard.services.options import ConfigFile, Offscreen, SessionOf, Theme, examples

if TYPE_CHECKING:
    from netboard.windows.launcher.control import SessionChoice

app = typer.Typer()


@app.command(
    epilog=examples("netboard launch", "netboard launch -c rig.toml", "netboard launch -c rig.toml --study paper")
)
def launch(
    config: ConfigFile = None,
    study: SessionOf = None,
    dyad: Annotated[int | None, typer.Option(min=1, help="Number of the dyad in the study.")] = None,
    offscreen: Offscreen = False,
    theme: Theme = "system",
) -> None:
    """Open the launcher: choose or write a study and a rig, start everything, watch and stop it."""
    from netboard.base.process.display_server import choose_screen
    from netboard.base.process.stopping import Stopping
    from netboard.base.terminal.logs import log_to_stderr

    log_to_stderr("launch")
    choose_screen(offscreen)
    from netboard.windows.launcher import client
    from netboard.windows.launcher.control import FileReaders

    def given(choice: "SessionChoice") -> "SessionChoice":
        """Put what was given on the command line into the remembered choice."""
        rig = choice.rig if config is None else str(config)
        return replace(choice, rig=rig, study=study or choice.study, dyad=dyad or choice.dyad)

    with Stopping() as stopping:
        client.run(given, FileReaders(load, load_study), stopping, offscreen=offscreen, theme=theme)
