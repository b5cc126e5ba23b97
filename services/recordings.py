"""The commands for recordings: what can be asked of a file, and nothing of how it is done."""

from pathlib import Path
from typing import Annotated

import typer

from netboard.config import Side
from netboard.services.wording import Screenshot, examples

RecordingFile = Annotated[Path, typer.Argument(metavar="RECORDING", help="The recording, an .mcap file.")]


def replay(
    recording: RecordingFile,
    verify: Annotated[
        bool, typer.Option("--verify", help="Compute every tick again and compare it to the bit; show nothing.")
    ] = False,
    headless: Annotated[bool, typer.Option("--headless", help="Play without a window.")] = False,
    station: Annotated[Side, typer.Option(help="The seat whose view is shown.")] = "left",
    speed: Annotated[float, typer.Option(min=0.1, max=16.0, help="Times real time.")] = 1.0,
    screenshot: Screenshot = None,
) -> None:
    """Show a recording in the participants' display, or verify it."""
    from netboard.services import replay as service

    raise typer.Exit(
        service.main(recording, check=verify, headless=headless, station=station, speed=speed, screenshot=screenshot)
    )


def info(recording: RecordingFile) -> None:
    """Say what is in a recording: trials, completion times, losses, latencies."""
    from netboard.services import info as service

    raise typer.Exit(service.main(recording))


def recover(
    recordings: Annotated[
        list[Path],
        typer.Argument(
            metavar="FILE...",
            help="What a killed logger left (.mcap.part), a damaged recording, a server's .spill, or folders of these.",
        ),
    ],
    output: Annotated[
        Path | None, typer.Option("--output", "-o", metavar="FILE", help="The new file, if it is one.")
    ] = None,
) -> None:
    """Make whole recordings of unfinished or damaged ones, which are left as they are."""
    from netboard.services import recover as service

    raise typer.Exit(service.main(recordings, output))


def add_to(app: typer.Typer) -> None:
    """Make these commands known.

    Parameters
    ----------
    app : typer.Typer
        The ``netboard`` command.
    """
    app.command(epilog=examples("netboard replay S01.mcap", "netboard replay S01.mcap --verify"))(replay)
    app.command(epilog=examples("netboard info recordings/S01.mcap"))(info)
    app.command(epilog=examples("netboard recover recordings/S01.mcap.part", "netboard recover recordings"))(recover)
