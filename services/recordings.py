"""The commands for recordings: their options, but not their implementation."""

from datetime import datetime
from pathlib import Path
from typing import Annotated, Literal

import typer

from netboard.base.config import Side
from netboard.base.errors import ConfigError
from netboard.recording.export.formats import FORMATS
from netboard.services import configuration
from netboard.services.configuration import ConfigFile, Overrides, load
from netboard.services.wording import Screenshot, examples

Interpolation = Literal["cubic", "linear"]
RecordingFile = Annotated[Path, typer.Argument(metavar="RECORDING", help="The recording, an .mcap file.")]


def replay(
    recordings: Annotated[
        list[Path],
        typer.Argument(metavar="RECORDING...", help="The recording, an .mcap file; two are shown side by side."),
    ],
    verify: Annotated[
        bool, typer.Option("--verify", help="Recompute every tick and compare bit for bit; show nothing.")
    ] = False,
    headless: Annotated[bool, typer.Option("--headless", help="Play without a window.")] = False,
    serve: Annotated[
        bool,
        typer.Option("--serve", help="Serve the recording as a live server would, for displays, consoles and status."),
    ] = False,
    markers: Annotated[bool, typer.Option("--markers", help="List trials and events with their times.")] = False,
    station: Annotated[Side, typer.Option(help="Station whose view is shown.")] = "left",
    speed: Annotated[float, typer.Option(min=0.1, max=16.0, help="Playback speed relative to real time.")] = 1.0,
    sync: Annotated[
        Literal["time", "trial"],
        typer.Option(help="Align two recordings at the start of the block, or of each trial."),
    ] = "time",
    screenshot: Screenshot = None,
    at: Annotated[float | None, typer.Option(min=0.0, metavar="S", help="Start position in the recording (s).")] = None,
    config: ConfigFile = None,
    overrides: Overrides = None,
) -> None:
    r"""Show a recording in the participants' display, replay it as a server, list its trials and events, or verify it.

    netboard control steers a served replay: play, pause, seek, speed, loop, step, next, previous. Of the configuration
    only \[network] counts, and only for --serve.
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
    """Return the options that replace the window."""
    return ("--verify", verify), ("--headless", headless), ("--serve", serve), ("--markers", markers)


def info(recording: RecordingFile) -> None:
    """Summarise a recording: trials, completion times, losses, latencies."""
    from netboard.services import info as service

    raise typer.Exit(service.main(recording))


def recover(
    recordings: Annotated[
        list[Path],
        typer.Argument(
            metavar="FILE...",
            help="Unfinished (.mcap.part) or damaged recordings, a server's spill files (.spill), or folders of these.",
        ),
    ],
    output: Annotated[
        Path | None,
        typer.Option("--output", "-o", metavar="FILE", help="Name of the recovered file, if there is only one."),
    ] = None,
) -> None:
    """Recover complete recordings from unfinished or damaged ones, which stay unchanged."""
    from netboard.services import recover as service

    raise typer.Exit(service.main(recordings, output))


def check(
    recordings: Annotated[
        list[Path], typer.Argument(metavar="RECORDING...", help="Recordings, finished or not, or folders of them.")
    ],
    verify: Annotated[
        bool, typer.Option("--verify", help="Also recompute every tick and compare bit for bit.")
    ] = False,
    as_json: Annotated[bool, typer.Option("--json", help="Print one JSON object.")] = False,
) -> None:
    """Check the integrity of recordings: checksums, numbers, times, clocks, trials, plan, journal.

    Each file has one result. Exit code: 0 all complete, 3 some complete with listed losses, 1 some damaged.
    """
    from netboard.services import check as service

    raise typer.Exit(service.main(recordings, replay=verify, as_json=as_json))


def whatif(
    recording: RecordingFile,
    overrides: Overrides = None,
    model: Annotated[
        Literal["paper", "lagrangian"] | None, typer.Option(help="The same as --set physics.model=...")
    ] = None,
    output: Annotated[
        Path | None,
        typer.Option("--output", "-o", metavar="FILE", help="Write the recomputed attempts as a recording."),
    ] = None,
    figure: Annotated[
        Path | None, typer.Option(metavar="FILE", help="Plot recorded and recomputed attempts (.png, .svg or .pdf).")
    ] = None,
    trial: Annotated[
        int | None, typer.Option(min=1, help="Trial shown in the figure. Default: the one that differs most.")
    ] = None,
    as_json: Annotated[bool, typer.Option("--json", help="Print one JSON object, in SI units.")] = False,
) -> None:
    """Counterfactual replay: the recorded hands with another board, model or force condition.

    The hands move as recorded, whatever the board does (open loop). Each attempt starts from the state recorded at its
    release.
    """
    from netboard.services import whatif as service

    changes = [*(overrides or ()), *([] if model is None else [f"physics.model={model}"])]
    raise typer.Exit(service.main(recording, changes, output=output, figure=figure, trial=trial, as_json=as_json))


def sessions(
    folder: Annotated[
        Path | None, typer.Argument(metavar="[DIR]", help="Folder. Default: recording.directory of the configuration.")
    ] = None,
    dyad: Annotated[str | None, typer.Option(help="Only this dyad, such as D03.")] = None,
    study: Annotated[str | None, typer.Option(help="Only this study.")] = None,
    since: Annotated[
        datetime | None, typer.Option(formats=["%Y-%m-%d"], help="Only sessions that began on this day (UTC) or later.")
    ] = None,
    verdict: Annotated[
        str | None, typer.Option(help="Only this result: complete, 'complete with listed losses' or damaged.")
    ] = None,
    pilot: Annotated[bool | None, typer.Option("--pilot/--no-pilot", help="Only pilot runs, or no pilot runs.")] = None,
    full: Annotated[
        bool, typer.Option("--check", help="Run the full integrity check on each file (netboard check).")
    ] = False,
    as_json: Annotated[bool, typer.Option("--json", help="Print one JSON array.")] = False,
) -> None:
    """List the recordings in a folder: participants, trials, losses, and the result of the integrity check."""
    from netboard.recording.integrity.catalogue import Filter
    from netboard.services import configuration
    from netboard.services import sessions as service

    place = Path(configuration.load(None).recording.directory) if folder is None else folder
    wanted = Filter(dyad, study, verdict, None if since is None else since.date(), pilot)
    raise typer.Exit(service.main(place, wanted, full=full, as_json=as_json))


def export(
    recordings: Annotated[list[Path], typer.Argument(metavar="RECORDING", help="Recordings, or folders of them.")],
    to: Annotated[str, typer.Option(metavar="FORMAT", help=f"One of {', '.join(FORMATS)}.")],
    output: Annotated[
        Path | None,
        typer.Option(
            "--output",
            "-o",
            metavar="FOLDER",
            help="New folder for the export. Default: named after the first recording.",
        ),
    ] = None,
) -> None:
    """Export recordings for other software."""
    from netboard.services import export as service

    raise typer.Exit(service.main(recordings, to, output))


def import_(
    tables: Annotated[list[Path] | None, typer.Argument(metavar="[TABLE]...", help=".csv or .parquet files.")] = None,
    manifest: Annotated[
        Path | None, typer.Option(metavar="FILE", help="TOML file that lists the tables of a study, instead of TABLE.")
    ] = None,
    workers: Annotated[
        int | None, typer.Option(min=1, metavar="N", help="Worker processes for --manifest. Default: one per core.")
    ] = None,
    config: ConfigFile = None,
    settings: Overrides = None,
    names: Annotated[
        list[str] | None, typer.Option("--map", metavar="COLUMN=THEIRS", help="Name of a column in the table.")
    ] = None,
    units: Annotated[
        list[str] | None,
        typer.Option(
            "--unit", metavar="COLUMN=UNIT", help="Unit of a column in the table, such as mm; -mm also flips its sign."
        ),
    ] = None,
    simulate: Annotated[
        bool,
        typer.Option(
            "--simulate", help="Simulate board, ball and trials from the hand trajectories, as the server does."
        ),
    ] = False,
    interpolation: Annotated[Interpolation, typer.Option(help="Interpolation of positions between samples.")] = "cubic",
    gap: Annotated[
        float, typer.Option(min=0.002, help="Longest interval between samples that is interpolated (s).")
    ] = 0.1,
    output: Annotated[Path, typer.Option("--output", "-o", metavar="FOLDER", help="Folder for the recordings.")] = Path(
        "recordings"
    ),
) -> None:
    """Import tables as recordings: measurements of another system, or exported ticks."""
    from netboard.recording.importing.table_import import Wishes
    from netboard.services import importing as service

    wishes = Wishes(tuple(names or ()), tuple(units or ()), simulate, interpolation, gap)
    said = {"--config": config, "--set": settings, "--map": names, "--unit": units, "--simulate": simulate}
    service.one_way(tables, manifest, [option for option, value in said.items() if value])
    if manifest is not None:
        raise typer.Exit(service.study(manifest, output, workers))
    raise typer.Exit(service.main(tables or (), output, load(config, settings or ()), wishes))


def add_to(app: typer.Typer) -> None:
    """Add these commands."""
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
    app.command(epilog=examples("netboard recover recordings/S01.mcap.part", "netboard recover recordings"))(recover)
    app.command(
        epilog=examples(
            "netboard check recordings/S01.mcap",
            "netboard check recordings/ --verify",
            "netboard check S01.mcap --json",
        )
    )(check)
    app.command(
        epilog=examples(
            "netboard whatif S01.mcap --set physics.k_h=400 --figure stiffer.png",
            "netboard whatif S01.mcap --set block.force=none --json",
            "netboard whatif S01.mcap --model lagrangian --output S01-lagrangian.mcap",
        )
    )(whatif)
    app.command(
        epilog=examples(
            "netboard sessions",
            "netboard sessions recordings/ --dyad D03 --no-pilot",
            "netboard sessions --study paper --since 2026-01-31 --check --verdict damaged",
        )
    )(sessions)
    app.command(
        epilog=examples("netboard export S01.mcap --to csv", "netboard export recordings/ --to parquet -o study")
    )(export)
    app.command(
        "import",
        epilog=examples(
            "netboard import study/ticks/S01.parquet",
            "netboard import hands.csv --simulate -c rig.toml",
            "netboard import --manifest study.toml -o recordings/",
            "netboard import theirs.csv --map time=t --unit time=ms --map left_z=Height1 --unit left_z=mm",
        ),
    )(import_)
