"""The commands for recordings: what can be asked of a file, and nothing of how it is done."""

from pathlib import Path
from typing import Annotated, Literal

import typer

from netboard.config import Side
from netboard.errors import ConfigError
from netboard.services import configuration
from netboard.services.configuration import ConfigFile, Overrides
from netboard.services.wording import Screenshot, examples

RecordingFile = Annotated[Path, typer.Argument(metavar="RECORDING", help="The recording, an .mcap file.")]


def replay(
    recordings: Annotated[
        list[Path],
        typer.Argument(metavar="RECORDING...", help="The recording, an .mcap file; two are shown side by side."),
    ],
    verify: Annotated[
        bool, typer.Option("--verify", help="Compute every tick again and compare it to the bit; show nothing.")
    ] = False,
    headless: Annotated[bool, typer.Option("--headless", help="Play without a window.")] = False,
    serve: Annotated[
        bool,
        typer.Option("--serve", help="Play it on the ports of a server, for displays, console and status, as if live."),
    ] = False,
    markers: Annotated[bool, typer.Option("--markers", help="List its trials and events, with their times.")] = False,
    station: Annotated[Side, typer.Option(help="The seat whose view is shown.")] = "left",
    speed: Annotated[float, typer.Option(min=0.1, max=16.0, help="Times real time.")] = 1.0,
    sync: Annotated[
        Literal["time", "trial"],
        typer.Option(help="Two recordings go together from the start of the block, or from that of each trial."),
    ] = "time",
    screenshot: Screenshot = None,
    at: Annotated[
        float | None, typer.Option(min=0.0, metavar="S", help="Begin so long after the start of the recording (s).")
    ] = None,
    config: ConfigFile = None,
    overrides: Overrides = None,
) -> None:
    r"""Show a recording in the participants' display, play it as a server, list what is in it, or verify it.

    A served one is steered by netboard control: play, pause, seek, speed, loop, step, next, previous. Of the
    configuration only \[network] counts, and only for --serve.
    """
    ways = [name for name, wanted in _ways(verify, headless, serve, markers) if wanted]
    if len(ways) > 1:
        raise ConfigError(f"{' and '.join(ways)}: expected one of them")
    if len(recordings) > (1 if ways else 2):
        raise ConfigError(f"replay: found {len(recordings)} recordings, expected one, or two to be shown side by side")
    from netboard.services import replay as service

    path = recordings[0]
    if verify:
        raise typer.Exit(service.verify(path))
    if headless:
        raise typer.Exit(service.narrate(path, speed))
    if markers:
        raise typer.Exit(service.tell_marks(path))
    if serve:
        raise typer.Exit(service.serve(path, configuration.load(config, overrides or ()), speed, at))
    raise typer.Exit(service.show(recordings, station, speed, sync, screenshot, at))


def _ways(verify: bool, headless: bool, serve: bool, markers: bool) -> tuple[tuple[str, bool], ...]:
    """What can be done with a recording but to show it."""
    return ("--verify", verify), ("--headless", headless), ("--serve", serve), ("--markers", markers)


def info(recording: RecordingFile) -> None:
    """Say what is in a recording: trials, completion times, losses, latencies."""
    from netboard.services import info as service

    raise typer.Exit(service.main(recording))


def recover(
    recording: Annotated[
        Path, typer.Argument(metavar="RECORDING", help="What a killed logger left, an .mcap.part file.")
    ],
    output: Annotated[Path | None, typer.Option("--output", "-o", metavar="FILE", help="The new file.")] = None,
) -> None:
    """Make a whole recording of an unfinished or damaged one, which is left as it is."""
    from netboard.services import recover as service

    raise typer.Exit(service.main(recording, output))


def add_to(app: typer.Typer) -> None:
    """Make these commands known.

    Parameters
    ----------
    app : typer.Typer
        The ``netboard`` command.
    """
    app.command(
        epilog=examples(
            "netboard replay S01.mcap",
            "netboard replay S01.mcap S02.mcap --sync trial",
            "netboard replay S01.mcap --serve -c rig.toml",
            "netboard replay S01.mcap --markers",
            "netboard replay S01.mcap --verify",
        )
    )(replay)
    app.command(epilog=examples("netboard info recordings/S01.mcap"))(info)
    app.command(epilog=examples("netboard recover recordings/S01.mcap.part"))(recover)
