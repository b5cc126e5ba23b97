"""The commands for recordings: what can be asked of a file, and nothing of how it is done."""

from pathlib import Path
from typing import Annotated, Literal

import typer

from netboard.config import Side
from netboard.export.formats import FORMATS
from netboard.services.configuration import ConfigFile, Overrides, load
from netboard.services.wording import Screenshot, examples

Interpolation = Literal["cubic", "linear"]
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
    recording: Annotated[
        Path, typer.Argument(metavar="RECORDING", help="What a killed logger left, an .mcap.part file.")
    ],
    output: Annotated[Path | None, typer.Option("--output", "-o", metavar="FILE", help="The new file.")] = None,
) -> None:
    """Make a whole recording of an unfinished or damaged one, which is left as it is."""
    from netboard.services import recover as service

    raise typer.Exit(service.main(recording, output))


def export(
    recordings: Annotated[list[Path], typer.Argument(metavar="RECORDING", help="Recordings, or folders of them.")],
    to: Annotated[str, typer.Option(metavar="FORMAT", help=f"One of {', '.join(FORMATS)}.")],
    output: Annotated[
        Path | None,
        typer.Option(
            "--output", "-o", metavar="FOLDER", help="The new folder; else it is named after the first recording."
        ),
    ] = None,
) -> None:
    """Write recordings in a format of other tools."""
    from netboard.services import export as service

    raise typer.Exit(service.main(recordings, to, output))


def import_(
    tables: Annotated[list[Path], typer.Argument(metavar="TABLE", help=".csv or .parquet files.")],
    config: ConfigFile = None,
    settings: Overrides = None,
    names: Annotated[
        list[str] | None, typer.Option("--map", metavar="COLUMN=THEIRS", help="What a column is called in the table.")
    ] = None,
    units: Annotated[
        list[str] | None,
        typer.Option("--unit", metavar="COLUMN=UNIT", help="Its unit there, such as mm; -mm turns its axis round."),
    ] = None,
    simulate: Annotated[
        bool, typer.Option("--simulate", help="Compute board, ball and trials from the hands, as the server does.")
    ] = False,
    interpolation: Annotated[Interpolation, typer.Option(help="How positions move between samples.")] = "cubic",
    gap: Annotated[
        float, typer.Option(min=0.002, help="Samples further apart, in seconds, have a gap between them.")
    ] = 0.1,
    output: Annotated[Path, typer.Option("--output", "-o", metavar="FOLDER", help="Where the recordings go.")] = Path(
        "recordings"
    ),
) -> None:
    """Make recordings of tables: of what others have measured, or of an exported table of ticks."""
    from netboard.foreign.importing import Wishes
    from netboard.services import importing as service

    wishes = Wishes(tuple(names or ()), tuple(units or ()), simulate, interpolation, gap)
    raise typer.Exit(service.main(tables, output, load(config, settings or ()), wishes))


def add_to(app: typer.Typer) -> None:
    """Make these commands known.

    Parameters
    ----------
    app : typer.Typer
        The ``netboard`` command.
    """
    app.command(epilog=examples("netboard replay S01.mcap", "netboard replay S01.mcap --verify"))(replay)
    app.command(epilog=examples("netboard info recordings/S01.mcap"))(info)
    app.command(epilog=examples("netboard recover recordings/S01.mcap.part"))(recover)
    app.command(
        epilog=examples("netboard export S01.mcap --to csv", "netboard export recordings/ --to parquet -o study")
    )(export)
    app.command(
        "import",
        epilog=examples(
            "netboard import study/ticks/S01.parquet",
            "netboard import hands.csv --simulate -c rig.toml",
            "netboard import theirs.csv --map time=t --unit time=ms --map left_z=Height1 --unit left_z=mm",
        ),
    )(import_)
